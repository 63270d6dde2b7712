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
