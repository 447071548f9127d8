// Names over the boxes, as text of the page; one that would cover another is moved up, or left out.

const MOST_TAGS = 70;
const GAP = 4; // pixels between tags
const STEPS_UP = [0, 1, 2, -1]; // heights of a tag by which it may be moved

class Tags {
  constructor(box, map) {
    this.box = box;
    this.map = map;
    this.made = new Map(); // id -> element and its size
  }

  tag(thing) {
    let made = this.made.get(thing.id);
    if (made) return made;
    const name = make("span", { className: "cut", text: thing.name || thing.label });
    const p = make("span", { text: thing.belief >= 0.995 ? "> 99 %" : `${Math.round(100 * thing.belief)} %` });
    const element = make("div", { className: "tag", "data-id": thing.id, children: [swatch(colorOf(this.map, thing.label)), name, p] });
    this.box.append(element);
    made = { element, width: element.offsetWidth, height: element.offsetHeight };
    this.made.set(thing.id, made);
    return made;
  }

  update(shown, camera, matrix) {
    const places = [], used = new Set(), [width, height] = camera.size;
    const rank = ({ thing }) => (thing.id === state.selected ? 2 : thing.id === state.hovered ? 1 : 0);
    const wanted = state.show.names ? shown : shown.filter((found) => rank(found));
    const most = width < 500 ? MOST_TAGS / 3 : MOST_TAGS;
    for (const found of [...wanted].sort((a, b) => rank(b) - rank(a)).slice(0, most)) {
      const { thing } = found, top = [...thing.center];
      top[2] += thing.size[2] / 2;
      const at = camera.project(top, matrix);
      if (!at || at.x < 0 || at.y < 0 || at.x > width || at.y > height) continue;
      const tag = this.tag(thing);
      const x = clamp(at.x - tag.width / 2, 4, Math.max(4, width - tag.width - 4));
      const free = STEPS_UP.map((step) => at.y - 6 - tag.height * (1 + 1.15 * step)).find((y) =>
        y > 2 && places.every((p) =>
          x + tag.width + GAP < p.x || p.x + p.width + GAP < x || y + tag.height + GAP / 2 < p.y || p.y + p.height + GAP / 2 < y));
      const y = free ?? (rank(found) ? at.y - 6 - tag.height : null);
      if (y === null) continue;
      places.push({ x, y, width: tag.width, height: tag.height });
      used.add(thing.id);
      tag.element.style.transform = `translate(${Math.round(x)}px, ${Math.round(y)}px)`;
      tag.element.style.visibility = "visible";
      tag.element.classList.toggle("chosen", thing.id === state.selected);
      tag.element.classList.toggle("hovered", thing.id === state.hovered);
    }
    for (const [id, { element }] of this.made) if (!used.has(id)) element.style.visibility = "hidden";
  }
}
