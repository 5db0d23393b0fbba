in vec3 in_place;
in vec3 in_light;   // of eyes, which pixels light, the normal
in vec3 in_detail;  // of textured surfaces the layer last
in vec4 in_colour;
in uvec4 in_surface;
in uint in_person;
EACH out vec3 place;
EACH out vec3 normal;
EACH out vec3 detail;
out vec3 albedo_here;
flat out uvec4 surface;
flat out uint person;
void main() {
    place = in_place;
    normal = in_light;
    detail = in_detail;
#ifdef VERTEX_LIT
    albedo_here = in_light;
#if defined(IN_CODES) && !defined(TEXTURED)
    albedo_here *= tone.w;
#endif
#else
    albedo_here = decoded(in_colour.rgb);
#endif
    surface = in_surface;
    person = in_person;
    gl_Position = view_projection * vec4(in_place, 1.0);
}
