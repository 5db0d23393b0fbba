// Fast textures hold codes, the others light.
vec4 texel_of(vec4 texel) {
#if defined(CODE_TEXTURES) && !defined(IN_CODES)
    texel.rgb = decoded(texel.rgb);
#endif
    return texel;
}
