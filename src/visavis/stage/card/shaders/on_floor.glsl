// On the screen where it is, in depth as if the floor lay higher: neither hides the other.
const float ABOVE_FLOOR_M = 0.005;
vec4 on_floor(vec3 place) {
    vec4 here = view_projection * vec4(place, 1.0);
    float high = max(eye_m.y - place.y, 1e-3);
    vec3 nearer = mix(place, eye_m.xyz, min(ABOVE_FLOOR_M / high, 0.5));
    vec4 before = view_projection * vec4(nearer, 1.0);
    if (here.w > 0.0 && before.w > 0.0) here.z = before.z / before.w * here.w;
    return here;
}
