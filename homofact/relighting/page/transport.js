// One object's transport: sparse vectors, what mixes them into the vertices' K-tuples, and its geometry.

class Transport {
  /** `packed` as build.py writes it, its arrays unpacked already. */
  constructor(packed) {
    Object.assign(this, packed);
    // K-tuples of a vertex lie 4 Q numbers apart, Q texels of a float texture.
    this.quads = Math.ceil((3 * this.terms) / 4);
    this.rows = this.scale.length;
    this.components = this.weights ? this.weights.length / this.vertices : 0;
    this.start = new Uint32Array(this.rows + 1);
    for (let r = 0; r < this.rows; r++) this.start[r + 1] = this.start[r] + this.count[r];
    this.longest = this.count.reduce((most, c) => Math.max(most, c), 0);
    this.lit = new Float32Array(3 * this.rows);
    // What suns add to the vectors' terms of light between surfaces, and lamps to the vertices'; null where there is none.
    this.sunny = this.lamplit = null;
    this.tuples = new Float32Array(4 * this.quads * this.vertices);
    this.columns = null;
    // Terms that count times a texture's tint: the first ones, and half of those of light between surfaces.
    this.tinted = Array.from({ length: this.terms }, (_, k) => Boolean(this.tint) && (k < this.tint.terms || (k >= this.terms - this.bounced && k < this.terms - this.bounced / 2)));
  }

  /** Every vector's product with the light (Haar coefficients × 3), the largest `kept` numbers of each. */
  sum(light, kept) {
    const { start, index, number, scale, lit, rows } = this;
    for (let r = 0; r < rows; r++) {
      const end = Math.min(start[r + 1], start[r] + kept);
      let red = 0, green = 0, blue = 0;
      for (let p = start[r]; p < end; p++) {
        const j = 3 * index[p], value = number[p];
        red += value * light[j];
        green += value * light[j + 1];
        blue += value * light[j + 2];
      }
      lit[3 * r] = red * scale[r];
      lit[3 * r + 1] = green * scale[r];
      lit[3 * r + 2] = blue * scale[r];
    }
  }

  /** The products of the last `bounced` terms' vectors with the spread light of suns, null for none. */
  sumSuns(light) {
    const { start, index, number, scale, rows, terms, bounced } = this;
    this.sunny = light && bounced ? new Float32Array(3 * rows) : null;
    if (!this.sunny) return;
    for (let r = 0; r < rows; r++) {
      if (r % terms < terms - bounced) continue;
      for (let p = start[r]; p < start[r + 1]; p++) {
        const j = 3 * index[p], value = number[p] * scale[r];
        for (let k = 0; k < 3; k++) this.sunny[3 * r + k] += value * light[j + k];
      }
    }
  }

  /** What lamps of these intensities add to the last `bounced` terms of each vertex (V × 3 B); null for none. */
  sumLamps(intensities) {
    const { bounced, vertices } = this, given = this.sunlight?.bounced;
    this.lamplit = intensities && given && bounced ? new Float32Array(3 * bounced * vertices) : null;
    if (!this.lamplit) return;
    for (let t = 0; t < bounced * vertices; t++) {
      intensities.forEach((levels, q) => {
        for (let k = 0; k < 3; k++) this.lamplit[3 * t + k] += given[t * intensities.length + q] * levels[k];
      });
    }
  }

  /** Numbers that `sum` touches. */
  cost(kept) {
    return this.count.reduce((sum, c) => sum + Math.min(c, kept), 0);
  }

  /** Adds the change (× 3) of one coefficient to every vector that has it. */
  addColumn(j, red, green, blue, kept) {
    const { start, rows, values } = this.byCoefficient(kept), { lit } = this;
    for (let p = start[j]; p < start[j + 1]; p++) {
      const at = 3 * rows[p], value = values[p];
      lit[at] += value * red;
      lit[at + 1] += value * green;
      lit[at + 2] += value * blue;
    }
  }

  /** The vectors by coefficient, their largest `kept` numbers: start, rows, values. Made when first asked for. */
  byCoefficient(kept) {
    if (this.columns?.kept === kept) return this.columns;
    const entries = this.cost(kept), start = new Uint32Array(this.coefficients + 1);
    const visit = (each) => {
      for (let r = 0; r < this.rows; r++) {
        const end = Math.min(this.start[r + 1], this.start[r] + kept);
        for (let p = this.start[r]; p < end; p++) each(r, p);
      }
    };
    visit((r, p) => { start[this.index[p] + 1]++; });
    for (let j = 0; j < this.coefficients; j++) start[j + 1] += start[j];
    const rows = new Uint32Array(entries), values = new Float32Array(entries), place = start.slice();
    visit((r, p) => {
      const at = place[this.index[p]]++;
      rows[at] = r;
      values[at] = this.number[p] * this.scale[r];
    });
    return (this.columns = { kept, start, rows, values });
  }

  /** How much each coefficient's light does to the vertices: the root sum square of its numbers, by use (J,). */
  reach(kept) {
    const { start, rows, values } = this.byCoefficient(kept), use = this.use();
    const found = new Float64Array(this.coefficients);
    for (let j = 0; j < this.coefficients; j++) {
      for (let p = start[j]; p < start[j + 1]; p++) found[j] += values[p] * values[p] * use[rows[p]];
    }
    return found;
  }

  /** The sum over vertices of the square of what they take of each vector (R,): 1 where a vector is a vertex's own. */
  use() {
    const use = new Float64Array(this.rows).fill(this.weights ? 0 : 1), n = this.components;
    if (!this.weights) return use;
    const row = (c, i, k) => (c * (n + 1) + i) * this.terms + k;
    for (let v = 0; v < this.vertices; v++) {
      const c = this.cluster[v];
      for (let k = 0; k < this.terms; k++) use[row(c, 0, k)] += 1;
      for (let i = 0; i < n; i++) {
        const weight = this.weights[i * this.vertices + v] * this.steps[c * n + i];
        for (let k = 0; k < this.terms; k++) use[row(c, i + 1, k)] += weight * weight;
      }
    }
    return use;
  }

  /** The vertices' K-tuples of the vectors' products: T_v L = mean + Σ weight · component, or the products themselves. */
  mix() {
    const { sunny, lamplit, tuples, vertices, components, weights, cluster, steps } = this;
    const lit = sunny ? this.lit.map((value, p) => value + sunny[p]) : this.lit;
    const width = 3 * this.terms, stride = 4 * this.quads, own = new Float32Array(components);
    for (let v = 0; v < vertices; v++) {
      const c = weights ? cluster[v] : v, base = c * (components + 1) * width, to = v * stride;
      for (let i = 0; i < components; i++) own[i] = weights[i * vertices + v] * steps[c * components + i];
      for (let q = 0; q < width; q++) {
        let sum = lit[base + q];
        for (let i = 0, p = base + width + q; i < components; i++, p += width) sum += own[i] * lit[p];
        tuples[to + q] = sum;
      }
      if (!lamplit) continue;
      const last = 3 * this.bounced;
      for (let q = 0; q < last; q++) tuples[to + width - last + q] += lamplit[v * last + q];
    }
  }
}

/** Unpacks one object of the page's data. */
async function unpackTransport(packed, coefficients, lights) {
  const { basis, mix, map, reference, lobe } = packed;
  const all = { positions: packed.positions, turns: packed.frames, triangles: packed.triangles, coarse: packed.coarse, texels: map.texels,
    count: basis.count, place: basis.place, number: basis.number, scale: basis.scale,
    ...(mix ?? {}), ...(reference ? { reference: reference.values } : {}) };
  const arrays = Object.fromEntries(await Promise.all(Object.entries(all).map(
    async ([name, array]) => [name, array && await unpack(array)])));
  for (const list of [arrays.triangles, arrays.coarse]) if (list) accumulate(list, 1, list.length);
  const { index, number } = orderedVectors(arrays);
  const shape = geometry(packed, arrays.positions, arrays.turns), bumps = packed.bumps ? await unpackBumps(packed.bumps) : null;
  if (bumps) bumps.mapped = mappedNormals(bumps, shape.normals);
  return new Transport({
    name: packed.name, material: packed.material, fade: packed.fade, closed: packed.closed, vertices: packed.vertices, terms: packed.terms,
    bounced: packed.bounced,
    bytes: packed.bytes, coefficients, number, count: arrays.count, index, scale: arrays.scale,
    cluster: arrays.cluster, weights: arrays.weights, steps: arrays.steps, triangles: arrays.triangles, coarse: arrays.coarse,
    map: { size: map.size, channels: map.channels, texels: arrays.texels },
    reference: reference ? fromHalves(arrays.reference, reference.scale) : null,
    lobe: lobe ? await unpackLobe(lobe, packed.vertices) : null,
    lights, sunlight: packed.sunlight ? await unpackSunlight(packed.sunlight) : null,
    tint: packed.tint ? await unpackTint(packed.tint) : null,
    bumps, ...shape,
  });
}

/** The places and numbers of all vectors, each in falling order of magnitude; of equals the one of the lower place first. */
function orderedVectors({ count, place, number: coded }) {
  const index = new Uint16Array(coded.length), number = new Int16Array(coded.length);
  const keys = new Uint32Array(count.reduce((most, c) => Math.max(most, c), 0));
  let first = 0;
  for (const own of count) {
    let at = 0;
    for (let p = 0; p < own; p++) {
      at = (at + place[first + p]) & 0xffff;
      const code = coded[first + p], value = (code >>> 1) ^ -(code & 1);
      // Places are below 2¹⁵ and magnitudes at most 2¹⁵, so both and the sign are one number to sort by.
      keys[p] = (0x8000 - Math.abs(value)) * 0x10000 + 2 * at + (value < 0);
    }
    const sorted = keys.subarray(0, own).sort();
    for (let p = 0; p < own; p++) {
      const size = 0x8000 - (sorted[p] >>> 16);
      index[first + p] = (sorted[p] & 0xffff) >> 1;
      number[first + p] = sorted[p] & 1 ? -size : size;
    }
    first += own;
  }
  return { index, number };
}

/** Positions (V × 3), normals and tangents of the rounded ones. */
function geometry({ low, step, vertices }, places, turns) {
  const positions = new Float32Array(3 * vertices), normals = new Float32Array(3 * vertices), tangents = new Float32Array(3 * vertices);
  for (let v = 0; v < vertices; v++) {
    for (let k = 0; k < 3; k++) positions[3 * v + k] = low[k] + step[k] * places[3 * v + k];
    const [x, y, z, w] = turns.subarray(4 * v, 4 * v + 4), unit = x * x + y * y + z * z + w * w;
    tangents.set([(x * x - y * y - z * z + w * w) / unit, (2 * (x * y - z * w)) / unit, (2 * (x * z + y * w)) / unit], 3 * v);
    normals.set([(2 * (x * z - y * w)) / unit, (2 * (y * z + x * w)) / unit, (z * z + w * w - x * x - y * y) / unit], 3 * v);
  }
  return { positions, normals, tangents };
}
