// Mouse, touch and keys: turn, move, zoom, point, click.

const CLICK = 5; // pixels that a pointer may move in a click
const TURN = 0.0065; // rad a pixel
const KEY_TURN = 0.1, KEY_MOVE = 40; // rad, pixels a key press

// `on` has changed(), hover(x, y), click(x, y), focus(x, y) and key(name), which says whether it was understood.
function attachControls(canvas, camera, on) {
  const down = new Map(); // pointer -> where it is
  let moved = 0;

  const place = (event) => {
    const box = canvas.getBoundingClientRect();
    return [event.clientX - box.left, event.clientY - box.top];
  };

  canvas.addEventListener("pointerdown", (event) => {
    canvas.setPointerCapture(event.pointerId);
    if (down.size === 0) moved = 0;
    down.set(event.pointerId, place(event));
    canvas.classList.add("turning");
  });

  canvas.addEventListener("pointermove", (event) => {
    const before = down.get(event.pointerId), now = place(event);
    if (!before) return event.pointerType === "mouse" ? on.hover(...now) : undefined;
    const dx = now[0] - before[0], dy = now[1] - before[1];
    moved += Math.hypot(dx, dy);
    if (down.size > 1) pinch(event.pointerId, now);
    else if (event.buttons & 6 || event.shiftKey) camera.pan(dx, dy);
    else camera.orbit(dx * TURN, dy * TURN);
    down.set(event.pointerId, now);
    on.changed();
  });

  // Two fingers: their middle moves, their distance zooms.
  function pinch(id, now) {
    const before = down.get(id), other = [...down].find(([key]) => key !== id)[1];
    camera.pan((now[0] - before[0]) / 2, (now[1] - before[1]) / 2);
    const apart = (p) => Math.max(Math.hypot(p[0] - other[0], p[1] - other[1]), 1);
    camera.zoom(apart(before) / apart(now));
  }

  const up = (event) => {
    const was = down.delete(event.pointerId);
    if (down.size === 0) canvas.classList.remove("turning");
    if (was && event.type === "pointerup" && moved <= CLICK && down.size === 0 && event.button === 0) on.click(...place(event));
  };
  canvas.addEventListener("pointerup", up);
  canvas.addEventListener("pointercancel", up);
  canvas.addEventListener("pointerleave", () => on.hover(-1, -1));
  canvas.addEventListener("dblclick", (event) => on.focus(...place(event)));
  canvas.addEventListener("contextmenu", (event) => event.preventDefault());
  canvas.addEventListener(
    "wheel",
    (event) => {
      event.preventDefault();
      const lines = event.deltaMode === 1 ? 24 : 1; // some mice count lines
      camera.zoom(Math.exp(clamp(event.deltaY * lines, -200, 200) * 0.0016));
      on.changed();
    },
    { passive: false },
  );

  canvas.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const side = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] }[event.key];
    if (side && event.shiftKey) camera.pan(-side[0] * KEY_MOVE, -side[1] * KEY_MOVE);
    else if (side) camera.orbit(-side[0] * KEY_TURN, -side[1] * KEY_TURN);
    else if (event.key === "+" || event.key === "=") camera.zoom(0.85);
    else if (event.key === "-") camera.zoom(1 / 0.85);
    else return;
    event.preventDefault();
    on.changed();
  });

  document.addEventListener("keydown", (event) => {
    const typing = event.target.tagName === "INPUT";
    if (event.ctrlKey || event.metaKey || event.altKey || (typing && event.key !== "Escape")) return;
    if (on.key(event.key)) event.preventDefault();
  });
}
