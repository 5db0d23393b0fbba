layout(location = 0) out vec4 pixel;
void deliver(vec3 linear, float alpha, uint person, uint part, float distance_m) {
#ifdef IN_LIGHT
    pixel = vec4(shown(linear) * tone.x, alpha);
#else
    pixel = vec4(encoded(shown(linear) * tone.x), alpha);
#endif
}
void deliver_lit(vec3 light, vec4 texel, uint person, uint part, float distance_m) {
#if defined(IN_CODES) && defined(TEXTURED)
    pixel = vec4(shown_codes(light * texel.rgb), texel.a);
#elif defined(IN_CODES)
    pixel = vec4(light, texel.a);
#else
    deliver(light * texel.rgb, texel.a, person, part, distance_m);
#endif
}
