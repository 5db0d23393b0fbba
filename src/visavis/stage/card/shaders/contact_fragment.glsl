in vec2 at;
flat in vec4 heel;
flat in vec4 ball;
flat in vec2 kind;
const float SHADE_M = 0.34, LEAST_M = 0.004;
const float BODY_M = 0.26;
const float HEEL_HIGH_M = 0.045, TOES_HIGH_M = 0.085, LEG_RADIUS_M = 0.055;

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
    shoe *= 1.0 - 0.6 * past * smoothstep(-0.005, 0.005, away);
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
