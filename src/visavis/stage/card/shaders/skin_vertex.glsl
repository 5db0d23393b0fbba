uniform sampler2D joint_rows;   // per person: 3 texels a joint, 4 of soles, 2 of face weights
uniform sampler2D morph_deltas; // per vertex that moves: 7 displacements, 1 spare
uniform usampler2D sources;     // per vertex: place and morph, normal and surface, detail and
                                // joints, weights, colour
uniform isampler2D chunks;      // first vertex, how many, person, first displacement

out vec3 out_place;
out vec3 out_normal;
out vec3 out_detail;
out vec3 out_albedo;
flat out uint out_surface;
flat out uint out_person;

vec3 delta(int row, int which) {
    return texelFetch(morph_deltas, ivec2(row % DELTAS_WIDE * 8 + which, row / DELTAS_WIDE), 0).xyz;
}

void main() {
    int number = gl_VertexID / CHUNK;
    ivec4 chunk = texelFetch(chunks, ivec2(number % CHUNKS_WIDE, number / CHUNKS_WIDE), 0);
    int vertex = chunk.x + min(gl_VertexID % CHUNK, chunk.y - 1), person = chunk.z;
    ivec2 at = ivec2(vertex % SOURCES_WIDE * 5, vertex / SOURCES_WIDE);
    uvec4 first = texelFetch(sources, at, 0);
    uvec4 second = texelFetch(sources, at + ivec2(1, 0), 0);
    uvec4 third = texelFetch(sources, at + ivec2(2, 0), 0);
    vec4 weights = uintBitsToFloat(texelFetch(sources, at + ivec2(3, 0), 0));
    vec3 colour = uintBitsToFloat(texelFetch(sources, at + ivec2(4, 0), 0).xyz);

    vec3 rest = uintBitsToFloat(first.xyz);
    int morph = int(first.w);
    if (morph >= 0) {
        int face = textureSize(joint_rows, 0).x - 2, row = chunk.w + morph;
        vec4 a = texelFetch(joint_rows, ivec2(face, person), 0);
        vec4 b = texelFetch(joint_rows, ivec2(face + 1, person), 0);
        rest += a.x * delta(row, 0) + a.y * delta(row, 1) + a.z * delta(row, 2)
              + a.w * delta(row, 3) + b.x * delta(row, 4) + b.y * delta(row, 5)
              + b.z * delta(row, 6);
    }
    vec4 x = vec4(0.0), y = vec4(0.0), z = vec4(0.0);
    for (int i = 0; i < 4; ++i) {
        int column = int(third.w >> (8 * i) & 255u) * 3;
        x += weights[i] * texelFetch(joint_rows, ivec2(column, person), 0);
        y += weights[i] * texelFetch(joint_rows, ivec2(column + 1, person), 0);
        z += weights[i] * texelFetch(joint_rows, ivec2(column + 2, person), 0);
    }
    vec4 p = vec4(rest, 1.0);
    vec3 n = uintBitsToFloat(second.xyz);
    out_place = vec3(dot(x, p), dot(y, p), dot(z, p));
    out_normal = normalize(vec3(dot(x.xyz, n), dot(y.xyz, n), dot(z.xyz, n)));
    out_detail = uintBitsToFloat(third.xyz);
    out_albedo = decoded(colour);
    out_surface = second.w;
    out_person = uint(person) + 1u;
    gl_Position = vec4(0.0);
}
