// A camera that goes round a point; up is up.

const FIELD = 0.8; // rad, of the shorter side of the picture
const LOWEST = -1.45, HIGHEST = 1.53; // rad above the horizontal
const FLIGHT = 420; // ms

class OrbitCamera {
  constructor(start) {
    this.start = start;
    this.size = [1, 1];
    this.flight = null;
    this.goTo(this.startPlace());
  }

  startPlace() {
    const { target, azimuth, elevation, radius } = this.start;
    return { target, azimuth, elevation, distance: (0.93 * radius) / Math.sin(FIELD / 2) };
  }

  place() {
    const { target, azimuth, elevation, distance } = this;
    return { target, azimuth, elevation, distance };
  }

  goTo(place) {
    Object.assign(this, place);
  }

  // Flies there, the short way round; at once for those who prefer less motion.
  flyTo(values, now) {
    const from = this.place(), to = { ...from, ...values };
    const turn = to.azimuth - from.azimuth;
    to.azimuth = from.azimuth + Math.atan2(Math.sin(turn), Math.cos(turn));
    if (matchMedia("(prefers-reduced-motion: reduce)").matches) this.goTo(to);
    else this.flight = { from, to, since: now };
  }

  // Moves along a flight; whether it goes on.
  advance(now) {
    if (!this.flight) return false;
    const { from, to, since } = this.flight;
    const t = clamp((now - since) / FLIGHT, 0, 1), s = t * t * (3 - 2 * t);
    this.goTo({
      target: mix(from.target, to.target, s),
      azimuth: from.azimuth + s * (to.azimuth - from.azimuth),
      elevation: from.elevation + s * (to.elevation - from.elevation),
      distance: from.distance * Math.pow(to.distance / from.distance, s),
    });
    if (t >= 1) this.flight = null;
    return t < 1;
  }

  orbit(dx, dy) {
    this.flight = null;
    this.azimuth -= dx;
    this.elevation = clamp(this.elevation + dy, LOWEST, HIGHEST);
  }

  // Moves by pixels, so that what is at the target's depth stays under the pointer.
  pan(dx, dy) {
    this.flight = null;
    const { right, up } = this.axes(), k = this.metresPerPixel();
    this.target = add(add(this.target, right, -dx * k), up, dy * k);
  }

  zoom(factor) {
    this.flight = null;
    this.distance = clamp(this.distance * factor, 0.05, 500);
  }

  axes() {
    const c = Math.cos(this.elevation);
    const back = [c * Math.cos(this.azimuth), c * Math.sin(this.azimuth), Math.sin(this.elevation)];
    const right = [-Math.sin(this.azimuth), Math.cos(this.azimuth), 0];
    return { back, right, up: cross(back, right), forward: scaled(back, -1) };
  }

  eye() {
    return add(this.target, this.axes().back, this.distance);
  }

  // Half the height of the picture at 1 m; the shorter side always shows `FIELD`.
  slope() {
    const [width, height] = this.size;
    return Math.tan(FIELD / 2) * Math.max(1, height / width);
  }

  metresPerPixel() {
    return (2 * this.slope() * this.distance) / this.size[1];
  }

  depths() {
    return { near: Math.max(0.004, 0.02 * this.distance), far: this.distance + 60 + 4 * this.start.radius };
  }

  matrix() {
    const { right, up, forward } = this.axes(), { near, far } = this.depths();
    const [width, height] = this.size;
    const lens = perspective(2 * Math.atan(this.slope()), width / height, near, far);
    return product(lens, viewMatrix(this.eye(), right, up, forward));
  }

  // Pixels of the page of a place, and its depth in metres; null behind the camera.
  project(place, matrix = this.matrix()) {
    const [x, y, , w] = toClip(matrix, place), [width, height] = this.size;
    if (w <= 0) return null;
    return { x: ((x / w + 1) / 2) * width, y: ((1 - y / w) / 2) * height, depth: w };
  }

  // The ray through a pixel of the page.
  ray(x, y) {
    const { right, up, forward } = this.axes(), [width, height] = this.size, slope = this.slope();
    const sideways = ((2 * x) / width - 1) * slope * (width / height), upwards = (1 - (2 * y) / height) * slope;
    return { from: this.eye(), along: unit(add(add(forward, right, sideways), up, upwards)) };
  }
}
