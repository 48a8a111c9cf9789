#version 120
attribute vec3 aPosition;
uniform mat4 viewMat;
uniform mat4 projectionMat;
varying vec3 vWay;
void main() {
    vWay = aPosition;
    vec4 p = projectionMat * mat4(mat3(viewMat)) * vec4(aPosition, 1.0);
    gl_Position = p.xyww;
}
