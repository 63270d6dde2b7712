// Axes: where values lie along them, and which values are written.

/** Round numbers within a range: 1, 2, 5 times powers of ten, or decades alone where there are many. */
function logTicks(low, high) {
  const first = Math.floor(Math.log10(low)), last = Math.ceil(Math.log10(high)), found = [];
  const steps = last - first > 3 ? [1] : [1, 2, 5];
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
  const shown = logarithmic ? values.filter((value) => value > 0) : values;
  let low = Infinity, high = -Infinity;
  for (const value of shown) { low = Math.min(low, value); high = Math.max(high, value); }
  if (!(low <= high)) [low, high] = [1, 10];
  if (logarithmic) {
    const spare = Math.max((high / low) ** 0.05, low === high ? 1.5 : 1.02);
    [low, high] = [low / spare, high * spare];
    const ratio = Math.log(high / low);
    let ticks = logTicks(low, high);
    if (ticks.length < 2) ticks = linearTicks(low, high);
    return { at: (value) => Math.log(value / low) / ratio, ticks, shows: (value) => value !== null && value > 0 };
  }
  const spare = 0.05 * (high - low) || Math.max(0.05 * Math.abs(high), 0.5);
  [low, high] = [low - spare, high + spare];
  return { at: (value) => (value - low) / (high - low), ticks: linearTicks(low, high), shows: (value) => value !== null };
}
