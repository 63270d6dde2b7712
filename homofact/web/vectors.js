// Vectors of three numbers, angles, and numbers in words.

const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const scaled = (a, s) => a.map((x) => x * s);
const minus = (a, b) => a.map((x, k) => x - b[k]);
const plus = (a, b) => a.map((x, k) => x + b[k]);
const normalized = (a) => scaled(a, 1 / (Math.hypot(...a) || 1));
const clamped = (x, low, high) => Math.min(high, Math.max(low, x));
const wrapped = (degrees) => ((((degrees + 180) % 360) + 360) % 360) - 180;
const DEGREE = Math.PI / 180;

const grouped = (count) => Math.round(count).toLocaleString("en-US");
const inWords = (x, unit = "") => `${String(x).replace("-", "−")}${unit}`;
/** A share as percent with two significant digits. */
function percent(share) {
  const value = 100 * share;
  if (!Number.isFinite(value)) return "–";
  return `${value === 0 ? "0" : value >= 9.95 ? value.toFixed(0) : value >= 0.995 ? value.toFixed(1) : value >= 0.0995 ? value.toFixed(2) : value < 0.0005 ? "< 0.001" : value.toFixed(3)}%`;
}

/** The numbers of half floats times a scale, by a table of all 65,536. */
function fromHalves(bits, scale) {
  fromHalves.table ??= Float32Array.from({ length: 65536 }, (_, k) => halfToFloat(k));
  const table = fromHalves.table, values = new Float32Array(bits.length);
  for (let i = 0; i < bits.length; i++) values[i] = table[bits[i]] * scale;
  return values;
}
