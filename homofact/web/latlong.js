// Lat-long pictures, {values (rows × columns × 3), rows, columns}.

/** Means over blocks of texels, weighted by solid angles, as coarse as leaves at least so many rows (rendering/light.py). */
function reducedPicture(picture, rows) {
  let factor = Math.max(Math.floor(picture.rows / rows), 1);
  while (picture.rows % factor || picture.columns % factor) factor--;
  if (factor === 1) return picture;
  const height = picture.rows / factor, width = picture.columns / factor;
  const values = new Float32Array(3 * height * width), edge = (r) => Math.cos((r * Math.PI) / picture.rows);
  for (let r = 0; r < picture.rows; r++) {
    const row = Math.floor(r / factor);
    const weight = (edge(r) - edge(r + 1)) / (factor * (edge(row * factor) - edge((row + 1) * factor)));
    for (let c = 0; c < picture.columns; c++) {
      const to = 3 * (row * width + Math.floor(c / factor)), from = 3 * (r * picture.columns + c);
      for (let k = 0; k < 3; k++) values[to + k] += weight * picture.values[from + k];
    }
  }
  return { values, rows: height, columns: width };
}

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
