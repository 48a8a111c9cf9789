uniform samplerCube uSky;
in vec3 vWay;
layout(location = 0) out vec4 fColour;

void main() { fColour = vec4(texture(uSky, vWay).rgb, 1.0); }
