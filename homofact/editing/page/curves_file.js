// Edited curves as JSON, in the format of curves_file.py: writing, and reading with one line for whatever is wrong.

const EQUAL = "equal", FINER = "finer near 0";

/** The text of a file with these curves as `state` has them. */
function curvesText(file, channels, curves, state) {
  const entries = curves.map((curve) => {
    const { values } = state[curve.index], rows = [];
    for (let j = 0; j < curve.bands; j++) rows.push([...values.subarray(j * curve.channels, (j + 1) * curve.channels)]);
    return { material: curve.materialName, term: curve.term, curve: curve.name, angle: curve.angle, bands: curve.finer ? FINER : EQUAL, values: rows };
  });
  return `${JSON.stringify({ format: file.format, format_version: file.version, channels, curves: entries })}\n`;
}

/** [[index, curve], …] of a file's text. Throws Trouble, one line: which entry, what was found, what is expected. */
function readCurves(text, file, channels, curves) {
  const refuse = (place, found, expected) => { throw new Trouble(`${place}: found ${found}, expected ${expected}.`, ""); };
  const short = (value) => (value === undefined ? "nothing" : JSON.stringify(value).slice(0, 60));
  const one = (entry, place, name, among) => {
    if (!among.includes(entry[name])) refuse(`${place}${name}`, short(entry[name]), among.length > 1 ? `one of ${among.join(", ")}` : `${among[0]}`);
    return entry[name];
  };
  let found;
  try {
    found = JSON.parse(text);
  } catch {
    refuse("file", "no JSON", "edited curves in JSON");
  }
  if (found === null || typeof found !== "object" || Array.isArray(found)) refuse("file", short(found), "an object");
  one(found, "", "format", [file.format]);
  if (!Number.isInteger(found.format_version) || found.format_version < 1 || found.format_version > file.version) {
    refuse("format_version", short(found.format_version), `${file.version} at most: write the page anew with a newer homofact`);
  }
  if (JSON.stringify(found.channels) !== JSON.stringify(channels)) refuse("channels", short(found.channels), `${JSON.stringify(channels)}, as the materials have`);
  if (!Array.isArray(found.curves) || !found.curves.length || found.curves.length > file.most) refuse("curves", short(found.curves), `1 to ${file.most} objects`);
  const changes = new Map();
  found.curves.forEach((entry, number) => {
    const place = `curves[${number}].`;
    if (entry === null || typeof entry !== "object" || Array.isArray(entry)) refuse(`curves[${number}]`, short(entry), "an object");
    const names = (list, name) => [...new Set(list.map((curve) => curve[name]))];
    let left = curves;
    for (const [name, key] of [["material", "materialName"], ["term", "term"], ["curve", "name"]]) {
      one(entry, place, name, names(left, key));
      left = left.filter((curve) => curve[key] === entry[name]);
    }
    const [curve] = left;
    one(entry, place, "angle", [curve.angle]);
    if (changes.has(curve.index)) refuse(`${place}curve`, short(entry.curve), "each curve once");
    const kind = found.format_version === 1 ? EQUAL : one(entry, place, "bands", [EQUAL, FINER]);
    const values = checkedValues(entry.values, curve, place, refuse, short);
    changes.set(curve.index, { values: rebanded(values, { ...curve, finer: kind === FINER }, curve), sliders: null });
  });
  return [...changes];
}

/** Means over bands of another kind, by the integral of constant pieces from 0, as curves.py has them. */
function rebanded(values, from, to) {
  if (from.finer === to.finer) return values;
  const { bands, channels } = from, found = new Float64Array(values.length);
  for (let c = 0; c < channels; c++) {
    const integral = [0];
    for (let j = 0; j < bands; j++) integral.push(integral[j] + values[j * channels + c] * (shareAt(from, j + 1) - shareAt(from, j)));
    const upTo = (share) => {
      const j = Math.min(Math.floor(placeAt(from, share)), bands - 1);
      return integral[j] + values[j * channels + c] * (share - shareAt(from, j));
    };
    for (let j = 0; j < bands; j++) {
      const [low, high] = [shareAt(to, j), shareAt(to, j + 1)];
      found[j * channels + c] = Math.max((upTo(high) - upTo(low)) / (high - low), 0);
    }
  }
  return found;
}

function checkedValues(rows, curve, place, refuse, short) {
  const { bands, channels } = curve;
  if (!Array.isArray(rows) || rows.length !== bands) {
    refuse(`${place}values`, Array.isArray(rows) ? `${rows.length} rows` : short(rows), `${bands} rows of ${channels} numbers`);
  }
  rows.forEach((row, j) => {
    if (!Array.isArray(row) || row.length !== channels || !row.every((value) => Number.isFinite(value) && value >= 0)) {
      refuse(`${place}values[${j}]`, short(row), `${channels} finite numbers >= 0`);
    }
  });
  const values = Float64Array.from(rows.flat());
  if (!values.some((value) => value > 0)) refuse(`${place}values`, "0 everywhere", "some value above 0");
  return values;
}
