// The cube map of light and transport, as cube.py and haar.py have it: directions, solid angles, an environment's mean
// in each texel, and the Haar transform of the faces.

const FACES = 6;
// Axis, first and second direction of each face.
const CUBE_AXES = [
  [[1, 0, 0], [0, 1, 0], [0, 0, 1]], [[-1, 0, 0], [0, 1, 0], [0, 0, 1]],
  [[0, 1, 0], [0, 0, 1], [1, 0, 0]], [[0, -1, 0], [0, 0, 1], [1, 0, 0]],
  [[0, 0, 1], [1, 0, 0], [0, 1, 0]], [[0, 0, -1], [1, 0, 0], [0, 1, 0]],
];

/** Steradians of a face's n × n texels; kept, since every turn asks for them. */
function solidAngles(n) {
  if (solidAngles.known?.has(n)) return solidAngles.known.get(n);
  const corner = (i, j) => {
    const a = (2 * i) / n - 1, b = (2 * j) / n - 1;
    return Math.atan((a * b) / Math.sqrt(1 + a * a + b * b));
  };
  const angles = new Float64Array(n * n);
  for (let i = 0; i < n; i++) {
    for (let j = 0; j < n; j++) angles[i * n + j] = corner(i + 1, j + 1) - corner(i, j + 1) - corner(i + 1, j) + corner(i, j);
  }
  (solidAngles.known ??= new Map()).set(n, angles);
  return angles;
}

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

/** Mean radiance (6 n² × 3) of a lat-long picture {values, rows, columns}, turned by `turn` radians, over each texel. */
function environmentCube(picture, n, turn) {
  const { values, rows, columns } = picture, texels = FACES * n * n;
  const flux = new Float64Array(3 * texels), given = new Float64Array(texels);
  if (rows >= 4 * n) spread(values, rows, columns, n, turn, flux, given);
  const ask = texelAsker(picture, n, turn), own = solidAngles(n), found = new Float32Array(3 * texels);
  for (let at = 0; at < texels; at++) {
    // Divided by what was given; where that is too little, the picture is asked instead.
    if (!(given[at] > 0.5 * own[at % (n * n)])) ask(at, found);
    else for (let k = 3 * at; k < 3 * at + 3; k++) found[k] = flux[k] / given[at];
  }
  return found;
}

/** Gives each texel of the picture whole to the texel of the cube map that it points into. */
function spread(values, rows, columns, n, turn, flux, given) {
  const sines = new Float64Array(columns), cosines = new Float64Array(columns);
  for (let c = 0; c < columns; c++) {
    const azimuth = ((c + 0.5) / columns - 0.5) * 2 * Math.PI - turn;
    [sines[c], cosines[c]] = [Math.sin(azimuth), -Math.cos(azimuth)];
  }
  for (let r = 0; r < rows; r++) {
    const polar = ((r + 0.5) * Math.PI) / rows, y = Math.cos(polar), around = Math.sin(polar);
    const angle = (Math.cos((r * Math.PI) / rows) - Math.cos(((r + 1) * Math.PI) / rows)) * ((2 * Math.PI) / columns);
    for (let c = 0, p = 3 * r * columns; c < columns; c++, p += 3) {
      const at = texelOf(around * sines[c], y, around * cosines[c], n), q = 3 * at;
      given[at] += angle;
      flux[q] += angle * values[p];
      flux[q + 1] += angle * values[p + 1];
      flux[q + 2] += angle * values[p + 2];
    }
  }
}

/** A function that writes the mean of 4 × 4 points in a texel, weighted by their solid angles, to its place. */
function texelAsker({ values, rows, columns }, n, turn) {
  const fine = 4 * n, angles = solidAngles(fine), coordinate = (i) => (2 * (i + 0.5)) / fine - 1;
  return (at, found) => {
    const face = Math.floor(at / (n * n)), i = Math.floor(at / n) % n, j = at % n, sum = [0, 0, 0];
    const [axis, first, second] = CUBE_AXES[face];
    let total = 0;
    for (let k = 0; k < 16; k++) {
      const p = 4 * i + (k >> 2), q = 4 * j + (k & 3), a = coordinate(p), b = coordinate(q);
      const [x, y, z] = [0, 1, 2].map((c) => axis[c] + a * first[c] + b * second[c]);
      const place = 3 * latLongTexel(x, y, z, rows, columns, turn), angle = angles[p * fine + q];
      total += angle;
      for (let c = 0; c < 3; c++) sum[c] += angle * values[place + c];
    }
    for (let c = 0; c < 3; c++) found[3 * at + c] = sum[c] / total;
  };
}

/** Which texel of a lat-long picture, turned, a direction of any length looks into. */
function latLongTexel(x, y, z, rows, columns, turn) {
  const turns = (Math.atan2(x, -z) + turn) / (2 * Math.PI) + 0.5;
  const column = Math.min(Math.floor((turns - Math.floor(turns)) * columns), columns - 1);
  const row = Math.min(Math.floor((Math.atan2(Math.hypot(x, z), y) / Math.PI) * rows), rows - 1);
  return row * columns + column;
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
