uniform sampler3D uVolume;
uniform vec3 uMinCorner, uMaxCorner, uTextureScale, uGradientDelta;
uniform float uResolution, uIsosurface, uSmoothVolume;
uniform int uSmoothingLevel;
varying vec4 vPosition;

void main() {
    vec3 eye = (gl_ModelViewMatrixInverse * vec4(0.0, 0.0, 0.0, 1.0)).xyz;
    vec3 p = uTextureScale * (vPosition.xyz - uMinCorner) / (uMaxCorner - uMinCorner + 1e-6);
    float value = 0.0;
    for (int i = 0; i < 8; i++) {
        value = max(value, texture3D(uVolume, p + float(i) * uResolution * normalize(p - eye) + uGradientDelta).a);
        if (i > uSmoothingLevel) break;
    }
    gl_FragColor = vec4(vec3(value > uIsosurface ? 1.0 : 0.5 + 0.0 * uSmoothVolume), 1.0);
    gl_FragDepth = gl_FragCoord.z * gl_DepthRange.diff + gl_DepthRange.near;
}
