// Boxes, ellipsoids, cameras as lines and triangles in the upright frame, metres.

const SIGNS = [[-1, -1, -1], [1, -1, -1], [1, 1, -1], [-1, 1, -1], [-1, -1, 1], [1, -1, 1], [1, 1, 1], [-1, 1, 1]];
const SIDES = [[0, 1, 2, 3], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7]];
const SIGMAS = 2; // of an ellipsoid
const RING = 40; // pieces of a circle

function boxAxes(thing) {
  const c = Math.cos(thing.yaw), s = Math.sin(thing.yaw);
  return [[c, s, 0], [-s, c, 0], [0, 0, 1]];
}

function boxCorners(thing, grow = 0) {
  const axes = boxAxes(thing);
  return SIGNS.map((sign) =>
    axes.reduce((p, axis, k) => add(p, axis, sign[k] * (thing.size[k] / 2 + grow)), thing.center));
}

// Lines and triangles for the graphics card; colours are [r, g, b, opacity], bytes.
class Lines {
  constructor() {
    this.items = [];
  }

  add(a, b, color, width = 1.5) {
    this.items.push([a, b, color, width]);
  }

  packed() {
    const buffer = new ArrayBuffer(32 * this.items.length);
    const numbers = new Float32Array(buffer), bytes = new Uint8Array(buffer);
    this.items.forEach(([a, b, color, width], k) => {
      numbers.set(a, 8 * k);
      numbers.set(b, 8 * k + 3);
      bytes.set(color, 32 * k + 24);
      numbers[8 * k + 7] = width;
    });
    return buffer;
  }
}

class Faces {
  constructor() {
    this.items = [];
  }

  add(a, b, c, color) {
    this.items.push([a, color], [b, color], [c, color]);
  }

  packed() {
    const buffer = new ArrayBuffer(16 * this.items.length);
    const numbers = new Float32Array(buffer), bytes = new Uint8Array(buffer);
    this.items.forEach(([place, color], k) => {
      numbers.set(place, 4 * k);
      bytes.set(color, 16 * k + 12);
    });
    return buffer;
  }
}

function addBox(lines, faces, edges, thing, rgb, { width, solid }) {
  const corners = boxCorners(thing);
  for (const [a, b] of edges) lines.add(corners[a], corners[b], [...rgb, 255], width);
  for (const [a, b, c, d] of SIDES) {
    faces.add(corners[a], corners[b], corners[c], [...rgb, solid]);
    faces.add(corners[a], corners[c], corners[d], [...rgb, solid]);
  }
}

// L with L L^T = the covariance: it maps the unit sphere to the ellipsoid of one standard deviation.
function cholesky(c) {
  const root = (value) => Math.sqrt(Math.max(value, 1e-14));
  const l00 = root(c[0]), l10 = c[3] / l00, l20 = c[6] / l00;
  const l11 = root(c[4] - l10 * l10), l21 = (c[7] - l20 * l10) / l11;
  return [[l00, l10, l20], [0, l11, l21], [0, 0, root(c[8] - l20 * l20 - l21 * l21)]]; // columns
}

function addEllipsoid(lines, faces, thing, rgb) {
  const columns = cholesky(thing.covariance);
  const at = (u) => columns.reduce((p, column, k) => add(p, column, SIGMAS * u[k]), thing.center);
  for (const [i, j] of [[0, 1], [1, 2], [2, 0]])
    for (let k = 0; k < RING; k++) {
      const on = (angle) => { const u = [0, 0, 0]; u[i] = Math.cos(angle); u[j] = Math.sin(angle); return at(u); };
      lines.add(on((2 * Math.PI * k) / RING), on((2 * Math.PI * (k + 1)) / RING), [...rgb, 235], 1.4);
    }
  const sphere = (row, column) => {
    const a = (Math.PI * row) / 8, b = (2 * Math.PI * column) / 16;
    return at([Math.sin(a) * Math.cos(b), Math.sin(a) * Math.sin(b), Math.cos(a)]);
  };
  for (let row = 0; row < 8; row++)
    for (let column = 0; column < 16; column++) {
      const [a, b, c, d] = [sphere(row, column), sphere(row + 1, column), sphere(row + 1, column + 1), sphere(row, column + 1)];
      faces.add(a, b, c, [...rgb, 70]);
      faces.add(a, c, d, [...rgb, 70]);
    }
}

// A camera as a pyramid `size` metres deep; `pose` is its position and R_upright_camera row by row.
function addCamera(lines, pose, size, color, width) {
  const eye = pose.slice(0, 3);
  const at = (x, y, z) => [0, 1, 2].map((k) => eye[k] + pose[3 + 3 * k] * x + pose[4 + 3 * k] * y + pose[5 + 3 * k] * z);
  const rim = [[-0.6, -0.45], [0.6, -0.45], [0.6, 0.45], [-0.6, 0.45]].map(([x, y]) => at(x * size, y * size, size));
  rim.forEach((corner, k) => {
    lines.add(eye, corner, color, width);
    lines.add(corner, rim[(k + 1) % 4], color, width);
  });
}
