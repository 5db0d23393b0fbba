uniform mat4 shadow_projection;
uniform mat4 world_from_prop;
in vec3 in_place_m;
void main() { gl_Position = shadow_projection * world_from_prop * vec4(in_place_m, 1.0); }
