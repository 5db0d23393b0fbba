uniform sampler2D picture;
uniform vec3 from_eye;
uniform vec3 towards;
uniform vec2 rim;
uniform vec2 kind;
uniform vec4 colour;
uniform float blur_px;
in vec3 direction;
layout(location = 0) out vec4 pixel;
vec4 blurred() {
    // A smaller copy of the picture, sampled half a pixel of it away: its pixels do not show.
    float level = log2(max(blur_px, 1.0));
    vec2 size = vec2(textureSize(picture, 0)), at = gl_FragCoord.xy / size;
    vec2 apart = 0.5 * blur_px / size;
    return 0.25 * (
        textureLod(picture, at + apart, level) + textureLod(picture, at - apart, level)
        + textureLod(picture, at + vec2(apart.x, -apart.y), level)
        + textureLod(picture, at + vec2(-apart.x, apart.y), level)
    );
}
void main() {
    // Where the ray meets what stands around the eye that looks, at a distance of 1, from that eye.
    vec3 ray = direction * inversesqrt(dot(direction, direction));
    float along = dot(ray, from_eye);
    float reach = sqrt(max(along * along - dot(from_eye, from_eye) + 1.0, 0.0)) - along;
    // Of the angle between two directions the chord is twice the sine of the half.
    float chord = length(from_eye + reach * ray - towards);
    float middle = 0.5 * (rim.x + rim.y), soft = max(0.5 * (rim.y - rim.x), 0.5 * fwidth(chord));
    float outside = smoothstep(middle - soft, middle + soft, chord);
    float cover = kind.x > 0.5 ? 1.0 : kind.y > 0.5 ? 1.0 - outside : outside;
    pixel = of_codes(blur_px > 0.0 ? blurred() : colour);
    pixel.a = cover;
}
