// Suns beside the sky: the light of each at the vertices, on the processor (sunlight.py).

/** Unpacks the tables of an object's material under suns, and what its vertices see of each sun (V × Q). */
async function unpackSunlight({ tables, seen }) {
  const unpacked = await Promise.all(tables.map(async (packed) => {
    const halves = await unpack(packed.values.values), { scale } = packed.values;
    return { ...packed, halves, scale, values: fromHalves(halves, scale) };
  }));
  return { tables: unpacked, seen: Float32Array.from(await unpack(seen), (x) => x / 255) };
}

/** The direction to a sun under a sky that is turned by degrees. */
function sunDirection(sun, turn) {
  return turnedBack(sun.direction, -turn);
}

/** T (three numbers) of a table at the slopes of a half vector; `grids` are those of `tableAt`. */
function tableValue({ width, nodes, values }, grids, hx, hy) {
  const scale = 1 / (width + Math.hypot(hx, hy)), mid = (nodes - 1) / 2, row = 3 * nodes, found = [0, 0, 0];
  const a = (hx * scale + 1) * mid, b = (hy * scale + 1) * mid;
  const i = Math.min(Math.floor(a), nodes - 2), j = Math.min(Math.floor(b), nodes - 2), u = a - i, v = b - j;
  for (const [start, own] of grids) {
    const t = start + i * row + 3 * j;
    for (let k = 0; k < 3; k++) {
      found[k] += own * ((1 - u) * ((1 - v) * values[t + k] + v * values[t + 3 + k]) + u * ((1 - v) * values[t + row + k] + v * values[t + row + 3 + k]));
    }
  }
  return found;
}

/** Adds the suns' radiance towards the eye to an object's vertices (3 V). Of turned suns no shadows are known here. */
function addSuns(object, eye, suns, turn, found) {
  const { positions, normals, tangents, vertices, sunlight } = object;
  const directions = suns.map((sun) => sunDirection(sun, turn));
  for (let v = 0, p = 0; v < vertices; v++, p += 3) {
    const n = normals.subarray(p, p + 3), t = tangents.subarray(p, p + 3);
    const w = normalized([0, 1, 2].map((k) => eye[k] - positions[p + k])), facing = dot(n, w);
    if (facing <= 0) continue;
    const b = cross(n, t), ox = dot(t, w), oy = dot(b, w), across = Math.hypot(ox, oy);
    const [c, s] = across > 1e-6 ? [ox / across, oy / across] : [1, 0];
    const oz = Math.max(facing, LEAST_COSINE), aside = facing < LEAST_COSINE ? Math.sin(STEEPEST) : across;
    suns.forEach((sun, q) => {
      const d = directions[q], z = dot(n, d), seen = turn === 0 ? sunlight.seen[v * suns.length + q] : 1;
      if (z <= 0 || seen === 0) return;
      const x = dot(t, d), y = dot(b, d), short = seen / oz;
      const hx = (c * x + s * y + aside) / (z + oz), hy = (c * y - s * x) / (z + oz);
      for (const table of sunlight.tables) {
        const value = tableValue(table, tableAt(table, ox, oy, oz), hx, hy), factor = table.cosine ? short : short * z;
        for (let k = 0; k < 3; k++) found[p + k] += value[k] * factor * sun.irradiance[k];
      }
    });
  }
  return found;
}
