// Lights of the scene in eye space, and how much of each arrives at a point.

const float AMBIENT_LIGHT = 0.35;

struct Light {
    vec4 position;     // metres; w 0 for a direction, from where the light comes
    vec3 direction;    // unit, the way the light shines
    vec3 attenuation;  // constant, linear, quadratic
    float cosCutoff;   // -2: no cone
    float exponent;
};

uniform mat4 uProjection;
uniform Light uLights[LIGHTS];  // those with a shadow first

#ifdef SHADOWS
uniform sampler2DShadow uShadowMap0;
#if SHADOWS > 1
uniform sampler2DShadow uShadowMap1;
#endif
#ifdef MARCHED
vec4 vShadow[SHADOWS];  // where the place that is lit is in the shadow maps
#else
in vec4 vShadow[SHADOWS];
#endif
#include "shadows.glsl"
#endif

bool isPerspective() { return uProjection[3][3] == 0.0; }

#ifdef SHADOWS
float litThrough(sampler2DShadow map, float texel, vec4 place) {
    vec3 p = place.xyz / place.w;
    float lit = 0.0;
    for (int x = 0; x < 2; ++x)
        for (int y = 0; y < 2; ++y) lit += texture(map, p + vec3((vec2(x, y) - 0.5) * 1.5 * texel, 0.0));
    bool outside = place.w <= 0.0 || any(lessThan(p.xy, vec2(0.0))) || any(greaterThan(p.xy, vec2(1.0)));
    return outside ? 1.0 : 0.25 * lit;
}
#endif

// Share of light i that arrives at `eye`, 0 beside its cone or in shadow; `toLight` points to it.
float lightAt(int i, vec3 eye, out vec3 toLight) {
    toLight = uLights[i].position.xyz - uLights[i].position.w * eye;
    float range = max(length(toLight), 1e-6);
    toLight /= range;
    float cone = dot(-toLight, uLights[i].direction);
    vec3 a = uLights[i].attenuation;
    float strength = pow(max(cone, 1e-4), uLights[i].exponent) / max(a.x + a.y * range + a.z * range * range, 1e-3);
#ifdef SHADOWS
    if (i == 0) strength *= litThrough(uShadowMap0, uShadowTexel[0].x, vShadow[0]);
#if SHADOWS > 1
    if (i == 1) strength *= litThrough(uShadowMap1, uShadowTexel[1].x, vShadow[1]);
#endif
#endif
    return cone < uLights[i].cosCutoff ? 0.0 : strength;
}
