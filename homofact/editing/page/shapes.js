// What an edit does to the values (J × C) of a curve: drawing, brush, handles, and shapes of the whole. All are pure.

// A curve never ends at nothing everywhere, and a factor finds something to multiply.
const LEAST = 1e-12;

/** The level of a band: of one channel, or the channels' mean. */
function levelAt(values, channels, band, channel) {
  if (channel !== null) return values[band * channels + channel];
  let sum = 0;
  for (let c = 0; c < channels; c++) sum += values[band * channels + c];
  return sum / channels;
}

/** Sets a band's level; with `channel` null all keep their ratios, and are equal where there was nothing. */
function setLevel(values, channels, band, channel, level) {
  if (channel !== null) {
    values[band * channels + channel] = level;
    return;
  }
  const before = levelAt(values, channels, band, null);
  for (let c = 0; c < channels; c++) {
    const i = band * channels + c;
    values[i] = before > LEAST ? values[i] * (level / before) : level;
  }
}

/** Freehand: a line from one point to the next, { band, level }, levels between them straight in `logs` or not. */
function drawn(values, channels, channel, from, to, logs) {
  const found = values.slice(), steps = Math.abs(to.band - from.band);
  for (let s = 0; s <= steps; s++) {
    const share = steps ? s / steps : 1, band = from.band + Math.sign(to.band - from.band) * s;
    const level = logs ? Math.exp((1 - share) * Math.log(Math.max(from.level, LEAST)) + share * Math.log(Math.max(to.level, LEAST)))
      : (1 - share) * from.level + share * to.level;
    setLevel(found, channels, band, channel, Math.max(level, 0));
  }
  return found;
}

/** Levels towards `level` at a band, by weights 0 … 1 of the bands about it: as factors in `logs`, else as sums. */
function pulled(values, channels, channel, band, level, weights, logs) {
  const found = values.slice(), before = levelAt(values, channels, band, channel);
  const factor = Math.max(level, LEAST) / Math.max(before, LEAST), step = level - before;
  for (const [j, weight] of weights) {
    const own = levelAt(values, channels, j, channel);
    setLevel(found, channels, j, channel, Math.max(logs && before > LEAST ? own * factor ** weight : own + step * weight, 0));
  }
  return found;
}

/** A bell of `width` bands about one. */
function bell(bands, band, width) {
  const found = [];
  for (let j = 0; j < bands; j++) {
    const weight = Math.exp(-0.5 * ((j - band) / width) ** 2);
    if (weight > 1e-4) found.push([j, weight]);
  }
  return found;
}

/** The bands of a curve's handles, denser at small angles, where highlights are. */
function handlesOf({ bands, finer }) {
  const count = 11, found = new Set();
  for (let k = 0; k < count; k++) found.add(Math.round((bands - 1) * (k / (count - 1)) ** (finer ? 0.85 : 1.7)));
  return [...found];
}

/** A smooth hat from one handle to its neighbours. */
function hatOf(bands, handles, number) {
  const at = handles[number], low = handles[number - 1] ?? null, high = handles[number + 1] ?? null, found = [];
  for (let j = 0; j < bands; j++) {
    const next = j < at ? low : high;
    const share = j === at || next === null ? (j === at ? 1 : 0) : 1 - Math.abs(j - at) / Math.abs(next - at);
    if (share > 0) found.push([j, share * share * (3 - 2 * share)]);
  }
  return found;
}

/** The curve with its angles divided by `factor`, straight between middles of bands. */
function narrowed(values, curve, factor) {
  const { channels, bands } = curve, found = new Float64Array(values.length);
  for (let j = 0; j < bands; j++) {
    const share = factor * shareAt(curve, j + 0.5), place = Math.min(Math.max(placeAt(curve, share) - 0.5, 0), bands - 1), low = Math.min(Math.floor(place), Math.max(bands - 2, 0)), part = place - low;
    for (let c = 0; c < channels; c++) {
      found[j * channels + c] = (1 - part) * values[low * channels + c] + part * values[Math.min(low + 1, bands - 1) * channels + c];
    }
  }
  return found;
}

/** What buttons do to a whole curve (or one channel of it), and of which curves they change nothing. */
const FLAT = "has the same value at every angle", NOTHING = "is 0 at every angle";
const SHAPES = {
  brighter: { title: "Brighter", hint: "times 1.25", still: NOTHING, of: (values) => values.map((x) => 1.25 * x) },
  darker: { title: "Darker", hint: "divided by 1.25", still: NOTHING, of: (values) => values.map((x) => x / 1.25) },
  narrower: { title: "Narrower", hint: "angles divided by 1.25", still: FLAT, of: (values, curve) => narrowed(values, curve, 1.25) },
  wider: { title: "Wider", hint: "angles times 1.25", still: FLAT, of: (values, curve) => narrowed(values, curve, 1 / 1.25) },
  smooth: { title: "Smooth", hint: "means over neighbouring bands", still: FLAT, of: (values, { channels, bands }) => smoothed(values, channels, bands) },
  grey: { title: "Grey", hint: "all channels to their mean", still: "is grey already", of: (values, { channels }) => values.map((_, i) => levelAt(values, channels, Math.floor(i / channels), null)) },
};

function smoothed(values, channels, bands) {
  const found = new Float64Array(values.length), reach = Math.max(1, Math.round(bands / 64));
  for (let j = 0; j < bands; j++) {
    for (let c = 0; c < channels; c++) {
      let sum = 0;
      for (let k = -reach; k <= reach; k++) sum += values[Math.min(Math.max(j + k, 0), bands - 1) * channels + c];
      found[j * channels + c] = sum / (2 * reach + 1);
    }
  }
  return found;
}

/** A shape for one channel alone leaves the others. */
function shaped(name, values, curve, channel) {
  const found = Float64Array.from(SHAPES[name].of(values, curve));
  if (channel === null || name === "grey") return found;
  return found.map((value, i) => (i % curve.channels === channel ? value : values[i]));
}

/** Whether two curves differ by rounding at most. */
function alike(a, b) {
  const most = 1e-12 * Math.max(...b);
  return a.every((value, i) => Math.abs(value - b[i]) <= most);
}

/** A sentence on a shape that changes nothing. */
function unchangedBy(name, channel) {
  const { title, still } = SHAPES[name], whose = channel === null || name === "grey" ? "curve" : "channel";
  return `The ${whose} ${still}, so “${title}” changes nothing.`;
}
