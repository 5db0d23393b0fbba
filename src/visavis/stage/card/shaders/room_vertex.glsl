invariant gl_Position;
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
