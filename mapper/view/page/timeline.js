// What every view on record said, over time: a stem a view, up for the thing and down against it.

const SVG = "http://www.w3.org/2000/svg";
const WIDE = 340, HIGH = 108, PAD = 10; // of the drawing
const FAINT_RATIO = 0.02; // nats: less is drawn as a ring on the line
const sideOf = (map, row) => ({ supported: "for", contradicted: "against" })[map.verdicts[row[2]].says] || "silent";

function drawn(name, attributes) {
  const element = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
  return element;
}

// `on` has point(row or null) and go(row). Returns the drawing and the line of text below it.
function timelineOf(map, thing, on) {
  const rows = thing.views.rows, first = rows[0][0], last = rows[rows.length - 1][0];
  const most = Math.max(1, ...rows.map((row) => Math.abs(row[3])));
  const x = (row) => PAD + ((WIDE - 2 * PAD) * (row[0] - first)) / (last - first || 1);
  const height = (ratio) => Math.sign(ratio) * Math.sqrt(Math.abs(ratio) / most); // small ones are to be seen too
  const y = (row) => HIGH / 2 - (HIGH / 2 - 18) * height(row[3]);
  const svg = drawn("svg", { id: "timeline", viewBox: `0 0 ${WIDE} ${HIGH}`, tabindex: 0, role: "slider", "aria-label": "Views over time: left and right choose one, Enter looks from there" });
  svg.append(drawn("line", { class: "zero", x1: 0, x2: WIDE, y1: HIGH / 2, y2: HIGH / 2 }));
  const mark = drawn("line", { class: "mark", y1: 14, y2: HIGH - 14, x1: -9, x2: -9 });
  svg.append(mark);
  for (const row of rows) {
    const side = sideOf(map, row), small = Math.abs(row[3]) < FAINT_RATIO;
    if (!small) svg.append(drawn("line", { class: side, x1: x(row), x2: x(row), y1: HIGH / 2, y2: y(row), "stroke-width": 1.6 }));
    svg.append(drawn("circle", { class: side, cx: x(row), cy: small ? HIGH / 2 : y(row), r: side === "silent" ? 2.4 : 3 }));
  }
  const span = `${first.toFixed(1)} – ${last.toFixed(1)} s`;
  for (const [text, at, up, anchor] of [["for", 6, 12, "start"], ["against", 6, HIGH - 5, "start"], [span, WIDE - 6, HIGH - 5, "end"]]) {
    const label = drawn("text", { x: at, y: up, "text-anchor": anchor });
    label.textContent = text;
    svg.append(label);
  }
  const said = make("p", { id: "said", role: "status" });
  let chosen = -1;

  const show = (k) => {
    chosen = k;
    const row = k < 0 ? null : rows[k];
    for (const end of ["x1", "x2"]) mark.setAttribute(end, row ? x(row) : -9);
    said.replaceChildren(...(row ? describeView(map, thing, row) : [make("span", { className: "quiet", text: "Point at a view for what it said; click to look from there." })]));
    if (row) svg.setAttribute("aria-valuetext", said.textContent);
    on.point(row);
  };
  const nearest = (event) => {
    const box = svg.getBoundingClientRect(), at = ((event.clientX - box.left) / box.width) * WIDE;
    return rows.reduce((best, row, k) => (Math.abs(x(row) - at) < Math.abs(x(rows[best]) - at) ? k : best), 0);
  };
  svg.addEventListener("pointermove", (event) => show(nearest(event)));
  svg.addEventListener("pointerleave", () => show(-1));
  svg.addEventListener("click", (event) => (show(nearest(event)), on.go(rows[chosen])));
  svg.addEventListener("keydown", (event) => {
    const step = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
    if (step) show(clamp(chosen + step, 0, rows.length - 1));
    else if (event.key === "Enter" && chosen >= 0) on.go(rows[chosen]);
    else return;
    event.preventDefault();
    event.stopPropagation();
  });
  svg.addEventListener("blur", () => show(-1));
  show(-1);
  return [svg, said];
}

function describeView(map, thing, row) {
  const [stamp, , , ratio, score, visible, frame, text] = row;
  const numbers = [`${stamp.toFixed(2)} s`, score === null ? "no score" : `score ${score.toFixed(2)}`, `${Math.round(100 * visible)} % visible`, `log ratio ${ratio >= 0 ? "+" : "−"}${Math.abs(ratio).toFixed(2)}`];
  return [make("b", { text: frame }), make("span", { className: "number", text: ` · ${numbers.join(" · ")}` }), make("br"), make("span", { className: "quiet", text })];
}
