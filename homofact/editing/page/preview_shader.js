// The preview's shader: a sphere seen from afar under one light, the material by its tables and its curves as they are.

const CORNER_VERTEX = `
layout(location = 0) in vec2 a_corner;
void main() { gl_Position = vec4(a_corner, 0.0, 1.0); }
`;

// ANGLES of angles.py, from the half vector times |ωi + ωo| (s) and the difference (e).
const ANGLE_TEXTS = {
  theta_h: "atan(length(s.xy), s.z)",
  theta_d: "atan(length(e), length(s))",
  theta_i: "atan(length(wi.xy), wi.z)",
  theta_o: "atan(length(wo.xy), wo.z)",
  gamma_alpha: "powerAngle(s, s.x)",
  gamma_beta: "powerAngle(s, s.y)",
  theta_r: "2.0 * atan(length(vec3(s.xy, e.z)), length(vec3(e.xy, s.z)))",
  theta_x: "atan(abs(s.x), s.z)",
  theta_y: "atan(abs(s.y), s.z)",
};

const PREVIEW_HEAD = `
const float PI = 3.14159265358979;
uniform highp sampler2D u_curves;
uniform vec2 u_size;
uniform mat3 u_axes;
uniform vec3 u_light;
uniform int u_raw;
out vec4 colour;

// γα and γβ: cosγ = cosθh to the power of the component's share.
float powerAngle(vec3 s, float component) {
  float across = dot(s.xy, s.xy), share = component * component / max(across, 1e-20);
  float logarithm = max(0.5 * log(max(1.0 - across / max(dot(s, s), 1e-20), 1e-12)), log(1e-6));
  float small = min(1.0 - exp(share * logarithm), 1.0);
  return 2.0 * asin(sqrt(clamp(small / 2.0, 0.0, 1.0)));
}

// Straight from the middle of a band to the next.
vec3 curve(int row, int bands, bool finer, float gamma) {
  float share = clamp(gamma / (0.5 * PI), 0.0, 1.0);
  float at = clamp((finer ? sqrt(share) : share) * float(bands) - 0.5, 0.0, float(bands - 1));
  int low = min(int(at), bands - 2);
  return mix(texelFetch(u_curves, ivec2(low, row), 0).rgb, texelFetch(u_curves, ivec2(low + 1, row), 0).rgb, at - float(low));
}

// The table over the square of the cosines' sum; sizes: levels of θh, θd, φd, φh; angles likewise.
vec3 quotient(highp sampler3D table, ivec4 sizes, vec4 angles, float cosines) {
  if (sizes.x == 1) return texelFetch(table, ivec3(0), 0).rgb;
  vec2 at = vec2(sqrt(clamp(angles.x / (0.5 * PI), 0.0, 1.0)), clamp(angles.y / (0.5 * PI), 0.0, 1.0));
  at = (at * vec2(sizes.xy - 1) + 0.5) / vec2(sizes.xy);
  vec2 round = fract(angles.zw / (2.0 * PI)) * vec2(sizes.zw);
  ivec2 low = ivec2(round) % sizes.zw, high = (low + 1) % sizes.zw;
  vec2 share = round - floor(round);
  float depth = float(sizes.z * sizes.w);
  vec3 found = mix(texture(table, vec3(at, (float(low.y * sizes.z + low.x) + 0.5) / depth)).rgb,
                   texture(table, vec3(at, (float(low.y * sizes.z + high.x) + 0.5) / depth)).rgb, share.x);
  if (sizes.w == 1) return found / (cosines * cosines);
  vec3 other = mix(texture(table, vec3(at, (float(high.y * sizes.z + low.x) + 0.5) / depth)).rgb,
                   texture(table, vec3(at, (float(high.y * sizes.z + high.x) + 0.5) / depth)).rgb, share.x);
  return mix(found, other, share.y) / (cosines * cosines);
}
`;

/** The fragment shader of a material: `terms` [{ sizes, scale }], `curves` with the rows they have in the texture. */
function previewFragment(terms, curves) {
  const samplers = terms.map((_, t) => `uniform highp sampler3D u_quotient_${t};`).join("\n");
  const lines = terms.map(({ name, sizes, scale }, t) => {
    const factors = curves.map((curve, row) => [curve, row]).filter(([curve]) => curve.term === name).flatMap(([curve, row]) => {
      const at = (angle) => `curve(${row}, ${curve.bands}, ${curve.finer}, ${ANGLE_TEXTS[angle]})`;
      return curve.also ? [at(curve.angle), at("theta_o")] : [at(curve.angle)];
    });
    return `  f += ${[`quotient(u_quotient_${t}, ivec4(${sizes.join(", ")}), angles, wi.z + wo.z) * ${scale.toExponential(8)}`, ...factors].join("\n    * ")};`;
  });
  return `${TONES}${PREVIEW_HEAD}
${samplers}

vec3 brdf(vec3 wi, vec3 wo) {
  vec3 s = wi + wo, e = wi - wo;
  float phi = atan(s.y, s.x), theta = atan(length(s.xy), s.z);
  vec2 turned = vec2(dot(e.xy, vec2(cos(phi), sin(phi))), dot(e.xy, vec2(-sin(phi), cos(phi))));
  vec4 angles = vec4(theta, atan(length(e), length(s)), atan(turned.y, turned.x * cos(theta) - e.z * sin(theta)), phi);
  vec3 f = vec3(0.0);
${lines.join("\n")}
  return f;
}

void main() {
  vec2 at = (gl_FragCoord.xy / u_size * 2.0 - 1.0) / 0.94;
  float inside = 1.0 - dot(at, at);
  vec3 radiance = vec3(0.0);
  if (inside > 0.0) {
    vec3 n = u_axes * vec3(at, sqrt(inside));
    vec3 t = length(n.xz) > 1e-6 ? normalize(vec3(n.z, 0.0, -n.x)) : vec3(1.0, 0.0, 0.0), b = cross(n, t);
    vec3 wi = vec3(dot(t, u_light), dot(b, u_light), dot(n, u_light)), wo = vec3(dot(t, u_axes[2]), dot(b, u_axes[2]), dot(n, u_axes[2]));
    // The light gives π on a surface that faces it.
    if (wi.z > 0.0 && wo.z > 0.0) radiance = brdf(wi, wo) * wi.z * PI;
  }
  if (u_raw == 1) { colour = vec4(radiance, inside > 0.0 ? 1.0 : 0.0); return; }
  float edge = clamp(inside * u_size.x * 0.25, 0.0, 1.0);
  colour = vec4(mix(vec3(0.082, 0.086, 0.102), displayed(radiance), edge), 1.0);
}
`;
}
