// Axes: where values lie along them, and which values are written.

const FEWEST = 4, STEPS = [1, 2, 5], FINER = [1, 1.5, 2, 3, 4, 5, 6, 8];

/** Round numbers within a range: `steps` times powers of ten, or only powers of ten in a large range. */
function logTicks(low, high, steps = Math.log10(high / low) > 2.5 ? [1] : STEPS) {
  const first = Math.floor(Math.log10(low)), last = Math.ceil(Math.log10(high)), found = [];
  const every = Math.ceil((last - first) / 8);
  for (let k = first; k <= last; k++) {
    if (steps.length === 1 && (k - first) % every) continue;
    for (const step of steps) found.push(Number(`${step}e${k}`));
  }
  return found.filter((value) => value >= low && value <= high);
}

function linearTicks(low, high) {
  const rough = (high - low) / 5, power = 10 ** Math.floor(Math.log10(rough));
  const step = power * [1, 2, 5, 10].find((each) => each * power >= rough);
  const found = [];
  for (let k = Math.ceil(low / step); k * step <= high * (1 + 1e-12); k++) found.push(Number((k * step).toPrecision(12)));
  return found;
}

/** An axis over `values`, logarithmic or not: `at` gives 0 … 1, `ticks` what is written. */
function makeAxis(values, logarithmic) {
  const shown = values.filter((value) => Number.isFinite(value) && (value > 0 || !logarithmic));
  let low = Infinity, high = -Infinity;
  for (const value of shown) { low = Math.min(low, value); high = Math.max(high, value); }
  if (!(low <= high)) [low, high] = [1, 10];
  if (logarithmic) {
    const spare = Math.max((high / low) ** 0.05, low === high ? 1.5 : 1.02);
    [low, high] = [low / spare, high * spare];
    const ratio = Math.log(high / low);
    let ticks = logTicks(low, high);
    if (ticks.length < FEWEST && high / low < 10) ticks = logTicks(low, high, FINER);
    if (ticks.length < 2) ticks = linearTicks(low, high);
    return { at: (value) => Math.log(value / low) / ratio, ticks, shows: (value) => Number.isFinite(value) && value > 0 };
  }
  const spare = 0.05 * (high - low) || Math.max(0.05 * Math.abs(high), 0.5);
  [low, high] = [low - spare, high + spare];
  return { at: (value) => (value - low) / (high - low), ticks: linearTicks(low, high), shows: Number.isFinite };
}
