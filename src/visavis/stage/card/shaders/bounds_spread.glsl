// Reads reach into the squares beside their own, never beyond.
uniform sampler2D shadow_bounds;
layout(location = 0) out vec4 bounds;
void main() {
    ivec2 last = textureSize(shadow_bounds, 0) - 1, here = ivec2(gl_FragCoord.xy);
    bounds = vec4(1.0, 0.0, 1.0, 0.0);
    for (int y = -1; y <= 1; ++y)
        for (int x = -1; x <= 1; ++x) {
            vec4 beside = texelFetch(shadow_bounds, clamp(here + ivec2(x, y), ivec2(0), last), 0);
            bounds.xz = min(bounds.xz, beside.xz);
            bounds.yw = max(bounds.yw, beside.yw);
        }
}
