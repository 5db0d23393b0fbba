invariant gl_Position;
uniform mat4 world_from_prop;
in vec3 in_place_m;
void main() {
    vec4 world = world_from_prop * vec4(in_place_m, 1.0);
    gl_Position = view_projection * world;
}
