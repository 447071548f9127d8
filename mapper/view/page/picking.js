// What is under the pointer: a box, or a point of the cloud.

const INSIDE = 4; // a box this much smaller, within the depth of the nearest, is what is meant: a cup in a cupboard
const REACH = 9; // pixels around the pointer in which points are found

// Distances along the ray at which it enters and leaves a box; null where it misses.
function throughBox(ray, thing) {
  const axes = boxAxes(thing), from = add(ray.from, thing.center, -1);
  let near = -Infinity, far = Infinity;
  for (let k = 0; k < 3; k++) {
    const start = dot(from, axes[k]), speed = dot(ray.along, axes[k]), half = Math.max(thing.size[k] / 2, 0.005);
    if (Math.abs(speed) < 1e-9) {
      if (Math.abs(start) > half) return null;
      continue;
    }
    const a = (-half - start) / speed, b = (half - start) / speed;
    near = Math.max(near, Math.min(a, b));
    far = Math.min(far, Math.max(a, b));
  }
  return near <= far && near > 0 ? { near, far } : null; // a box around the viewer is not meant
}

function pickThing(ray, things) {
  const volume = (thing) => thing.size[0] * thing.size[1] * thing.size[2];
  const hits = things.map((thing) => ({ thing, hit: throughBox(ray, thing) })).filter(({ hit }) => hit);
  hits.sort((a, b) => a.hit.near - b.hit.near);
  let best = hits[0];
  for (const other of hits)
    if (other.hit.near < best.hit.far && INSIDE * volume(other.thing) < volume(best.thing)) best = other;
  return best ? best.thing : null;
}

// The place of the point nearest to the viewer among those near the pointer; null where there are none.
function pickPoint(camera, cloud, x, y) {
  const ray = camera.ray(x, y), eye = ray.from, spread = (REACH * camera.metresPerPixel()) / camera.distance;
  const { places, low, high, count } = cloud, step = [0, 1, 2].map((k) => (high[k] - low[k]) / 65535);
  let best = Infinity;
  for (let k = 0; k < count; k++) {
    const px = low[0] + step[0] * places[3 * k] - eye[0], py = low[1] + step[1] * places[3 * k + 1] - eye[1];
    const pz = low[2] + step[2] * places[3 * k + 2] - eye[2];
    const along = px * ray.along[0] + py * ray.along[1] + pz * ray.along[2];
    if (along <= 0.05 || along >= best) continue;
    const off = px * px + py * py + pz * pz - along * along;
    if (off < spread * spread * along * along) best = along;
  }
  return best < Infinity ? add(eye, ray.along, best) : null;
}
