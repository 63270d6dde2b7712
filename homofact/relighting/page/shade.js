// A view on the processor, as kernels.py has it: the numbers beside the picture are made of these.

/** Radiance (3 V) of an object's vertices towards the eye; 0 where one is seen from behind. Residues stay negative. */
function shade(object, eye, terms) {
  if (object.bumps) return shadeTilted(object, eye, terms);
  const { positions, normals, tangents, vertices, tuples, map, tinted } = object, tints = object.tint?.vertices;
  const { size, channels, texels } = map, count = Math.min(terms, object.terms), all = object.terms * channels;
  const found = new Float32Array(3 * vertices), stride = 4 * object.quads, [green, blue] = channels === 3 ? [1, 2] : [0, 0];
  for (let v = 0, p = 0; v < vertices; v++, p += 3) {
    let dx = eye[0] - positions[p], dy = eye[1] - positions[p + 1], dz = eye[2] - positions[p + 2];
    const length = Math.sqrt(dx * dx + dy * dy + dz * dz);
    dx /= length; dy /= length; dz /= length;
    const nx = normals[p], ny = normals[p + 1], nz = normals[p + 2], z = nx * dx + ny * dy + nz * dz;
    if (z <= 0) continue;
    const tx = tangents[p], ty = tangents[p + 1], tz = tangents[p + 2];
    const x = tx * dx + ty * dy + tz * dz;
    const y = (ny * tz - nz * ty) * dx + (nz * tx - nx * tz) * dy + (nx * ty - ny * tx) * dz;
    const u = clamped((x / (1 + z)) * 0.5 * size + 0.5 * size - 0.5, 0, size - 1);
    const w = clamped((y / (1 + z)) * 0.5 * size + 0.5 * size - 0.5, 0, size - 1);
    const i = Math.min(Math.floor(u), size - 2), j = Math.min(Math.floor(w), size - 2), a = u - i, b = w - j;
    const w00 = (1 - a) * (1 - b), w01 = (1 - a) * b, w10 = a * (1 - b), w11 = a * b;
    const here = (i * size + j) * all, right = here + all, below = here + size * all, across = below + all;
    for (let k = 0, m = 0, t = v * stride; k < count; k++, m += channels, t += 3) {
      const h = (c) => w00 * texels[here + m + c] + w01 * texels[right + m + c] + w10 * texels[below + m + c] + w11 * texels[across + m + c];
      found[p] += h(0) * tuples[t] * (tinted[k] ? tints[p] : 1);
      found[p + 1] += h(green) * tuples[t + 1] * (tinted[k] ? tints[p + 1] : 1);
      found[p + 2] += h(blue) * tuples[t + 2] * (tinted[k] ? tints[p + 2] : 1);
    }
  }
  return found;
}

/** The root mean square of the differences to the reference over that of the reference: of each object, then of all. */
function relativeRms(objects, colours) {
  const sums = objects.map((object, o) => {
    const expected = object.reference, found = colours[o], sum = [0, 0];
    for (let p = 0; p < found.length; p++) {
      if (!object.seen[Math.floor(p / 3)]) continue;
      sum[0] += (found[p] - expected[p]) ** 2;
      sum[1] += expected[p] ** 2;
    }
    return sum;
  });
  const all = [0, 1].map((k) => sums.reduce((total, sum) => total + sum[k], 0));
  return [...sums, all].map(([wrong, whole]) => Math.sqrt(wrong / whole));
}

/** The part of all light that is below zero, of the vertices that face the eye. */
function shareBelowZero(colours) {
  let below = 0, above = 0;
  for (const values of colours) {
    for (let p = 0; p < values.length; p++) {
      if (values[p] < 0) below -= values[p]; else above += values[p];
    }
  }
  return above > 0 ? below / (above + below) : 0;
}
