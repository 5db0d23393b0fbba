vec4 of_codes(vec4 codes) {
#ifdef IN_LIGHT
    codes.rgb = decoded(codes.rgb);
#endif
    return codes;
}
