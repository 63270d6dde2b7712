// Suns and lamps beside the sky: the light of each at the vertices, on the processor (sunlight.py, lamps.py).

/** Unpacks the tables of an object's material, what its vertices see of each light (V × Q), and what lamps add by way of other surfaces. */
async function unpackSunlight({ tables, seen, directions, width, bounced }) {
  const parts = Float32Array.from(await unpack(seen), (x) => x / 255);
  const terms = bounced ? fromHalves(await unpack(bounced.values), bounced.scale) : null;
  return { tables: await Promise.all(tables.map(unpackTable)), directions, width, seen: parts, bounced: terms };
}

/** How a point sees a light (cones.py): the direction to its middle, its half angle, the irradiance of what faces it. */
function coneAt(light, turn, position) {
  if (!light.position) return { middle: sunDirection(light, turn), radius: light.radius, irradiance: light.irradiance };
  const towards = minus(light.position, position), distance = Math.max(Math.hypot(...towards), light.radius * (1 + 1e-6));
  return { middle: normalized(towards), radius: Math.asin(light.radius / distance), irradiance: scaled(light.intensity, 1 / distance ** 2) };
}

/** The direction to a sun under a sky that is turned by degrees. */
function sunDirection(sun, turn) {
  return turnedBack(sun.direction, -turn);
}

/** Two directions across a sun's, in which its disc is spread out. */
function discAxes(direction) {
  const least = direction.map(Math.abs).reduce((best, x, k, all) => (x < all[best] ? k : best), 0);
  const across = normalized(cross(direction, [0, 1, 2].map((k) => (k === least ? 1 : 0))));
  return [across, cross(direction, across)];
}

/** So many directions of a disc, as LightCones.directions has them; the middle where there is one. */
function discDirections(direction, radius, count) {
  if (count === 1) return [direction];
  const [across, other] = discAxes(direction);
  return Array.from({ length: count }, (_, k) => {
    const angle = (k + 0.5) * 2.399963229728653, along = 1 - ((1 - Math.cos(radius)) * (k + 0.5)) / count, out = Math.sqrt(1 - along ** 2);
    return plus(scaled(direction, along), plus(scaled(across, out * Math.cos(angle)), scaled(other, out * Math.sin(angle))));
  });
}

// As cones.py has them: how many directions follow a lobe, how far, and how many have what is beyond.
const FOLLOWING = 64, LOBE_REACH = 3, LOBE_WIDEST = 1.2, LOBE_FEW = 32;

/** Directions at which f is evaluated, each with its part of the irradiance, as Sunlight.at has them. */
function lightDirections({ middle, radius }, count, mirror, width) {
  if (count === 1) return [[middle, 1]];
  if (count < FOLLOWING) return discDirections(middle, radius, count).map((d) => [d, 2 / ((1 + Math.cos(radius)) * count)]);
  const reach = Math.min(LOBE_REACH * width, LOBE_WIDEST), whole = reach ** 2 / (width ** 2 + reach ** 2), found = [];
  const [across, other] = discAxes(mirror), facing = Math.PI * Math.sin(radius) ** 2;
  for (let k = 0; k < count; k++) {
    const angle = (k + 0.5) * 2.399963229728653, x = (whole * (k + 0.5)) / count, beta = width * Math.sqrt(x / (1 - x)), out = Math.sin(beta);
    const d = plus(scaled(mirror, Math.cos(beta)), plus(scaled(across, out * Math.cos(angle)), scaled(other, out * Math.sin(angle))));
    if (dot(d, middle) >= Math.cos(radius)) found.push([d, ((Math.PI * out * width * Math.sqrt((1 - x) / x)) / (1 - x) ** 2) * (whole / count / facing)]);
  }
  const each = (2 * Math.PI * (1 - Math.cos(radius))) / (LOBE_FEW * facing);
  return found.concat(discDirections(middle, radius, LOBE_FEW).filter((d) => dot(d, mirror) < Math.cos(reach)).map((d) => [d, each]));
}

// As interreflection.py has them.
const SPREAD = 0.2, SPREAD_RAYS = 1024, SPREAD_SIDE = 8;

/** Haar coefficients (6 n² × 3) of suns as surfaces send their light on: spread over wide discs, on a coarse cube map. */
function spreadSuns(suns, turn, n) {
  const side = SPREAD_SIDE, cube = new Float32Array(3 * FACES * side * side), found = new Float32Array(3 * FACES * n * n);
  for (const sun of suns) {
    const radius = Math.max(sun.radius, SPREAD), flux = 2 / (1 + Math.cos(radius));
    for (const [x, y, z] of discDirections(sunDirection(sun, turn), radius, SPREAD_RAYS)) {
      const at = texelOf(x, y, z, side), place = at % (side * side);
      const share = flux / (SPREAD_RAYS * solidAngle(Math.floor(place / side), place % side, side));
      for (let k = 0; k < 3; k++) cube[3 * at + k] += share * sun.irradiance[k];
    }
  }
  const coarse = haarCoefficients(cube, side);
  for (let f = 0; f < FACES; f++) {
    for (let i = 0; i < side; i++) {
      for (let j = 0; j < 3 * side; j++) found[3 * (f * n + i) * n + j] = (n / side) * coarse[3 * (f * side + i) * side + j];
    }
  }
  return found;
}

/** T (three numbers) of a table at the slopes of a half vector; `grids` are those of `tableAt`. */
function tableValue({ width, whole, along, around, values }, grids, hx, hy) {
  const a = placeAlong(Math.hypot(hx, hy), width) * (along - 1), b = placeAround(hx, hy, whole) * (around - 1);
  const i = Math.min(Math.floor(a), along - 2), j = Math.min(Math.floor(b), around - 2), u = a - i, v = b - j;
  const row = 3 * around, found = [0, 0, 0];
  for (const [start, own] of grids) {
    const t = start + i * row + 3 * j;
    for (let k = 0; k < 3; k++) {
      found[k] += own * ((1 - u) * ((1 - v) * values[t + k] + v * values[t + 3 + k]) + u * ((1 - v) * values[t + row + k] + v * values[t + row + 3 + k]));
    }
  }
  return found;
}

/** Adds the radiance of the lights at these levels to an object's vertices (3 V). Of turned suns no shadows are known here. */
function addLights(object, eye, lights, turn, levels, found) {
  const { positions, vertices, sunlight } = object, { normals, tangents } = shadingFrames(object, eye);
  for (let v = 0, p = 0; v < vertices; v++, p += 3) {
    const n = normals.subarray(p, p + 3), t = tangents.subarray(p, p + 3);
    const w = normalized([0, 1, 2].map((k) => eye[k] - positions[p + k])), facing = dot(n, w);
    const horizon = object.normals.subarray(p, p + 3);
    if (facing <= 0 || dot(horizon, w) <= 0) continue;
    const b = cross(n, t), ox = dot(t, w), oy = dot(b, w), across = Math.hypot(ox, oy);
    const [c, s] = across > 1e-6 ? [ox / across, oy / across] : [1, 0];
    const oz = Math.max(facing, LEAST_COSINE), aside = facing < LEAST_COSINE ? Math.sin(STEEPEST) : across;
    lights.forEach((light, q) => {
      const seen = turn === 0 || light.position ? sunlight.seen[v * lights.length + q] : 1;
      if (seen === 0 || !levels[q]) return;
      const cone = coneAt(light, turn, positions.subarray(p, p + 3)), mirror = minus(scaled(Array.from(n), 2 * facing), w);
      for (const [d, part] of lightDirections(cone, sunlight.directions[q], mirror, sunlight.width)) {
        const short = (levels[q] * seen * part) / oz, z = dot(n, d), x = dot(t, d), y = dot(b, d);
        if (z <= 0 || dot(horizon, d) <= 0) continue;
        const hx = (c * x + s * y + aside) / (z + oz), hy = (c * y - s * x) / (z + oz);
        for (const table of sunlight.tables) {
          const value = tableValue(table, tableAt(table, ox, oy, oz), hx, hy), factor = table.cosine ? short : short * z;
          for (let k = 0; k < 3; k++) found[p + k] += value[k] * factor * cone.irradiance[k] * tintOf(table, object.tint, p, oz, k);
        }
      }
    });
  }
  return found;
}
