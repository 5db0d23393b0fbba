layout(std140) uniform Frame {
    mat4 view_projection;
    vec4 eye_m;          // xyz: the eye in world
    vec4 tone;           // x: brightness, y: catch-light strength, z: alpha threshold,
                         // w: brightness of the display's codes
};
