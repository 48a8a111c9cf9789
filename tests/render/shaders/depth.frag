// the depth buffer to coordinates
uniform mat4 invProjection;
uniform sampler2D diffuseMap;

void main() {
    vec2 at = gl_TexCoord[0].xy * 2.0 - 1.0;
    float stored = texture2D(diffuseMap, gl_TexCoord[0].xy).r;
    float z = (2.0 * stored - gl_DepthRange.near - gl_DepthRange.far) / gl_DepthRange.diff;
    vec4 p = invProjection * vec4(at, z, 1.0);
    p /= p.w;
    gl_FragColor = vec4(-p.z * -1.0, p.x, p.y, 1.0);
    gl_FragDepth = stored;
}
