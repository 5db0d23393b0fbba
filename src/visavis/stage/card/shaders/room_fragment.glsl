uniform sampler2DArray picture;
in vec3 place;
in vec3 normal;
in vec3 albedo_here;
in vec3 pictured_at;  // the layer last
flat in vec2 look;
//OUTPUT//
void main() {
    vec3 path = eye_m.xyz - place;
    float distance_m = length(path);
    vec4 texel = vec4(1.0);
#ifdef TEXTURED
    texel = texel_of(texture(picture, pictured_at));
    CUT(texel.a)
#endif
#ifdef VERTEX_LIT
    deliver_lit(albedo_here, texel, 0u, 0u, distance_m);
#else
    vec3 albedo = albedo_here * texel.rgb;
    vec3 n = normalize(gl_FrontFacing ? normal : -normal);
    float smoothness = 1.0 - look.x;
    vec3 result = lit(albedo, vec3(0.0), place, n, path / distance_m,
                      mix(6.0, 120.0, smoothness * smoothness), 0.25 * smoothness * smoothness);
    deliver(mix(result, albedo, look.y), texel.a, 0u, 0u, distance_m);
#endif
}
