uniform sampler2D picture;
in vec3 direction;
layout(location = 0) out vec4 pixel;
const float PI = 3.14159265358979;
void main() {
    vec3 d = normalize(direction);
    vec2 uv = vec2(0.5 + atan(d.x, -d.z) / (2.0 * PI), acos(clamp(d.y, -1.0, 1.0)) / PI);
    // where the picture's two edges meet, the step from one pixel to the next is no whole picture
    vec2 across = dFdx(uv), down = dFdy(uv);
    across.x -= round(across.x);
    down.x -= round(down.x);
    pixel = of_codes(textureGrad(picture, uv, across, down));
}
