// The picture: the cloud, shaded by its depths; then boxes, ellipsoids and the path, faint where the cloud hides them.

const FRUSTUMS = 40; // keyframes drawn as cameras, evenly chosen
const DIAMETER = 1.6; // of a point, in spacings: closes a surface
const HIDDEN = 0.22; // opacity of lines behind the cloud
const LARGEST_RATIO = 2; // pixels of the picture to a pixel of the page

class Scene {
  constructor(canvas, map, cloud) {
    const gl = canvas.getContext("webgl2", { antialias: true, alpha: true, powerPreference: "high-performance" });
    if (!gl) throw new Error("no WebGL 2");
    Object.assign(this, { gl, canvas, map, cloud });
    this.build();
    this.setPath();
  }

  build() {
    const { gl, cloud } = this;
    this.programs = Object.fromEntries(["points", "shade", "lines", "faces"].map((name) => [name, compileProgram(gl, name)]));
    this.target = new Target(gl);
    const [places, paint] = [gl.createBuffer(), gl.createBuffer()];
    fill(gl, places, cloud.places, gl.STATIC_DRAW);
    fill(gl, paint, cloud.paint, gl.STATIC_DRAW);
    this.points = vertexArray(gl, [
      { buffer: places, stride: 6, attributes: [[3, gl.UNSIGNED_SHORT, true, 0]] },
      { buffer: paint, stride: 4, attributes: [[4, gl.UNSIGNED_BYTE, true, 0]] },
    ]);
    this.empty = gl.createVertexArray();
    this.layers = Object.fromEntries(["path", "boxes", "over"].map((name) => [name, this.layer()]));
    this.spacing = cloud.voxel || this.meanSpacing();
  }

  layer() {
    const { gl } = this, lines = gl.createBuffer(), faces = gl.createBuffer();
    const one = [[3, gl.FLOAT, false, 0], [3, gl.FLOAT, false, 12], [4, gl.UNSIGNED_BYTE, true, 24], [1, gl.FLOAT, false, 28]];
    const two = [[3, gl.FLOAT, false, 0], [4, gl.UNSIGNED_BYTE, true, 12]];
    return {
      lines, faces, lineCount: 0, faceCount: 0,
      lineArray: vertexArray(gl, [{ buffer: lines, stride: 32, attributes: one }], 1),
      faceArray: vertexArray(gl, [{ buffer: faces, stride: 16, attributes: two }]),
    };
  }

  put(name, lines, faces = new Faces()) {
    const { gl } = this, layer = this.layers[name];
    fill(gl, layer.lines, lines.packed(), gl.DYNAMIC_DRAW);
    fill(gl, layer.faces, faces.packed(), gl.DYNAMIC_DRAW);
    layer.lineCount = lines.items.length;
    layer.faceCount = faces.items.length;
  }

  // Of neighbours in the list, which lie along a Z curve: the median of their distances.
  meanSpacing() {
    const { places, low, high, count } = this.cloud, found = [];
    const unitOf = [0, 1, 2].map((k) => (high[k] - low[k]) / 65535);
    for (let k = 1; k < count; k += Math.max(1, count >> 10))
      found.push(Math.hypot(...unitOf.map((u, axis) => u * (places[3 * k + axis] - places[3 * k - 3 + axis]))));
    return found.sort((a, b) => a - b)[found.length >> 1] || 0.01;
  }

  setPath() {
    const { path, poses, keyframes } = this.map.cameras, lines = new Lines(), color = this.light ? [52, 62, 78] : [226, 232, 242];
    for (let k = 3; k < path.length; k += 3)
      lines.add(path.slice(k - 3, k), path.slice(k, k + 3), [...color, 210], 1.8);
    const step = Math.max(1, Math.ceil(keyframes / FRUSTUMS)), size = 0.05 * this.map.start.radius + 0.015;
    for (let k = 0; k < keyframes; k += step) addCamera(lines, poses[k], size, [...color, 130], 1);
    this.put("path", lines);
  }

  // The boxes of shown things; over everything, what is chosen, pointed at or asked for.
  setThings(shown) {
    const { map } = this, lines = new Lines(), faces = new Faces(), overLines = new Lines(), overFaces = new Faces();
    for (const { thing } of shown) {
      const rgb = colorOf(map, thing.label), chosen = thing.id === state.selected, hovered = thing.id === state.hovered;
      const look = { width: chosen ? 3.2 : hovered ? 2.6 : 1.8, solid: chosen ? 66 : hovered ? 52 : 26 };
      if (state.show.boxes || chosen || hovered) addBox(lines, faces, map.edges, thing, rgb, look);
      if (chosen) addBox(overLines, new Faces(), map.edges, thing, rgb, { width: 1.4, solid: 0 });
      if (state.show.uncertainty || chosen) addEllipsoid(overLines, overFaces, thing, rgb);
    }
    const pose = state.view && map.cameras.poses[state.view[1]], thing = map.byId.get(state.selected);
    if (pose) {
      const color = [255, 255, 255, 255];
      addCamera(overLines, pose, 0.12 * map.start.radius + 0.03, color, 2);
      if (thing) overLines.add(pose.slice(0, 3), thing.center, [255, 255, 255, 150], 1.2);
    }
    this.put("boxes", lines, faces);
    this.put("over", overLines, overFaces);
  }

  resize() {
    const { canvas } = this, box = canvas.getBoundingClientRect();
    this.ratio = Math.min(window.devicePixelRatio || 1, LARGEST_RATIO);
    const size = [Math.max(1, Math.round(box.width * this.ratio)), Math.max(1, Math.round(box.height * this.ratio))];
    if (canvas.width !== size[0]) canvas.width = size[0];
    if (canvas.height !== size[1]) canvas.height = size[1];
    return [Math.max(1, box.width), Math.max(1, box.height)];
  }

  use(name, matrix) {
    const { gl } = this, { program, places } = this.programs[name];
    gl.useProgram(program);
    if (places.toClip) gl.uniformMatrix4fv(places.toClip, false, matrix);
    return places;
  }

  draw(camera) {
    const { gl, canvas } = this, matrix = camera.matrix();
    gl.disable(gl.BLEND);
    gl.enable(gl.DEPTH_TEST);
    gl.depthMask(true);
    gl.depthFunc(gl.LEQUAL);
    gl.viewport(0, 0, canvas.width, canvas.height);
    const cloud = state.show.cloud && this.cloud.count > 0;
    if (cloud) this.drawPoints(camera, matrix);
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    if (cloud) this.shade(camera);
    gl.enable(gl.BLEND);
    gl.blendFuncSeparate(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA, gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
    gl.depthMask(false);
    const hidden = [[gl.GREATER, HIDDEN], [gl.LEQUAL, 1]];
    if (state.show.path) for (const way of hidden) this.drawLines("path", matrix, ...way);
    this.drawFaces("boxes", matrix, gl.LEQUAL);
    for (const way of hidden) this.drawLines("boxes", matrix, ...way);
    this.drawFaces("over", matrix, gl.ALWAYS);
    this.drawLines("over", matrix, gl.ALWAYS, 1);
  }

  drawPoints(camera, matrix) {
    const { gl, canvas, cloud, target } = this;
    target.resize(canvas.width, canvas.height);
    gl.bindFramebuffer(gl.FRAMEBUFFER, target.frame);
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    const at = this.use("points", matrix);
    gl.uniform3fv(at.low, cloud.low);
    gl.uniform3fv(at.extent, cloud.high.map((value, k) => value - cloud.low[k]));
    gl.uniform3fv(at.eye, camera.eye());
    gl.uniform1f(at.diameter, (DIAMETER * this.spacing * canvas.height) / (2 * camera.slope()));
    const { near, far } = camera.depths();
    gl.uniform1f(at.near, near);
    gl.uniform1f(at.far, far);
    gl.uniform1f(at.height, 0.5 * this.spacing);
    gl.uniform1f(at.smallest, 1.6 * this.ratio);
    gl.uniform1i(at.hideBacks, state.show.backs ? 0 : 1);
    gl.bindVertexArray(this.points);
    gl.drawArrays(gl.POINTS, 0, cloud.count);
  }

  shade(camera) {
    const { gl, target, ratio } = this, at = this.use("shade"), { near, far } = camera.depths();
    gl.activeTexture(gl.TEXTURE0);
    gl.bindTexture(gl.TEXTURE_2D, target.color);
    gl.activeTexture(gl.TEXTURE1);
    gl.bindTexture(gl.TEXTURE_2D, target.depth);
    gl.uniform1i(at.colors, 0);
    gl.uniform1i(at.depths, 1);
    gl.uniform2f(at.step_, (1.4 * ratio) / target.size[0], (1.4 * ratio) / target.size[1]);
    gl.uniform1f(at.near, near);
    gl.uniform1f(at.far, far);
    gl.uniform1f(at.strength, 7);
    gl.bindVertexArray(this.empty);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
  }

  drawLines(name, matrix, depth, opacity) {
    const { gl, canvas } = this, layer = this.layers[name];
    if (!layer.lineCount) return;
    const at = this.use("lines", matrix);
    gl.depthFunc(depth);
    gl.uniform2f(at.size, canvas.width, canvas.height);
    gl.uniform1f(at.ratio, this.ratio);
    gl.uniform1f(at.opacity, opacity);
    gl.bindVertexArray(layer.lineArray);
    gl.drawArraysInstanced(gl.TRIANGLE_STRIP, 0, 4, layer.lineCount);
  }

  drawFaces(name, matrix, depth) {
    const { gl } = this, layer = this.layers[name];
    if (!layer.faceCount) return;
    this.use("faces", matrix);
    gl.depthFunc(depth);
    gl.bindVertexArray(layer.faceArray);
    gl.drawArrays(gl.TRIANGLES, 0, layer.faceCount);
  }
}
