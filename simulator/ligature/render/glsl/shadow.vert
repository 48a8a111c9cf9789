// Depth as a light sees it.

uniform mat4 uProjection;
in vec3 aPosition;
in mat4 iModelView;

void main() { gl_Position = uProjection * (iModelView * vec4(aPosition, 1.0)); }
