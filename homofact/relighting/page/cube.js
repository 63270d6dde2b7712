// The cube map of light and transport, as cube.py and haar.py have it: directions, solid angles, an environment's mean
// in each texel, and the Haar transform of the faces.

const FACES = 6;
/** The flat index of the texel that (x, y, z), of any length, points into. */
function texelOf(x, y, z, n) {
  const ax = Math.abs(x), ay = Math.abs(y), az = Math.abs(z);
  let face = x < 0 ? 1 : 0, a = y, b = z, length = ax;
  if (ay > ax && ay >= az) {
    face = y < 0 ? 3 : 2; a = z; b = x; length = ay;
  } else if (az > ax) {
    face = z < 0 ? 5 : 4; a = x; b = y; length = az;
  }
  const i = Math.min(Math.max(Math.floor((a / length + 1) * 0.5 * n), 0), n - 1);
  const j = Math.min(Math.max(Math.floor((b / length + 1) * 0.5 * n), 0), n - 1);
  return (face * n + i) * n + j;
}

// Rows of a picture across a texel of the cube map, at least.
const FINER = 8;

/** Mean radiance (6 n² × 3) of a lat-long picture {values, rows, columns}, turned by `turn` radians, over each texel. */
function environmentCube({ values, rows, columns }, n, turn) {
  const times = Math.max(1, Math.ceil((FINER * 2 * n) / rows)), height = rows * times, width = columns * times;
  const flux = new Float64Array(3 * FACES * n * n), given = new Float64Array(FACES * n * n);
  const sines = new Float64Array(width), cosines = new Float64Array(width);
  for (let c = 0; c < width; c++) {
    const azimuth = ((c + 0.5) / width - 0.5) * 2 * Math.PI - turn;
    [sines[c], cosines[c]] = [Math.sin(azimuth), -Math.cos(azimuth)];
  }
  for (let r = 0; r < height; r++) {
    const polar = ((r + 0.5) * Math.PI) / height, y = Math.cos(polar), around = Math.sin(polar);
    const angle = (Math.cos((r * Math.PI) / height) - Math.cos(((r + 1) * Math.PI) / height)) * ((2 * Math.PI) / width);
    const row = 3 * Math.floor(r / times) * columns;
    for (let c = 0; c < width; c++) {
      const at = texelOf(around * sines[c], y, around * cosines[c], n), q = 3 * at, p = row + 3 * Math.floor(c / times);
      given[at] += angle;
      flux[q] += angle * values[p];
      flux[q + 1] += angle * values[p + 1];
      flux[q + 2] += angle * values[p + 2];
    }
  }
  return Float32Array.from(flux, (sum, k) => sum / given[Math.floor(k / 3)]);
}

/** The orthonormal Haar coefficients (6 n² × 3) of a cube map (6 n² × 3). */
function haarCoefficients(cube, n) {
  const found = Float32Array.from(cube), scratch = new Float64Array(3 * n * n), face = new Float64Array(3 * n * n);
  for (let f = 0; f < FACES; f++) {
    const offset = 3 * f * n * n;
    face.set(cube.subarray(offset, offset + 3 * n * n));
    for (let size = n; size > 1; size /= 2) haarStep(face, scratch, size, n);
    found.set(face, offset);
  }
  return found;
}

/** Sums and differences of 2 × 2 values of the upper left size × size ones, in place. */
function haarStep(face, scratch, size, n) {
  const half = size / 2;
  for (let i = 0; i < half; i++) {
    for (let j = 0; j < half; j++) {
      for (let k = 0; k < 3; k++) {
        const at = 3 * (2 * i * n + 2 * j) + k;
        const a = face[at], b = face[at + 3], c = face[at + 3 * n], d = face[at + 3 * n + 3];
        scratch[3 * (i * n + j) + k] = (a + b + c + d) / 2;
        scratch[3 * (i * n + half + j) + k] = (a - b + c - d) / 2;
        scratch[3 * ((half + i) * n + j) + k] = (a + b - c - d) / 2;
        scratch[3 * ((half + i) * n + half + j) + k] = (a - b - c + d) / 2;
      }
    }
  }
  for (let i = 0; i < size; i++) face.set(scratch.subarray(3 * i * n, 3 * (i * n + size)), 3 * i * n);
}
