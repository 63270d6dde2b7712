// The views with their parts: radiance (P × C) of the covered pixels, as the curves are and as kept ones were.

class SceneView {
  /** `numbers` (P) of the covered pixels, `objects` (P) what each sees; parts are of this view alone. */
  constructor(given, parts) {
    Object.assign(this, given);
    this.count = given.numbers.length;
    this.parts = parts;
    this.radiance = new Float32Array(this.count * given.channels);
    const rows = new Map();
    given.objects.forEach((thing, p) => { if (!rows.has(thing)) rows.set(thing, []); rows.get(thing).push(p); });
    this.things = [...rows].map(([thing, list]) => ({ thing, rows: Uint32Array.from(list), parts: parts.filter((part) => part.thing === thing), state: null }));
    this.before = { state: null, radiance: null };
  }

  /** Brings the radiance nearer to these curves, until it is there or the clock says `until`; whether it changed. */
  update(state, until = Infinity) {
    let changed = false;
    for (const each of this.things) {
      let news = false;
      for (const part of each.parts) part.ask(state);
      // The part that lacks most columns does not make the others wait for all of it.
      for (const part of each.parts.toSorted((a, b) => a.order.length - b.order.length)) news = part.advance(until) || news;
      const factors = each.state === null || each.parts.some((part) => part.watched.some((curve) => each.state[curve.index] !== state[curve.index]));
      if (!news && !factors) continue;
      each.state = state;
      this.gather(each, state);
      changed = true;
    }
    return changed;
  }

  /** The object's pixels anew, from the sums of its parts. */
  gather({ rows, parts }, state) {
    const { channels, radiance } = this;
    for (const row of rows) radiance.fill(0, row * channels, (row + 1) * channels);
    for (const part of parts) part.addTo(radiance, rows, state);
  }

  /** Columns that are still to be added. */
  get pending() {
    return this.parts.reduce((sum, part) => sum + part.order.length, 0);
  }

  /** Radiance (P × C) of other curves; the last one asked for is kept. */
  other(state) {
    if (this.before.state === state) return this.before.radiance;
    const radiance = new Float32Array(this.radiance.length);
    for (const { rows, parts } of this.things) {
      for (const part of parts) {
        const twin = part.twin();
        twin.ask(state);
        twin.advance();
        twin.addTo(radiance, rows, state);
      }
    }
    this.before = { state, radiance };
    return radiance;
  }

  /** The material's number at a pixel of the picture, or null beside all objects. */
  thingAt(column, row) {
    const wanted = row * this.width + column;
    let low = 0, high = this.count;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (this.numbers[middle] < wanted) low = middle + 1; else high = middle;
    }
    return this.numbers[low] === wanted ? this.objects[low] : null;
  }
}

/** All views of the page's data, with parts that know the curves of `history`, and the senders of light. */
async function unpackScene(data, curves, senders, meshes, sky) {
  const channels = data.channels.length;
  const parts = await Promise.all(data.parts.map(async (given) => new Part(
    await unpackPart(given), curves.filter((curve) => curve.material === given.thing && curve.term === given.term), channels, data.floor, senders)));
  return Promise.all(data.views.map(async (given, number) => {
    const [numbers, objects, normals, depth] = await Promise.all(["numbers", "objects", "normals", "depth"].map((name) => unpack(given[name])));
    accumulate(numbers, 1, numbers.length);
    const seen = { ...given, numbers, objects, normals, depth, channels };
    const surroundings = new Surroundings(seen, meshes, sky), range = rangeOf(seen, meshes);
    return new SceneView({ ...seen, surroundings, range }, parts.filter((part) => part.view === number));
  }));
}
