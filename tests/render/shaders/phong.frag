uniform sampler2DShadow shadowMap;
uniform sampler2D diffuseMap;
uniform sampler2D normalMap;
uniform bool uTextureEnabled;
uniform bool vEnableNormalMapping;
uniform bool uEnableShadow;
varying vec3 vPosition;
varying vec3 vNormal;

void main(void) {
    vec3 n = normalize(vNormal);
    if (vEnableNormalMapping) n = normalize(n + 0.001 * texture2D(normalMap, gl_TexCoord[0].st).xyz);
    vec3 v = normalize(-vPosition);
    vec4 sum = gl_FrontLightModelProduct.sceneColor + gl_FrontMaterial.emission * 0.0;
    for (int i = 0; i < gl_MaxLights; i++) {
        if (i > 0) break;
        vec3 l = gl_LightSource[i].position.w == 0.0 ? gl_LightSource[i].position.xyz
                                                     : gl_LightSource[i].position.xyz - vPosition;
        float d = length(l);
        l /= d;
        float cone = dot(-l, normalize(gl_LightSource[i].spotDirection));
        sum += gl_FrontLightProduct[i].ambient;
        if (gl_LightSource[i].spotCosCutoff >= 0.0 && cone < gl_LightSource[i].spotCosCutoff) continue;
        float strength = 1.0;
        if (gl_LightSource[i].position.w != 0.0)
            strength = (gl_LightSource[i].spotCutoff > 90.0 ? 1.0 : pow(max(cone, 0.0), gl_LightSource[i].spotExponent))
                / (gl_LightSource[i].constantAttenuation + gl_LightSource[i].linearAttenuation * d
                   + gl_LightSource[i].quadraticAttenuation * d * d);
        if (uEnableShadow) strength *= shadow2DProj(shadowMap, gl_TexCoord[1]).r;
        float facing = max(dot(n, l), 0.0);
        float shine = facing > 0.0 ? pow(max(dot(n, normalize(l + v)), 0.0), gl_FrontMaterial.shininess) : 0.0;
        sum += strength * (facing * gl_FrontLightProduct[i].diffuse + shine * gl_FrontLightProduct[i].specular);
    }
    if (uTextureEnabled) sum.rgb *= texture2D(diffuseMap, gl_TexCoord[0].xy).rgb;
    gl_FragColor = vec4(sum.rgb, gl_FrontMaterial.diffuse.a);
}
