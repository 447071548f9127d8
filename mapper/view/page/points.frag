#version 300 es
// A point as a shallow bowl turned over: where two overlap, each pixel is of the nearer one's middle.
precision highp float;
uniform float near, far;
uniform float height;                 // metres of the bowl
in vec3 color;
in float depth;
out vec4 pixel;

void main() {
  vec2 from = gl_PointCoord - 0.5;
  float r2 = 4.0 * dot(from, from);
  if (r2 > 1.0) discard;
  float z = depth + height * r2;
  gl_FragDepth = 0.5 + 0.5 * (far + near - 2.0 * far * near / z) / (far - near);
  pixel = vec4(color, 1.0);
}
