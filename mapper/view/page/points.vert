#version 300 es
// A point of the cloud; hidden where it faces away, so that one looks into a room through its nearer wall.
layout(location = 0) in vec3 place;   // 0..1 between the bounds
layout(location = 1) in vec4 paint;   // RGB 0..1, and the code of the side / 255
uniform mat4 toClip;
uniform vec3 low, extent, eye;
uniform float diameter;               // pixels of a point at 1 m
uniform float smallest;               // pixels
uniform bool hideBacks;
out vec3 color;
out float depth;                      // metres from the viewer's plane

vec3 side(float code) {               // as facing.py writes it
  vec2 xy = vec2(floor(code / 16.0), mod(code, 16.0)) / 14.0 * 2.0 - 1.0;
  vec3 n = vec3(xy, 1.0 - abs(xy.x) - abs(xy.y));
  if (n.z < 0.0) n.xy = (1.0 - abs(n.yx)) * vec2(n.x >= 0.0 ? 1.0 : -1.0, n.y >= 0.0 ? 1.0 : -1.0);
  return normalize(n);
}

void main() {
  vec3 at = low + place * extent;
  float code = floor(paint.a * 255.0 + 0.5);
  gl_Position = toClip * vec4(at, 1.0);
  depth = gl_Position.w;
  gl_PointSize = clamp(diameter / gl_Position.w, smallest, 64.0);
  if (hideBacks && code < 254.5 && dot(side(code), normalize(eye - at)) < -0.17) gl_Position = vec4(2.0, 2.0, 2.0, 1.0);
  color = paint.rgb;
}
