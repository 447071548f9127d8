#version 300 es
layout(location = 0) in vec3 place;
layout(location = 1) in vec4 color;
uniform mat4 toClip;
out vec4 paint;

void main() {
  gl_Position = toClip * vec4(place, 1.0);
  paint = color;
}
