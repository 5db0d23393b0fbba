uniform mat4 shadow_projection;
in vec3 in_place;
void main() { gl_Position = shadow_projection * vec4(in_place, 1.0); }
