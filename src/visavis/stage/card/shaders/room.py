"""Rooms, things and flat boards, in GLSL."""

from visavis.stage.card.shaders.lighting import DECODED, FRAME_BLOCK, LIGHTING

VERTEX = (
    LIGHTING
    + DECODED
    + """
uniform mat4 world_from_prop;
in vec3 in_place_m;
in vec4 in_normal;
in vec4 in_colour;
in vec4 in_look;
in vec2 in_uv;
#ifdef BAKED
in vec3 in_light;
#endif
out vec3 place;
out vec3 normal;
out vec3 albedo_here;
flat out vec2 look;
out vec3 pictured_at;
void main() {
    vec4 world = world_from_prop * vec4(in_place_m, 1.0);
    place = world.xyz;
    normal = mat3(world_from_prop) * in_normal.xyz;
    albedo_here = decoded(in_colour.rgb);
    look = in_look.xy;
#if defined(BAKED)
    albedo_here = in_light;
#elif defined(VERTEX_LIT)
    vec3 n = normalize(normal);
    vec3 here = lit(albedo_here, vec3(0.0), place, n, vec3(0.0), 1.0, 0.0);
    albedo_here = mix(here, albedo_here, in_look.y);
#ifdef IN_CODES
    albedo_here = in_codes(albedo_here);
#endif
#endif
#if defined(IN_CODES) && !defined(TEXTURED)
    albedo_here *= tone.w;
#endif
    pictured_at = vec3(in_uv, floor(in_look.z * 255.0 + 0.5 + 65280.0 * in_look.w));
    gl_Position = view_projection * world;
}
"""
)

SHADOW_VERTEX = """
uniform mat4 shadow_projection;
uniform mat4 world_from_prop;
in vec3 in_place_m;
void main() { gl_Position = shadow_projection * world_from_prop * vec4(in_place_m, 1.0); }
"""

FRAGMENT = (
    LIGHTING
    + DECODED
    + """
uniform sampler2DArray picture;
in vec3 place;
in vec3 normal;
in vec3 albedo_here;
in vec3 pictured_at;  // the layer last
flat in vec2 look;
"""
    + "//OUTPUT//"
    + """
void main() {
    vec3 path = eye_m.xyz - place;
    float distance_m = length(path);
    vec4 texel = vec4(1.0);
#ifdef TEXTURED
    texel = texel_of(texture(picture, pictured_at));
    CUT(texel.a)
#endif
#ifdef VERTEX_LIT
    deliver_lit(albedo_here, texel, 0u, 0u, distance_m);
#else
    vec3 albedo = albedo_here * texel.rgb;
    vec3 n = normalize(gl_FrontFacing ? normal : -normal);
    float smoothness = 1.0 - look.x;
    vec3 result = lit(albedo, vec3(0.0), place, n, path / distance_m,
                      mix(6.0, 120.0, smoothness * smoothness), 0.25 * smoothness * smoothness);
    deliver(mix(result, albedo, look.y), texel.a, 0u, 0u, distance_m);
#endif
}
"""
)

BOARD_VERTEX = (
    FRAME_BLOCK
    + """
uniform mat4 world_from_board;
in vec2 in_corner;
out vec2 uv;
void main() {
    uv = vec2(in_corner.x + 0.5, 0.5 - in_corner.y);
    gl_Position = view_projection * world_from_board * vec4(in_corner, 0.0, 1.0);
}
"""
)

_CODES = (
    DECODED
    + """
vec4 of_codes(vec4 codes) {
#ifdef IN_LIGHT
    codes.rgb = decoded(codes.rgb);
#endif
    return codes;
}
"""
)

BOARD_FRAGMENT = (
    _CODES
    + """
uniform sampler2D picture;
in vec2 uv;
layout(location = 0) out vec4 pixel;
void main() { pixel = of_codes(texture(picture, uv)); }
"""
)

MARK_FRAGMENT = (
    _CODES
    + """
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
"""
)
