uniform mat4 world_from_board;
in vec2 in_corner;
out vec2 uv;
void main() {
    uv = vec2(in_corner.x + 0.5, 0.5 - in_corner.y);
    gl_Position = view_projection * world_from_board * vec4(in_corner, 0.0, 1.0);
}
