// Metallic-roughness reflectance (Burley 2012, Karis 2013) under lights and a small procedural surrounding.

uniform float uMetallic;
uniform float uRoughness;
uniform float uCoat;
uniform float uCoatRoughness;
uniform mat3 uWorldFromEye;
#ifdef METALLIC_MAP
uniform sampler2D uMetallicMap;
#endif
#ifdef ROUGHNESS_MAP
uniform sampler2D uRoughnessMap;
#endif

const float PI = 3.14159265;
const float FILM = 0.04;  // reflectance of water or saline at normal incidence, rounded up as is custom

// The surrounding is a sum of spherical Gaussians: axis and sharpness, colour (linear). World axes, z up.
const int LOBES = 4;
const vec4 LOBE_AXIS[LOBES] = vec4[](
    vec4(0.45, -0.35, 0.82, 30.0),  // a lamp
    vec4(-0.62, 0.20, 0.76, 20.0),  // another
    vec4(0.10, 0.95, 0.30, 8.0),    // pale wall behind
    vec4(0.00, 0.00, 1.00, 2.0));   // wide light from above
const vec3 LOBE_COLOUR[LOBES] = vec3[](
    vec3(3.2, 3.1, 3.0), vec3(1.8, 1.9, 2.0), vec3(0.35, 0.34, 0.33), vec3(0.35, 0.36, 0.38));
const vec3 HAZE = vec3(0.19, 0.16, 0.155), UPWARD = vec3(-0.03, 0.02, 0.03);  // and tissue all around, redder below

// The surrounding seen in direction d through a lobe of `sharpness` (Wang et al. 2009, eq. 12: lobes convolved).
vec3 surrounding(vec3 d, float sharpness) {
    vec3 sum = HAZE + UPWARD * d.z;
    for (int i = 0; i < LOBES; ++i) {
        float own = LOBE_AXIS[i].w;
        float joint = own * sharpness / (own + sharpness);
        sum += LOBE_COLOUR[i] * (joint / own) * exp2(1.442695 * joint * (dot(d, LOBE_AXIS[i].xyz) - 1.0));
    }
    return sum;
}

// What a matt surface with normal n gathers of it: the same through a cosine lobe, which is wide enough for a line in z.
vec3 gathered(vec3 n) { return vec3(0.34, 0.315, 0.31) + vec3(0.18, 0.20, 0.21) * n.z; }

// Sharpness of the reflection lobe of a GGX distribution with alpha squared a2.
float sharpnessOf(float a2) { return 0.5 / max(a2, 1e-3); }

// Scale and bias of the reflectance over the hemisphere (Karis 2014, a fit of the split sum).
vec2 splitSum(float roughness, float cosine) {
    vec4 r = roughness * vec4(-1.0, -0.0275, -0.572, 0.022) + vec4(1.0, 0.0425, 1.04, -0.04);
    float a004 = min(r.x * r.x, exp2(-9.28 * cosine)) * r.x + r.y;
    return vec2(-1.04, 1.04) * a004 + r.zw;
}

// GGX distribution times Smith visibility (Hammon 2017 approximation) and pi, without Fresnel.
float microfacets(float nh, float nl, float nv, float a2) {
    float d = nh * nh * (a2 - 1.0) + 1.0;
    return a2 * 0.5 / (d * d * max(mix(2.0 * nl * nv, nl + nv, sqrt(a2)), 1e-4));
}

float schlick(float cosine) { return exp2((-5.55473 * cosine - 6.98316) * cosine); }

// sRGB to linear and back, by polynomials in c and in its roots (Chapman 2012), which are cheap on a CPU.
vec3 linearOf(vec3 c) { return c * (c * (c * 0.305306011 + 0.682171111) + 0.012522878); }
vec3 shownOf(vec3 c) {
    vec3 s = sqrt(c), q = sqrt(s);
    return 0.662002687 * s + 0.684122060 * q - 0.323583601 * sqrt(q) - 0.0225411470 * c;
}

// Narkowicz 2015: a fit of the ACES filmic curve.
vec3 toneMapped(vec3 c) {
    c *= 0.8;
    return shownOf(clamp(c * (2.51 * c + 0.03) / (c * (2.43 * c + 0.59) + 0.14), 0.0, 1.0));
}

vec3 physical(vec3 shown, vec3 eye, vec3 n, vec3 v) {
    vec3 base = linearOf(shown);
    float metallic = uMetallic;
    float roughness = uRoughness;
#ifdef METALLIC_MAP
    metallic *= texture(uMetallicMap, vTexCoord).b;
#endif
#ifdef ROUGHNESS_MAP
    roughness *= texture(uRoughnessMap, vTexCoord).g;
#endif
    vec3 f0 = mix(vec3(FILM), base, metallic);
    vec3 diffuse = base * (1.0 - metallic);
    float a = max(roughness * roughness, 2e-3), a2 = a * a;
    float nv = max(dot(n, v), 1e-3);
    vec2 ab = splitSum(roughness, nv);
    vec3 mirrored = uWorldFromEye * reflect(-v, n);
    vec3 colour = diffuse * gathered(uWorldFromEye * n);
#ifdef COAT
    float ac = max(uCoatRoughness * uCoatRoughness, 2e-3), ac2 = ac * ac;
    float film = uCoat * (FILM + (1.0 - FILM) * schlick(nv));
    colour = colour * (1.0 - film) + film * surrounding(mirrored, sharpnessOf(ac2));
#else
    colour += (f0 * ab.x + ab.y) * surrounding(mirrored, sharpnessOf(a2));
#endif
    colour *= ambientShare();
    for (int i = 0; i < LIGHTS; ++i) {
        vec3 l;
        float strength = lightAt(i, eye, l);
        float nl = max(dot(n, l), 0.0);
        vec3 h = normalize(l + v);
        float nh = max(dot(n, h), 0.0), fresnel = schlick(max(dot(v, h), 0.0));
        vec3 sum = diffuse + (f0 + (1.0 - f0) * fresnel) * microfacets(nh, nl, nv, a2);
#ifdef COAT
        float fc = uCoat * (FILM + (1.0 - FILM) * fresnel);
        sum = sum * (1.0 - fc) + fc * microfacets(nh, nl, nv, ac2);
#endif
        colour += strength * nl * sum;
    }
    return toneMapped(colour + linearOf(uEmission));
}
