// Curves of the analytic models as functions of their sliders, as starts.py has them, and means over bands.

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

/** What sliders of these names make: the value of a channel at γ, and the range of each on a logarithmic scale or not. */
const FORMULAS = {
  "sigma": { at: (gamma, { sigma }) => beckmann(gamma, sigma), ranges: { sigma: { low: 0.01, high: 1, logs: true, hint: "RMS slope of the facets" } } },
  "n,k": {
    at: (gamma, { n, k }, channel) => fresnel(gamma, n[channel], k[channel]),
    ranges: { n: { low: 0.05, high: 10, logs: true, hint: "refractive index" }, k: { low: 0, high: 10, logs: false, hint: "extinction" } },
  },
  "nu": { at: (gamma, { nu }) => cosinePower(gamma, nu), ranges: { nu: { low: 1, high: 10000, logs: true, hint: "exponent along x" } } },
  "nv": { at: (gamma, { nv }) => cosinePower(gamma, nv), ranges: { nv: { low: 1, high: 10000, logs: true, hint: "exponent along y" } } },
};

/** The formula of a curve's sliders, or null where this page knows none. */
function formulaOf(sliders) {
  return sliders ? FORMULAS[Object.keys(sliders).join()] ?? null : null;
}

/** Means (J × C) over each of J equal bands of [0, π/2] of a curve at slider values. */
function bandedFormula(formula, sliders, bands, channels) {
  const found = new Float64Array(bands * channels), width = RIGHT_ANGLE / bands;
  for (let j = 0; j < bands; j++) {
    for (let c = 0; c < channels; c++) {
      let sum = 0;
      for (let q = 0; q < 8; q++) sum += NODE_WEIGHTS[q] * formula.at((j + NODES[q]) * width, sliders, c);
      found[j * channels + c] = Math.max(sum, 0);
    }
  }
  return found;
}
