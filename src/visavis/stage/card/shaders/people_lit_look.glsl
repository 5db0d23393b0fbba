in vec3 in_light;   // of eyes, which pixels light, the normal
in vec4 in_colour;
vec3 vertex_normal() { return in_light; }
vec3 vertex_albedo() {
#ifdef VERTEX_LIT
#if defined(IN_CODES) && !defined(TEXTURED)
    return in_light * tone.w;
#else
    return in_light;
#endif
#else
    return decoded(in_colour.rgb);
#endif
}
