// Lights of the scene in eye space, and how much of each arrives at a point.

const float AMBIENT_LIGHT = 0.35;

struct Light {
    vec3 position;     // metres
    vec3 direction;    // unit, the way the light shines
    vec3 attenuation;  // constant, linear, quadratic
    float cosCutoff;   // -1: no cone
    float exponent;
    int directional;
};

uniform mat4 uProjection;
uniform Light uLights[LIGHTS];

#ifdef SHADOWS
uniform sampler2DShadow uShadowMap0;
#if SHADOWS > 1
uniform sampler2DShadow uShadowMap1;
#endif
uniform mat4 uShadowFromEye[SHADOWS];  // to texture coordinates and depth of the shadow map
uniform int uShadowOf[SHADOWS];        // index of the light
uniform vec2 uShadowTexel[SHADOWS];    // edge of a texel: of the map; in metres at one metre (or everywhere)
#endif

bool isPerspective() { return uProjection[3][3] == 0.0; }

#ifdef SHADOWS
float litThrough(sampler2DShadow map, mat4 fromEye, vec2 texel, vec3 eye, vec3 n) {
    float away = abs(dot(vec4(fromEye[0].w, fromEye[1].w, fromEye[2].w, fromEye[3].w), vec4(eye, 1.0)));
    vec4 place = fromEye * vec4(eye + n * (1.5 * texel.y * away), 1.0);  // off the surface by a texel and a half
    vec3 p = place.xyz / place.w;
    float lit = 0.0;
    for (int x = 0; x < 2; ++x)
        for (int y = 0; y < 2; ++y) lit += texture(map, p + vec3((vec2(x, y) - 0.5) * 1.5 * texel.x, 0.0));
    bool outside = place.w <= 0.0 || any(lessThan(p.xy, vec2(0.0))) || any(greaterThan(p.xy, vec2(1.0)));
    return outside ? 1.0 : 0.25 * lit;
}
#endif

// Share of light i that arrives at `eye`, 0 behind its cone or in shadow; `toLight` points to it.
float lightAt(int i, vec3 eye, vec3 n, out vec3 toLight) {
    float strength = 1.0;
    if (uLights[i].directional == 1) {
        toLight = -uLights[i].direction;
    } else {
        toLight = uLights[i].position - eye;
        float range = max(length(toLight), 1e-6);
        toLight /= range;
        float cone = dot(-toLight, uLights[i].direction);
        if (cone < uLights[i].cosCutoff) return 0.0;
        if (uLights[i].cosCutoff >= 0.0) strength = pow(max(cone, 0.0), uLights[i].exponent);
        vec3 a = uLights[i].attenuation;
        strength /= max(a.x + a.y * range + a.z * range * range, 1e-3);
    }
#ifdef SHADOWS
    if (i == uShadowOf[0]) strength *= litThrough(uShadowMap0, uShadowFromEye[0], uShadowTexel[0], eye, n);
#if SHADOWS > 1
    if (i == uShadowOf[1]) strength *= litThrough(uShadowMap1, uShadowFromEye[1], uShadowTexel[1], eye, n);
#endif
#endif
    return strength;
}
