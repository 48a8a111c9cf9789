// Passes on what all_lights.frag needs, in eye space.
varying vec3 vPlace;
varying vec3 vOut;

void main() {
    vPlace = (gl_ModelViewMatrix * gl_Vertex).xyz;
    vOut = gl_NormalMatrix * gl_Normal;
    gl_TexCoord[0] = gl_MultiTexCoord0;
    gl_Position = ftransform();
}
