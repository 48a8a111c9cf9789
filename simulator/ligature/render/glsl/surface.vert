#version 330 core
// Geometry pass: positions in eye space, so that depth and light need no further matrices.

uniform mat4 uModelView;
uniform mat4 uProjection;

layout(location = 0) in vec3 aPosition;
layout(location = 1) in vec3 aNormal;
layout(location = 2) in vec2 aTexCoord;

out vec3 vEye;
out vec3 vNormal;
out vec2 vTexCoord;

void main() {
    vec4 eye = uModelView * vec4(aPosition, 1.0);
    vEye = eye.xyz;
    vNormal = mat3(uModelView) * aNormal;
    vTexCoord = aTexCoord;
    gl_Position = uProjection * eye;
}
