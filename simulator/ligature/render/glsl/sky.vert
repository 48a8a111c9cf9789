// One triangle over the whole picture, at the far plane.

uniform mat4 uWorldFromClip;
out vec3 vWay;

void main() {
    vec2 corner = vec2(gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0);
    vec4 far = uWorldFromClip * vec4(corner, 1.0, 1.0);
    vWay = far.xyz / far.w;
    gl_Position = vec4(corner, 1.0, 1.0);
}
