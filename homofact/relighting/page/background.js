// The sky behind the objects: a cube map for the graphics card, softened as what is out of focus is.

const BACKGROUND = 192;
// The faces of a cube map in WebGL: axis, then the directions of the columns and of the rows.
const WEBGL_FACES = [
  [[1, 0, 0], [0, 0, -1], [0, -1, 0]], [[-1, 0, 0], [0, 0, 1], [0, -1, 0]],
  [[0, 1, 0], [1, 0, 0], [0, 0, 1]], [[0, -1, 0], [1, 0, 0], [0, 0, -1]],
  [[0, 0, 1], [1, 0, 0], [0, -1, 0]], [[0, 0, -1], [-1, 0, 0], [0, -1, 0]],
];

/** The picture smoothed by the cubic B-spline's weights 1/6, 4/6, 1/6 along rows and columns. */
function softened({ values, rows, columns }) {
  const across = new Float32Array(values.length), found = new Float32Array(values.length), width = 3 * columns;
  for (let r = 0, p = 0; r < rows; r++) {
    for (let c = 0; c < columns; c++) {
      const left = p + (c ? -3 : width - 3), right = p + (c < columns - 1 ? 3 : 3 - width);
      for (let k = 0; k < 3; k++) across[p + k] = (values[left + k] + 4 * values[p + k] + values[right + k]) / 6;
      p += 3;
    }
  }
  for (let r = 0; r < rows; r++) {
    const own = r * width, above = Math.max(r - 1, 0) * width, below = Math.min(r + 1, rows - 1) * width;
    for (let q = 0; q < width; q++) found[own + q] = (across[above + q] + 4 * across[own + q] + across[below + q]) / 6;
  }
  return { values: found, rows, columns };
}

/** Writes the bilinear value of a lat-long picture in a direction of any length to `out` at `to`, times `factor`. */
function lookUp({ values, rows, columns }, x, y, z, factor, out, to) {
  const u = (Math.atan2(x, -z) / (2 * Math.PI) + 0.5) * columns - 0.5;
  const v = clamped((Math.atan2(Math.hypot(x, z), y) / Math.PI) * rows - 0.5, 0, rows - 1);
  const i = Math.min(Math.floor(v), Math.max(rows - 2, 0)), j = Math.floor(u), a = v - i, b = u - j;
  const near = (j + columns) % columns, far = (j + 1) % columns, next = Math.min(i + 1, rows - 1);
  const p = 3 * (i * columns + near), q = 3 * (i * columns + far), s = 3 * (next * columns + near), t = 3 * (next * columns + far);
  for (let k = 0; k < 3; k++) {
    out[to + k] = factor * ((1 - a) * ((1 - b) * values[p + k] + b * values[q + k]) + a * ((1 - b) * values[s + k] + b * values[t + k]));
  }
}

/** A sky's cube map with the number that its texels are to be multiplied by: half floats end at 65,504. */
function skyTexture(gl, picture) {
  const soft = softened(picture), scale = soft.values.reduce((most, x) => Math.max(most, x), 1e-30) / 60000;
  const texture = makeTexture(gl, gl.TEXTURE_CUBE_MAP, gl.LINEAR), size = BACKGROUND;
  const face = new Float32Array(3 * size * size);
  WEBGL_FACES.forEach(([axis, along, down], f) => {
    for (let i = 0, to = 0; i < size; i++) {
      const b = (2 * (i + 0.5)) / size - 1;
      for (let j = 0; j < size; j++, to += 3) {
        const a = (2 * (j + 0.5)) / size - 1;
        lookUp(soft, axis[0] + a * along[0] + b * down[0], axis[1] + a * along[1] + b * down[1], axis[2] + a * along[2] + b * down[2], 1 / scale, face, to);
      }
    }
    gl.texImage2D(gl.TEXTURE_CUBE_MAP_POSITIVE_X + f, 0, gl.RGB16F, size, size, 0, gl.RGB, gl.FLOAT, face);
  });
  return { texture, scale };
}
