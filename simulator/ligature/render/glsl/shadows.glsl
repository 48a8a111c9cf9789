// Where a point of a surface is in the shadow maps.

uniform mat4 uShadowFromEye[SHADOWS];  // to texture coordinates and depth of the shadow map
uniform vec2 uShadowTexel[SHADOWS];    // edge of a texel: of the map; in metres at one metre (or everywhere)

// Where `eye` is looked up in a shadow map: off the surface by a texel and a half.
vec4 inShadowMap(mat4 fromEye, float texel, vec3 eye, vec3 n) {
    float away = abs(dot(vec4(fromEye[0].w, fromEye[1].w, fromEye[2].w, fromEye[3].w), vec4(eye, 1.0)));
    return fromEye * vec4(eye + n * (1.5 * texel * away), 1.0);
}
