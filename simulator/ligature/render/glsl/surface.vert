// Positions in eye space, so that depth and light need no further matrices. One instance is one body.

uniform mat4 uProjection;

in vec3 aPosition;
in vec3 aNormal;
in vec2 aTexCoord;
#ifdef NORMAL_MAP
in vec4 aTangent;
#endif

in mat4 iModelView;
in ivec2 iIds;  // of the object, of the piece
#ifdef PASS_FLOW
in mat4 iBefore;  // model-view-projection of the frame before
#ifdef DEFORMS
in vec3 aBefore;  // place of the vertex then
#endif
#endif

#ifdef MARCHED
flat out mat4 vModelView;
#ifdef PASS_FLOW
flat out mat4 vModelBefore;
#endif
#endif

#ifdef ANALYTIC
const float COVER = 1.02;  // facets of 32 to the circle cover the shape when they are this much larger
out vec3 vLocal;
flat out mat3 vTurn;
#endif

out vec3 vEye;
out vec3 vNormal;
out vec2 vTexCoord;
flat out ivec2 vIds;
#ifdef NORMAL_MAP
out vec4 vTangent;
#endif
#if defined(PASS_FLOW) && !defined(MARCHED)
out vec4 vNow;
out vec4 vBefore;
#endif

#if defined(SHADOWS) && !defined(MARCHED)
#include "shadows.glsl"
uniform int uClosed;  // 1: back faces are never seen
out vec4 vShadow[SHADOWS];
#endif

void main() {
#ifdef ANALYTIC
    vec3 place = aPosition * COVER;
    vLocal = place;
    vTurn = mat3(iModelView);
#else
    vec3 place = aPosition;
#endif
    vec4 eye = iModelView * vec4(place, 1.0);
    mat3 turn = mat3(iModelView);
    vEye = eye.xyz;
    vNormal = turn * aNormal;
    vTexCoord = aTexCoord;
    vIds = iIds;
#ifdef NORMAL_MAP
    vTangent = vec4(turn * aTangent.xyz, aTangent.w);
#endif
    gl_Position = uProjection * eye;
#ifdef MARCHED
    vModelView = iModelView;
    gl_Position.z = 0.0;  // near and far planes cut the ray, not the box
#ifdef PASS_FLOW
    vModelBefore = iBefore;
#endif
#endif
#if defined(SHADOWS) && !defined(MARCHED)
    vec3 n = vNormal / max(length(vNormal), 1e-9);
    if (uClosed == 0 && dot(n, eye.xyz) > 0.0) n = -n;
    for (int i = 0; i < SHADOWS; ++i) vShadow[i] = inShadowMap(uShadowFromEye[i], uShadowTexel[i].y, eye.xyz, n);
#endif
#if defined(PASS_FLOW) && !defined(MARCHED)
    vNow = gl_Position;
#ifdef DEFORMS
    vBefore = iBefore * vec4(aBefore, 1.0);
#else
    vBefore = iBefore * vec4(place, 1.0);
#endif
#endif
}
