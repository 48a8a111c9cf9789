#ifdef MARCHED
uniform mat4 uProjection;
in vec3 vEye;
#include "march.glsl"

void main() {
    Ray ray = rayThrough(vEye, uProjection[3][3] == 0.0);
    float t;
    if (!meetVolume(ray, t)) discard;
    gl_FragDepth = depthOf(ray.start + t * ray.way);
}
#else
void main() {}
#endif
