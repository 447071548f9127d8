#version 300 es
// A line as a band of pixels: one instance a line, four corners each.
layout(location = 0) in vec3 from;
layout(location = 1) in vec3 to;
layout(location = 2) in vec4 color;
layout(location = 3) in float width;  // pixels
uniform mat4 toClip;
uniform vec2 size;                    // of the picture, pixels
uniform float ratio;                  // pixels of the picture to a pixel of the page
out vec4 paint;
out float across;
out float half_;

void main() {
  vec4 p = toClip * vec4(from, 1.0), q = toClip * vec4(to, 1.0);
  float dp = p.z + p.w, dq = q.z + q.w;  // negative behind the near plane
  if (dp < 0.0 && dq < 0.0) { gl_Position = vec4(2.0, 2.0, 2.0, 1.0); return; }
  if (dp < 0.0) p = mix(p, q, dp / (dp - dq)); else if (dq < 0.0) q = mix(q, p, dq / (dq - dp));
  vec2 along = (q.xy / q.w - p.xy / p.w) * size;
  along = dot(along, along) > 1e-6 ? normalize(along) : vec2(1.0, 0.0);
  bool end = (gl_VertexID & 1) == 1;
  float sideways = (gl_VertexID & 2) == 0 ? -1.0 : 1.0;
  half_ = 0.5 * width * ratio;
  across = sideways * (half_ + 1.0);
  vec4 at = end ? q : p;
  vec2 offset = vec2(-along.y, along.x) * across + along * (end ? half_ : -half_);
  gl_Position = vec4(at.xy + offset * 2.0 / size * at.w, at.z - 0.0006 * at.w, at.w);
  paint = color;
}
