uniform sampler2D picture;
in vec3 direction;
layout(location = 0) out vec4 pixel;
const float PI = 3.14159265358979;
void main() {
    vec3 d = normalize(direction);
    vec2 uv = vec2(0.5 + atan(d.x, -d.z) / (2.0 * PI), acos(clamp(d.y, -1.0, 1.0)) / PI);
    // Sharpness follows from angles: steps of uv jump where the picture's edges meet, and at poles.
    float pixel_rad = max(length(dFdx(d)), length(dFdy(d)));
    float texel_rad = PI / float(textureSize(picture, 0).y);
    pixel = of_codes(textureLod(picture, uv, log2(pixel_rad / texel_rad)));
}
