#version 120
uniform sampler2D albedoMap, metallicMap, roughnessMap, aoMap, uMatcapMap, normalMap;
varying mat3 TBN;
varying vec4 vColor;
varying vec3 vFromEye;

void main() {
    vec3 albedo = texture2D(albedoMap, gl_TexCoord[0].xy).rgb * texture(aoMap, gl_TexCoord[0].stp).rgb;
    float metallic = texture2D(metallicMap, gl_TexCoord[0].st).b, rough = texture2D(roughnessMap, gl_TexCoord[0].st).g;
    vec3 n = normalize(TBN * (texture2D(normalMap, gl_TexCoord[0].xy).xyz * 2.0 - 1.0));
    vec3 matcap = texture2D(uMatcapMap, n.xy * 0.5 + 0.5).rgb;
    float facing = dot(vec4(n, 0.0), vec3(0.0, 0.0, 1.0));  // a call that only lenient drivers accept
    gl_FragColor = vec4(albedo * matcap * vColor.rgb * (0.25 + 0.25 * metallic + 0.25 * rough + 0.25 * facing), 1.0);
    gl_FragColor.rgb += vFromEye;
}
