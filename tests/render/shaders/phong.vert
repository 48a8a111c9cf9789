/* Blinn-Phong as the fixed-function names let one write it. No version: GLSL 1.10. */
varying vec3 vPosition;
varying vec3 vNormal;

void main(void) {
    vec4 eye = gl_ModelViewMatrix * gl_Vertex; // ftransform() needs no matrices of ours
    vPosition = eye.xyz;
    vNormal = gl_NormalMatrix * gl_Normal;
    gl_TexCoord[0] = gl_TextureMatrix[0] * gl_MultiTexCoord0;
    gl_TexCoord[1].s = dot(eye, gl_EyePlaneS[1]);
    gl_TexCoord[1].t = dot(eye, gl_EyePlaneT[1]);
    gl_TexCoord[1].p = dot(eye, gl_EyePlaneR[1]);
    gl_TexCoord[1].q = dot(eye, gl_EyePlaneQ[1]);
    gl_Position = ftransform();
}
