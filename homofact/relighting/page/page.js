// Begins: unpacks the data, lights the objects, draws when something has changed, and only then.

// A frame's share for light, in milliseconds, while it comes in piece by piece.
const LIGHT_BUDGET = 14;
// Degrees a second.
const TURNS = 24;
// How a picture is drawn while it moves, from fine to quick: a part of the width and height, whether edges are smooth,
// whether with fewer triangles.
const LEVELS = [[1, true, false], [1, false, false], [1, false, true], [0.71, false, true], [0.5, false, true]];
const SLOW = 45, QUICK = 20, REST = 220, PAUSE = 1000;
const TELLING = 150;

class View {
  constructor(data, objects, skies) {
    this.objects = objects;
    this.skies = skies;
    this.suns = data.suns;
    this.lamps = data.lamps;
    this.lights = [...data.suns, ...data.lamps];
    this.reference = data.reference;
    this.judged = data.numbers.some(([, rows]) => rows.some(([name]) => name.startsWith("error, ")));
    this.orbit = new Orbit(data.camera);
    this.mostTerms = Math.max(...objects.map((object) => object.terms));
    this.mostKept = Math.max(...objects.map((object) => object.longest));
    this.keptSteps = keptSteps(this.mostKept);
    this.state = {
      sky: data.reference?.sky ?? 0, turn: 0, terms: this.mostTerms, kept: this.mostKept, interpolation: "vertex", signal: false,
      stops: 0, curve: "filmic", show: "picture", split: 0.5, range: 0.1, pieces: true, turning: false, suns: true, lamps: true,
      levels: this.lights.map(() => 1),
    };
    for (const object of objects) if (object.reference) object.seen = withReference(object, this.orbit.eye);
    this.relit = new Relit(objects, 6 * data.cube ** 2);
    this.divisions = Math.max(0, ...objects.map((object) => object.lobe?.divisions ?? 0));
    this.stage = new Stage(by("canvas"), objects, this.lights);
    this.highlights = new Highlights(this);
    this.times = { light: null, view: null };
    this.frames = 0;
    this.firstFrameMs = this.pending = this.before = null;
    this.lightBudget = LIGHT_BUDGET;
    this.level = this.pace = 0;
    this.last = null;
    this.moving = false;
    by("objects").textContent = objectsInWords(objects);
    makeTables(by("numbers"), data.numbers);
    this.turner = new Turner((sky, light) => this.arrive(sky, light));
    const { cube, coefficients } = this.sky.light(0);
    this.relit.relight(coefficients);
    this.lightCells(cube);
    this.lit = this.sky;
    this.bring();
    this.expose();
    this.controls = new Controls(this);
    by("loading").remove();
    new ResizeObserver(() => this.changed("picture")).observe(by("picture"));
    this.changed("picture");
    by("canvas").addEventListener("webglcontextlost", (event) => {
      event.preventDefault();
      showTrouble(new Trouble("The graphics driver stopped.", "Reload the page. If it happens again, close other pages that draw much."));
    });
  }

  get sky() {
    return this.skies[this.state.sky];
  }

  /** Whether the suns shine: they belong to the scene's own sky. */
  get sunny() {
    return this.state.suns && this.state.sky === 0;
  }

  /** How bright each light is, of its own brightness; 0 where it is off. Lamps belong to the scene under every sky. */
  get shining() {
    return this.lights.map((light, q) => ((light.position ? this.state.lamps : this.sunny) ? this.state.levels[q] : 0));
  }

  /** The levels of the lamps whose light surfaces send on to one another, as text; null where none do. */
  get bouncingLamps() {
    return this.bouncing(this.shining.slice(this.suns.length));
  }

  /** The levels and the turn of the suns whose light surfaces send on to one another, as text; null where none do. */
  get bouncingSuns() {
    const levels = this.bouncing(this.shining.slice(0, this.suns.length));
    return levels && `${levels} ${this.state.turn}`;
  }

  bouncing(levels) {
    return levels.some(Boolean) && this.objects.some((object) => object.bounced) ? levels.join(" ") : null;
  }

  /** Whether suns and lamps shine as the scene's file has them. */
  get lightsAsGiven() {
    return this.state.suns && this.state.lamps && this.state.levels.every((level) => level === 1);
  }

  /** Whether light and camera are those that the reference was made for. */
  get atReference() {
    return Boolean(this.reference) && this.state.sky === this.reference.sky && this.state.turn === 0 && this.lightsAsGiven && this.orbit.atStart;
  }

  /** What is drawn: the picture alone where the reference does not hold. */
  get shown() {
    return this.atReference ? this.state.show : "picture";
  }

  goToReference() {
    Object.assign(this.state, { sky: this.reference.sky, turn: 0, turning: false, suns: true, lamps: true, levels: this.lights.map(() => 1) });
    this.orbit.reset();
    this.changed("light");
  }

  /** A sky of a file's bytes, chosen at once. Throws Trouble. */
  addSky(bytes, name) {
    this.skies.push(new Sky(name.replace(/\.[^.]*$/, ""), readHdr(bytes, name), Math.sqrt(this.relit.coefficients / 6)));
    this.controls.skies();
    this.controls.choose(this.skies.length - 1);
  }

  /** "light": sky or turn; "kept": N; "light-shown": exposure anew; "picture" and "moving": the picture alone. */
  changed(what) {
    this.moving = what === "moving" || what === "light";
    if (what === "light") this.lightAsked = true;
    if (what === "kept") this.keptAsked = true;
    if (what === "light-shown") this.expose();
    this.pending ??= requestAnimationFrame((now) => this.frame(now));
  }

  frame(now) {
    this.pending = null;
    try {
      this.draw(now);
    } catch (error) {
      showTrouble(error);
    }
  }

  draw(now) {
    const { state, relit } = this, began = performance.now();
    if (state.turning) {
      state.turn = wrapped(state.turn + (TURNS * Math.min(now - (this.before ?? now), 100)) / 1000);
      this.lightAsked = true;
    }
    this.before = state.turning ? now : null;
    if (this.update() || this.bouncedSuns !== this.bouncingSuns || this.bouncedLamps !== this.bouncingLamps) {
      this.bring();
      if (!relit.pending && this.exposed !== this.lit) this.expose();
      this.times.light = performance.now() - began;
    }
    this.paint();
    this.frames += 1;
    this.firstFrameMs ??= performance.now();
    this.tell();
    if (state.turning || relit.pending) this.pending ??= requestAnimationFrame((next) => this.frame(next));
    this.readSoon();
  }

  /** The words beside the picture: at once, or a few times a second while things move, since they cost as much as it. */
  tell() {
    if (performance.now() - (this.told ?? -Infinity) > TELLING || !this.busy) {
      this.told = performance.now();
      showState(this);
      showStatus(this);
    }
  }

  get busy() {
    return this.moving || this.state.turning || this.relit.pending > 0 || this.turner.busy;
  }

  /** Whether the picture and all that is said of it are those of the state: for programs that drive the page. */
  get idle() {
    const asked = this.pending !== null || this.lightAsked || this.keptAsked || this.arrived;
    return !asked && !this.busy && !this.resting && !this.reading && !this.highlights.pending;
  }

  /** Draws: finely at rest; while something moves as finely as keeps up, by the time from frame to frame. */
  paint() {
    const moving = this.busy, began = performance.now();
    const [scale, smooth, coarse] = LEVELS[moving ? this.level : 0];
    this.highlights.stop();
    this.fit(scale);
    this.stage.draw(this, smooth, coarse);
    clearTimeout(this.resting);
    this.resting = null;
    if (!moving) {
      this.stage.finish();
      this.times.view = performance.now() - began;
      this.last = null;
      this.highlights.begin();
      return;
    }
    if (this.last !== null && began - this.last < PAUSE) {
      this.times.view = began - this.last;
      // Of a slow card's frames every other one seems quick: finer only where the last few were.
      this.pace = 0.6 * this.pace + 0.4 * this.times.view;
      if (this.times.view > SLOW) this.level = Math.min(this.level + 1, LEVELS.length - 1);
      else if (this.pace < QUICK) this.level = Math.max(this.level - 1, 0);
    }
    this.last = began;
    this.resting = setTimeout(() => { this.resting = null; this.changed("picture"); }, REST);
  }

  /** Brings the sums in line with sky, turn and N, or nearer to it; whether they changed. */
  update() {
    const { state, relit } = this;
    if (this.lightAsked && state.turn === 0) {
      this.turner.forget();
      this.arrived = [this.sky, this.sky.light(0)];
    } else if (this.lightAsked) {
      this.turner.ask(this.sky, state.turn);
    }
    this.lightAsked = false;
    if (!this.keptAsked && !this.arrived && !relit.pending) return false;
    if (this.keptAsked) relit.keep(state.kept);
    if (this.arrived) {
      const [sky, { cube, coefficients }] = this.arrived;
      this.lit = sky;
      if (state.pieces) relit.ask(coefficients); else relit.relight(coefficients);
      // Separate lobes have all of a new light at once.
      this.lightCells(cube);
    }
    this.keptAsked = false;
    this.arrived = null;
    relit.advance(this.lightBudget);
    return true;
  }

  /** A turned sky's light, which may be a few frames old while the sky is turning; another sky's is no longer wanted. */
  arrive(sky, light) {
    if (sky !== this.sky) return;
    this.arrived = [sky, light];
    // What passed since the last frame was no drawing.
    if (!this.state.turning) this.last = null;
    this.pending ??= requestAnimationFrame((now) => this.frame(now));
  }

  /** Mixes the vertices' K-tuples and brings them to the graphics card. */
  bring() {
    this.bouncedSuns = this.bouncingSuns;
    this.bouncedLamps = this.bouncingLamps;
    const levels = this.shining, suns = this.suns.map((sun, q) => ({ ...sun, irradiance: scaled(sun.irradiance, levels[q]) }));
    const spread = this.bouncedSuns === null ? null : spreadSuns(suns, this.state.turn, this.sky.size);
    const lamps = this.lamps.map(({ intensity }, q) => scaled(intensity, levels[this.suns.length + q]));
    for (const object of this.objects) {
      object.sumSuns(spread);
      object.sumLamps(this.bouncedLamps === null ? null : lamps);
      object.mix();
    }
    this.stage.upload();
  }

  /** The light of separate lobes, where there are any. */
  lightCells(radiance) {
    if (!this.stage.cells) return;
    this.cells = lightCells(radiance, this.sky.size, this.divisions);
    this.stage.cells.upload(this.cells);
  }

  /** Radiance (3 V) of each object's vertices, on the processor. */
  shade() {
    const { eye } = this.orbit;
    return this.objects.map((object) => {
      const found = shade(object, eye, this.state.terms);
      if (object.lobe) addLobe(object, eye, this.cells, found);
      return object.sunlight ? addLights(object, eye, this.lights, this.state.turn, this.shining, found) : found;
    });
  }

  /** The exposure of this sky: a new sky has a scale of its own. */
  expose() {
    this.exposed = this.lit;
    this.stops = this.stage.meter.stops(this);
  }

  auto() {
    this.state.stops = 0;
    this.changed("light-shown");
  }

  fit(scale = 1) {
    const { canvas } = this.stage, ratio = scale * Math.min(window.devicePixelRatio || 1, 2);
    const [width, height] = [canvas.clientWidth, canvas.clientHeight].map((x) => Math.max(1, Math.round(x * ratio)));
    if (canvas.width !== width || canvas.height !== height) [canvas.width, canvas.height] = [width, height];
  }

  /** The figures take longer than a frame may: once nothing moves, or where it moves slower than that. */
  readSoon() {
    clearTimeout(this.reading);
    this.reading = setTimeout(() => {
      this.reading = null;
      showError(this, this.statistics());
    }, this.busy ? 600 : 120);
  }

  /** The part of the light below zero, and the error against the reference where it holds. */
  statistics() {
    const colours = this.shade();
    const compared = this.atReference && !this.relit.pending;
    const errors = compared ? relativeRms(this.objects, colours) : [null];
    return { below: shareBelowZero(colours), error: errors.at(-1), errors: errors.slice(0, -1) };
  }
}

/** Which vertices (V) have a reference and face the eye, 1 or 0; the others' is set to 0. */
function withReference({ positions, normals, vertices, reference }, eye) {
  return Float32Array.from({ length: vertices }, (_, v) => {
    let facing = 0;
    for (let p = 3 * v; p < 3 * v + 3; p++) facing += normals[p] * (eye[p - 3 * v] - positions[p]);
    const given = facing > 0 && !Number.isNaN(reference[3 * v]);
    if (!given) reference.fill(0, 3 * v, 3 * v + 3);
    return given ? 1 : 0;
  });
}

/** 1 … most in steps of about a fifth. */
function keptSteps(most) {
  const steps = [];
  for (let step = 1; step < most; step = Math.max(step + 1, Math.round(step * 1.19))) steps.push(step);
  return [...steps, most];
}

async function begin() {
  const data = restored(JSON.parse(by("data").textContent));
  // A browser without WebGL 2 is told before anything is unpacked.
  openContext(document.createElement("canvas"));
  const objects = await Promise.all(data.objects.map((object) => unpackTransport(object, 6 * data.cube ** 2, data.suns.length + data.lamps.length)));
  const skies = await Promise.all(data.skies.map((sky) => unpackSky(sky, data.cube)));
  const view = new View(data, objects, skies);
  // For programs that drive the page.
  return {
    view,
    state: view.state,
    environmentCube,
    lightCells,
    lobeRadiance,
    objectsInWords,
    readHdr,
    changed: (what = "light") => view.changed(what),
    pixels() {
      view.fit();
      view.stage.draw(view, false);
      return view.stage.pixels();
    },
    get firstFrameMs() { return view.firstFrameMs; },
    get frames() { return view.frames; },
    get idle() { return view.idle; },
  };
}

startPage(begin);
