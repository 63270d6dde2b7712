// Light in the shaders: the sky of a map, what both surfaces share, and the sum over directions.

const DRAWN = 4096;

// The sky of a lat-long map, laid out as in rendering/light.py; its fourth channel is the density of drawing from it.
const SKY = `
const float PI = 3.14159265358979;
const int DRAWN = ${DRAWN};
uniform sampler2D u_sky;
uniform float u_turn;      // radians from +z towards +x

vec2 sky_place(vec3 w) {
  return vec2(fract(0.5 + (atan(w.x, -w.z) + u_turn) / (2.0 * PI)), atan(length(w.xz), w.y) / PI);
}
vec3 sky_radiance(vec3 w) { return textureLod(u_sky, sky_place(w), 0.0).rgb; }
float sky_density(vec3 w) {
  ivec2 size = textureSize(u_sky, 0);
  return texelFetch(u_sky, min(ivec2(sky_place(w) * vec2(size)), size - 1), 0).a;
}
vec3 turned_sky(vec3 w) {
  float c = cos(u_turn), s = sin(u_turn);
  return vec3(c * w.x + s * w.z, w.y, c * w.z - s * w.x);
}
`;

// What both surfaces share. Frame at a point with normal n: tangent norm(y x n), binormal n x t, as in the project's
// own renderer, so that its pictures and these are the same.
const LIGHTING = SKY + `
uniform vec2 u_size;       // the target in pixels
uniform vec2 u_shift;      // where in the pixel this pass looks
uniform float u_radius;    // of the unit sphere, in pixels
uniform mat3 u_camera;     // right, up and towards the viewer, in the world
uniform vec3 u_towards;    // the light's direction, or the sky's zenith
uniform int u_light;
uniform int u_pass;
uniform sampler2D u_drawn; // directions drawn from the sky
out vec4 o_radiance;

const float BROAD = 20.0, WIDE = 200.0, NARROW = 6000.0;

vec3 azimuthal(vec3 n) {
  vec3 across = vec3(n.z, 0.0, -n.x);
  float size = length(across);
  return size > 1e-6 ? across / size : vec3(1.0, 0.0, 0.0);
}

// Radiance from a direction of the world. Skies without a map give an irradiance of about pi on a surface that faces
// u_towards.
vec3 surroundings(vec3 w) {
  if (u_light == 3) return sky_radiance(w);
  float height = dot(w, u_towards);
  if (u_light == 1) {
    // The CIE overcast sky, a third as bright at its horizon as at its zenith, over ground of albedo 0.2.
    return vec3(height >= 0.0 ? (9.0 / 7.0) * (1.0 + 2.0 * height) / 3.0 : 0.2);
  }
  // A studio: a square soft box, a narrow strip at its left, and dim walls.
  vec3 side = azimuthal(u_towards), up = cross(u_towards, side);
  vec2 box = abs(vec2(dot(w, side), dot(w, up))) / max(height, 1e-3);
  float key = height > 0.0 ? 1.0 - smoothstep(0.38, 0.46, max(box.x, box.y)) : 0.0;
  vec3 back = normalize(vec3(0.0, 0.3, 0.0) - side - 0.25 * u_towards);
  vec3 along = azimuthal(back), over = cross(back, along);
  float front = dot(w, back);
  vec2 strip = abs(vec2(dot(w, along), dot(w, over))) / max(front, 1e-3);
  float rim = front > 0.0 ? (1.0 - smoothstep(0.08, 0.16, strip.x)) * (1.0 - smoothstep(0.6, 0.8, strip.y)) : 0.0;
  return vec3(4.6 * key + 2.4 * rim + 0.06 + 0.05 * (w.y + 1.0));
}

// Sample j of a set that has count (1, 2 or 4) of them in each pass. In the first 16 passes the 4 x 4 pixels of a tile
// share the 16 count points of Hammersley's set, handed round pass by pass. Any 4 x 4 neighbours have all of them in
// each pass, and any 2 x 2 in four passes, since exclusive or permutes within these groups (stage.js averages over them
// at first); 16 passes give all to every pixel. From then on each pixel moves them to a place of its own, so that
// errors average out. The layers share them: their difference has no grain of its own.
vec2 sample_place(int j, int count, int kind) {
  ivec2 p = ivec2(gl_FragCoord.xy);
  ivec2 q = ivec2(p.x ^ p.y, p.y);
  int near = (q.x & 1) << 1 | q.y & 1, far = q.x & 2 | (q.y & 2) >> 1;
  int order = near ^ u_pass >> 2 & 3 | (far ^ u_pass & 3) << 2;
  int turned = (order & 1) << 3 | (order & 2) << 1 | (order & 4) >> 1 | order >> 3;
  int part = count < 4 ? j : (j & 1) << 1 | j >> 1;
  vec2 place = vec2(float(order) + (float(j) + 0.5) / float(count),
    (float(16 * part + turned) + 0.5) / float(count)) / 16.0 + 0.31 * float(kind);
  if (u_pass < 16) return fract(place);
  uint h = uint(p.x) * 1664525u + uint(p.y) * 1013904223u + 374761393u;
  h ^= h >> 16; h *= 2246822519u; h ^= h >> 13; h *= 3266489917u; h ^= h >> 16;
  vec2 own = vec2(float(h & 65535u), float(h >> 16)) / 65536.0;
  return fract(place + own + float(u_pass / 16) * vec2(0.7548776662, 0.5698402910));
}

// A half vector's density with this exponent, as that of the direction mirrored at it.
float mirrored_density(float exponent, float cosine, float towards) {
  return (exponent + 1.0) / (2.0 * PI) * pow(cosine, exponent) / (4.0 * towards);
}

// Power heuristic (Veach and Guibas 1995, eq. 15, with exponent 2) over sets of directions that do not depend on the
// material: by the cosine, by mirroring at half vectors broadly, widely and narrowly, and from the map where there is
// one. The balance heuristic leaves specks where a set of low density finds the sun. Seen at a grazing angle, a rough
// surface reflects much at angles that are grazing too, which only the broad mirroring finds often enough.
vec3 under_sky(mat3 frame, vec3 wo) {
  const int COUNT = 8;
  vec3 total = vec3(0.0);
  bool mapped = u_light == 3;
  // Shares of the map, the cosine, the wide and the narrow mirroring; the broad one's is the narrow one's.
  vec4 share = mapped ? vec4(0.25, 0.25, 0.25, 0.125) : vec4(0.0, 0.5, 0.25, 0.125);
  for (int k = 0; k < COUNT; k++) {
    int kind = k == 7 ? 4 : k & 3;
    if (!mapped && k != 3 && k != 7) kind = (k & 1) == 0 ? 1 : 2;
    int count = kind > 2 ? 1 : !mapped && kind == 1 ? 4 : 2;
    vec2 u = sample_place(k * count / COUNT, count, kind);
    float turn = 2.0 * PI * u.y;
    vec3 wi;
    if (kind == 0) {
      int at = min(int(u.x * float(DRAWN)), DRAWN - 1);
      wi = turned_sky(texelFetch(u_drawn, ivec2(at & 63, at >> 6), 0).xyz) * frame;
    } else if (kind == 1) {
      wi = vec3(sqrt(u.x) * cos(turn), sqrt(u.x) * sin(turn), sqrt(1.0 - u.x));
    } else {
      float exponent = kind == 2 ? WIDE : kind == 3 ? NARROW : BROAD;
      float z = pow(1.0 - u.x, 1.0 / (exponent + 1.0)), s = sqrt(max(1.0 - z * z, 0.0));
      vec3 half_vector = vec3(s * cos(turn), s * sin(turn), z);
      wi = 2.0 * dot(half_vector, wo) * half_vector - wo;
    }
    if (wi.z <= 0.0) continue;
    vec3 h = normalize(wi + wo), w = frame * wi;
    float towards = max(dot(h, wo), 1e-6), cosine = max(h.z, 0.0);
    vec4 density = share * vec4(mapped ? sky_density(w) : 0.0, wi.z / PI, mirrored_density(WIDE, cosine, towards),
      mirrored_density(NARROW, cosine, towards));
    float broad = share.w * mirrored_density(BROAD, cosine, towards);
    float weight = (kind == 4 ? broad : density[min(kind, 3)]) / (dot(density, density) + broad * broad);
    total += LAYER_evaluate(wi, wo) * surroundings(w) * (open_towards(w) * wi.z * weight);
  }
  return total / float(COUNT);
}

vec3 radiance(vec3 n, vec3 t, vec3 wo) {
  mat3 frame = mat3(t, cross(n, t), n);
  if (u_light != 0) return under_sky(frame, wo);
  vec3 wi = u_towards * frame;
  return wi.z > 0.0 ? LAYER_evaluate(wi, wo) * wi.z * PI : vec3(0.0);
}
`;
