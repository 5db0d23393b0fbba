"""Contact shadows in GLSL: how much light from above an object on the floor blocks."""

from visavis.stage.card.shaders.lighting import FRAME_BLOCK

_PULLED = """
// On the screen where it is, in depth as if the floor lay higher: neither hides the other.
const float ABOVE_FLOOR_M = 0.005;
vec4 on_floor(vec3 place) {
    vec4 here = view_projection * vec4(place, 1.0);
    float high = max(eye_m.y - place.y, 1e-3);
    vec3 nearer = mix(place, eye_m.xyz, min(ABOVE_FLOOR_M / high, 0.5));
    vec4 before = view_projection * vec4(nearer, 1.0);
    if (here.w > 0.0 && before.w > 0.0) here.z = before.z / before.w * here.w;
    return here;
}
"""

VERTEX = (
    FRAME_BLOCK
    + _PULLED
    + """
uniform sampler2D joint_rows;  // per person: discs at heel and ball, left, then right
uniform int first_texel;
uniform int soles;           // so many of the instances; blocks of the room follow them
uniform sampler2D blocks;    // per block: x, z, low, high; half sizes, turn; floor, reach, round
in vec2 in_corner;
out vec2 at;
flat out vec4 heel;  // x, z, how high above the floor, radius; of a block: half sizes, low, high
flat out vec4 ball;
flat out vec2 kind;  // of a block: its reach, 2 where it is round, else 1
const float SHADE_M = 0.34;

void block(int row) {
    vec4 place = texelFetch(blocks, ivec2(0, row), 0);
    vec4 shape = texelFetch(blocks, ivec2(1, row), 0);
    vec4 more = texelFetch(blocks, ivec2(2, row), 0);
    heel = vec4(shape.xy, place.zw);
    ball = vec4(0.0);
    kind = vec2(more.y, more.z + 1.0);
    at = in_corner * (shape.xy + more.y);
    vec2 world = place.xy + mat2(shape.z, -shape.w, shape.w, shape.z) * at;
    gl_Position = on_floor(vec3(world.x, more.x, world.y));
}

void main() {
    if (gl_InstanceID >= soles) {
        block(gl_InstanceID - soles);
        return;
    }
    kind = vec2(0.0);
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

FRAGMENT = (
    _SHADED
    + """
in vec2 at;
flat in vec4 heel;
flat in vec4 ball;
flat in vec2 kind;
const float SHADE_M = 0.34, LEAST_M = 0.004;
const float BODY_M = 0.26;
const float HEEL_HIGH_M = 0.09, TOES_HIGH_M = 0.055, LEG_RADIUS_M = 0.055;

// What the edge of a box hides that lies `ahead`, from `left` to `right`: seen from the floor its
// lower edge is the farther one where the box is overhead, its upper one where it is not.
float edge(float ahead, float left, float right, float low, float high) {
    float up = ahead > 0.0 ? low : high;
    float nearness = inversesqrt(ahead * ahead + up * up);
    vec2 ends = vec2(left, right) * nearness;
    // atan(ends.y) - atan(ends.x), by one of them.
    float angle = 1.570796 - atan((1.0 + ends.x * ends.y) / (ends.y - ends.x));
    return ahead * nearness * angle;
}

// Share of the light of an even sky that an upright box hides from `place`, from its middle.
float hidden_by_box(vec2 place, vec2 size, float low, float high) {
    vec2 less = -size - place, more = size - place;
    return (edge(more.x, less.y, more.y, low, high) + edge(-less.x, less.y, more.y, low, high)
            + edge(more.y, less.x, more.x, low, high) + edge(-less.y, less.x, more.x, low, high))
        / 6.28319;
}

void shade_of_block() {
    vec2 size = heel.xy, place = at;
    float low = max(heel.z, LEAST_M), high = max(heel.w, low);
    float away = length(max(abs(at) - size, 0.0));
    if (kind.y > 1.5) {
        // A cylinder hides as much as a board before it that looks as wide.
        float far = max(length(at), size.x + 1e-4);
        away = far - size.x;
        place = vec2(far, 0.0);
        size.y = size.x * sqrt((far - size.x) / (far + size.x));
        low = 1e-5;
    }
    float fading = 1.0 - smoothstep(0.5, 1.0, away / kind.x);
    shade(1.0 - clamp(hidden_by_box(place, size, low, high), 0.0, 1.0) * fading);
}

void shade_of_sole() {
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
    shade(open);
}

void main() {
#if defined(SOLES) && defined(BLOCKS)
    if (kind.y > 0.5) shade_of_block();
    else shade_of_sole();
#elif defined(SOLES)
    shade_of_sole();
#else
    shade_of_block();
#endif
}
"""
)
