in vec2 uv;
layout(location = 0) out vec4 pixel;
void main() {
    // A disc with a dark cross and a bright centre, the target that keeps eyes stillest.
    vec2 at = (uv - 0.5) * 2.0;
    float radius = length(at), soft = max(fwidth(radius), 1e-4);
    float disc = 1.0 - smoothstep(1.0 - min(2.0 * soft, 0.5), 1.0, radius);
    float cross_at = min(abs(at.x), abs(at.y));
    float arms = 1.0 - smoothstep(0.20 - soft, 0.20 + soft, cross_at);
    float centre = 1.0 - smoothstep(0.20 - soft, 0.20 + soft, radius);
    pixel = of_codes(vec4(vec3(mix(mix(0.85, 0.05, arms), 0.95, centre)), disc));
}
