layout(location = 0) out uvec2 identity;
layout(location = 1) out vec2 measured;
void deliver(vec3 linear, float alpha, uint person, uint part, float distance_m) {
    if (alpha < 0.5) discard;
    identity = uvec2(person, part);
    measured = vec2(tone.x * dot(shown(linear), vec3(0.2126, 0.7152, 0.0722)), distance_m);
}
void deliver_lit(vec3 light, vec4 texel, uint person, uint part, float distance_m) {
    deliver(light * texel.rgb, texel.a, person, part, distance_m);
}
