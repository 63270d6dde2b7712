// The sky that lights the page: a lat-long map with the directions that are drawn from it (rendering/light.py).

const OWN_ROWS = 128;              // of the page's own sky
const LIGHT_ROWS = 256;            // at least, of a larger map that is made coarser

/** {name, rows, columns, texels (RGBA: radiance and density in sr⁻¹), drawn (RGBA)} of a picture, of mean radiance 1. */
function skyLight(name, picture) {
  const { values, rows, columns } = reducedPicture(picture, LIGHT_ROWS);
  const count = rows * columns, running = new Float64Array(count + 1), texels = new Float32Array(4 * count);
  const edge = (row) => Math.cos((row * Math.PI) / rows), means = sampledMeans(values, rows, columns);
  for (let i = 0; i < count; i++) {
    const row = Math.floor(i / columns);
    const solid = ((edge(row) - edge(row + 1)) * 2 * Math.PI) / columns;
    running[i + 1] = running[i] + means[i] * solid;
  }
  const total = running[count], scale = (4 * Math.PI) / total;
  if (!(total > 0 && total < Infinity)) {
    throw new Trouble(`${name}: its light is ${total > 0 ? "without bound" : "none"}.`, "Expected finite radiance, some above 0.");
  }
  for (let i = 0; i < count; i++) {
    for (let k = 0; k < 3; k++) texels[4 * i + k] = values[3 * i + k] * scale;
    texels[4 * i + 3] = means[i] / total;
  }
  return { name, rows, columns, texels, drawn: drawnFrom(running, rows, columns) };
}

/**
 * Mean radiance of the channels over each texel as the sampler reads it, linear between texels: an eighth from either
 * neighbour. What is drawn from otherwise misses the soft edge of a sun.
 */
function sampledMeans(values, rows, columns) {
  const grey = (row, column) => {
    const at = 3 * (Math.min(Math.max(row, 0), rows - 1) * columns + ((column + columns) % columns));
    return (values[at] + values[at + 1] + values[at + 2]) / 3;
  };
  const across = (row, column) => (grey(row, column - 1) + 6 * grey(row, column) + grey(row, column + 1)) / 8;
  return Float64Array.from({ length: rows * columns }, (_, i) => {
    const row = Math.floor(i / columns), column = i % columns;
    return (across(row - 1, column) + 6 * across(row, column) + across(row + 1, column)) / 8;
  });
}

/** Directions by the running sum of the light, one in each of DRAWN equal parts of it. */
function drawnFrom(running, rows, columns) {
  const drawn = new Float32Array(4 * DRAWN), total = running[rows * columns];
  for (let k = 0, texel = 0; k < DRAWN; k++) {
    const target = ((k + 0.5) / DRAWN) * total;
    while (texel < rows * columns - 1 && running[texel + 1] <= target) texel++;
    const along = (target - running[texel]) / (running[texel + 1] - running[texel]);
    const azimuth = (((texel % columns) + along) / columns - 0.5) * 2 * Math.PI, row = Math.floor(texel / columns);
    const upper = Math.cos((row * Math.PI) / rows), lower = Math.cos(((row + 1) * Math.PI) / rows);
    const y = upper + (lower - upper) * ((k * 0.6180339887498949 + 0.5) % 1), around = Math.sqrt(Math.max(1 - y * y, 0));
    drawn.set([around * Math.sin(azimuth), y, -around * Math.cos(azimuth), 1], 4 * k);
  }
  return drawn;
}

/** The page's own sky: a low sun at azimuth 0, where lightFrom says, thin clouds, and dark ground. */
function ownSky() {
  const rows = OWN_ROWS, columns = 2 * rows, values = new Float32Array(3 * rows * columns);
  const mix = (a, b, t) => a.map((x, k) => x + (b[k] - x) * t);
  const smooth = (low, high, x) => { const t = clamped((x - low) / (high - low), 0, 1); return t * t * (3 - 2 * t); };
  for (let row = 0; row < rows; row++) {
    const polar = ((row + 0.5) * Math.PI) / rows, y = Math.cos(polar);
    for (let column = 0; column < columns; column++) {
      const azimuth = ((column + 0.5) / columns - 0.5) * 2 * Math.PI;
      const x = Math.sin(polar) * Math.sin(azimuth), z = -Math.sin(polar) * Math.cos(azimuth);
      const facing = Math.max(0.5 * y + Math.sqrt(0.75) * z, 0);
      let colour = mix([0.62, 0.56, 0.56], [0.05, 0.13, 0.36], Math.max(y, 0) ** 0.5);
      const clouds = smooth(0.46, 0.78, cloudiness((1.6 * x) / (Math.abs(y) + 0.12), (1.6 * z) / (Math.abs(y) + 0.12)));
      colour = mix(colour, mix([0.6, 0.61, 0.67], [1.7, 1.4, 1.1], facing ** 3), 0.8 * clouds * smooth(0.0, 0.2, y));
      colour = mix(colour, [2.2, 1.6, 1.0], 0.7 * facing ** 10);
      const ground = mix([0.06, 0.052, 0.046], [0.3, 0.25, 0.21], Math.exp(9 * Math.min(y, 0)));
      colour = mix(ground, colour, smooth(-0.015, 0.02, y));
      const disc = smooth(Math.cos(0.085), Math.cos(0.06), facing);
      for (let k = 0; k < 3; k++) values[3 * (row * columns + column) + k] = colour[k] + disc * [300, 255, 200][k];
    }
  }
  return { values, rows, columns };
}

/** Four octaves of value noise, 0 to 1. */
function cloudiness(x, y) {
  const corner = (i, j) => {
    let h = (Math.imul(i, 374761393) + Math.imul(j, 668265263)) | 0;
    h = Math.imul(h ^ (h >>> 13), 1274126177);
    return ((h ^ (h >>> 16)) >>> 0) / 4294967296;
  };
  const noise = (a, b) => {
    const i = Math.floor(a), j = Math.floor(b), ease = (t) => t * t * (3 - 2 * t), u = ease(a - i), v = ease(b - j);
    return (corner(i, j) * (1 - u) + corner(i + 1, j) * u) * (1 - v) + (corner(i, j + 1) * (1 - u) + corner(i + 1, j + 1) * u) * v;
  };
  let total = 0;
  for (let octave = 0; octave < 4; octave++) total += noise(x * 2 ** octave + 17 * octave, y * 2 ** octave) / 2 ** (octave + 1);
  return total / 0.9375;
}
