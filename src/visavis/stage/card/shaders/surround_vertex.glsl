uniform mat3 picture_from_corner;
in vec2 in_corner;
out vec3 direction;
void main() {
    direction = picture_from_corner * vec3(in_corner, 1.0);
    gl_Position = vec4(2.0 * in_corner, 0.0, 1.0);
}
