uniform sampler2D picture;
uniform vec3 from_eye;
uniform vec3 towards;
uniform vec4 window;
uniform vec4 colour;
uniform float blur_px;
in vec3 direction;
layout(location = 0) out vec4 pixel;
vec4 blurred() {
    // Smaller copies of the picture, smoothed over three by three of their pixels.
    float level = log2(max(blur_px, 1.0));
    vec2 size = vec2(textureSize(picture, 0)), sum_at = gl_FragCoord.xy / size;
    vec4 sum = vec4(0.0);
    for (int x = -1; x <= 1; x++) {
        for (int y = -1; y <= 1; y++) {
            float weight = (x == 0 ? 0.5 : 0.25) * (y == 0 ? 0.5 : 0.25);
            sum += weight * textureLod(picture, sum_at + 0.5 * blur_px * vec2(x, y) / size, level);
        }
    }
    return sum;
}
void main() {
    // Where the ray meets what stands around the eye that looks, at its distance.
    vec3 ray = normalize(direction);
    float along = dot(ray, from_eye), distance_m = window.z;
    float reach = sqrt(max(along * along - dot(from_eye, from_eye) + distance_m * distance_m, 0.0)) - along;
    vec3 seen = normalize(from_eye + reach * ray);
    float angle = 2.0 * asin(clamp(0.5 * length(seen - towards), 0.0, 1.0));
    float soft = max(window.y, 0.5 * fwidth(angle));
    float inside = 1.0 - smoothstep(window.x - soft, window.x + soft, angle);
    float cover = window.w > 1.5 ? 1.0 : window.w > 0.5 ? inside : 1.0 - inside;
    pixel = of_codes(vec4(blur_px > 0.0 ? blurred().rgb : colour.rgb, 1.0));
    pixel.a = cover;
}
