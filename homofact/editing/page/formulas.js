// How curves are divided into bands, curves of the analytic models as functions of their sliders, as starts.py has them.

const RIGHT_ANGLE = Math.PI / 2;
const LEAST_COSINE = 1e-6;
// 8 Gauss-Legendre nodes on [0, 1], as curves.py takes them.
const NODES = [0.1834346424956498, 0.525532409916329, 0.7966664774136267, 0.9602898564975363].flatMap((x) => [0.5 - x / 2, 0.5 + x / 2]);
const NODE_WEIGHTS = [0.3626837833783620, 0.3137066458778873, 0.2223810344533745, 0.1012285362903763].flatMap((w) => [w / 2, w / 2]);

/** D(θh) = exp(−(tanθh/σ)²)/(4σ² cos⁴θh). */
function beckmann(gamma, sigma) {
  const cosine = Math.max(Math.cos(gamma), LEAST_COSINE);
  return Math.exp(-((Math.sin(gamma) / cosine / sigma) ** 2) - 4 * Math.log(cosine)) / (4 * sigma ** 2);
}

/** F(θd) from air into n + ik, unpolarised (Born and Wolf, 14.2). */
function fresnel(gamma, n, k) {
  const cosine = Math.min(Math.max(Math.cos(gamma), 0), 1), sine2 = 1 - cosine ** 2;
  const inner = n ** 2 - k ** 2 - sine2, length = Math.sqrt(inner ** 2 + (2 * n * k) ** 2);
  const a = Math.sqrt(Math.max((length + inner) / 2, 0));
  const s = (length - 2 * a * cosine + cosine ** 2) / (length + 2 * a * cosine + cosine ** 2);
  const whole = length * cosine ** 2 + sine2 ** 2, mixed = 2 * a * cosine * sine2;
  return (s * (1 + (whole - mixed) / (whole + mixed))) / 2;
}

/** √(n + 1) cosⁿγ (eq. 15, 16). */
function cosinePower(gamma, exponent) {
  const sine2 = Math.sin(gamma) ** 2;
  const logarithm = Math.max(0.5 * Math.log1p(-Math.min(sine2, 1 - 1e-16)), Math.log(LEAST_COSINE));
  return Math.sqrt(exponent + 1) * Math.exp(exponent * logarithm);
}

/** scale · cosⁿγ. */
const cosineLobe = (gamma, exponent, scale) => scale * Math.max(Math.cos(gamma), 0) ** exponent;

/** (n + 2)(n + 4)/(8π(2^(−n/2) + n)), Blinn's lobe at its peak. */
const blinnPeak = (n) => ((n + 2) * (n + 4)) / (8 * Math.PI * (2 ** (-n / 2) + n));

/** exp(−tan²γ/α²)/(4πα²)^(d/2). */
function slopeGaussian(gamma, alpha, dimensions) {
  const slope = Math.sin(gamma) / Math.max(Math.cos(gamma), LEAST_COSINE);
  return Math.exp(-((slope / alpha) ** 2)) / (4 * Math.PI * alpha ** 2) ** (dimensions / 2);
}

const range = (low, high, logs, hint) => ({ low, high, logs, hint });

/** What sliders make, by the name of the formula: the value of a channel at γ, and the range of each on a logarithmic scale or not. */
const FORMULAS = {
  beckmann: { at: (gamma, { sigma }) => beckmann(gamma, sigma), ranges: { sigma: range(0.01, 1, true, "RMS slope of the facets") } },
  fresnel: {
    at: (gamma, { n, k }, channel) => fresnel(gamma, n[channel], k[channel]),
    ranges: { n: range(0.05, 10, true, "refractive index"), k: range(0, 10, false, "extinction") },
  },
  cosine_power_u: { at: (gamma, { nu }) => cosinePower(gamma, nu), ranges: { nu: range(1, 10000, true, "exponent along x") } },
  cosine_power_v: { at: (gamma, { nv }) => cosinePower(gamma, nv), ranges: { nv: range(1, 10000, true, "exponent along y") } },
  phong: {
    at: (gamma, { exponent: n }) => cosineLobe(gamma, n, (n + 2) / (2 * Math.PI)), ranges: { exponent: range(1, 10000, true, "Phong's exponent") },
  },
  blinn: { at: (gamma, { exponent: n }) => cosineLobe(gamma, n, blinnPeak(n)), ranges: { exponent: range(1, 10000, true, "Blinn's exponent") } },
  facet_gaussian: {
    at: (gamma, { sigma }) => Math.exp(-((gamma / sigma) ** 2)) / (4 * Math.PI * sigma ** 2),
    ranges: { sigma: range(0.01, 1, true, "width of the Gaussian in radians") },
  },
  ward: { at: (gamma, { alpha }) => slopeGaussian(gamma, alpha, 2), ranges: { alpha: range(0.01, 1, true, "RMS slope") } },
  ward_x: { at: (gamma, { alpha_x: alpha }) => slopeGaussian(gamma, alpha, 1), ranges: { alpha_x: range(0.01, 1, true, "RMS slope along x") } },
  ward_y: { at: (gamma, { alpha_y: alpha }) => slopeGaussian(gamma, alpha, 1), ranges: { alpha_y: range(0.01, 1, true, "RMS slope along y") } },
  sharpened: { at: (gamma, { sharpening: m }) => cosineLobe(gamma, m, 1), ranges: { sharpening: range(0, 500, false, "added to the lobe's exponent") } },
};

/** The share of [0, 90°] at a place among a curve's bands (k at the lower edge of band k), and the place of a share. */
const shareAt = ({ bands, finer }, place) => (finer ? (place / bands) ** 2 : place / bands);
const placeAt = ({ bands, finer }, share) => (finer ? Math.sqrt(share) : share) * bands;

/** Means (J × C) over each of a curve's bands of what its formula gives at slider values. */
function bandedFormula(curve, sliders) {
  const { formula, bands, channels } = curve, found = new Float64Array(bands * channels);
  for (let j = 0; j < bands; j++) {
    const low = RIGHT_ANGLE * shareAt(curve, j), width = RIGHT_ANGLE * shareAt(curve, j + 1) - low;
    for (let c = 0; c < channels; c++) {
      let sum = 0;
      for (let q = 0; q < 8; q++) sum += NODE_WEIGHTS[q] * formula.at(low + NODES[q] * width, sliders, c);
      found[j * channels + c] = Math.max(sum, 0);
    }
  }
  return found;
}
