// All curves of all materials, with what was before: undo, redo, and states kept by name. States are never changed.

const MOST_STATES = 200;

/** The curves of a scene in one list, each with its address, angle, bands and start. */
function curvesOf(data) {
  const channels = data.channels.length;
  return data.materials.flatMap((material, m) => material.curves.map((given) => {
    const formula = FORMULAS[given.formula] ?? null;
    const start = { values: Float64Array.from(given.start.flat()), sliders: formula ? given.sliders : null };
    return { ...given, material: m, materialName: material.name, channels, start, formula, presets: PRESETS[given.formula] };
  })).map((curve, index) => ({ ...curve, index }));
}

class History {
  constructor(curves) {
    this.curves = curves;
    this.states = [curves.map((curve) => curve.start)];
    this.now = 0;
    this.kept = [{ name: "Start", state: this.states[0] }];
  }

  /** The curves as they are: {values (J × C), sliders or null where they were drawn}. */
  get state() {
    return this.states[this.now];
  }

  /** One step: changes is [[index, curve], …]. `instead` puts it in the place of the step before, as while dragging. */
  set(changes, instead = false) {
    const next = [...this.state];
    for (const [index, curve] of changes) next[index] = curve;
    this.put(next, instead);
  }

  put(state, instead = false) {
    if (instead) {
      this.states[this.now] = state;
      return;
    }
    this.states.length = this.now + 1;
    this.states.push(state);
    // The start stays the first of all.
    if (this.states.length > MOST_STATES) this.states.splice(1, 1);
    this.now = this.states.length - 1;
  }

  undo() {
    if (this.now === 0) return false;
    this.now -= 1;
    return true;
  }

  redo() {
    if (this.now + 1 >= this.states.length) return false;
    this.now += 1;
    return true;
  }

  keep() {
    this.kept.push({ name: `Kept ${this.kept.length}`, state: this.state });
    return this.kept.length - 1;
  }

  /** Curves that are not as they started. */
  get changed() {
    return this.curves.filter((curve) => !sameValues(this.state[curve.index].values, curve.start.values));
  }
}

const sameValues = (a, b) => a === b || a.every((value, i) => value === b[i]);
