// The BRDF over the viewing angle in the plane of incidence, logarithmic: what a sphere does not show in one look.

const CURVE_SAMPLES = 241;

/** The pairs of a curve: ωi fixed, ωo from 89° on the light's side to 89° opposite. */
function curveDirections(wi) {
  const across = Math.hypot(wi[0], wi[1]);
  const away = across > 1e-6 ? [-wi[0] / across, -wi[1] / across] : [1, 0];
  const lights = new Float32Array(3 * CURVE_SAMPLES), views = new Float32Array(3 * CURVE_SAMPLES);
  const degrees = new Float32Array(CURVE_SAMPLES);
  for (let k = 0; k < CURVE_SAMPLES; k++) {
    degrees[k] = -89 + (178 * k) / (CURVE_SAMPLES - 1);
    const angle = (degrees[k] * Math.PI) / 180;
    lights.set(wi, 3 * k);
    views.set([Math.sin(angle) * away[0], Math.sin(angle) * away[1], Math.cos(angle)], 3 * k);
  }
  return { lights, views, degrees };
}

const luminance = (values, k) => 0.2126 * values[3 * k] + 0.7152 * values[3 * k + 1] + 0.0722 * values[3 * k + 2];

/** Stripes between two places of the axis. */
function hatch(context, left, right, top, bottom) {
  if (right - left < 0.5) return;
  context.save();
  context.beginPath();
  context.rect(left, top, right - left, bottom - top);
  context.clip();
  context.strokeStyle = "#3a3f47";
  context.beginPath();
  for (let from = left - (bottom - top); from < right; from += 6) {
    context.moveTo(from, bottom);
    context.lineTo(from + bottom - top, top);
  }
  context.stroke();
  context.restore();
}

/**
 * Draws the curves of [{colour, values}] at these directions; `mark` is the θo (signed, degrees) of the pointer. Angles
 * beyond `measuredTo` degrees are hatched, all of them where the light is beyond it; null hatches none.
 */
function drawCurves(canvas, degrees, curves, mark, thetaI, measuredTo) {
  const ratio = Math.min(window.devicePixelRatio || 1, 2);
  const width = canvas.clientWidth, height = canvas.clientHeight;
  [canvas.width, canvas.height] = [Math.round(width * ratio), Math.round(height * ratio)];
  const context = canvas.getContext("2d");
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  context.clearRect(0, 0, width, height);
  const left = 36, right = width - 6, top = 6, bottom = height - 30;
  let low = Infinity, high = -Infinity;
  for (const { values } of curves) {
    for (let k = 0; k < degrees.length; k++) {
      const y = luminance(values, k);
      if (y > 1e-9) [low, high] = [Math.min(low, y), Math.max(high, y)];
    }
  }
  if (!(high > 0)) [low, high] = [0.1, 1];
  // Whole decades, five at most: what lies deeper is not seen beside the highlight.
  const upper = Math.ceil(Math.log10(high) + 0.02), lower = Math.max(Math.floor(Math.log10(low)), upper - 5);
  const x = (angle) => left + ((angle + 90) / 180) * (right - left);
  const y = (value) => bottom - ((Math.log10(Math.max(value, 1e-12)) - lower) / Math.max(upper - lower, 1)) * (bottom - top);
  context.font = getComputedStyle(canvas).font.replace(/^\S*\s*\d+(\.\d+)?px/, "11px");
  context.font = `11px ${getComputedStyle(document.documentElement).fontFamily}`;
  context.textBaseline = "middle";
  context.lineWidth = 1;
  for (let decade = lower; decade <= upper; decade++) {
    context.strokeStyle = "#2c2f35";
    context.beginPath();
    context.moveTo(left, y(10 ** decade) + 0.5);
    context.lineTo(right, y(10 ** decade) + 0.5);
    context.stroke();
    context.fillStyle = "#8a9099";
    context.textAlign = "right";
    context.fillText(decade >= -2 && decade <= 3 ? String(Number((10 ** decade).toFixed(2))) : `1e${decade}`, left - 6, y(10 ** decade));
  }
  context.textAlign = "center";
  for (const angle of [-90, -45, 0, 45, 90]) {
    context.fillStyle = "#8a9099";
    context.fillText(`${Math.abs(angle)}°`, Math.min(Math.max(x(angle), left + 8), right - 10), bottom + 10);
  }
  context.textAlign = "left";
  context.fillText("← light's side", left, bottom + 23);
  context.textAlign = "right";
  context.fillText("θo, away →", right, bottom + 23);
  context.save();
  context.beginPath();
  context.rect(left, top - 2, right - left, bottom - top + 4);
  context.clip();
  const reach = measuredTo === null ? 90 : thetaI > measuredTo ? 0 : measuredTo;
  for (const [from, to] of [[-90, -reach], [reach, 90]]) hatch(context, x(from), x(to), top, bottom);
  for (const [angle, colour] of [[thetaI, "#5b616b"], [mark, "#e7e8ea"]]) {
    if (angle === null) continue;
    context.strokeStyle = colour;
    context.setLineDash([2, 3]);
    context.beginPath();
    context.moveTo(x(angle), top);
    context.lineTo(x(angle), bottom);
    context.stroke();
    context.setLineDash([]);
  }
  context.lineWidth = 1.6;
  context.lineJoin = "round";
  for (const { values, colour } of curves) {
    context.strokeStyle = colour;
    context.beginPath();
    for (let k = 0; k < degrees.length; k++) context[k ? "lineTo" : "moveTo"](x(degrees[k]), y(luminance(values, k)));
    context.stroke();
  }
  context.restore();
}
