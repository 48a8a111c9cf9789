layout(location = 1) in vec3 aPosition;
layout(location = 2) in vec3 aNormal;
layout(location = 3) in vec3 aTexCoord;
layout(location = 4) in vec4 aColor;
layout(location = 5) in vec3 aTangent;
layout(location = 6) in vec3 aBitangent;
varying vec3 vSum;

void main() {
    vSum = aNormal * 0.25 + aTexCoord + aColor.rgb * 0.25 + (aTangent + aBitangent) * 0.125;
    gl_Position = gl_ModelViewProjectionMatrix * vec4(aPosition, 1.0);
}
