// Where a ray first meets a primitive, exactly: the drawn facets only say which pixels to try.
// The ray starts at p, near the shape, and goes along the unit vector d, both in the frame of the shape.

const int SPHERE = 1, CYLINDER = 2, CAPSULE = 3, CONE = 4;

uniform vec2 uShape;  // radius, half height

// Entry into a sphere of radius r about the origin; the half chord is taken from the nearest point, which is well
// conditioned, other than the difference of squares of the textbook.
bool meetSphere(vec3 p, vec3 d, float r, out float t) {
    float along = -dot(p, d);
    vec3 nearest = p + along * d;
    float half2 = r * r - dot(nearest, nearest);
    t = along - sqrt(max(half2, 0.0));
    return half2 >= 0.0;
}

// Entry into an endless cylinder about z.
bool meetSide(vec3 p, vec3 d, float r, out float t) {
    float a = dot(d.xy, d.xy);
    float along = -dot(p.xy, d.xy) / max(a, 1e-12);
    vec2 nearest = p.xy + along * d.xy;
    float half2 = r * r - dot(nearest, nearest);
    t = along - sqrt(max(half2, 0.0) / max(a, 1e-12));
    return a > 1e-12 && half2 >= 0.0;
}

// Entry through a flat end at height z with the outward direction `up` (+1 or -1).
bool meetEnd(vec3 p, vec3 d, float z, float up, float r, out float t) {
    t = (z - p.z) / (abs(d.z) > 1e-12 ? d.z : 1e-12);
    vec2 at = p.xy + t * d.xy;
    return d.z * up < 0.0 && dot(at, at) <= r * r;
}

bool meet(vec3 p, vec3 d, out float t, out vec3 n) {
    float r = uShape.x, h = uShape.y;
    n = vec3(0.0, 0.0, 1.0);
    t = 0.0;
#if ANALYTIC == 1
    bool found = meetSphere(p, d, r, t);
    n = (p + t * d) / r;
    return found;
#elif ANALYTIC == 2
    float up = d.z < 0.0 ? 1.0 : -1.0;
    if (meetEnd(p, d, up * h, up, r, t)) {
        n.z = up;
        return true;
    }
    bool found = meetSide(p, d, r, t);
    vec3 at = p + t * d;
    n = vec3(at.xy / r, 0.0);
    return found && abs(at.z) <= h;
#elif ANALYTIC == 3
    float straight = h - r;
    bool found = meetSide(p, d, r, t);
    vec3 at = p + t * d;
    if (found && abs(at.z) <= straight) {
        n = vec3(at.xy / r, 0.0);
        return true;
    }
    // a ray along the axis enters by the end it faces, any other by the end its entry into the side lies beyond
    float end = found ? sign(at.z) : (d.z < 0.0 ? 1.0 : -1.0);
    vec3 centre = vec3(0.0, 0.0, end * straight);
    found = meetSphere(p - centre, d, r, t);
    n = (p + t * d - centre) / r;
    return found;
#else
    float k = r / (2.0 * h);
    vec3 q = p - vec3(0.0, 0.0, h);  // from the apex
    float base;
    bool below = meetEnd(p, d, -h, -1.0, r, base);
    float a = dot(d.xy, d.xy) - k * k * d.z * d.z;
    float b = dot(q.xy, d.xy) - k * k * q.z * d.z;
    float c = dot(q.xy, q.xy) - k * k * q.z * q.z;
    float disc = b * b - a * c;
    float root = sqrt(max(disc, 0.0));
    float first = (-b - root) / a, second = (-b + root) / a;
    if (first > second) {
        float swap = first;
        first = second;
        second = swap;
    }
    float zFirst = q.z + first * d.z, zSecond = q.z + second * d.z;
    bool inFirst = disc >= 0.0 && zFirst <= 0.0 && zFirst >= -2.0 * h;
    bool inSecond = disc >= 0.0 && zSecond <= 0.0 && zSecond >= -2.0 * h;
    t = inFirst ? first : second;
    bool side = inFirst || inSecond;
    if (below && (!side || base <= t)) {
        t = base;
        n = vec3(0.0, 0.0, -1.0);
        return true;
    }
    vec3 at = q + t * d;
    n = normalize(vec3(at.xy, -k * k * at.z));
    return side;
#endif
}
