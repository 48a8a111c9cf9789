// The lighting of OpenGL 2.1, section 2.14.1, a fragment at a time: the sum over every light that OpenGL knows,
// there or not, with a local viewer. Two-sided, as AMBF sets it.
#version 120
uniform sampler2D diffuseMap;
uniform bool uTextureEnabled;
varying vec3 vPlace;
varying vec3 vOut;

struct Sums {
    vec4 ambient, diffuse, specular;
};

float attenuation(int i, float far) {
    if (gl_LightSource[i].position.w == 0.0) return 1.0;
    return 1.0 / (gl_LightSource[i].constantAttenuation + gl_LightSource[i].linearAttenuation * far
                  + gl_LightSource[i].quadraticAttenuation * far * far);
}

float cone(int i, vec3 towards) {
    if (gl_LightSource[i].spotCutoff == 180.0) return 1.0;
    float middle = dot(-towards, normalize(gl_LightSource[i].spotDirection));
    return middle < gl_LightSource[i].spotCosCutoff ? 0.0 : pow(max(middle, 0.0), gl_LightSource[i].spotExponent);
}

void add(int i, vec3 n, vec3 v, inout Sums sums) {
    vec3 towards = gl_LightSource[i].position.xyz - gl_LightSource[i].position.w * vPlace;
    float share = attenuation(i, length(towards));
    towards = normalize(towards);
    share *= cone(i, towards);
    float facing = max(dot(n, towards), 0.0);
    sums.ambient += share * gl_FrontLightProduct[i].ambient;
    sums.diffuse += share * facing * gl_FrontLightProduct[i].diffuse;
    if (facing > 0.0) {
        float shine = pow(max(dot(n, normalize(towards + v)), 0.0), gl_FrontMaterial.shininess);
        sums.specular += share * shine * gl_FrontLightProduct[i].specular;
    }
}

void main() {
    vec3 n = normalize(vOut), v = normalize(-vPlace);
    if (dot(n, v) < 0.0) n = -n;
    Sums sums = Sums(vec4(0.0), vec4(0.0), vec4(0.0));
    for (int i = 0; i < gl_MaxLights; ++i) add(i, n, v, sums);
    vec4 colour = gl_FrontLightModelProduct.sceneColor + sums.ambient + sums.diffuse;
    if (uTextureEnabled) colour *= texture2D(diffuseMap, gl_TexCoord[0].xy);
    gl_FragColor = vec4((colour + sums.specular).rgb, gl_FrontMaterial.diffuse.a);
}
