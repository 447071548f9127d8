// What the page carries, unpacked: the map (JSON), the cloud, the crops. document.py and cloud.py say how it is packed.

function bytesOf(name) {
  const element = document.getElementById("data-" + name);
  const text = atob(element.textContent);
  element.remove(); // the text is not needed twice
  const bytes = new Uint8Array(text.length);
  for (let k = 0; k < text.length; k++) bytes[k] = text.charCodeAt(k);
  return bytes;
}

async function inflate(bytes) {
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

async function readMap() {
  return JSON.parse(new TextDecoder().decode(await inflate(bytesOf("map"))));
}

// Positions as 16-bit numbers between the bounds, and red, green, blue, side as bytes: as the graphics card wants them.
async function readCloud(about) {
  const planes = await inflate(bytesOf("cloud")), count = about.count;
  const places = new Uint16Array(3 * count), paint = new Uint8Array(4 * count);
  for (let axis = 0; axis < 3; axis++) {
    const low = 2 * axis * count, high = low + count;
    for (let k = 0, value = 0; k < count; k++) {
      value = (value + planes[low + k] + 256 * planes[high + k]) & 65535;
      places[3 * k + axis] = value;
    }
  }
  for (let band = 0; band < 4; band++) {
    const start = (6 + band) * count;
    for (let k = 0, value = 0; k < count; k++) {
      value = band < 3 ? (value + planes[start + k]) & 255 : planes[start + k];
      paint[4 * k + band] = value;
    }
  }
  return { ...about, places, paint };
}
