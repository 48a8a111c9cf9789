attribute vec3 aPosition;
varying vec4 vPosition;
void main() {
    vPosition = vec4(aPosition, 1.0);
    gl_Position = gl_ModelViewProjectionMatrix * vPosition;
}
