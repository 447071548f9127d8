// The little of WebGL 2 that the scene needs.

function compileProgram(gl, name) {
  const program = gl.createProgram();
  for (const [kind, suffix] of [[gl.VERTEX_SHADER, ".vert"], [gl.FRAGMENT_SHADER, ".frag"]]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, document.getElementById(name + suffix).textContent.trim());
    gl.compileShader(shader);
    if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS) && !gl.isContextLost())
      throw new Error(`${name}${suffix}: ${gl.getShaderInfoLog(shader)}`);
    gl.attachShader(program, shader);
  }
  gl.linkProgram(program);
  if (!gl.getProgramParameter(program, gl.LINK_STATUS) && !gl.isContextLost())
    throw new Error(`${name}: ${gl.getProgramInfoLog(program)}`);
  const places = {};
  for (let k = 0; k < gl.getProgramParameter(program, gl.ACTIVE_UNIFORMS); k++) {
    const uniform = gl.getActiveUniform(program, k).name;
    places[uniform] = gl.getUniformLocation(program, uniform);
  }
  return { program, places };
}

// A vertex array over one buffer; `attributes` are [count, type, normalized, offset in bytes] in the order of locations.
function vertexArray(gl, buffers, divisor = 0) {
  const array = gl.createVertexArray();
  gl.bindVertexArray(array);
  let location = 0;
  for (const { buffer, stride, attributes } of buffers) {
    gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
    for (const [count, type, normalized, offset] of attributes) {
      gl.enableVertexAttribArray(location);
      gl.vertexAttribPointer(location, count, type, normalized, stride, offset);
      gl.vertexAttribDivisor(location, divisor);
      location += 1;
    }
  }
  gl.bindVertexArray(null);
  return array;
}

function fill(gl, buffer, values, usage) {
  gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
  gl.bufferData(gl.ARRAY_BUFFER, values, usage);
}

// A picture with colours and depths that a shader can read.
class Target {
  constructor(gl) {
    this.gl = gl;
    this.size = [0, 0];
    this.frame = gl.createFramebuffer();
    this.color = gl.createTexture();
    this.depth = gl.createTexture();
  }

  resize(width, height) {
    if (this.size[0] === width && this.size[1] === height) return;
    const { gl } = this;
    this.size = [width, height];
    const formats = [
      [this.color, gl.RGBA8, gl.RGBA, gl.UNSIGNED_BYTE],
      [this.depth, gl.DEPTH_COMPONENT24, gl.DEPTH_COMPONENT, gl.UNSIGNED_INT],
    ];
    for (const [texture, internal, format, type] of formats) {
      gl.bindTexture(gl.TEXTURE_2D, texture);
      gl.texImage2D(gl.TEXTURE_2D, 0, internal, width, height, 0, format, type, null);
      for (const name of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) gl.texParameteri(gl.TEXTURE_2D, name, gl.NEAREST);
      for (const name of [gl.TEXTURE_WRAP_S, gl.TEXTURE_WRAP_T]) gl.texParameteri(gl.TEXTURE_2D, name, gl.CLAMP_TO_EDGE);
    }
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.frame);
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, this.color, 0);
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.DEPTH_ATTACHMENT, gl.TEXTURE_2D, this.depth, 0);
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
  }
}
