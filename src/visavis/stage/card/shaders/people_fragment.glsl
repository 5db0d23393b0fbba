uniform sampler2DArray picture;  // of textured surfaces the layer is the last of detail
EACH in vec3 place;
EACH in vec3 normal;
EACH in vec3 detail;
in vec3 albedo_here;
flat in uvec4 surface;
flat in uint person;
//OUTPUT//
#ifdef TEXTURED
vec4 picture_here() {
#if defined(KIND_CLOTH) && defined(SHRUNK) && !defined(MAPPED)
    // Stripes that pixels of the small picture cannot hold must be gone before it is made small.
    // Where cloth turns away, what lies beside it in the picture must not come in.
    vec2 size = vec2(textureSize(picture, 0));
    vec2 right = dFdx(detail.xy) * size, up = dFdy(detail.xy) * size;
    float wide = dot(right, right), high = dot(up, up);
    float span = SHRUNK * SHRUNK * min(0.5 * (wide + high), 2.0 * min(wide, high));
    return textureLod(picture, detail, 0.5 * log2(max(span, 1e-8)));
#else
    return texture(picture, detail);
#endif
}
#endif

float grain(vec2 at) { return fract(sin(dot(at, vec2(12.9898, 78.233))) * 43758.5453); }

float smooth_grain(float at) {
    float whole = floor(at);
    float share = smoothstep(0.0, 1.0, at - whole);
    return mix(grain(vec2(whole, 3.0)), grain(vec2(whole + 1.0, 3.0)), share);
}

#ifdef KIND_EYE
// Lengths about an eye are counted in radii of its iris, some 6 mm: where the lids' margins lie
// above and below the pupil and the corners beside it, and how far skin stands before the ball.
const float UPPER_LID = 0.85, LOWER_LID = 1.0, CORNER = 2.2;
const float UPPER_DEEP = 0.40, LOWER_DEEP = 0.20, CORNER_DEEP = 0.40;
const float BESIDE_BROW_AND_NOSE = 0.80;  // of the light all round
const float FARTHEST_GLINT = 0.70;  // a tangent, from the line of sight

// The share of the light all round that an edge hides, so deep, at a place so far from it.
float hidden_by(float deep, float away) {
    float from = max(away, 0.0);
    return 0.5 - 0.5 * from * inversesqrt(from * from + deep * deep);
}

// Colour of the eye at a place on it, times how open it lies; w: the share that the cornea covers.
vec4 eye_at(vec3 at, float iris, float pupil, vec3 iris_colour, float fair, float blur) {
    float radius = at.z < 0.0 ? length(at.xy) : 2.0;
    float share = radius / iris;
    vec2 place = at.xy / iris;
    float corner = smoothstep(0.9, CORNER, abs(place.x));
    // Who has much pigment in iris or skin has some in the white, too.
    float pale = smoothstep(0.03, 0.10, dot(iris_colour, vec3(0.2126, 0.7152, 0.0722)));
    vec3 white = vec3(0.72, 0.69, 0.66) * mix(vec3(0.86, 0.83, 0.78), vec3(1.0), pale);
    white *= mix(vec3(0.70, 0.69, 0.67), vec3(1.0), fair);
    white = mix(white, vec3(0.50, 0.34, 0.30), corner * corner);
    float angle = atan(at.y, at.x);
    float fibres = mix(1.0, 0.72 + 0.5 * smooth_grain(angle * 22.0 + 80.0 + 3.0 * share),
                       1.0 - smoothstep(0.006, 0.03, blur));
    vec3 ring = iris_colour * mix(0.54, 0.33, smoothstep(pupil / iris, 0.85, share)) * fibres;
    ring = mix(ring, iris_colour * 0.12, smoothstep(0.62, 0.90, share));
    float soft = max(blur, 0.02);
    vec3 albedo = mix(ring, white, smoothstep(iris - 0.5 * soft, iris + 0.5 * soft, radius));
    albedo = mix(vec3(0.006), albedo, smoothstep(pupil - 0.6 * blur, pupil + 0.6 * blur, radius));
    float open = 1.0 - hidden_by(UPPER_DEEP, UPPER_LID - place.y)
                 - hidden_by(LOWER_DEEP, LOWER_LID + place.y)
                 - hidden_by(CORNER_DEEP, CORNER - abs(place.x));
    return vec4(albedo * max(open, 0.0), 1.0 - smoothstep(iris * 0.9, iris * 1.25, radius));
}

// The upper lid with its lashes and the brow keep light from above off the eye.
float below_lid(vec3 towards, vec3 n, float up) {
    vec3 upwards = normalize(vec3(0.0, 1.0, 0.0) - n * n.y + vec3(1e-5));
    float rise = dot(towards, upwards) / max(dot(towards, n), 0.05);
    float lid = smoothstep(-0.3, 0.3, UPPER_DEEP * rise - max(UPPER_LID - up, 0.0));
    return (1.0 - 0.75 * lid) * (1.0 - 0.6 * smoothstep(0.8, 2.0, rise));
}

// Whither a cornea that mirrors the lamps must reflect the view: to the middle of those before the
// face. Of lamps overhead the glint is seen at the lid's edge, so no farther than that.
vec3 glint_towards(vec3 lamps, vec3 view) {
    vec3 middle = normalize(lamps + 1e-4 * view);
    vec3 aside = middle - view * dot(middle, view);
    float far = length(aside) / max(dot(middle, view), 1e-3);
    return normalize(view + aside * (min(far, FARTHEST_GLINT) / max(length(aside), 1e-4)));
}

vec3 eye_surface(vec3 n, vec3 view, vec3 iris_colour) {
    float iris = float(surface.y) / 255.0, pupil = float(surface.w) / 255.0;
    float fair = smoothstep(0.05, 0.25, float(surface.x >> 3) / 31.0);  // the skin about it

    vec3 arrived = ambient_at(n) * BESIDE_BROW_AND_NOSE;
    vec3 lamps = vec3(0.0, 1e-3, 0.0);
    float raised = normalize(detail).y / iris;
    vec2 shares = shares_at(place, n, 0.25);
    for (int i = 0; i < LAMPS; ++i) {
        vec3 towards;
        vec3 arriving = lamp_at(i, place, towards);
        lamps += towards * (arriving.g * max(dot(view, towards), 0.0));
        if (SHADOW_OF[i] >= 0) arriving *= shares[SHADOW_OF[i]];
        arrived += arriving * (below_lid(towards, n, raised)
                               * max((dot(n, towards) + 0.25) / 1.5625, 0.0));
    }
    vec3 box = glint_towards(lamps, view);

    // From afar an iris is smaller than two pixels: one point of each says little of where it is.
    vec3 right = ACROSS * dFdx(detail), up = ACROSS * dFdy(detail);
    vec3 n_right = ACROSS * dFdx(n), n_up = ACROSS * dFdy(n);
    float span = max(length(right), length(up));
    int wide = clamp(int(ceil(span / 0.07)), 1, 4);
    float blur = max(span / float(wide), 0.004);
    vec4 seen = vec4(0.0);
    float catch_light = 0.0;
    for (int i = 0; i < wide * wide; ++i) {
        vec2 aside = (vec2(i % wide, i / wide) + 0.5) / float(wide) - 0.5;
        vec4 here = eye_at(normalize(detail + aside.x * right + aside.y * up), iris, pupil,
                           iris_colour, fair, blur);
        vec3 leans = normalize(n + aside.x * n_right + aside.y * n_up);
        seen.rgb += here.rgb;
        catch_light += smoothstep(0.984, 0.993, dot(reflect(-view, leans), box))
                       * mix(0.12, 0.95, here.w);
    }
    float points = float(wide * wide);

    vec3 sky_light = sky.rgb + 0.25;
    vec3 result = arrived * seen.rgb / points;
    result += sky_light * (catch_light / points * tone.y);
    result += sky_light * 0.035 * pow(1.0 - max(dot(n, view), 0.0), 3.0);
    return result;
}

#endif

#ifdef KIND_HAIR
vec3 hair_surface(vec3 albedo, vec3 n, vec3 view, float roughness) {
    vec3 along = vec3(0.0, 1.0, 0.0) - n * n.y;
    along = normalize(along + vec3(1e-4, 0.0, 1e-4));
#ifdef TEXTURED
    float strand = 0.5;
#else
    float strand = smooth_grain(atan(detail.x, detail.z + 0.02) * 60.0 + 200.0);
#endif
    vec3 result = albedo * (0.80 + 0.4 * strand) * ambient_at(n);
    vec2 shares = shares_at(place, n, 0.3);
    for (int i = 0; i < LAMPS; ++i) {
        vec3 towards;
        vec3 arriving = lamp_at(i, place, towards);
        if (SHADOW_OF[i] >= 0) arriving *= shares[SHADOW_OF[i]];
        float cosine = dot(n, towards);
        vec3 middle = normalize(towards + view);
        float lean = dot(along, middle) + 0.18 * (strand - 0.5);
        float sheen = pow(max(1.0 - lean * lean, 0.0), 38.0) * smoothstep(-0.2, 0.3, cosine);
        result += arriving * (albedo * (0.80 + 0.4 * strand) * max((cosine + 0.3) / 1.69, 0.0)
                              + (0.02 + 0.35 * albedo) * sheen * (1.0 - 0.6 * roughness));
    }
    return result;
}

#endif

#ifdef MAPPED
uniform sampler2DArray normal_map;
uniform sampler2DArray surface_map;  // occlusion, roughness, metalness
uniform sampler2DArray glow_map;
uniform sampler2DArray sheen_map;

// The normal leant as the map says. Axes of the picture on the surface come from how place and
// coordinates change from pixel to pixel; y of the map is up, v runs down.
vec3 leant(vec3 n, vec2 at) {
    vec3 along_x = dFdx(place), along_y = dFdy(place);
    vec2 uv_x = dFdx(at), uv_y = dFdy(at);
    vec3 a = cross(along_y, n), b = cross(n, along_x);
    vec3 tangent = a * uv_x.x + b * uv_y.x;
    vec3 down = a * uv_x.y + b * uv_y.y;
    float most = max(dot(tangent, tangent), dot(down, down));
    if (most <= 0.0) return n;
    vec3 map = texture(normal_map, vec3(at, detail.z)).xyz * (255.0 / 127.0) - 128.0 / 127.0;
    return normalize((tangent * map.x - down * map.y) * inversesqrt(most)
                     + n * max(map.z, 0.05));
}

#endif

#if (defined(MAPPED) && !defined(KIND_HAIR)) || (defined(KIND_SKIN) && !defined(VERTEX_LIT))
// How far light bleeds round edges of skin, red the farthest, and what it mirrors when faced.
const vec3 SKIN_WRAP = vec3(0.34, 0.17, 0.11);
const float SKIN_MIRRORS = 0.028;

// Microfacets (GGX, Smith, Schlick) over wrapped Lambert; lamps' colours have 1/pi in them.
vec3 microfacets(vec3 albedo, vec3 wrap, vec3 n, vec3 view, float roughness, float metalness,
                 float mirroring, float open, vec3 fuzz) {
    float facing = max(dot(n, view), 1e-3);
    float a = max(roughness * roughness, 0.02);
    // Normals that differ within a pixel widen its highlight (Kaplanyan and others 2016).
    vec3 leans_x = dFdx(n), leans_y = dFdy(n);
    float a2 = min(a * a + min(0.7 * (dot(leans_x, leans_x) + dot(leans_y, leans_y)), 0.9), 1.0);
    vec3 f0 = mix(vec3(mirroring), albedo, metalness);
    float f90 = min(50.0 * f0.g, 1.0);
    vec3 matte = albedo * (1.0 - metalness);
    vec3 spread = 1.0 / ((1.0 + wrap) * (1.0 + wrap));
    // What the surroundings mirror: the split sum of microfacets, as fitted by Lazarov (2013).
    vec4 fit = roughness * vec4(-1.0, -0.0275, -0.572, 0.022) + vec4(1.0, 0.0425, 1.04, -0.04);
    float low = min(fit.x * fit.x, exp2(-9.28 * facing)) * fit.x + fit.y;
    vec2 share = vec2(-1.04, 1.04) * low + fit.zw;
    vec3 mirrored = max(f0 * share.x + f90 * share.y, 0.0) * ambient_at(reflect(-view, n));
    vec3 result = open * (matte * ambient_at(n) + mirrored
                          + fuzz * ambient_at(n) * pow(1.0 - facing, 3.0));
    vec2 shares = shares_at(place, n, max(wrap.r, max(wrap.g, wrap.b)));
    for (int i = 0; i < LAMPS; ++i) {
        vec3 towards;
        vec3 arriving = lamp_at(i, place, towards);
        float cosine = dot(n, towards);
        if (SHADOW_OF[i] >= 0) arriving *= shares[SHADOW_OF[i]];
        vec3 halfway = normalize(towards + view);
        float nh = max(dot(n, halfway), 0.0), lit_cosine = max(cosine, 0.0);
        float bell = nh * nh * (a2 - 1.0) + 1.0;
        float spread_of = a2 / (bell * bell);
        float hidden = lit_cosine * sqrt(facing * facing * (1.0 - a2) + a2)
                       + facing * sqrt(lit_cosine * lit_cosine * (1.0 - a2) + a2);
        vec3 mirror = f0 + (f90 - f0) * pow(1.0 - max(dot(halfway, view), 0.0), 5.0);
        result += arriving * (matte * max((cosine + wrap) * spread, 0.0)
                              + mirror * (lit_cosine * spread_of * 0.5 / max(hidden, 1e-4))
                              + fuzz * lit_cosine * pow(1.0 - nh * nh, 1.5));
    }
    return result;
}
#endif

#if defined(KIND_SKIN) && defined(TEXTURED) && !defined(MAPPED) && !defined(VERTEX_LIT)
float smooth_grain(vec2 at) {
    vec2 whole = floor(at), share = smoothstep(0.0, 1.0, at - whole);
    return mix(mix(grain(whole), grain(whole + vec2(1.0, 0.0)), share.x),
               mix(grain(whole + vec2(0.0, 1.0)), grain(whole + 1.0), share.x), share.y);
}

// The normal leant by pores and fine folds, as far as pixels are fine enough to show them; how much
// rougher or smoother than the rest the place is, about -0.5 to 0.5.
vec3 with_pores(vec3 n, vec2 at, out float uneven) {
    vec2 folds = at * 420.0, pores = at * 1100.0;
    float clear_folds = 1.0 - smoothstep(0.4, 1.0, length(fwidth(folds)));
    float clear_pores = 1.0 - smoothstep(0.4, 1.0, length(fwidth(pores)));
    uneven = smooth_grain(folds) - 0.5;
    float height_m = 0.00010 * clear_folds * uneven
                     + 0.00005 * clear_pores * (smooth_grain(pores) - 0.5);
    uneven *= clear_folds;
    vec3 right = dFdx(place), up = dFdy(place);
    vec3 across = cross(up, n), along = cross(n, right);
    float area = dot(right, across);
    vec3 steepest = sign(area) * (dFdx(height_m) * across + dFdy(height_m) * along);
    return normalize(abs(area) * n - steepest);
}
#endif

#ifdef VERTEX_LIT
void main() {
#ifdef TEXTURED
    vec4 texel = texel_of(picture_here());
    CUT(texel.a)
    deliver_lit(albedo_here, texel, person, surface.z, length(eye_m.xyz - place));
#else
    deliver_lit(albedo_here, vec4(1.0), person, surface.z, length(eye_m.xyz - place));
#endif
}
#else
void main() {
    vec3 n = normalize(gl_FrontFacing ? normal : -normal);
    vec3 path = eye_m.xyz - place;
    float distance_m = length(path);
    vec3 view = path / distance_m;
    float roughness = float(surface.y) / 255.0;
    float smoothness = 1.0 - roughness;
    vec3 albedo = albedo_here;
    float alpha = 1.0;
#ifdef TEXTURED
    vec4 texel = texel_of(picture_here());
    albedo *= texel.rgb;
    alpha = texel.a;
    CUT(alpha)
#endif
#ifdef MAPPED
    n = leant(n, detail.xy);
    float open = 1.0, metalness = 0.0;
#ifdef SURFACE_MAP
    vec3 surface_here = texture(surface_map, detail).rgb;
    open = surface_here.r;
    roughness = surface_here.g;
    metalness = surface_here.b;
#endif
#endif
#if defined(MAPPED) && !defined(KIND_HAIR)
#if defined(KIND_SKIN)
    vec3 wrap = SKIN_WRAP;
    float mirroring = SKIN_MIRRORS;
#else
    vec3 wrap = vec3(0.0);
    float mirroring = 0.04;
#endif
    vec3 result = microfacets(albedo, wrap, n, view, roughness, metalness, mirroring, open,
                              texture(sheen_map, detail).rgb)
                  + texture(glow_map, detail).rgb;
#elif defined(KIND_SKIN)
    float uneven = 0.0, mirroring = SKIN_MIRRORS;
#ifdef TEXTURED
    n = with_pores(n, detail.xy, uneven);
    // Brows, stubble and short hair are painted on: they are darker than skin, and do not shine.
    mirroring *= smoothstep(0.1, 0.5, texel.g);
#endif
    roughness = clamp(roughness + 0.14 * uneven, 0.5, 1.0);
    vec3 result = microfacets(albedo, SKIN_WRAP, n, view, roughness, 0.0, mirroring, 1.0,
                              vec3(0.0));
#elif defined(KIND_EYE)
    vec3 result = eye_surface(n, view, albedo);
#elif defined(KIND_HAIR)
    vec3 result = hair_surface(albedo, n, view, roughness);
#ifdef MAPPED
    result = result * open + texture(glow_map, detail).rgb;
#endif
#elif defined(KIND_CLOTH)
#ifndef TEXTURED
    vec2 at = vec2(detail.x + detail.z, detail.y) * 900.0;
    float fine = max(fwidth(at.x), fwidth(at.y));
    albedo *= 1.0 + 0.10 * (sin(at.x) * sin(at.y)) * (1.0 - smoothstep(0.6, 2.2, fine));
#endif
    float grazing = 1.0 - max(dot(n, view), 0.0);
    vec3 result = lit(albedo, vec3(0.12), place, n, view, 4.0, 0.0);
    result += albedo * sky.rgb * (0.35 * grazing * grazing * grazing);
#else
    vec3 result = lit(albedo, vec3(0.0), place, n, view, mix(6.0, 90.0, smoothness * smoothness),
                      0.02 + 0.22 * smoothness * smoothness);
#endif
    deliver(result, alpha, person, surface.z, distance_m);
}
#endif
