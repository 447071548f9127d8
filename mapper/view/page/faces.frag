#version 300 es
precision highp float;
in vec4 paint;
out vec4 pixel;

void main() {
  pixel = paint;
}
