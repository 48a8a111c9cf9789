#version 120
uniform samplerCube skybox;
varying vec3 vWay;
void main() { gl_FragColor = textureCube(skybox, vWay); }
