layout(location = 0) out vec4 pixel;

// Share of the light of an even sky that something long hides from a point of the floor: `away`
// from its side, negative below it, where it is `wide`, and reaches from `low` to `high`.
float hidden(float away, float wide, float low, float high) {
    float beyond = away + wide, top = away < 0.0 ? low : high;
    return 0.5 * (beyond * inversesqrt(beyond * beyond + low * low)
                  - away * inversesqrt(away * away + top * top));
}

void shade(float open) {
#ifndef IN_LIGHT
    open = pow(open, 1.0 / 2.2);  // what is darkened are the display's codes
#endif
    pixel = vec4(vec3(open), 1.0);
}
