#version 120
attribute vec3 aPosition;
attribute vec3 aNormal;
attribute vec3 aTexCoord;
attribute vec4 aColor;
attribute vec3 aTangent;
attribute vec3 aBitangent;
varying mat3 TBN;
varying vec4 vColor;
varying vec3 vFromEye;

void main() {
    TBN = mat3(gl_NormalMatrix * aTangent, gl_NormalMatrix * aBitangent, gl_NormalMatrix * aNormal);
    vColor = aColor;
    vec4 eye = gl_ModelViewMatrix * vec4(aPosition, 1.0);
    vFromEye = (gl_ModelViewMatrixInverse * eye).xyz - aPosition; /* zero, up to rounding */
    gl_TexCoord[0] = vec4(aTexCoord, 1.0);
    gl_Position = gl_ModelViewProjectionMatrix * vec4(aPosition, 1.0);
}
