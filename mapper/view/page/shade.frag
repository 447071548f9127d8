#version 300 es
// Eye-dome lighting: a pixel is darker the more of its neighbours are nearer, which shows edges and hollows of a cloud
// that has no normals (Boucheny, "Interactive scientific visualization of large datasets", 2009).
precision highp float;
uniform sampler2D colors;
uniform highp sampler2D depths;
uniform vec2 step_;       // of the texture, times the radius in pixels
uniform float near, far, strength;
in vec2 uv;
out vec4 pixel;

float logDepth(vec2 at) {
  float z = texture(depths, at).r;
  return z >= 1.0 ? log2(far) : log2(2.0 * near * far / (far + near - (2.0 * z - 1.0) * (far - near)));
}

void main() {
  float z = texture(depths, uv).r;
  if (z >= 1.0) discard;
  float own = logDepth(uv), sum = 0.0;
  for (int k = 0; k < 8; k++) {
    float angle = float(k) * 0.7853981634;
    sum += clamp(own - logDepth(uv + step_ * vec2(cos(angle), sin(angle))), 0.0, 0.4);
  }
  pixel = vec4(texture(colors, uv).rgb * exp(-strength * sum / 8.0), 1.0);
  gl_FragDepth = z;
}
