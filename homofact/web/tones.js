// From radiance to what is shown, as rendering/tonemap.py has it: the filmic curve (Narkowicz 2015), and sRGB's.

/** One number of linear radiance, exposed, as 0 … 1. */
function toneOf(exposed, filmic) {
  let x = Math.max(exposed, 0);
  if (filmic) x = (x * (2.51 * x + 0.03)) / (x * (2.43 * x + 0.59) + 0.14);
  x = Math.min(x, 1);
  return x <= 0.0031308 ? 12.92 * x : 1.055 * x ** (1 / 2.4) - 0.055;
}

/** The same curves in a shader, of three channels each. */
const TONE_CURVES = `
vec3 filmic(vec3 x) {
  return x * (2.51 * x + 0.03) / (x * (2.43 * x + 0.59) + 0.14);
}

vec3 encode(vec3 c) {
  c = clamp(c, 0.0, 1.0);
  return mix(12.92 * c, 1.055 * pow(max(c, vec3(1e-8)), vec3(1.0 / 2.4)) - 0.055, step(vec3(0.0031308), c));
}
`;

/** Radiance times the exposure, bent where it is asked for, encoded. */
const TONES = `
uniform float u_exposure;
uniform int u_filmic;
${TONE_CURVES}
vec3 displayed(vec3 radiance) {
  vec3 x = max(radiance * u_exposure, 0.0);
  return encode(u_filmic == 1 ? filmic(x) : x);
}
`;

/** Stops as they are said: +0.3. */
const stopsInWords = (stops) => (Math.abs(stops) < 0.05 ? "0.0" : `${stops > 0 ? "+" : "−"}${Math.abs(stops).toFixed(1)}`);
