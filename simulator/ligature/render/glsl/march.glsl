// Rays through the values of a volume: where one meets the surface, or what it gathers by the transfer function.
//
// A ray is start + t * way with t in metres; `MARCHED` 1 is a surface, 2 a transfer function. Samples are `uStep` voxels
// apart where there may be something; the rest is leapt over. Wants uProjection.

uniform sampler3D uVolume;  // red: value; green: to how many voxels around all is empty, of 255; one empty voxel around
uniform vec3 uFromMetres;   // from metres in the volume's frame, around its middle, to coordinates of the texture
uniform float uLevel;       // of the surface
uniform float uStep;        // voxels from one sample to the next
uniform int uMost;          // samples that no ray exceeds

flat in mat4 vModelView;    // from the volume's frame to that of the eye, without scale

const float FLAT = 0.02;    // growth of the value from voxel to voxel below which there is no slope
const float NEARER = 1.75;  // voxels by which an interpolated distance may be too long

struct Ray {
    vec3 start, way;   // of the eye's frame, metres
    vec3 from, along;  // the same in the texture
    float first, last; // t where the ray comes into the box or past the near plane, and where it ends
    float voxel;       // t from one voxel to the next
};

Ray rayThrough(vec3 eye, bool perspective) {
    Ray ray;
    ray.start = perspective ? vec3(0.0) : vec3(eye.xy, 0.0);
    ray.way = perspective ? normalize(eye) : vec3(0.0, 0.0, -1.0);
    mat3 turn = mat3(vModelView);
    ray.from = ((ray.start - vModelView[3].xyz) * turn) * uFromMetres + 0.5;
    ray.along = (ray.way * turn) * uFromMetres;
    ray.along += (1.0 - step(1e-9, abs(ray.along))) * 1e-9;
    vec3 size = vec3(textureSize(uVolume, 0)), inset = 0.5 / size;
    vec3 a = (inset - ray.from) / ray.along, b = (1.0 - inset - ray.from) / ray.along;
    vec3 low = min(a, b), high = max(a, b);
    vec4 here = uProjection * vec4(ray.start, 1.0), there = uProjection * vec4(ray.way, 0.0);
    float near = -(here.z + here.w) / (there.z + there.w), far = -(here.z - here.w) / (there.z - there.w);
    ray.first = max(max(low.x, low.y), max(low.z, near));
    ray.last = min(min(high.x, high.y), high.z);
    if (far > near) ray.last = min(ray.last, far);
    vec3 rate = abs(ray.along) * size;
    ray.voxel = 1.0 / max(rate.x, max(rate.y, rate.z));
    return ray;
}

vec2 valueAt(Ray ray, float t) { return textureLod(uVolume, ray.from + t * ray.along, 0.0).rg; }

// How the value grows around t, in the axes of the eye: its length is the difference to the next voxel. The mean over
// the eight corners of two voxels: the values of a scan are steps, whose rings narrower differences show.
vec3 growth(Ray ray, float t) {
    vec3 p = ray.from + t * ray.along, d = 1.0 / vec3(textureSize(uVolume, 0)), g = vec3(0.0);
    for (int i = 0; i < 8; ++i) {
        vec3 corner = vec3(i & 1, (i >> 1) & 1, i >> 2) * 2.0 - 1.0;
        g += corner * textureLod(uVolume, p + corner * d, 0.0).r;
    }
    vec3 rate = uFromMetres / d;
    return mat3(vModelView) * (0.125 * g * rate / max(rate.x, max(rate.y, rate.z)));
}

// The normal there; where there is hardly a slope, that of the place `before` on the ray.
vec3 slope(Ray ray, float t, vec3 before) {
    vec3 g = growth(ray, t);
    return normalize(max(FLAT - length(g), 1e-4) * before - g);
}

float depthOf(vec3 eye) {
    vec4 clip = uProjection * vec4(eye, 1.0);
    return 0.5 + 0.5 * clip.z / clip.w;
}

#if MARCHED == 1
// Where the ray first enters what is inside the surface. One that starts inside leaves it first, as through the back
// faces of a mesh.
bool meetVolume(Ray ray, out float t) {
    t = ray.first;
    if (t >= ray.last) return false;
    vec2 here = valueAt(ray, t);
    bool found = false;
    float next = t, there = here.r;
    for (int i = 0; i < uMost && !found && t < ray.last; ++i) {
        next = min(t + ray.voxel * max(uStep, 255.0 * here.g - NEARER), ray.last);
        vec2 sampled = valueAt(ray, next);
        there = sampled.r;
        found = here.r < uLevel && there >= uLevel;
        if (!found) {
            here = sampled;
            t = next;
        }
    }
    if (!found) return false;
    for (int i = 0; i < 3; ++i) {
        float middle = 0.5 * (t + next), value = valueAt(ray, middle).r;
        if (value < uLevel) {
            t = middle;
            here.r = value;
        } else {
            next = middle;
            there = value;
        }
    }
    t = mix(t, next, clamp((uLevel - here.r) / max(there - here.r, 1e-6), 0.0, 1.0));
    return true;
}
#else
uniform sampler2D uTransfer;  // by value: colour, and the extinction in 1/m

// What a place of the ray absorbs, and its colour; and how far the ray goes on from `t` until the next one.
vec4 matterAt(Ray ray, float t, float last, out float span, out float to) {
    float fine = ray.voxel * uStep;
    span = min(fine, last - t);
    float middle = t + 0.5 * span;
    vec2 here = valueAt(ray, middle);
    float leap = ray.voxel * (255.0 * here.g - NEARER);
    bool empty = leap > 0.5 * fine;
    to = empty ? middle + leap : t + fine;
    vec4 matter = textureLod(uTransfer, vec2((here.r * 255.0 + 0.5) / 256.0, 0.5), 0.0);
    if (empty) matter.a = 0.0;
    return matter;
}

// Where half of the light from behind is absorbed.
bool meetVolume(Ray ray, out float t) {
    float left = 0.6931472, span, to;
    t = ray.first;
    for (int i = 0; i < uMost && t < ray.last; ++i) {
        float extinction = matterAt(ray, t, ray.last, span, to).a;
        if (extinction * span >= left) {
            t += left / extinction;
            return true;
        }
        left -= extinction * span;
        t = to;
    }
    return false;
}
#endif
