// Search: which things may be what was asked for, likeliest first; the list, the classes and the counts.

const LISTED = 400; // rows; more would be scrolled by nobody

// Things with the probability by which they are ranked: P(exists) P(class) of the class that was found, by a name or a
// synonym that holds the text; or of the thing's own label where its id or given name holds it.
function rankedThings(map, query) {
  const text = query.trim().toLowerCase();
  if (!text) return map.things.map((thing) => ({ thing, p: thing.belief, as: thing.label }));
  const holds = (label) =>
    label.toLowerCase().includes(text) || (map.synonyms[label] || []).some((word) => word.toLowerCase().includes(text));
  const found = [];
  for (const thing of map.things) {
    const own = [thing.id, thing.name || ""].some((name) => name.toLowerCase().includes(text));
    const best = thing.posterior.filter(([label]) => holds(label)).sort((a, b) => b[1] - a[1])[0];
    if (own) found.push({ thing, p: thing.belief, as: thing.label });
    else if (best) found.push({ thing, p: thing.existence * best[1], as: best[0] });
  }
  return found.sort((a, b) => b.p - a.p || (a.thing.id < b.thing.id ? -1 : 1));
}

class Side {
  constructor(map, choose) {
    this.map = map;
    this.choose = choose;
    this.rows = new Map();
    const at = (id) => document.getElementById(id);
    at("source").textContent = map.source;
    const { frames, keyframes } = map.cameras;
    at("facts").textContent =
      `${map.things.length} things · ${map.classes} classes · ${frames} frames, ${keyframes} of them keyframes`;
    at("search").addEventListener("input", (event) => change({ query: event.target.value }));
    at("search").addEventListener("keydown", (event) => {
      if (event.key === "ArrowDown") (event.preventDefault(), at("list").querySelector("button")?.focus());
    });
    at("threshold").value = state.threshold;
    at("threshold").addEventListener("input", (event) => change({ threshold: Number(event.target.value) }));
    at("list").addEventListener("keydown", (event) => this.step(event));
    this.makeClasses(at("classes"));
    this.makeAbout(at("about-text"));
  }

  makeClasses(box) {
    for (const [label, count] of Object.entries(this.map.counts)) {
      const toggle = () => {
        const off = new Set(state.classesOff);
        if (!off.delete(label)) off.add(label);
        change({ classesOff: off });
      };
      const name = make("span", { className: "cut", text: label });
      const chip = make("button", { className: "chip", "data-label": label, on: { click: toggle } });
      chip.append(swatch(colorOf(this.map, label)), name, make("b", { text: count }));
      box.append(chip);
    }
  }

  makeAbout(box) {
    const { map } = this, { cloud } = map;
    const thinned = cloud.voxel ? `, means of voxels of ${(1000 * cloud.voxel).toFixed(1)} mm` : "";
    const cloudLine = cloud.count
      ? `Cloud: ${cloud.count.toLocaleString("en")} of ${cloud.of.toLocaleString("en")} points${thinned}.`
      : "Cloud: the map has none, or this page was made without one.";
    const lines = [
      `Positions are in metres in the axes of the map: ${map.frame}. Up is known to ${map.up.std_deg}° (${map.up.source}).`,
      "Probability of a thing: that it exists, times that it is of its class. ± is one standard deviation; ellipsoids " +
        "show two.",
      cloudLine + " What faces away from you is hidden, so that you look into rooms; “backs” shows it.",
      "Keys: arrows turn, Shift + arrows move, + and − zoom, R resets, F goes to the chosen thing, Esc lets it go, / searches.",
    ];
    box.append(...lines.map((text) => make("p", { text })));
  }

  // Arrow keys in the list.
  step(event) {
    const move = { ArrowDown: 1, ArrowUp: -1 }[event.key];
    if (!move) return;
    event.preventDefault();
    const buttons = [...document.querySelectorAll("#list button")];
    const next = buttons.indexOf(document.activeElement) + move;
    (buttons[next] || (next < 0 ? document.getElementById("search") : null))?.focus();
  }

  update(shown) {
    const at = (id) => document.getElementById(id);
    at("threshold-text").textContent = `${Math.round(100 * state.threshold)} %`;
    for (const chip of at("classes").children)
      chip.setAttribute("aria-pressed", String(!state.classesOff.has(chip.dataset.label)));
    const more = shown.length > LISTED ? `; the first ${LISTED} are listed` : "";
    at("count").textContent = this.map.things.length
      ? `${shown.length} of ${this.map.things.length} things${more}`
      : "The map holds no things.";
    this.rows.clear();
    at("list").replaceChildren(...shown.slice(0, LISTED).map((found) => make("li", { children: [this.row(found)] })));
    this.mark();
  }

  row({ thing, p, as }) {
    const rgb = colorOf(this.map, as);
    const other = as === thing.label ? "" : ` · rather a ${thing.label}`;
    const name = make("span", { className: "cut", text: thing.name || as });
    name.append(make("small", { className: "cut", text: thing.name ? `${as} · ${thing.id}${other}` : thing.id + other }));
    const share = make("span", { className: "share", text: percent(p), children: [barOf(p, css(rgb))] });
    const row = make("button", {
      className: "row",
      "data-id": thing.id,
      children: [swatch(rgb), name, share],
      on: {
        click: () => this.choose(thing.id),
        pointerenter: () => change({ hovered: thing.id }),
        pointerleave: () => change({ hovered: null }),
      },
    });
    this.rows.set(thing.id, row);
    return row;
  }

  mark() {
    for (const [id, row] of this.rows) {
      row.classList.toggle("hovered", id === state.hovered);
      if (id === state.selected) row.setAttribute("aria-current", "true");
      else row.removeAttribute("aria-current");
    }
  }

  reveal(id) {
    this.rows.get(id)?.scrollIntoView({ block: "nearest" });
  }
}
