// All objects under one light: changed at once, or piece by piece, the largest changes first (Overbeck et al. 2006).

class Relit {
  constructor(objects, coefficients) {
    this.objects = objects;
    this.light = new Float32Array(3 * coefficients);
    this.target = null;
    this.order = null;
    this.done = 0;
    this.kept = Infinity;
    // Numbers a millisecond, measured as it goes; a start that a slow machine holds.
    this.pace = 20000;
  }

  get coefficients() {
    return this.light.length / 3;
  }

  /** Coefficients whose change is not in the picture yet. */
  get pending() {
    return this.order ? this.order.length - this.done : 0;
  }

  /** The whole light from nothing. */
  relight(light) {
    this.light.set(light);
    this.target = this.order = null;
    this.sum();
  }

  /** Only the largest `kept` numbers of every vector count from now on. */
  keep(kept) {
    if (kept === this.kept) return;
    this.kept = kept;
    this.lengths = null;
    this.light.set(this.target ?? this.light);
    this.target = this.order = null;
    this.sum();
  }

  sum() {
    for (const object of this.objects) object.sum(this.light, this.kept);
  }

  /** Names the light that `step` will lead to. */
  ask(light) {
    const reach = this.reach(), count = this.coefficients, changes = new Float32Array(count);
    this.target = Float32Array.from(light);
    let changed = 0;
    for (let j = 0; j < count; j++) {
      let most = 0;
      for (let k = 3 * j; k < 3 * j + 3; k++) most = Math.max(most, Math.abs(light[k] - this.light[k]));
      // What reaches no vector changes nothing.
      changes[j] = most * reach[j];
      if (changes[j] > 0) changed++;
    }
    // Bits of positive floats order as the floats do: one number holds the change and, beneath it, the place.
    const bits = new Uint32Array(changes.buffer), keys = new Float64Array(count);
    for (let j = 0; j < count; j++) keys[j] = -(bits[j] * 32768 + (32767 - j));
    keys.sort();
    this.order = Uint16Array.from(keys.subarray(0, changed), (key) => 32767 - (-key % 32768));
    this.done = 0;
  }

  /** Brings in so many coefficients; how many are left. The last ones make all sums anew: then they are exact. */
  step(count) {
    if (!this.order) return 0;
    if (this.pending <= count) {
      this.relight(this.target);
      return 0;
    }
    const end = this.done + count;
    for (; this.done < end; this.done++) {
      const j = this.order[this.done], k = 3 * j;
      const change = [0, 1, 2].map((c) => this.target[k + c] - this.light[k + c]);
      for (const object of this.objects) object.addColumn(j, ...change, this.kept);
      for (let c = 0; c < 3; c++) this.light[k + c] = this.target[k + c];
    }
    return this.pending;
  }

  /** Steps for about so many milliseconds, or everything at once where that is expected to be as quick. */
  advance(milliseconds) {
    if (!this.order) return 0;
    const began = performance.now();
    const cost = this.objects.reduce((sum, object) => sum + object.cost(this.kept), 0);
    if (cost <= this.pace * milliseconds) {
      this.step(Infinity);
      this.pace = 0.7 * this.pace + 0.3 * (cost / Math.max(performance.now() - began, 0.5));
      return 0;
    }
    // At least one chunk: it ends, however slow the machine.
    do this.step(Math.min(64, this.pending)); while (this.order && performance.now() - began < milliseconds);
    return this.pending;
  }

  /** The root sum square of what each coefficient does to all vertices (J,). */
  reach() {
    if (!this.lengths) {
      this.lengths = new Float64Array(this.coefficients);
      for (const object of this.objects) object.reach(this.kept).forEach((square, j) => { this.lengths[j] += square; });
      for (let j = 0; j < this.lengths.length; j++) this.lengths[j] = Math.sqrt(this.lengths[j]);
    }
    return this.lengths;
  }
}
