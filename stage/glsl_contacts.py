"""Shade where something stands on a floor, in GLSL: how much of the light from above it hides."""

from stage.glsl_lighting import FRAME_BLOCK

_PULLED = """
// On the screen where it is, in depth as if the floor lay higher: neither hides the other, also
// where a sole sinks into the floor a little.
const float ABOVE_FLOOR_M = 0.025;
vec4 on_floor(vec3 place) {
    vec4 here = view_projection * vec4(place, 1.0);
    float high = max(eye_m.y - place.y, 1e-3);
    vec3 nearer = mix(place, eye_m.xyz, min(ABOVE_FLOOR_M / high, 0.5));
    vec4 before = view_projection * vec4(nearer, 1.0);
    if (here.w > 0.0 && before.w > 0.0) here.z = before.z / before.w * here.w;
    return here;
}
"""

SOLE_VERTEX = (
    FRAME_BLOCK
    + _PULLED
    + """
uniform sampler2D joint_rows;  // per person: discs at heel and ball, left, then right
uniform int first_texel;
in vec2 in_corner;
out vec2 at;
flat out vec4 heel;  // x, z, how high above the floor, radius
flat out vec4 ball;
const float SHADE_M = 0.34;
void main() {
    int person = gl_InstanceID / 2, first = first_texel + gl_InstanceID % 2 * 2;
    float floor_m = 1e9;
    for (int i = 0; i < 4; ++i)
        floor_m = min(floor_m, texelFetch(joint_rows, ivec2(first_texel + i, person), 0).y);
    vec4 a = texelFetch(joint_rows, ivec2(first, person), 0);
    vec4 b = texelFetch(joint_rows, ivec2(first + 1, person), 0);
    heel = vec4(a.xz, a.y - floor_m, a.w);
    ball = vec4(b.xz, b.y - floor_m, b.w);
    vec2 along = b.xz - a.xz;
    along = dot(along, along) > 1e-8 ? normalize(along) : vec2(1.0, 0.0);
    float wide = max(a.w, b.w) + SHADE_M;
    vec2 end = in_corner.x < 0.0 ? a.xz : b.xz;
    at = end + along * in_corner.x * wide + vec2(-along.y, along.x) * in_corner.y * wide;
    gl_Position = on_floor(vec3(at.x, floor_m, at.y));
    if (b.w <= 0.0) gl_Position = vec4(0.0, 0.0, 2.0, 1.0);
}
"""
)

_SHADED = """
layout(location = 0) out vec4 pixel;

// Share of the light of an even sky that something long hides from a point of the floor: `away`
// from its side, negative below it, where it is `wide`, and reaches from `low` to `high`.
float hidden(float away, float wide, float low, float high) {
    float beyond = away + wide, top = away < 0.0 ? low : high;
    return 0.5 * (beyond * inversesqrt(beyond * beyond + low * low)
                  - away * inversesqrt(away * away + top * top));
}

void shade(float open) {
#ifndef IN_LIGHT
    open = pow(open, 1.0 / 2.2);  // what is darkened are the display's codes
#endif
    pixel = vec4(vec3(open), 1.0);
}
"""

SOLE_FRAGMENT = (
    _SHADED
    + """
in vec2 at;
flat in vec4 heel;
flat in vec4 ball;
const float SHADE_M = 0.34, LEAST_M = 0.004;
const float ABOVE_FLOOR_M = 0.025, COVERED_M = 0.012, BODY_M = 0.26;
const float HEEL_HIGH_M = 0.09, TOES_HIGH_M = 0.055, LEG_RADIUS_M = 0.055;
void main() {
    vec2 along = ball.xy - heel.xy;
    float share = dot(at - heel.xy, along) / max(dot(along, along), 1e-8);
    float t = clamp(share, 0.0, 1.0);
    vec3 nearest = mix(heel.xyz, ball.xyz, t);
    float radius = mix(heel.w, ball.w, t);
    float away = distance(at, nearest.xy) - radius;
    float low = max(nearest.z, LEAST_M);
    float shoe = hidden(away, 2.0 * radius, low, low + mix(HEEL_HIGH_M, TOES_HIGH_M, t));
    // Round ends hide less than long sides do.
    float past = clamp(abs(share - t) * length(along) / radius, 0.0, 1.0);
    shoe *= 1.0 - 0.35 * past * smoothstep(-0.005, 0.005, away);
    // High above the floor it is short.
    float half_long = length(along) / 2.0 + radius;
    shoe *= half_long * inversesqrt(half_long * half_long + low * low);
    // The leg and the body above it, as high as the sky.
    float leg = asin(LEG_RADIUS_M / max(distance(at, heel.xy), 0.2)) / 3.1416;
    float fading = 1.0 - smoothstep(0.7, 1.0, away / SHADE_M);
    float open = 1.0 - (1.0 - (1.0 - shoe) * (1.0 - leg)) * fading;
#ifdef NO_MAPS
    // What lamps above would throw, were there maps of it.
    float near = max(1.0 - away * away / (BODY_M * BODY_M), 0.0);
    open *= 1.0 - 0.45 * (away < 0.0 ? 1.0 : near * near);
#endif
    // What a planted sole covers is not seen, but the shoe's own side is, before it.
    shade(away < -COVERED_M && low < ABOVE_FLOOR_M ? 1.0 : open);
}
"""
)
