// Reading a Radiance picture (.hdr, RGBE) that is dropped on the page; the layout and its limits stand in
// containers/hdr.py, the limits of radiance in rendering/light.py.

const MOST_PIXELS = 1 << 26, FREE_PIXELS = 1 << 22, PIXELS_A_BYTE = 16, MOST_SHIFT = 24;
const MOST_LIGHT = 1e12, LEAST_LIGHT = 1e-12;

/** {values (rows × columns × 3), rows, columns} of a file's bytes. Throws Trouble, one line, for anything else. */
function readHdr(bytes, name) {
  const bad = (found) => { throw new Trouble(`${name}: ${found}.`, "Expected a Radiance picture (.hdr, RGBE), lat-long."); };
  const { rows, columns, exposure, at } = hdrHeader(bytes, bad);
  const pixels = new Uint8Array(4 * rows * columns);
  let place = at;
  for (let row = 0; row < rows; row++) {
    const runs = columns >= 8 && columns < 32768 && bytes[place] === 2 && bytes[place + 1] === 2
      && bytes[place + 2] === columns >> 8 && bytes[place + 3] === (columns & 255);
    if (!runs) {
      place = flatPixels(bytes, place, pixels.subarray(4 * row * columns), bad);
      break;
    }
    place = scanline(bytes, place + 4, pixels.subarray(4 * row * columns, 4 * (row + 1) * columns), columns, row, bad);
  }
  if (place !== bytes.length) bad(`${bytes.length - place} bytes follow its last scanline`);
  const values = new Float32Array(3 * rows * columns);
  const scales = Float64Array.from({ length: 256 }, (_, e) => (e ? 2 ** (e - 136) / exposure : 0));
  let brightest = 0;
  for (let i = 0; i < rows * columns; i++) {
    const scale = scales[pixels[4 * i + 3]];
    for (let k = 0; k < 3; k++) {
      const value = pixels[4 * i + k] * scale;
      if (value > brightest) brightest = value;
      values[3 * i + k] = value;
    }
  }
  if (brightest === 0) bad("every pixel is 0");
  if (!(brightest >= LEAST_LIGHT && brightest <= MOST_LIGHT)) bad(`its brightest radiance is ${brightest.toPrecision(3)}`);
  return { values, rows, columns };
}

function hdrHeader(bytes, bad) {
  const text = String.fromCharCode(...bytes.subarray(0, 4096));
  if (!/^#\?(RADIANCE|RGBE)/.test(text)) bad("it does not start with #?RADIANCE");
  const end = text.indexOf("\n\n"), last = text.indexOf("\n", end + 2);
  if (end < 0 || last < 0) bad("its header has no end");
  let exposure = 1;
  for (const line of text.slice(0, end).split("\n").slice(1)) {
    const [key, value = ""] = line.split("=");
    if (key === "FORMAT" && value.trim() !== "32-bit_rle_rgbe") bad(`its format is ${value.trim().slice(0, 40)}, not 32-bit_rle_rgbe`);
    if (key === "EXPOSURE") exposure *= Number(value);
  }
  if (!(exposure > 0 && exposure < Infinity)) bad("its EXPOSURE is not above 0");
  const size = /^-Y {1,9}(\d{1,9}) {1,9}\+X {1,9}(\d{1,9})\s{0,9}$/.exec(text.slice(end + 2, last));
  if (!size) bad("its size is not given as -Y rows +X columns");
  const [rows, columns] = [Number(size[1]), Number(size[2])];
  const left = bytes.length - (last + 1), most = Math.min(MOST_PIXELS, Math.max(FREE_PIXELS, PIXELS_A_BYTE * left));
  if (!(rows >= 1 && columns >= 1 && rows * columns <= most)) bad(`it is ${rows} × ${columns} pixels in ${left} bytes`);
  return { rows, columns, exposure, at: last + 1 };
}

/** Fills one scanline from run lengths, component by component; the offset after it. */
function scanline(bytes, at, pixels, columns, row, bad) {
  for (let component = 0; component < 4; component++) {
    for (let filled = 0; filled < columns;) {
      const code = bytes[at++], count = code > 128 ? code - 128 : code;
      if (code === undefined || at + (code > 128 ? 1 : count) > bytes.length) bad(`it ends within scanline ${row}`);
      if (count === 0 || filled + count > columns) bad(`a run of ${count} in scanline ${row} does not fit`);
      for (let k = 0; k < count; k++) pixels[4 * (filled + k) + component] = bytes[code > 128 ? at : at + k];
      at += code > 128 ? 1 : count;
      filled += count;
    }
  }
  return at;
}

/** Fills all remaining pixels, four bytes each; (1, 1, 1, n) repeats the one before; the offset after them. */
function flatPixels(bytes, at, pixels, bad) {
  let filled = 0, shift = 0;
  while (filled < pixels.length) {
    if (at + 4 > bytes.length) bad(`it ends after ${filled / 4} of ${pixels.length / 4} pixels`);
    const pixel = bytes.subarray(at, at + 4);
    at += 4;
    if (pixel[0] === 1 && pixel[1] === 1 && pixel[2] === 1) {
      if (shift > MOST_SHIFT) bad(`repeats without end at pixel ${filled / 4}`);
      const count = pixel[3] * 2 ** shift;
      if (!filled || filled + 4 * count > pixels.length) bad(`a repeat of ${count} pixels does not fit`);
      for (let k = 0; k < 4 * count; k++) pixels[filled + k] = pixels[filled - 4 + (k & 3)];
      filled += 4 * count;
      shift += 8;
    } else {
      pixels.set(pixel, filled);
      filled += 4;
      shift = 0;
    }
  }
  return at;
}
