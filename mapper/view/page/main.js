// Puts the page together.

const TOOLS = [
  ["cloud", "cloud", "The points that were seen"],
  ["boxes", "boxes", "Boxes of the things"],
  ["names", "names", "Names of the things"],
  ["path", "path", "Where the camera went; small cameras are keyframes"],
  ["uncertainty", "uncertainty", "Ellipsoids: two standard deviations of each position"],
  ["backs", "backs", "Show surfaces that face away from you"],
];

class Page {
  constructor(map, cloud, crops) {
    map.byId = new Map(map.things.map((thing) => [thing.id, thing]));
    Object.assign(this, { map, cloud, canvas: document.getElementById("canvas") });
    this.camera = new OrbitCamera(map.start);
    this.scene = this.makeScene();
    this.side = new Side(map, (id) => this.choose(id, true));
    this.tags = new Tags(document.getElementById("tags"), map);
    this.panel = new Panel(document.getElementById("detail"), map, crops, {
      close: () => this.choose(null),
      focus: () => this.focusOn(state.selected),
      point: (view) => change({ view }),
      go: (row) => this.lookFrom(row),
    });
    this.makeTools();
    attachControls(this.canvas, this.camera, {
      changed: () => this.redraw(),
      hover: (x, y) => this.hover(x, y),
      click: (x, y) => this.choose(this.thingAt(x, y)),
      focus: (x, y) => this.focusAt(x, y),
      key: (name) => this.key(name),
    });
    listeners.push((names) => this.changed(names));
    new ResizeObserver(() => this.redraw()).observe(this.canvas);
    this.changed(["query", "selected"]);
  }

  // Without WebGL 2 the list and the panels still say everything.
  makeScene() {
    try {
      const scene = new Scene(this.canvas, this.map, this.cloud);
      this.canvas.addEventListener("webglcontextlost", (event) => event.preventDefault());
      this.canvas.addEventListener("webglcontextrestored", () => {
        scene.build();
        scene.setPath();
        this.changed(["show"]);
      });
      return scene;
    } catch (error) {
      const message = document.getElementById("message");
      message.textContent = `This browser cannot draw the map in 3D (${error.message}); the list works without.`;
      message.hidden = false;
      return null;
    }
  }

  makeTools() {
    const box = document.getElementById("tools");
    for (const [name, text, title] of TOOLS) {
      const click = () => change({ show: { ...state.show, [name]: !state.show[name] } });
      box.append(make("button", { text, title, "data-show": name, on: { click } }));
    }
    box.append(make("button", { text: "reset", title: "The first view again (R)", id: "reset", on: { click: () => this.reset() } }));
    const asked = matchMedia("(prefers-color-scheme: light)");
    const theme = (light) => {
      document.documentElement.dataset.theme = light ? "light" : "dark";
      if (this.scene) ((this.scene.light = light), this.scene.setPath());
      this.redraw();
    };
    theme(asked.matches);
    asked.addEventListener("change", () => theme(asked.matches));
    const turn = () => theme(document.documentElement.dataset.theme === "dark");
    box.append(make("button", { text: "◐", title: "Light or dark", "aria-label": "Light or dark", id: "theme", on: { click: turn } }));
  }

  changed(names) {
    const has = (...some) => some.some((name) => names.includes(name));
    if (has("query", "threshold", "classesOff")) {
      this.shown = shownThings(this.map);
      this.side.update(this.shown);
    }
    if (has("selected")) this.panel.show(this.map.byId.get(state.selected));
    if (has("selected", "hovered")) this.side.mark();
    for (const button of document.querySelectorAll("#tools [data-show]"))
      button.setAttribute("aria-pressed", String(state.show[button.dataset.show]));
    this.stale = true;
    this.redraw();
  }

  // Draws before the next frame of the screen; nothing is drawn while nothing changes.
  redraw() {
    if (this.asked) return;
    this.asked = true;
    requestAnimationFrame((now) => {
      this.asked = false;
      const flying = this.camera.advance(now);
      if (this.scene) this.draw();
      if (flying) this.redraw();
    });
  }

  draw() {
    this.camera.size = this.scene.resize();
    if (this.stale) this.scene.setThings(this.drawnThings());
    this.stale = false;
    this.scene.draw(this.camera);
    this.tags.update(this.drawnThings(), this.camera, this.camera.matrix());
    this.drawScale();
  }

  // A chosen thing stays in the picture when a search leaves it out.
  drawnThings() {
    const thing = this.map.byId.get(state.selected);
    const lacks = thing && !this.shown.some((found) => found.thing === thing);
    return lacks ? [{ thing, p: thing.belief, as: thing.label }, ...this.shown] : this.shown;
  }

  drawScale() {
    const wanted = 110 * this.camera.metresPerPixel(), ten = Math.pow(10, Math.floor(Math.log10(wanted)));
    const metres = [5, 2, 1].map((k) => k * ten).find((value) => value <= wanted) || ten;
    const bar = document.querySelector("#scale span");
    bar.style.width = `${metres / this.camera.metresPerPixel()}px`;
    bar.textContent = metres >= 1 ? `${metres} m` : `${Math.round(100 * metres)} cm`;
  }

  thingAt(x, y) {
    if (x < 0 || !this.scene) return null;
    const thing = pickThing(this.camera.ray(x, y), this.drawnThings().map((found) => found.thing));
    return thing ? thing.id : null;
  }

  hover(x, y) {
    const id = this.thingAt(x, y);
    this.canvas.classList.toggle("over", id !== null);
    if (id !== state.hovered) change({ hovered: id });
  }

  choose(id, fly = false) {
    if (id !== state.selected) change({ selected: id, view: null });
    if (id) this.side.reveal(id);
    if (id && fly) this.focusOn(id);
  }

  focusOn(id) {
    const thing = this.map.byId.get(id);
    if (!thing) return;
    const distance = Math.min(this.camera.distance, Math.max(1.1, (2.6 * length(thing.size)) / Math.sin(FIELD / 2)));
    this.flyTo({ target: thing.center, distance });
  }

  focusAt(x, y) {
    const id = this.thingAt(x, y);
    if (id) return this.focusOn(id);
    const point = this.scene && this.cloud.count ? pickPoint(this.camera, this.cloud, x, y) : null;
    if (point) this.flyTo({ target: point, distance: 0.6 * this.camera.distance });
  }

  // To where the camera of a view was, looking at the chosen thing.
  lookFrom(row) {
    const pose = this.map.cameras.poses[row[1]], thing = this.map.byId.get(state.selected);
    if (!pose || !thing) return;
    const back = add(pose.slice(0, 3), thing.center, -1), distance = Math.max(length(back), 0.1);
    this.flyTo({ target: thing.center, distance, azimuth: Math.atan2(back[1], back[0]), elevation: clamp(Math.asin(back[2] / distance), LOWEST, HIGHEST) });
  }

  reset() {
    this.flyTo(this.camera.startPlace());
  }

  flyTo(place) {
    this.camera.flyTo(place, performance.now());
    this.redraw();
  }

  key(name) {
    const search = document.getElementById("search");
    if (name === "Escape" && document.activeElement === search) search.blur();
    else if (name === "Escape") this.choose(null);
    else if (name === "r" || name === "R" || name === "Home") this.reset();
    else if ((name === "f" || name === "F") && state.selected) this.focusOn(state.selected);
    else if (name === "/") search.focus();
    else return false;
    return true;
  }
}

// For scripts that look at the page, tests among them.
function hook(page) {
  const project = (id) => {
    const thing = page.map.byId.get(id), box = page.canvas.getBoundingClientRect();
    const at = thing && page.camera.project(thing.center);
    return at ? { x: at.x + box.left, y: at.y + box.top } : null;
  };
  const shown = () => page.shown.map((found) => found.thing.id);
  const look = (place) => (page.camera.goTo(place), page.redraw());
  return { project, shown, look, choose: (id) => page.choose(id), state, firstFrame: performance.now() };
}

async function start() {
  const begun = performance.now(), map = await readMap(), cloud = await readCloud(map.cloud);
  const unpacked = performance.now() - begun;
  const page = new Page(map, cloud, bytesOf("crops"));
  requestAnimationFrame(() =>
    requestAnimationFrame(() => {
      window.thingmap = { ...hook(page), unpacked };
      document.documentElement.dataset.ready = ""; // the first picture is there
    }));
}

start().catch((error) => {
  const message = document.getElementById("message");
  message.textContent = `This page could not be shown: ${error.message}. It needs a browser from 2023 or later.`;
  message.hidden = false;
  throw error;
});
