// Writes what the passes of a picture ask for: colour, linear depth, ids, eye-space normal, motion.

uniform vec3 uAmbient;
uniform vec3 uDiffuse;
uniform vec3 uSpecular;
uniform vec3 uEmission;
uniform float uShininess;
uniform float uAlpha;
uniform vec2 uHalfSize;  // of the picture in pixels
#ifdef TEXTURED
uniform sampler2D uTexture;
#endif
#ifdef NORMAL_MAP
uniform sampler2D uNormalMap;
in vec4 vTangent;
#endif

#ifdef OCCLUSION_MAP
uniform sampler2D uOcclusionMap;  // red: how much ambient light arrives
#endif

#ifdef ANALYTIC
#include "analytic.glsl"
in vec3 vLocal;
flat in mat3 vTurn;
#endif

in vec3 vEye;
in vec3 vNormal;
in vec2 vTexCoord;
flat in ivec2 vIds;

#include "lights.glsl"

#ifdef MARCHED
#include "march.glsl"
#if MARCHED == 2 && defined(PASS_RGB)
#define GATHERED
#endif
#endif

float ambientShare() {
#ifdef OCCLUSION_MAP
    return texture(uOcclusionMap, vTexCoord).r;
#else
    return 1.0;
#endif
}

#ifdef PHYSICAL
#include "physical.glsl"
#endif

#ifdef PASS_FLOW
#ifdef MARCHED
flat in mat4 vModelBefore;
vec4 vNow, vBefore;
#else
in vec4 vNow;
in vec4 vBefore;
#endif
#endif

#ifdef PASS_RGB
layout(location = PASS_RGB) out vec4 fColour;
#endif
#ifdef PASS_DEPTH
layout(location = PASS_DEPTH) out float fDepth;
#endif
#ifdef PASS_IDS
layout(location = PASS_IDS) out float fId;
#endif
#ifdef PASS_PARTS
layout(location = PASS_PARTS) out float fPart;
#endif
#ifdef PASS_NORMALS
layout(location = PASS_NORMALS) out vec4 fNormal;
#endif
#ifdef PASS_FLOW
layout(location = PASS_FLOW) out vec2 fFlow;
#endif
#ifdef PASS_PLACES
layout(location = PASS_PLACES) out vec4 fPlaces;
#endif
#ifdef PASS_FACETS
layout(location = PASS_FACETS) out vec2 fFacet;
#endif

#ifdef MARKS
uniform int uMarkCount;
uniform vec4 uMarks[MARKS];     // of punctures: place in eye space, radius
uniform vec4 uMarkAxes[MARKS];  // outward normal, how far along it the mark is seen

// What punctures leave of a colour: dark discs with a soft edge.
vec3 marked(vec3 eye) {
    float left = 1.0;
    for (int i = 0; i < uMarkCount; ++i) {
        vec3 away = eye - uMarks[i].xyz, axis = uMarkAxes[i].xyz;
        float along = dot(away, axis), beside = length(away - along * axis);
        if (abs(along) < uMarkAxes[i].w) left = min(left, smoothstep(0.6, 1.1, beside / uMarks[i].w));
    }
    return mix(vec3(0.2, 0.04, 0.04), vec3(1.0), left);
}
#endif

#ifdef PASS_RGB
vec3 shadedNormal(vec3 n) {
#ifdef NORMAL_MAP
    vec3 t = normalize(vTangent.xyz - n * dot(n, vTangent.xyz));
    vec3 m = texture(uNormalMap, vTexCoord).xyz * 2.0 - 1.0;
    return normalize(m.x * t + m.y * vTangent.w * cross(n, t) + m.z * n);
#else
    return n;
#endif
}

vec3 phong(vec3 texel, vec3 eye, vec3 n, vec3 toEye) {
    vec3 base = uDiffuse * texel;
    vec3 colour = (uEmission + ambientShare() * AMBIENT_LIGHT * uAmbient) * texel;
    for (int i = 0; i < LIGHTS; ++i) {
        vec3 toLight;
        float strength = lightAt(i, eye, toLight);
        float facing = max(dot(n, toLight), 0.0);
        float shine = facing > 0.0 ? pow(max(dot(n, normalize(toLight + toEye)), 0.0), uShininess) : 0.0;
        colour += strength * (facing * base + shine * uSpecular);
    }
    return colour;
}
#endif

#ifdef MARCHED
// Look a place of a volume up in the shadow maps.
void shade(vec3 eye, vec3 n) {
#ifdef SHADOWS
    for (int i = 0; i < SHADOWS; ++i) vShadow[i] = inShadowMap(uShadowFromEye[i], uShadowTexel[i].y, eye, n);
#endif
}
#endif

#ifdef GATHERED
uniform sampler2D uBehind;  // depth in metres of what is opaque; 0 where nothing is

const float SPENT = 0.004;  // light that is left when a ray may end: one step of the picture's colours
const float SHARE = 0.15;   // of the light that a ray gathers: as much is lit at one place

// What a ray gathers on its way to what is opaque, and how much of that it hides.
vec4 gathered(Ray ray, vec3 toEye) {
    float behind = texelFetch(uBehind, ivec2(gl_FragCoord.xy), 0).r;
    float last = behind > 0.0 ? min(ray.last, (-behind - ray.start.z) / ray.way.z) : ray.last;
    float left = 1.0, t = ray.first, span, to;
    vec3 colour = vec3(0.0), n = toEye;
    vec4 share = vec4(0.0);  // not yet lit
    float place = 0.0;       // of that, times its amount
    bool on = t < last;
    for (int i = 0; on; ) {
        // an inner loop, since processors that draw skip the light of a pixel only where a loop ends
        for (; on && share.a <= SHARE; ++i) {
            vec4 matter = matterAt(ray, t, last, span, to);
            float part = left * (1.0 - exp(-matter.a * span));
            share += part * vec4(matter.rgb, 1.0);
            place += part * (t + 0.5 * span);
            left -= part;
            t = to;
            on = t < last && left > SPENT && i < uMost;
        }
        if (share.a > 0.0) {
            float middle = place / share.a;
            vec3 eye = ray.start + middle * ray.way;
            n = slope(ray, middle, n);
            n = faceforward(n, -toEye, n);
            shade(eye, n);
            colour += share.a * phong(share.rgb / share.a, eye, n, toEye);
        }
        share = vec4(0.0);
        place = 0.0;
    }
    return vec4(colour / max(1.0 - left, 1e-6), 1.0 - left);
}
#endif

#ifdef PASS_RGB
// Colour of a place of a surface; in alpha how opaque it is, or what tells it apart.
vec4 colourOf(vec3 eye, vec3 normal, vec3 toEye) {
    vec4 colour;
#ifdef TEXTURED
    vec4 texel = texture(uTexture, vTexCoord);
#else
    vec4 texel = vec4(1.0);
#endif
#ifdef MARKS
    texel.rgb *= marked(eye);
#endif
#ifdef PHYSICAL
    colour.rgb = physical(uDiffuse * texel.rgb, eye, shadedNormal(normal), toEye);
#else
    colour.rgb = phong(texel.rgb, eye, shadedNormal(normal), toEye);
#endif
#ifdef CLEAR
    colour.a = uAlpha * texel.a;
#else
    // not needed for blending, so it tells surfaces and their directions apart for the smoothing of outlines
    colour.a = fract(0.381966 * float(vIds.y) + dot(normal, vec3(0.13, 0.17, 0.2)));
#endif
    return colour;
}
#endif

void main() {
    vec3 toEye = isPerspective() ? normalize(-vEye) : vec3(0.0, 0.0, 1.0);
#ifdef ANALYTIC
    float t;
    vec3 outward;
    if (!meet(vLocal, -toEye * vTurn, t, outward)) discard;
    vec3 eye = vEye - t * toEye;
    vec3 normal = normalize(vTurn * outward);
    vec4 clip = uProjection * vec4(eye, 1.0);
    gl_FragDepth = 0.5 + 0.5 * clip.z / clip.w;
#elif defined(MARCHED)
    Ray ray = rayThrough(vEye, isPerspective());
    toEye = -ray.way;
#ifdef GATHERED
    fColour = gathered(ray, toEye);
    fColour.a *= uAlpha;
    if (fColour.a <= 0.0) discard;
    gl_FragDepth = 0.0;  // what is opaque has ended the ray already
    return;
#endif
    float t;
    if (!meetVolume(ray, t)) discard;
    vec3 eye = ray.start + t * ray.way;
    vec3 normal = slope(ray, t, toEye);
    gl_FragDepth = depthOf(eye);
#ifdef PASS_RGB
    shade(eye, normal);
#endif
#ifdef PASS_FLOW
    vNow = uProjection * vec4(eye, 1.0);
    vBefore = vModelBefore * vec4((eye - vModelView[3].xyz) * mat3(vModelView), 1.0);
#endif
#else
    vec3 eye = vEye;
    vec3 normal = normalize(vNormal);
#endif
    if (dot(normal, toEye) < 0.0) normal = -normal;  // meshes of others are not always closed
#ifdef PASS_RGB
    fColour = colourOf(eye, normal, toEye);
#endif
#ifdef PASS_PLACES
    fPlaces = vec4(-1.0);  // in the first two shadow maps; outside of them all is lit
#ifdef SHADOWS
    if (vShadow[0].w > 0.0) fPlaces.xy = vShadow[0].xy / vShadow[0].w;
#if SHADOWS > 1
    if (vShadow[1].w > 0.0) fPlaces.zw = vShadow[1].xy / vShadow[1].w;
#endif
#endif
#endif
#ifdef PASS_FACETS
    fFacet = vec2(float(vIds.y), float(gl_PrimitiveID));
#endif
#ifdef PASS_DEPTH
    fDepth = -eye.z;
#endif
#ifdef PASS_IDS
    fId = float(vIds.x);
#endif
#ifdef PASS_PARTS
    fPart = float(vIds.y);
#endif
#ifdef PASS_NORMALS
    fNormal = vec4(normal, 1.0);
#endif
#ifdef PASS_FLOW
    fFlow = (vNow.xy / vNow.w - vBefore.xy / vBefore.w) * vec2(uHalfSize.x, -uHalfSize.y);
#endif
}
