// From radiance to what is shown, as rendering/tonemap.py has it: the filmic curve (Narkowicz 2015), and sRGB's.

/** One number of linear radiance, exposed, as 0 … 1. */
function toneOf(exposed, filmic) {
  let x = Math.max(exposed, 0);
  if (filmic) x = (x * (2.51 * x + 0.03)) / (x * (2.43 * x + 0.59) + 0.14);
  x = Math.min(x, 1);
  return x <= 0.0031308 ? 12.92 * x : 1.055 * x ** (1 / 2.4) - 0.055;
}

// rendering/tonemap.py's TARGET, MIDDLE, PERCENTILE and MIDDLE_SHARE; tests/web/test_tones.py holds them equal.
const TARGET = 0.9, MIDDLE = 0.18, PERCENTILE = 99, MIDDLE_SHARE = 0.7;

/**
 * The stops of the automatic exposure of pixels of `channels` numbers each, as automatic_exposure there: those that take the
 * percentile of the brightest channel to 0.9, and those that take the median brightness of what is lit to 0.18, which weigh 0.7.
 */
function automaticStops(radiance, channels) {
  const count = radiance.length / channels, largest = new Float32Array(count), brightness = new Float32Array(count);
  let dark = 0;
  for (let i = 0, p = 0; i < count; i++) {
    let most = -Infinity, sum = 0;
    for (let c = 0; c < channels; c++, p++) {
      most = Math.max(most, radiance[p]);
      sum += radiance[p];
    }
    [largest[i], brightness[i]] = [most, sum / channels];
    if (!(sum > 0)) dark += 1;
  }
  largest.sort();
  brightness.sort();
  const at = (PERCENTILE / 100) * (count - 1), low = Math.max(Math.floor(at), 0), high = Math.min(low + 1, count - 1);
  const highlight = largest[low] + (at - low) * (largest[high] - largest[low]), middle = brightness[dark + ((count - dark - 1) >> 1)];
  const levels = [highlight > 0 ? highlight : largest[count - 1], middle];
  if (!levels.every((level) => level > 0)) return 0;
  return (1 - MIDDLE_SHARE) * Math.log2(TARGET / levels[0]) + MIDDLE_SHARE * Math.log2(MIDDLE / levels[1]);
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

/** Radiance times the exposure, bent where it is asked for, encoded; with u_linear as it is, for half floats. */
const TONES = `
uniform float u_exposure;
uniform int u_filmic;
uniform bool u_linear;
${TONE_CURVES}
vec3 displayed(vec3 radiance) {
  vec3 x = max(radiance * u_exposure, 0.0);
  if (u_linear) return min(x, 6e4);
  return encode(u_filmic == 1 ? filmic(x) : x);
}
`;

/** Stops as they are said: +0.3. */
const stopsInWords = (stops) => (Math.abs(stops) < 0.05 ? "0.0" : `${stops > 0 ? "+" : "−"}${Math.abs(stops).toFixed(1)}`);
