// One term of one object in one view: R = Σ_k a_k h_k, h = W ρ, brought up to date by the largest changes of h first.

// So many columns are added in one go.
const TOGETHER = 4;

class Part {
  /** `curves` are the term's in their order; `numbers` (r × P × C) int16, `outward` W (r × J·K).
   *  Light of other surfaces has `received`: a row of the view and a sender's number for each of P, of these `senders`. */
  constructor(given, curves, channels, floor, senders) {
    Object.assign(this, given);
    this.senders = this.received && senders;
    this.watched = this.senders ? [...curves, ...senders.curves] : curves;
    this.channels = channels;
    this.curves = curves;
    this.summed = curves.filter((curve) => curve.summed);
    [this.first, this.second = 1] = this.summed.map((curve) => curve.bands);
    this.size = this.numbers.length / this.rank;
    this.sums = new Float64Array(this.size);
    this.wanted = Array.from({ length: channels }, () => new Float64Array(this.rank));
    this.shown = Array.from({ length: channels }, () => new Float64Array(this.rank));
    this.held = [null, null];
    this.asked = null;
    this.order = [];
    this.inverse = this.inverseScale(floor);
    this.loudness = Float64Array.from({ length: this.rank }, (_, k) => this.columnSize(k));
  }

  columnSize(k) {
    let sum = 0;
    for (let i = k * this.size, end = i + this.size; i < end; i++) sum += this.numbers[i] ** 2;
    return Math.sqrt(sum) * this.steps[k];
  }

  /** 1 / scale (C × J·K): the starting coefficients, but no less than `floor` of the largest. */
  inverseScale(floor) {
    const { first, second, channels } = this, [a, b] = this.summed.map((curve) => curve.start.values);
    return Array.from({ length: channels }, (_, c) => {
      const found = new Float64Array(first * second);
      let most = 0;
      for (let j = 0; j < first; j++) {
        for (let q = 0; q < second; q++) {
          const value = a[j * channels + c] * (b ? b[q * channels + c] : 1);
          found[j * second + q] = value;
          most = Math.max(most, value);
        }
      }
      for (let i = 0; i < found.length; i++) found[i] = 1 / Math.max(found[i], floor * most);
      return found;
    });
  }

  /** h (C × r) of these curves (values of the summed ones). */
  coefficients(values) {
    if (values.length === 1) return this.single(values[0]);
    // The curve that changed alone is multiplied with what the other one leaves (eq. 26).
    const active = this.held[0]?.other === values[1] ? 0 : this.held[1]?.other === values[0] ? 1
      : this.asked && this.asked[0] === values[0] ? 1 : 0;
    const table = this.contracted(active, values[1 - active]);
    const bands = active === 0 ? this.first : this.second, { rank, channels } = this, own = values[active];
    return table.map((rows, c) => {
      const found = new Float64Array(rank);
      for (let k = 0, i = 0; k < rank; k++) {
        let sum = 0;
        for (let j = 0; j < bands; j++, i++) sum += rows[i] * own[j * channels + c];
        found[k] = sum;
      }
      return found;
    });
  }

  single(values) {
    const { rank, channels, first, outward } = this;
    return this.inverse.map((inverse, c) => {
      const weighted = new Float64Array(first), found = new Float64Array(rank);
      for (let j = 0; j < first; j++) weighted[j] = values[j * channels + c] * inverse[j];
      for (let k = 0, i = 0; k < rank; k++) {
        let sum = 0;
        for (let j = 0; j < first; j++, i++) sum += outward[i] * weighted[j];
        found[k] = sum;
      }
      return found;
    });
  }

  /** W times the other curve: for each channel r × bands of the active one. Kept until the other curve changes. */
  contracted(active, other) {
    if (this.held[active]?.other === other) return this.held[active].table;
    const { rank, channels, first, second, outward } = this;
    const table = this.inverse.map((inverse, c) => {
      const weights = new Float64Array(first * second), rows = new Float64Array(rank * (active === 0 ? first : second));
      for (let j = 0, i = 0; j < first; j++) {
        for (let q = 0; q < second; q++, i++) weights[i] = inverse[i] * other[(active === 0 ? q : j) * channels + c];
      }
      for (let k = 0, i = 0; k < rank; k++) {
        for (let j = 0, w = 0; j < first; j++) {
          if (active === 0) {
            let sum = 0;
            for (let q = 0; q < second; q++, i++, w++) sum += outward[i] * weights[w];
            rows[k * first + j] = sum;
          } else {
            for (let q = 0, to = k * second; q < second; q++, i++, w++, to++) rows[to] += outward[i] * weights[w];
          }
        }
      }
      return rows;
    });
    this.held = active === 0 ? [{ other, table }, null] : [null, { other, table }];
    return table;
  }

  /** Sets what the sums should become; true where that is news. */
  ask(state) {
    const values = this.summed.map((curve) => state[curve.index].values);
    if (this.asked?.every((each, k) => each === values[k])) return false;
    this.wanted = this.coefficients(values);
    this.asked = values;
    const { rank, wanted, shown, loudness } = this, lacking = new Float64Array(rank), order = [];
    for (let k = 0; k < rank; k++) {
      for (let c = 0; c < wanted.length; c++) lacking[k] = Math.max(lacking[k], Math.abs(wanted[c][k] - shown[c][k]) * loudness[k]);
      if (lacking[k] > 0) order.push(k);
    }
    this.order = order.sort((a, b) => lacking[b] - lacking[a]);
    return true;
  }

  /** Adds columns, the loudest change first, until all are in or the clock says `until`; whether sums changed. */
  advance(until = Infinity) {
    const before = this.order.length;
    let done = 0;
    while (done < before && (done === 0 || performance.now() < until)) {
      const columns = this.order.slice(done, done + TOGETHER);
      this.add(columns);
      for (const k of columns) for (let c = 0; c < this.channels; c++) this.shown[c][k] = this.wanted[c][k];
      done += columns.length;
    }
    this.order = this.order.slice(done);
    return done > 0;
  }

  /** sums += Σ over the columns of their numbers times what h lacks. */
  add(columns) {
    const { channels, sums, numbers, size } = this;
    const by = (n, c) => (n < columns.length ? (this.wanted[c][columns[n]] - this.shown[c][columns[n]]) * this.steps[columns[n]] : 0);
    const [i, j, k, l] = [0, 1, 2, 3].map((n) => (columns[n] ?? columns[0]) * size);
    if (channels === 1) {
      const [a, b, d, e] = [0, 1, 2, 3].map((n) => by(n, 0));
      for (let p = 0; p < size; p++) sums[p] += a * numbers[i + p] + b * numbers[j + p] + d * numbers[k + p] + e * numbers[l + p];
      return;
    }
    const [a0, a1, a2, b0, b1, b2, d0, d1, d2, e0, e1, e2] = [0, 1, 2, 3].flatMap((n) => [0, 1, 2].map((c) => by(n, c)));
    for (let p = 0; p < size; p += 3) {
      sums[p] += a0 * numbers[i + p] + b0 * numbers[j + p] + d0 * numbers[k + p] + e0 * numbers[l + p];
      sums[p + 1] += a1 * numbers[i + p + 1] + b1 * numbers[j + p + 1] + d1 * numbers[k + p + 1] + e1 * numbers[l + p + 1];
      sums[p + 2] += a2 * numbers[i + p + 2] + b2 * numbers[j + p + 2] + d2 * numbers[k + p + 2] + e2 * numbers[l + p + 2];
    }
  }

  /** The part's share of the picture (P × C) for sums of these curves: curves over θo, the pattern and senders' albedos
   *  multiply it. `things` are the object's rows. */
  addTo(picture, things, state) {
    const { channels, sums, pattern, received } = this, rows = received ? received.rows : things, albedos = this.senders?.albedos(state);
    const outgoing = this.curves.filter((curve) => this.outgoing[curve.name]).map((curve) => [this.outgoing[curve.name], state[curve.index].values]);
    for (let p = 0, i = 0; p < rows.length; p++) {
      const at = rows[p] * channels;
      for (let c = 0; c < channels; c++, i++) {
        let value = sums[i];
        for (let o = 0; o < outgoing.length; o++) value *= outgoing[o][1][outgoing[o][0][p] * channels + c];
        if (pattern) value *= pattern.values[i] * pattern.scale;
        if (albedos) value *= albedos[received.senders[p] * channels + c];
        picture[at + c] += value;
      }
    }
  }

  /** The sums of other curves, and what is shown now untouched: a part of its own that shares the numbers. */
  twin() {
    const other = Object.create(this);
    Object.assign(other, {
      sums: new Float64Array(this.size), held: [...this.held], asked: null, order: [],
      shown: this.shown.map((each) => new Float64Array(each.length)),
    });
    return other;
  }
}

/** The arrays of a part, unpacked; small ones as they are. */
async function unpackPart(given) {
  const [numbers, codes, rowScales, columnScales] = await Promise.all(["numbers", "outward", "rows", "columns"].map((name) => unpack(given[name])));
  const rank = rowScales.length, columns = columnScales.length;
  const outgoing = {};
  for (const [name, packed] of Object.entries(given.outgoing)) outgoing[name] = await unpack(packed);
  const pattern = given.pattern && { scale: given.pattern.scale, values: await unpack(given.pattern.values) };
  let received = null;
  if (given.received) {
    const [rows, senders] = await Promise.all([unpack(given.received.rows), unpack(given.received.senders)]);
    accumulate(rows, 1, rows.length);
    received = { rows, senders };
  }
  // What is read again and again is kept as floats.
  const outward = Float32Array.from(codes, (code, i) => code * rowScales[Math.floor(i / columns)] * columnScales[i % columns]);
  return { ...given, rank, numbers, outward, outgoing, pattern, received };
}
