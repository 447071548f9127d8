// What the user has chosen, and who wants to hear when that changes.

const state = {
  query: "",
  threshold: 0.5,
  classesOff: new Set(),
  selected: null, // id of a thing
  hovered: null, // id of a thing
  view: null, // the row of a view that is pointed at in the timeline
  show: { cloud: true, boxes: true, names: true, path: true, uncertainty: false, backs: false },
};
const listeners = [];

function change(values) {
  Object.assign(state, values);
  for (const listener of listeners) listener(Object.keys(values));
}

// Things that are shown, likeliest or best match first.
function shownThings(map) {
  const found = rankedThings(map, state.query);
  return found.filter(({ thing, p }) => p >= state.threshold && !state.classesOff.has(thing.label));
}

const percent = (p) => (p >= 0.9995 ? "> 99.9 %" : p < 0.0005 ? "< 0.1 %" : (100 * p).toFixed(1) + " %");
const colorOf = (map, label) => map.colors[label] || [150, 150, 150];
const css = (rgb) => `rgb(${rgb.join(" ")})`;

// An element with text and children; text is never read as HTML.
function make(name, { text, children = [], on = {}, ...attributes } = {}) {
  const element = document.createElement(name);
  if (text !== undefined) element.textContent = text;
  for (const [key, value] of Object.entries(attributes))
    if (value !== undefined && value !== null) element.setAttribute(key === "className" ? "class" : key, value);
  for (const [event, handler] of Object.entries(on)) element.addEventListener(event, handler);
  element.append(...children);
  return element;
}

function swatch(rgb) {
  const element = make("span", { className: "dot" });
  element.style.background = css(rgb);
  return element;
}

function barOf(share, color) {
  const fill = make("i");
  fill.style.width = `${100 * clamp(share, 0, 1)}%`;
  fill.style.background = color;
  return make("span", { className: "bar", children: [fill] });
}
