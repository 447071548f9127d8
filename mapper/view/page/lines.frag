#version 300 es
precision highp float;
uniform float opacity;
in vec4 paint;
in float across;
in float half_;
out vec4 pixel;

void main() {
  float cover = clamp(half_ + 0.5 - abs(across), 0.0, 1.0);
  pixel = vec4(paint.rgb, paint.a * opacity * cover);
}
