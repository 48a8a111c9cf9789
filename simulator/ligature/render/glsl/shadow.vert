// Depth as a light sees it.

uniform mat4 uProjection;
in vec3 aPosition;
in mat4 iModelView;

#ifdef MARCHED
out vec3 vEye;
flat out mat4 vModelView;
#endif

void main() {
    vec4 eye = iModelView * vec4(aPosition, 1.0);
    gl_Position = uProjection * eye;
#ifdef MARCHED
    vEye = eye.xyz;
    vModelView = iModelView;
    gl_Position.z = 0.0;  // the ray knows where near and far are
#endif
}
