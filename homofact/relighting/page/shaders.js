// The page's shaders: shading of vertices, kept by transform feedback; surfaces by vertex or by pixel; the sky.

/** Σ over the terms of the view map times the K-tuple, towards the eye; a line a term, K-tuples in vec4 t[QUADS]. */
function viewMaps({ terms, tinted }) {
  const part = (i) => `t[${i >> 2}].${"xyzw"[i & 3]}`;
  const lines = Array.from({ length: terms }, (_, k) => `  if (u_terms > ${k}) ${tinted[k] ? "tinted" : "sum"} += textureLod(u_maps, vec3(at, ${k}.0), 0.0).rgb`
    + ` * vec3(${part(3 * k)}, ${part(3 * k + 1)}, ${part(3 * k + 2)});`);
  return `
uniform highp sampler2DArray u_maps;
uniform int u_terms;
uniform vec3 u_eye;
// What a texture's tint multiplies.
vec3 tinted = vec3(0.0);

vec3 outgoing(vec3 position, vec3 normal, vec3 tangent, vec4 t[QUADS]) {
  vec3 n = normalize(normal), s = normalize(tangent - dot(tangent, n) * n), w = normalize(u_eye - position);
  vec3 local = vec3(dot(s, w), dot(cross(n, s), w), dot(n, w));
  // Seen from behind: as at the horizon. A triangle at the outline has such a corner.
  vec2 disc = local.z > 0.0 ? local.xy / (1.0 + local.z) : local.xy / max(length(local.xy), 1e-6);
  // The map's first axis is its rows.
  vec2 at = 0.5 * disc.yx + 0.5;
  vec3 sum = vec3(0.0);
${lines.join("\n")}
  return sum;
}
`;
}

const TUPLES = `
uniform highp sampler2D u_tuples;
#ifdef CHOSEN
layout(location = 6) in uint a_number;
#define NUMBER int(a_number)
#else
#define NUMBER gl_VertexID
#endif
vec4 tuple(int q) {
  int width = textureSize(u_tuples, 0).x, at = NUMBER * QUADS + q;
  return texelFetch(u_tuples, ivec2(at % width, at / width), 0);
}
`;

const fetched = (quads, to) => Array.from({ length: quads }, (_, q) => `  ${to}[${q}] = tuple(${q});`).join("\n");

/**
 * Shades each vertex once; v_colour is what transform feedback keeps, and v_tinted, which a texture's tint multiplies. "ALONE":
 * of the separate lobe alone; "TERMS": without it; "TILTED": with the normals of a normal map.
 */
const shadeVertex = ({ terms, tinted, quads, lobe, bumps }) => `
layout(location = 0) in vec3 a_position;
layout(location = 1) in vec3 a_normal;
layout(location = 2) in vec3 a_tangent;
out vec3 v_colour;
#ifdef TINTED
out vec3 v_tinted;
#endif
${TUPLES}${viewMaps({ terms, tinted })}${lobe ? lobeSum(lobe) : ""}
${bumps ? `#ifdef TILTED
layout(location = 12) in vec3 a_mapped;
${tiltedTerms({ bumps, tinted, quads })}
#endif` : ""}
void main() {
  vec3 normal = a_normal, tangent = a_tangent;
#ifdef TILTED
  vec3 w = normalize(u_eye - a_position);
  normal = normalize(a_mapped + max(${BENT} - dot(a_mapped, w), 0.0) * w);
  tangent = vec3((normal.y + 1.0) * (normal.y + 1.0) + normal.z * normal.z - normal.x * normal.x, -2.0 * (normal.y + 1.0) * normal.x, -2.0 * normal.x * normal.z);
  tangent = normal.y > -0.999999 ? normalize(tangent) : vec3(1.0, 0.0, 0.0);
#endif
#ifdef ALONE
  v_colour = vec3(0.0);
#elif defined(TILTED)
  tiltedAt(NUMBER, 1.0, normal, w);
  v_colour = tiltedSum;
  tinted = tiltedTints;
#else
  vec4 t[QUADS];
${fetched(quads, "t")}
  v_colour = outgoing(a_position, a_normal, a_tangent, t);
#endif
${lobe ? `#ifndef TERMS
  vec3 own = lobe(a_position, normal, tangent);
${lobe.tinted ? "  tinted += own * lobeTinted;\n  own *= 1.0 - lobeTinted;" : ""}
  v_colour += own;
#endif` : ""}
#ifdef TINTED
  v_tinted = tinted;
#endif
  gl_Position = vec4(0.0);
}
`;

const NOTHING = "void main() {}";

/**
 * By vertex "COLOURED" with what was shaded; "BY_PIXEL" too where that is a separate lobe; "BETWEEN" the corners
 * of triangles that share none, such a lobe by pixel.
 */
const surfaceVertex = ({ quads, lobe, bumps }) => `
layout(location = 0) in vec3 a_position;
uniform mat4 u_camera;
${lobe || bumps ? `// Drawn again over itself: the same depth each time.
invariant gl_Position;` : ""}
#if defined(BY_PIXEL) || defined(BETWEEN) || defined(SUNS)
layout(location = 1) in vec3 a_normal;
out vec3 v_normal;
#endif
#ifdef BETWEEN
layout(location = 7) in uvec3 a_corners;
flat out highp uvec3 v_corners;
centroid out vec3 v_share;
#endif
#ifdef BY_PIXEL
layout(location = 2) in vec3 a_tangent;
out vec3 v_tangent;
out vec4 v_tuple[QUADS];
${TUPLES}
#endif
#ifdef COLOURED
layout(location = 4) in vec3 a_colour;
out vec3 v_colour;
#endif
#ifdef TINTED
layout(location = 8) in vec3 a_tinted;
layout(location = 9) in vec3 a_tint;
#ifdef COLOURED
out vec3 v_tinted;
#endif
#ifdef COMPARED
out vec3 v_tint;
#endif
#endif
#if defined(TINTED) || defined(BUMPED)
layout(location = 10) in vec2 a_place;
out vec2 v_place;
#endif
#ifdef BUMPED
layout(location = 11) in vec4 a_along;
out vec4 v_along;
#ifdef COMPARED
layout(location = 12) in vec3 a_mapped;
out vec3 v_mapped;
#endif
#endif
#if defined(BY_PIXEL) || defined(BETWEEN) || defined(FADES) || defined(SUNS)
out vec3 v_position;
#endif
#ifdef COMPARED
layout(location = 3) in vec3 a_reference;
layout(location = 5) in float a_seen;
out vec4 v_reference;
#endif

void main() {
#if defined(BY_PIXEL) || defined(BETWEEN) || defined(SUNS)
  v_normal = a_normal;
#endif
#ifdef BETWEEN
  int corner = gl_VertexID % 3;
  v_corners = a_corners;
  v_share = vec3(corner == 0, corner == 1, corner == 2);
#endif
#ifdef BY_PIXEL
  v_tangent = a_tangent;
${fetched(quads, "v_tuple")}
#endif
#ifdef COLOURED
  v_colour = a_colour;
#endif
#ifdef TINTED
#ifdef COLOURED
  v_tinted = a_tinted;
#endif
#ifdef COMPARED
  v_tint = a_tint;
#endif
#endif
#if defined(TINTED) || defined(BUMPED)
  v_place = a_place;
#endif
#ifdef BUMPED
  v_along = a_along;
#ifdef COMPARED
  v_mapped = a_mapped;
#endif
#endif
#if defined(BY_PIXEL) || defined(BETWEEN) || defined(FADES) || defined(SUNS)
  v_position = a_position;
#endif
#ifdef COMPARED
  v_reference = vec4(a_reference, a_seen);
#endif
  gl_Position = u_camera * vec4(a_position, 1.0);
}
`;

const COMPARISON = `
in vec4 v_reference;
uniform int u_show;
uniform float u_split;
uniform float u_range;
uniform vec3 u_ramp[5];

vec3 ramp(float x) {
  float at = clamp(x, 0.0, 1.0) * 4.0;
  int k = min(int(at), 3);
  return mix(u_ramp[k], u_ramp[k + 1], at - float(k));
}

/** The reference, or its difference to the page's own; what the reference cannot know of is the page's. */
vec3 compared(vec3 own, vec3 shown) {
  vec3 reference = v_reference.w < 0.999 ? own : v_reference.rgb;
  if (u_show == 3) return ramp(dot(abs(own - reference), vec3(0.2126, 0.7152, 0.0722)) * u_exposure / u_range);
  return u_show == 2 || gl_FragCoord.x < u_split ? displayed(reference) : shown;
}
`;

const surfaceFragment = ({ terms, tinted, lobe, sunlight, bumps, quads }, between, lights) => `
#if defined(TINTED) || defined(BUMPED)
in vec2 v_place;
#endif
#ifdef TINTED
// A reference is known at vertices: beside it the texture is too.
#ifdef COMPARED
in vec3 v_tint;
#else
uniform highp sampler2D u_tint;
uniform vec3 u_tint_scale;
#endif
vec3 tint = vec3(1.0);
#endif

#if defined(BY_PIXEL) || defined(BETWEEN) || defined(SUNS)
in vec3 v_normal;
#endif
#ifdef BY_PIXEL
in vec3 v_tangent;
in vec4 v_tuple[QUADS];
${viewMaps({ terms, tinted })}
#elif defined(BETWEEN) || defined(SUNS)
uniform vec3 u_eye;
#endif
#ifdef COLOURED
in vec3 v_colour;
#ifdef TINTED
in vec3 v_tinted;
#endif
#endif
#if defined(BY_PIXEL) || defined(BETWEEN) || defined(FADES) || defined(SUNS)
in vec3 v_position;
#endif
${MAPPED_NORMAL}
${between ? cornersOf(lobe) : ""}
${between && bumps ? `uniform highp sampler2D u_tuples;
uniform int u_terms;
${tiltedTerms({ bumps, tinted, quads })}` : ""}
${sunlight ? lightSum(sunlight, lights) : ""}
uniform int u_signal;
uniform vec2 u_fade;
out vec4 colour;
${TONES}
#ifdef COMPARED
${COMPARISON}
#endif

void main() {
#if defined(BETWEEN) && defined(FADES)
  // What lies under a soft end is no longer there: such an end stays as it is.
  if (length(v_position.xz) > u_fade.x) discard;
#endif
#ifdef TINTED
#ifdef COMPARED
  tint = v_tint;
#else
  tint = texture(u_tint, v_place).rgb * u_tint_scale;
#endif
#endif
#ifdef BY_PIXEL
  vec3 own = outgoing(v_position, v_normal, v_tangent, v_tuple);
#ifdef TINTED
  own += tinted * tint;
#endif
#else
  vec3 own = vec3(0.0);
#endif
#ifdef COLOURED
  own += v_colour;
#ifdef TINTED
  own += v_tinted * tint;
#endif
#endif
#ifdef BETWEEN
  if (gl_FrontFacing) {
${bumps ? `    vec3 w = normalize(u_eye - v_position), n = normalize(v_normal);
    n = mappedNormal(normalize(n + max(${BENT} - dot(n, w), 0.0) * w), w);
    for (int c = 0; c < 3; c++) tiltedAt(int(v_corners[c]), v_share[c], n, w);
    own += tiltedSum + tiltedTints * ${tinted.some(Boolean) ? "tint" : "1.0"};
` : ""}${lobe ? `    vec3 lit = lobeBetween(v_position, v_normal);
    own += ${lobe.tinted ? "lit * (1.0 + lobeTinted * (tint - 1.0))" : "lit"};
` : ""}  }
#endif
#ifdef SUNS
  if (gl_FrontFacing) own += besideSky(v_position, v_normal);
#endif
  // From behind a surface gives no light.
  if (!gl_FrontFacing) own = vec3(0.0);
  vec3 shown = displayed(own);
  if (u_signal == 1 && min(own.r, min(own.g, own.b)) * u_exposure < -1.0 / 255.0) shown = vec3(1.0, 0.0, 0.85);
#ifdef COMPARED
  shown = compared(own, shown);
#endif
#ifdef FADES
  float alpha = 1.0 - smoothstep(u_fade.x, u_fade.y, length(v_position.xz));
  colour = vec4(shown * alpha, alpha);
#else
  colour = vec4(shown, 1.0);
#endif
}
`;

const SKY_VERTEX = `
layout(location = 0) in vec2 a_corner;
uniform vec3 u_axes[3];
out vec3 v_along;
void main() {
  v_along = a_corner.x * u_axes[0] + a_corner.y * u_axes[1] + u_axes[2];
  gl_Position = vec4(a_corner, 1.0, 1.0);
}
`;

const SKY_FRAGMENT = `
in vec3 v_along;
uniform highp samplerCube u_picture;
uniform float u_scale;
uniform int u_plain;
uniform vec3 u_ground;
uniform int u_suns;
// Towards each, and the cosine of its radius; its radiance.
uniform vec4 u_discs[${MOST_LIGHTS}];
uniform vec3 u_disc_light[${MOST_LIGHTS}];
out vec4 colour;
${TONES}
void main() {
  vec3 light = textureLod(u_picture, v_along, 0.0).rgb * u_scale, along = normalize(v_along);
  for (int q = 0; q < u_suns; q++) if (dot(along, u_discs[q].xyz) > u_discs[q].w) light += u_disc_light[q];
  colour = vec4(u_plain == 1 ? u_ground : displayed(light), 1.0);
}
`;

// A lamp, as a glowing sphere.
const LAMP_VERTEX = `
layout(location = 0) in vec3 a_place;
uniform mat4 u_camera;
uniform vec4 u_lamp;
void main() {
  gl_Position = u_camera * vec4(u_lamp.xyz + u_lamp.w * a_place, 1.0);
}
`;

const LAMP_FRAGMENT = `
uniform vec3 u_light;
out vec4 colour;
${TONES}
void main() {
  colour = vec4(displayed(u_light), 1.0);
}
`;

const COPY_VERTEX = `
layout(location = 0) in vec2 a_corner;
out vec2 v_at;
void main() {
  v_at = 0.5 * a_corner + 0.5;
  gl_Position = vec4(a_corner, 1.0, 1.0);
}
`;

const COPY_FRAGMENT = `
in vec2 v_at;
uniform sampler2D u_picture;
out vec4 colour;
void main() {
  colour = texture(u_picture, v_at);
}
`;
