uniform sampler2D shadow_depth_0;
uniform sampler2D shadow_depth_1;
uniform int maps;
layout(location = 0) out vec4 bounds;
vec2 nearest_and_farthest(sampler2D depths) {
    ivec2 last = textureSize(depths, 0) - 1, first = ivec2(gl_FragCoord.xy) * SHADOW_SQUARE;
    vec2 between = vec2(1.0, 0.0);
    for (int y = 0; y < SHADOW_SQUARE; ++y)
        for (int x = 0; x < SHADOW_SQUARE; ++x) {
            float depth = texelFetch(depths, min(first + ivec2(x, y), last), 0).r;
            between = vec2(min(between.x, depth), max(between.y, depth));
        }
    return between;
}
void main() {
    bounds = vec4(nearest_and_farthest(shadow_depth_0), 1.0, 1.0);
    if (maps > 1) bounds.zw = nearest_and_farthest(shadow_depth_1);
}
