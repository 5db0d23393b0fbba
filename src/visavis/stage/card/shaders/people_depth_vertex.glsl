invariant gl_Position;
in vec3 in_place;
void main() { gl_Position = view_projection * vec4(in_place, 1.0); }
