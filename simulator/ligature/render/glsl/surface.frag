#version 330 core
// One pass writes colour, linear depth, object id and eye-space normal together.

const int MAX_LIGHTS = 8;

struct Light {
    vec3 position;     // eye space, metres
    vec3 direction;    // eye space, unit
    vec3 attenuation;  // constant, linear, quadratic
    float cosCutoff;
    float exponent;
};

uniform Light uLights[MAX_LIGHTS];
uniform int uLightCount;

uniform vec3 uAmbient;
uniform vec3 uDiffuse;
uniform vec3 uSpecular;
uniform vec3 uEmission;
uniform float uShininess;
uniform float uAlpha;
uniform bool uTextured;
uniform sampler2D uTexture;
uniform int uId;

in vec3 vEye;
in vec3 vNormal;
in vec2 vTexCoord;

layout(location = 0) out vec4 fColour;
layout(location = 1) out float fDepth;
layout(location = 2) out int fId;
layout(location = 3) out vec4 fNormal;

void main() {
    vec3 toEye = normalize(-vEye);
    vec3 normal = normalize(vNormal);
    if (dot(normal, toEye) < 0.0) normal = -normal;  // meshes of others are not always closed

    vec4 base = vec4(uDiffuse, uAlpha);
    if (uTextured) base *= texture(uTexture, vTexCoord);

    vec3 colour = uEmission + 0.35 * uAmbient * (uTextured ? base.rgb : vec3(1.0));
    for (int i = 0; i < uLightCount; ++i) {
        vec3 toLight = uLights[i].position - vEye;
        float range = length(toLight);
        toLight /= range;
        float cone = dot(-toLight, uLights[i].direction);
        if (cone < uLights[i].cosCutoff) continue;
        vec3 a = uLights[i].attenuation;
        float strength = pow(max(cone, 0.0), uLights[i].exponent) / max(a.x + a.y * range + a.z * range * range, 1e-3);
        float facing = max(dot(normal, toLight), 0.0);
        float shine = facing > 0.0 ? pow(max(dot(normal, normalize(toLight + toEye)), 0.0), uShininess) : 0.0;
        colour += strength * (facing * base.rgb + shine * uSpecular);
    }
    fColour = vec4(colour, base.a);
    fDepth = -vEye.z;
    fId = uId;
    fNormal = vec4(normal, 1.0);
}
