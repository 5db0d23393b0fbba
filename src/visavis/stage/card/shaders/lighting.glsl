layout(std140) uniform Lighting {
    vec4 sky;                         // rgb ambient from above, w: number of lights
    vec4 ground;                      // rgb ambient from below, w: number of shadow maps
    vec4 lamp_place[MAX_LIGHTS];     // xyz, w: 0 sun, 1 spot, 2 point
    vec4 lamp_axis[MAX_LIGHTS];      // xyz direction of travel, w: cosine of the half angle
    vec4 lamp_colour[MAX_LIGHTS];    // rgb at one metre, w: shadow map or -1
    mat4 shadow_from_world[MAX_SHADOWS];
    vec4 shadow_shape[MAX_SHADOWS];  // x: taps a way, y: share of the map a metre spans at
                                     // one metre (sun: everywhere), z: near (sun: 0), w: far
};

#ifdef SHADOWS
uniform sampler2DShadow shadow_map_0;
uniform sampler2DShadow shadow_map_1;
#ifndef AREA_LAMPS
uniform sampler2D shadow_bounds;  // per square of texels the nearest and farthest depth that reads
                                  // there can meet: of map 0 in xy, of map 1 in zw

// A box as many texels wide as 2 * side - 1, on 2 * side texels a way: the card compares and weighs
// two by two of them at a time.
float shadow_taps(sampler2DShadow map, vec3 at, int side) {
    vec2 texel = 1.0 / vec2(textureSize(map, 0));
    vec2 before = floor(at.xy / texel - 0.5), share = at.xy / texel - 0.5 - before;
    vec2 first = before - float(side) + 1.5, at_first = 1.0 / (2.0 - share);
    vec2 at_last = share / (1.0 + share), last = vec2(float(side) - 1.0);
    float lit = 0.0;
    for (float y = 0.0; y <= last.y; y += 1.0)
        for (float x = 0.0; x <= last.x; x += 1.0) {
            vec2 tap = vec2(x, y);
            bvec2 is_first = equal(tap, vec2(0.0)), is_last = equal(tap, last);
            vec2 wide = mix(mix(vec2(2.0), 1.0 + share, is_last), 2.0 - share, is_first);
            vec2 aside = mix(mix(vec2(0.5), at_last, is_last), at_first, is_first);
            vec2 here = (first + 2.0 * tap + aside) * texel;
            lit += wide.x * wide.y * textureLod(map, vec3(here, at.z), 0.0);
        }
    float wide = 2.0 * last.x + 1.0;
    return lit / (wide * wide);
}
#endif

#ifdef AREA_LAMPS
uniform sampler2D shadow_depth_0;
uniform sampler2D shadow_depth_1;

// Lamps have a size: shadows are sharp where a thing touches what it darkens, and the softer the
// farther it is above (percentage-closer soft shadows, Fernando 2005).
const float LAMP_RADIUS_M = 0.22, SUN_TANGENT = 0.09, SEARCHED_M = 0.22, WIDEST_M = 0.22;
const int SEARCHES = 16, TAPS = 32;

float lamp_distance(float depth, vec4 shape) {
    return shape.z <= 0.0 ? depth * shape.w
                          : shape.z * shape.w / (shape.w - depth * (shape.w - shape.z));
}

vec2 on_disc(int i, int count) {
    float turn = 2.39996323 * float(i);
    return sqrt((float(i) + 0.5) / float(count)) * vec2(cos(turn), sin(turn));
}

float area_taps(sampler2DShadow map, sampler2D depths, vec3 at, vec4 shape) {
    float here = lamp_distance(at.z, shape);
    bool is_sun = shape.z <= 0.0;
    float metre = is_sun ? shape.y : shape.y / here;
    float nearer = 0.0, blockers = 0.0;
    for (int i = 0; i < SEARCHES; ++i) {
        vec2 aside = on_disc(i, SEARCHES);
        float depth = texture(depths, at.xy + SEARCHED_M * metre * aside).r;
        float away = lamp_distance(depth, shape);
        if (away < here - 0.01) { nearer += away; blockers += 1.0; }
    }
    if (blockers == 0.0) return 1.0;
    nearer /= blockers;
    float wide = is_sun ? SUN_TANGENT * (here - nearer)
                        : LAMP_RADIUS_M * (here - nearer) / max(nearer, 0.1);
    vec2 reach = max(vec2(min(wide, WIDEST_M) * metre), 1.0 / vec2(textureSize(map, 0)));
    float lit = 0.0;
    for (int i = 0; i < TAPS; ++i)
        lit += texture(map, vec3(at.xy + reach * on_disc(i, TAPS), at.z));
    return lit / float(TAPS);
}
#endif
#endif

vec3 ambient_at(vec3 normal) {
    return mix(ground.rgb, sky.rgb, 0.5 + 0.5 * normal.y);
}

// Direction towards lamp i and the light that arrives, before the surface's angle.
vec3 lamp_at(int i, vec3 place, out vec3 towards) {
    vec4 where = lamp_place[i];
    vec4 axis = lamp_axis[i];
    vec3 arriving = lamp_colour[i].rgb;
    if (LAMP_KIND[i] == 0) {
        towards = -axis.xyz;
    } else {
        vec3 path = where.xyz - place;
        float squared = max(dot(path, path), 0.04);
        towards = path * inversesqrt(squared);
        arriving /= squared;
        if (LAMP_KIND[i] == 1) {
            float cosine = -dot(towards, axis.xyz);
            arriving *= smoothstep(axis.w, mix(axis.w, 1.0, 0.3), cosine);
        }
    }
    return arriving;
}

#ifdef SHADOWS
// The share of a lamp's light that arrives.
float shadow_of(int map, vec3 place, vec3 normal) {
    vec4 at = shadow_from_world[map] * vec4(place + normal * 0.018, 1.0);
    vec3 uvz = at.xyz / at.w * 0.5 + 0.5;
    if (at.w <= 0.0 || uvz.z >= 1.0 || any(lessThanEqual(uvz.xy, vec2(0.0)))
        || any(greaterThanEqual(uvz.xy, vec2(1.0)))) return 1.0;
#ifdef AREA_LAMPS
    return map == 0 ? area_taps(shadow_map_0, shadow_depth_0, uvz, shadow_shape[0])
                    : area_taps(shadow_map_1, shadow_depth_1, uvz, shadow_shape[1]);
#else
    ivec2 texel = ivec2(uvz.xy * vec2(textureSize(shadow_map_0, 0)));
    vec4 bounds = texelFetch(shadow_bounds, texel / SHADOW_SQUARE, 0);
    vec2 depths = map == 0 ? bounds.xy : bounds.zw;
    if (uvz.z <= depths.x) return 1.0;
    if (uvz.z > depths.y) return 0.0;
    int side = int(shadow_shape[map].x);
    return map == 0 ? shadow_taps(shadow_map_0, uvz, side) : shadow_taps(shadow_map_1, uvz, side);
#endif
}
#endif

// The share of its light that arrives from each lamp with a map, on a surface that takes it up to
// `beyond` the right angle; of what is not seen there anyway, 1.
vec2 shares_at(vec3 place, vec3 normal, float beyond) {
    vec2 shares = vec2(1.0);
#ifdef SHADOWS
    vec3 towards;
#ifdef LAMP_OF_MAP_0
    if (lamp_at(LAMP_OF_MAP_0, place, towards) != vec3(0.0) && dot(normal, towards) > -beyond)
        shares.x = shadow_of(0, place, normal);
#endif
#ifdef LAMP_OF_MAP_1
    if (lamp_at(LAMP_OF_MAP_1, place, towards) != vec3(0.0) && dot(normal, towards) > -beyond)
        shares.y = shadow_of(1, place, normal);
#endif
#endif
    return shares;
}

// Lambert's law with the light bleeding round the edge by `wrap` per colour, and one highlight.
vec3 lit(vec3 albedo, vec3 wrap, vec3 place, vec3 normal, vec3 view, float gloss, float shine) {
    vec3 arrived = ambient_at(normal);
    vec3 highlight = vec3(0.0);
    vec3 spread = 1.0 / ((1.0 + wrap) * (1.0 + wrap));
    vec2 shares = shares_at(place, normal, max(wrap.r, max(wrap.g, wrap.b)));
    for (int i = 0; i < LAMPS; ++i) {
        vec3 towards;
        vec3 arriving = lamp_at(i, place, towards);
        float cosine = dot(normal, towards);
        if (SHADOW_OF[i] >= 0) arriving *= shares[SHADOW_OF[i]];
        arrived += arriving * max((cosine + wrap) * spread, 0.0);
#ifndef NO_SHINE
        float half_cosine = max(dot(normal, normalize(towards + view)), 0.0);
        highlight += arriving * (max(cosine, 0.0) * shine * pow(half_cosine, gloss));
#endif
    }
    return albedo * arrived + highlight;
}

// Colours up to 0.5 stay as they are; brighter ones approach 1 without ever being cut, and keep
// most of their hue.
vec3 shown(vec3 linear) {
    vec3 x = max(linear, 0.0);
    float most = max(x.r, max(x.g, x.b));
    float mapped = min(most, 0.5) + 0.5 * (1.0 - exp(-max(most - 0.5, 0.0) / 0.5));
    vec3 apart = min(x, 0.5) + 0.5 * (1.0 - exp(-max(x - 0.5, 0.0) / 0.5));
    return mix(apart, x * (mapped / max(most, 1e-4)), 0.7);
}

vec3 encoded(vec3 linear) {
    vec3 x = clamp(linear, 0.0, 1.0);
#ifdef FAST_TONE
    // Square roots instead of powers: within 0.5 of 255 of the exact curve.
    vec3 half_root = sqrt(x), fourth = sqrt(half_root), eighth = sqrt(fourth);
    return max(0.662002687 * half_root + 0.684122060 * fourth - 0.323583601 * eighth
               - 0.0225411470 * x, 0.0);
#endif
    return mix(12.92 * x, 1.055 * pow(max(x, 1e-5), vec3(1.0 / 2.4)) - 0.055,
               step(0.0031308, x));
}

// What vertices hand to pixels that work in the display's codes, at full brightness: without a
// texture the colour itself; with one the factor of its codes, as codes go nearly with the 2.2nd
// root of light. `vertex_light` does the same on the processor.
vec3 in_codes(vec3 linear) {
#ifdef TEXTURED
    return pow(max(linear, 0.0), vec3(1.0 / 2.2));
#else
    return encoded(shown(linear));
#endif
}

// The curve of `shown`, for codes.
vec3 shown_codes(vec3 codes) {
    vec3 beyond = max(codes - 0.735, 0.0) / 0.265;
    vec3 falling = 1.0 / (1.0 + beyond * (1.0 + beyond * (0.5 + beyond * 0.1667)));
    return (min(codes, 0.735) + 0.265 * (1.0 - falling)) * tone.w;
}

#if defined(CUT_OUT) && defined(SHRUNK)
// Of four pixels that become one, as many stay as the surface covers: soft edges.
#define ODD(at) (int(at) & 1)
#define RANK(at) (2 * (ODD((at).x) ^ ODD((at).y)) + ODD((at).y))
#define CUT(alpha) if ((alpha) < 0.125 + 0.25 * float(RANK(gl_FragCoord.xy))) discard;
#elif defined(CUT_OUT)
#define CUT(alpha) if ((alpha) < tone.z) discard;
#else
#define CUT(alpha)
#endif
