uniform sampler2D picture;
in vec2 uv;
layout(location = 0) out vec4 pixel;
void main() { pixel = of_codes(texture(picture, uv)); }
