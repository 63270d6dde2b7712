// The light of a separate lobe from an object's in-out factors: cells of the sky, and their sum on the processor
// (lobe_light.py, sight.py, lobe_kernels.py).

const STEEPEST = (89.7 * Math.PI) / 180, LEAST_COSINE = Math.cos(STEEPEST);
// The widest cell in slopes of h, as a part of the table's width; beyond slopes of CORE widths it may grow with the slope.
// Parts of a bright texel grow beyond slopes of NEAR widths alone.
const WIDEST = 0.25, CORE = 0.7, NEAR = 2;
// A cell is bright where one texel of it holds more of all the light: it is always divided into texels.
const BRIGHT = 1e-3;
// Cells along a face of the coarsest level, and of a whole face.
const ROOTS = 8, ROOT_CELLS = ROOTS * ROOTS;
// Numbers of a cell: direction, signed size, radiance, one unused. Cells in a row of their texture, two texels each.
const CELL = 8, CELLS_ACROSS = 1024;

// Places on a table's grid, from 0 to 1 (lobe_table.py, slope_grid.py).
const PEAK = 8, FARTHEST = 20, CROWDING = 1.5;

/** Of a view at this cosine. */
function placeOfView(oz) {
  return 1 - Math.max(1 - Math.acos(Math.min(oz, 1)) / STEEPEST, 0) ** (1 / CROWDING);
}

/** Along the slope of a half vector. */
function placeAlong(slope, width) {
  return Math.min(Math.log1p((slope * PEAK) / width) / Math.log1p((FARTHEST * PEAK) / width), 1);
}

/** Round the peak, of a whole circle or of half of one. */
function placeAround(hx, hy, whole) {
  const p = hx / Math.max(Math.abs(hx) + Math.abs(hy), 1e-30);
  return whole ? (hy < 0 ? 3 + p : 1 - p) / 4 : (1 - p) / 2;
}

/** The same for shaders; of a half vector (around, along), as a texture has them. */
const GRID_PLACE = `
#ifndef GRID_PLACE
#define GRID_PLACE
float placeOfView(float oz) {
  return 1.0 - pow(max(1.0 - acos(min(oz, 1.0)) / ${STEEPEST.toFixed(9)}, 0.0), ${(1 / CROWDING).toFixed(9)});
}

vec2 gridPlace(vec2 h, float width, bool whole) {
  float along = log(1.0 + length(h) * ${PEAK}.0 / width) / log(1.0 + ${FARTHEST * PEAK}.0 / width);
  float p = h.x / max(abs(h.x) + abs(h.y), 1e-30);
  return vec2(whole ? (h.y < 0.0 ? 3.0 + p : 1.0 - p) / 4.0 : (1.0 - p) / 2.0, min(along, 1.0));
}
#endif
`;

/** Row and column of a place in Morton's order: bits of the two in turn, the row's first. */
function mortonPlace(place) {
  let row = 0, column = 0;
  for (let bit = 0; place >> (2 * bit); bit++) {
    row |= ((place >> (2 * bit + 1)) & 1) << bit;
    column |= ((place >> (2 * bit)) & 1) << bit;
  }
  return [row, column];
}

/** The point at (a, b) of a face of the cube: texelOf's inverse. */
function facePoint(face, a, b) {
  const axis = face & 1 ? -1 : 1;
  if (face < 2) return [axis, a, b];
  return face < 4 ? [b, axis, a] : [a, b, axis];
}

/** Steradians of the texel (i, j) of a face of n × n. */
function solidAngle(i, j, n) {
  const corner = (r, c) => {
    const a = (2 * r) / n - 1, b = (2 * c) / n - 1;
    return Math.atan((a * b) / Math.sqrt(1 + a * a + b * b));
  };
  return corner(i + 1, j + 1) - corner(i, j + 1) - corner(i + 1, j) + corner(i, j);
}

/** Direction and size of the cell of a face at a place in Morton's order, into `values` from `to` on. */
function writeCell(values, to, face, place, size, solid) {
  const [row, column] = mortonPlace(place), point = facePoint(face, (2 * row + 1) / size - 1, (2 * column + 1) / size - 1);
  const length = Math.hypot(...point);
  for (let k = 0; k < 3; k++) values[to + k] = point[k] / length;
  values[to + 3] = Math.sqrt(solid);
}

/**
 * The parts of texels that are divided, `divisions` times, for lobes narrower than a texel: `starts` of their levels, the
 * finest first, counted from `begin` on. They never change: their light is that of the texel.
 */
function texelParts(n, divisions, begin) {
  texelParts.known ??= new Map();
  const key = `${n} ${divisions} ${begin}`;
  if (texelParts.known.has(key)) return texelParts.known.get(key);
  const starts = [];
  let count = 0;
  for (let more = divisions; more > 0; more--) {
    starts.push(begin + count);
    count += FACES * (n << more) ** 2;
  }
  const values = new Float32Array(CELL * count);
  starts.forEach((start, k) => {
    const size = n << (divisions - k), own = size * size;
    for (let at = 0; at < FACES * own; at++) {
      writeCell(values, CELL * (start - begin + at), Math.floor(at / own), at % own, size, solidAngle(...mortonPlace(at % own), size));
    }
  });
  const made = { starts, count, values };
  texelParts.known.set(key, made);
  return made;
}

/** Cells of all levels of a cube map of n × n texels a face, as `LightCells` has them, without light. */
function cellPlaces(n) {
  cellPlaces.known ??= new Map();
  if (cellPlaces.known.has(n)) return cellPlaces.known.get(n);
  const starts = [];
  let count = 0;
  for (let size = n; size >= ROOTS; size /= 2) {
    starts.push(count);
    count += FACES * size * size;
  }
  const values = new Float32Array(CELL * count), texels = new Uint32Array(FACES * n * n);
  let solid = Float64Array.from(texels, (_, at) => solidAngle(...mortonPlace(at % (n * n)), n));
  const angles = [];
  starts.forEach((start, k) => {
    const size = n >> k, own = size * size;
    if (k > 0) solid = Float64Array.from({ length: FACES * own }, (_, at) => solid[4 * at] + solid[4 * at + 1] + solid[4 * at + 2] + solid[4 * at + 3]);
    angles.push(solid);
    for (let at = 0; at < FACES * own; at++) {
      const face = Math.floor(at / own);
      writeCell(values, CELL * (start + at), face, at % own, size, solid[at]);
      if (k > 0) continue;
      const [row, column] = mortonPlace(at % own);
      texels[at] = (face * n + row) * n + column;
    }
  });
  const made = { n, starts, count, values, texels, angles };
  cellPlaces.known.set(n, made);
  return made;
}

/**
 * The cells of a cube map of radiance (6 n² × 3), texels and larger: `values` has CELL numbers of each, its size below 0
 * where it is bright. `parts` are those of divided texels, whose numbers begin at a new row of the card's texture.
 */
function lightCells(radiance, n, divisions = 0) {
  const { starts, count, values: places, texels, angles } = cellPlaces(n), values = places.slice();
  let flux = new Float64Array(3 * texels.length), peak = new Float64Array(texels.length), all = 0;
  texels.forEach((texel, at) => {
    for (let c = 0; c < 3; c++) flux[3 * at + c] = radiance[3 * texel + c] * angles[0][at];
    peak[at] = (flux[3 * at] + flux[3 * at + 1] + flux[3 * at + 2]) / 3;
    all += peak[at];
  });
  starts.forEach((start, k) => {
    const own = angles[k].length;
    if (k > 0) {
      const finer = flux, peaks = peak;
      flux = new Float64Array(3 * own);
      peak = new Float64Array(own);
      for (let at = 0; at < 4 * own; at++) {
        const to = at >> 2;
        for (let c = 0; c < 3; c++) flux[3 * to + c] += finer[3 * at + c];
        peak[to] = Math.max(peak[to], peaks[at]);
      }
    }
    for (let at = 0; at < own; at++) {
      const to = CELL * (start + at);
      for (let c = 0; c < 3; c++) values[to + 4 + c] = flux[3 * at + c] / angles[k][at];
      if (peak[at] > BRIGHT * all) values[to + 3] = -values[to + 3];
    }
  });
  const begin = CELLS_ACROSS * Math.ceil(count / CELLS_ACROSS), parts = texelParts(n, divisions, begin);
  return { n, divisions, starts: [...parts.starts, ...starts], count, values, begin, parts };
}

/** Levels of the cube map of light that are finer than the one of which vertices know what they see. */
function finerLevels(words, { n, divisions }) {
  const most = n << divisions;
  // Bits of a face against its texels.
  return Math.max(0, Math.round(Math.log2((most * most) / ((words * 32) / FACES)) / 2));
}

function bitsSet(word) {
  word -= (word >>> 1) & 0x55555555;
  word = (word & 0x33333333) + ((word >>> 2) & 0x33333333);
  return Math.imul((word + (word >>> 4)) & 0x0f0f0f0f, 0x01010101) >>> 24;
}

/** The part that is seen of `size` texels, a power of 4, 64 at most, of the vertex whose words begin at `first`. */
function seenPart(sight, first, at, size) {
  const word = first + (at >> 5);
  if (size === 64) return (bitsSet(sight[word]) + bitsSet(sight[word + 1])) / 64;
  return bitsSet((sight[word] >>> (at & 31)) & ((1 << size) - 1)) / size;
}

/** Adds the lobe's radiance towards the eye to an object's vertices (3 V); nothing where one is seen from behind. */
function addLobe(object, eye, cells, found) {
  const { positions, vertices } = object, { normals, tangents } = shadingFrames(object, eye), towards = [0, 0, 0];
  for (let p = 0; p < 3 * vertices; p += 3) {
    for (let k = 0; k < 3; k++) towards[k] = eye[k] - positions[p + k];
    const length = Math.hypot(...towards), [dx, dy, dz] = towards.map((x) => x / length);
    const n = normals.subarray(p, p + 3), t = tangents.subarray(p, p + 3);
    const oz = n[0] * dx + n[1] * dy + n[2] * dz;
    if (oz <= 0 || dot(object.normals.subarray(p, p + 3), [dx, dy, dz]) <= 0) continue;
    const b = [n[1] * t[2] - n[2] * t[1], n[2] * t[0] - n[0] * t[2], n[0] * t[1] - n[1] * t[0]];
    const ox = t[0] * dx + t[1] * dy + t[2] * dz, oy = b[0] * dx + b[1] * dy + b[2] * dz, across = Math.hypot(ox, oy);
    // The frame is turned so that the viewer's azimuth is 0.
    const [c, s] = across > 1e-6 ? [ox / across, oy / across] : [1, 0];
    const tx = [0, 1, 2].map((k) => c * t[k] + s * b[k]), ty = [0, 1, 2].map((k) => c * b[k] - s * t[k]);
    // A view beyond the table's last angle is raised to it.
    const level = Math.max(oz, LEAST_COSINE), aside = oz < LEAST_COSINE ? Math.sin(STEEPEST) : across;
    const sum = lobeAt(object.lobe, p / 3, [...tx, ...ty, ...n], aside, level, tableAt(object.lobe, ox, oy, level), cells);
    for (let k = 0; k < 3; k++) found[p + k] += (sum[k] / level) * tintOf(object.lobe, object.tint, p, level, k);
  }
  return found;
}

/** The lobe's radiance (3 V) alone. */
function lobeRadiance(object, eye, cells) {
  return addLobe(object, eye, cells, new Float32Array(3 * object.vertices));
}

/** [start, share] of the grids of half vectors that a view lies between: of two levels, of two turns each where there are more. */
function tableAt({ levels, turns, along, around, period }, ox, oy, oz) {
  const level = placeOfView(oz) * (levels - 1);
  const low = Math.min(Math.floor(level), levels - 2), up = Math.min(level - low, 1);
  let turn = Math.atan2(oy, ox) / period;
  turn = (turn - Math.floor(turn)) * turns;
  const first = Math.floor(turn) % turns, over = turns > 1 ? turn - Math.floor(turn) : 0, second = (first + 1) % turns;
  const grid = 3 * along * around, grids = [];
  for (const [k, part] of turns > 1 ? [[first, 1 - over], [second, over]] : [[0, 1]]) {
    grids.push([grid * (low * turns + k), (1 - up) * part], [grid * ((low + 1) * turns + k), up * part]);
  }
  return grids;
}

/** The sum over the cells at a vertex with `frame` (turned tangent, binormal, normal), before it is divided by cosθo. */
function lobeAt(lobe, vertex, frame, across, oz, grids, cells) {
  const { width, whole, along, around, values, sight, words } = lobe, { starts, divisions, begin, parts } = cells, least = divisions - lobe.divisions;
  const [xx, xy, xz, yx, yy, yz, zx, zy, zz] = frame, top = starts.length - 1, texels = ROOT_CELLS << (2 * top);
  const finer = finerLevels(words, cells), sights = texels >> (2 * finer), row = 3 * around;
  let red = 0, green = 0, blue = 0;
  for (let face = 0; face < FACES; face++) {
    let place = 0, k = top, bright = false;
    while (place < texels) {
      const number = starts[k] + ((face * texels + place) >> (2 * k)), divides = k < divisions;
      const all = divides ? parts.values : cells.values, cell = CELL * (divides ? number - begin : number);
      const dx = all[cell], dy = all[cell + 1], dz = all[cell + 2], wide = all[cell + 3], extent = Math.abs(wide);
      const z = zx * dx + zy * dy + zz * dz;
      let divided = false;
      // Of the parts of a texel, which come after it, too.
      if (!divides) bright = wide < 0;
      if (z > -0.5 * extent - 0.25 * extent * extent) {
        const short = 1 / (Math.max(z, 0) + oz);
        const hx = (xx * dx + xy * dy + xz * dz + across) * short, hy = (yx * dx + yy * dy + yz * dz) * short;
        const slope = Math.sqrt(hx * hx + hy * hy);
        const within = extent * short, near = bright && k <= divisions && slope < NEAR * width + within;
        divided = k > least && ((bright && k > divisions) || within > WIDEST * (near ? width : Math.max(width, slope + (1 - CORE) * width)));
        if (!divided && z > 0) {
          const size = 1 << (2 * Math.max(k - finer, 0)), at = face * sights + (place >> (2 * finer));
          const part = seenPart(sight, vertex * words, at, size);
          if (part > 0) {
            const seen = part * extent * extent;
            let a = placeAlong(slope, width) * (along - 1), b = placeAround(hx, hy, whole) * (around - 1);
            const i = Math.min(Math.floor(a), along - 2), j = Math.min(Math.floor(b), around - 2);
            a -= i;
            b -= j;
            let f0 = 0, f1 = 0, f2 = 0;
            for (const [start, own] of grids) {
              const t = start + i * row + 3 * j, u = t + row;
              const w00 = own * (1 - a) * (1 - b), w01 = own * (1 - a) * b, w10 = own * a * (1 - b), w11 = own * a * b;
              f0 += w00 * values[t] + w01 * values[t + 3] + w10 * values[u] + w11 * values[u + 3];
              f1 += w00 * values[t + 1] + w01 * values[t + 4] + w10 * values[u + 1] + w11 * values[u + 4];
              f2 += w00 * values[t + 2] + w01 * values[t + 5] + w10 * values[u + 2] + w11 * values[u + 5];
            }
            const light = CELL * (divides ? starts[divisions] + ((face * texels + place) >> (2 * divisions)) : number) + 4;
            red += seen * f0 * cells.values[light];
            green += seen * f1 * cells.values[light + 1];
            blue += seen * f2 * cells.values[light + 2];
          }
        }
      }
      if (divided) {
        k -= 1;
      } else {
        place += 1 << (2 * k);
        while (k < top && ((place >> (2 * k)) & 3) === 0) k += 1;
      }
    }
  }
  return [red, green, blue];
}

/** Unpacks a table, which keeps its half floats for the graphics card. */
async function unpackTable(packed) {
  const halves = await unpack(packed.values.values), { scale } = packed.values;
  return { ...packed, halves, scale, values: fromHalves(halves, scale) };
}

/** Unpacks an object's lobe. */
async function unpackLobe(packed, vertices) {
  const [table, bytes] = await Promise.all([unpackTable(packed), unpack(packed.sight)]), sight = new Uint32Array(bytes.buffer);
  return { ...table, sight, words: sight.length / vertices };
}
