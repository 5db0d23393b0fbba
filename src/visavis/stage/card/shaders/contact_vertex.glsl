uniform sampler2D joint_rows;  // per person: discs at heel and ball, left, then right
uniform int first_texel;
uniform int soles;           // so many of the instances; blocks of the room follow them
uniform sampler2D blocks;    // per block: x, z, low, high; half sizes, turn; floor, reach, round
in vec2 in_corner;
out vec2 at;
flat out vec4 heel;  // x, z, how high above the floor, radius; of a block: half sizes, low, high
flat out vec4 ball;
flat out vec2 kind;  // of a block: its reach, 2 where it is round, else 1
const float SHADE_M = 0.34;
const float SUNK_M = 0.08;

void block(int row) {
    vec4 place = texelFetch(blocks, ivec2(0, row), 0);
    vec4 shape = texelFetch(blocks, ivec2(1, row), 0);
    vec4 more = texelFetch(blocks, ivec2(2, row), 0);
    heel = vec4(shape.xy, place.zw);
    ball = vec4(0.0);
    kind = vec2(more.y, more.z + 1.0);
    at = in_corner * (shape.xy + more.y);
    vec2 world = place.xy + mat2(shape.z, -shape.w, shape.w, shape.z) * at;
    gl_Position = on_floor(vec3(world.x, more.x, world.y));
}

void main() {
    if (gl_InstanceID >= soles) {
        block(gl_InstanceID - soles);
        return;
    }
    kind = vec2(0.0);
    int person = gl_InstanceID / 2, first = first_texel + gl_InstanceID % 2 * 2;
    float floor_m = 1e9;
    for (int i = 0; i < 4; ++i)
        floor_m = min(floor_m, texelFetch(joint_rows, ivec2(first_texel + i, person), 0).y);
    // The ground is at 0; motions let soles sink into it by centimetres.
    if (floor_m < 0.0 && floor_m > -SUNK_M) floor_m = 0.0;
    vec4 a = texelFetch(joint_rows, ivec2(first, person), 0);
    vec4 b = texelFetch(joint_rows, ivec2(first + 1, person), 0);
    heel = vec4(a.xz, max(a.y - floor_m, 0.0), a.w);
    ball = vec4(b.xz, max(b.y - floor_m, 0.0), b.w);
    vec2 along = b.xz - a.xz;
    along = dot(along, along) > 1e-8 ? normalize(along) : vec2(1.0, 0.0);
    float wide = max(a.w, b.w) + SHADE_M;
    vec2 end = in_corner.x < 0.0 ? a.xz : b.xz;
    at = end + along * in_corner.x * wide + vec2(-along.y, along.x) * in_corner.y * wide;
    gl_Position = on_floor(vec3(at.x, floor_m, at.y));
    if (b.w <= 0.0) gl_Position = vec4(0.0, 0.0, 2.0, 1.0);
}
