invariant gl_Position;
in vec3 in_place;
in vec3 in_detail;  // of textured surfaces the layer last
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
    normal = vertex_normal();
    detail = in_detail;
    albedo_here = vertex_albedo();
    surface = in_surface;
    person = in_person;
    gl_Position = view_projection * vec4(in_place, 1.0);
}
