// Begins: unpacks the data, shows the scene, and after each change brings picture, plot, preview and words up to date.

// A frame's share for the picture's sums, in milliseconds, while an edit comes in piece by piece.
const BUDGET = 16;
const TELLING = 120, QUIET = 90, READING = 500, SETTLING = 150;
// While something is dragged the preview follows at every so many frames.
const PREVIEW_EVERY = 4;

class Page {
  constructor(data, curves, views, furnaces, materials, [meshes, sky]) {
    Object.assign(this, { data, curves, views, furnaces, materials, meshes, sky });
    this.history = new History(curves);
    this.state = {
      view: 0, material: 0, curve: 0, tool: "brush", channel: null, logs: false, root: true, band: 0, show: "after", compare: 0,
      split: 0.5, stops: 0, tones: "filmic",
    };
    // The first curve that the picture depends on most plainly: a specular one where there is one.
    const first = curves.find((curve) => curve.angle !== "theta_i" && curve.angle !== "theta_o") ?? curves[0];
    Object.assign(this.state, { material: first.material, curve: first.index, root: first.finer, band: Math.floor(first.bands / (first.finer ? 4 : 8)) });
    this.budget = BUDGET;
    this.times = { edit: null };
    this.frames = 0;
    this.firstFrameMs = this.pending = this.step = this.axisHeld = null;
    this.todo = new Set(["all"]);
    this.tones = new Tones();
    this.images = new Map();
    this.makeSettled();
    this.plot = new Plot(by("plot"));
    this.hands = new Hands(by("plot"), this.plot, this);
    makeTables(by("numbers"), data.numbers);
    this.makePreview();
    this.controls = new Controls(this);
    this.view.update(this.history.state);
    this.expose(this.start);
    by("loading").remove();
    new ResizeObserver(() => this.changed("all")).observe(by("picture"));
    new ResizeObserver(() => this.changed("plot")).observe(by("plot"));
    this.changed("all");
  }

  /** Without WebGL 2 the small picture stays. */
  makeSettled() {
    this.settled = null;
    by("settled").addEventListener("webglcontextlost", () => {
      this.settled = null;
      by("settled").hidden = true;
      showStatus(this);
    });
    try {
      this.settled = new Settled(by("settled"), this.meshes, this.sky);
    } catch (error) {
      // No WebGL 2, or a context that was lost at once.
      console.info(String(error));
    }
  }

  /** The preview draws with WebGL 2 too: without it the rest of the page works. */
  makePreview() {
    this.preview = null;
    by("preview").addEventListener("webglcontextlost", () => { this.preview = null; });
    try {
      this.preview = new Preview(by("preview"), this.materials, this.data.channels.length);
    } catch (error) {
      by("preview-place").replaceChildren(element("p", { class: "note", id: "no-preview" },
        error instanceof Trouble ? "The preview sphere is drawn with WebGL 2, which is not available here. Everything else works without it." : String(error)));
    }
  }

  get view() { return this.views[this.state.view]; }
  get start() { return this.history.states[0]; }
  get curve() { return this.curves[this.state.curve]; }
  get material() { return this.data.materials[this.state.material]; }
  get shown() { return this.history.state[this.state.curve]; }
  get values() { return this.shown.values; }

  curvesOf(material) { return this.curves.filter((curve) => curve.material === material); }

  /** The plot's axis; held while a curve is dragged, so that it does not run away under the pointer. */
  get axis() {
    return this.axisHeld ?? axisOf([this.values, this.curve.start.values], this.state.logs);
  }

  note(words, wrong = false) {
    by("note").textContent = words;
    by("note").className = wrong ? "note wrong" : "note";
  }

  beginStep() {
    this.axisHeld = this.axis;
    this.step = { begun: false };
  }

  endStep() {
    this.step = this.axisHeld = null;
    this.changed("all");
  }

  /** Gives the curve in hand new values, within the step that is being made or as one of its own. */
  setValues(values, sliders = null) {
    if (sameValues(values, this.values)) return;
    if (!values.some((value) => value > 0)) {
      this.note("A curve that is 0 everywhere leaves nothing to see: it stays as it was.", true);
      return;
    }
    this.note("");
    this.history.set([[this.state.curve, { values, sliders }]], Boolean(this.step?.begun));
    if (this.step) this.step.begun = true;
    this.changed("curves");
  }

  /** One step of its own. */
  edit(values) {
    this.setValues(values);
    this.changed("all");
  }

  /** A shape of the whole curve as one step, or a note where it would change nothing. */
  shape(name) {
    const found = shaped(name, this.values, this.curve, this.state.channel);
    if (alike(found, this.values)) this.note(unchangedBy(name, this.state.channel));
    else this.edit(found);
  }

  /** The curve times a number, one for each channel, with which the material has its mean albedo before the edits again. */
  keepAlbedo() {
    const { curve, data, state } = this, { channels } = curve, furnace = this.furnaces[state.material], now = this.history.state;
    const mean = (curves, terms = null) => meanAlbedo(furnace.albedo(curves, terms), data.furnace.mean, channels);
    const before = mean(this.curves.map(({ start }) => start)), whole = mean(now), own = mean(now, [curve.term]);
    // The other terms stay as they are; a curve over both directions multiplies twice.
    const power = 1 / furnace.times(curve);
    const factors = own.map((value, c) => (state.channel === null || state.channel === c ? ((before[c] - whole[c] + value) / value) ** power : 1));
    const found = this.values.map((value, i) => value * factors[i % channels]);
    if (!factors.every((factor) => factor > 0 && factor < Infinity)) this.note("No factor of this curve gives the material its albedo back.", true);
    else if (alike(found, this.values)) this.note("The material has its albedo before the edits.");
    else this.edit(found);
  }

  /** The curve from its model's numbers; those that are not named stay as they are. */
  slide(values, partly = false) {
    const { curve } = this, sliders = { ...(this.shown.sliders ?? curve.sliders), ...values };
    this.setValues(bandedFormula(curve, sliders), sliders);
    if (!partly) this.changed("all");
  }

  travel(way) {
    if (this.history[way]()) this.controls.say(way);
    this.changed("all");
  }

  reset() {
    if (sameValues(this.values, this.curve.start.values)) return;
    this.history.set([[this.state.curve, this.curve.start]]);
    this.changed("all");
  }

  resetAll() {
    if (!this.history.changed.length) return;
    this.history.put([...this.start]);
    this.changed("all");
  }

  /** The edited curves as a file's text, and a file's curves as one step. Throws Trouble. */
  text() {
    return curvesText(this.data.file, this.data.channels, this.history.changed, this.history.state);
  }

  load(text) {
    this.history.set(readCurves(text, this.data.file, this.data.channels, this.curves));
    this.changed("all");
  }

  /** The exposure that goes with a state's picture. */
  expose(state) {
    this.stops = automaticStops(state === this.history.state ? this.view.radiance : this.view.other(state), this.data.channels.length);
    this.state.stops = 0;
  }

  auto() {
    this.expose(this.history.state);
    this.changed("picture");
  }

  /** "curves", "picture", "plot", "preview", or "all". */
  changed(what) {
    this.todo.add(what);
    this.pending ??= requestAnimationFrame(() => this.frame());
  }

  frame() {
    this.pending = null;
    try {
      this.draw();
    } catch (error) {
      showTrouble(error);
    }
  }

  draw() {
    const began = performance.now(), { todo, view, history } = this, all = todo.has("all"), edited = todo.has("curves");
    this.todo = new Set();
    const news = view.update(history.state, began + this.budget);
    if (news || all || todo.has("picture")) this.paint();
    if (edited) this.times.edit = performance.now() - began;
    if (all || edited || todo.has("plot")) this.drawPlot();
    const dragged = Boolean(this.step);
    this.previewDue ||= all || edited || todo.has("preview");
    if (this.preview && this.previewDue && (!dragged || this.frames % PREVIEW_EVERY === 0)) {
      this.preview.draw(this.state.material, history.state, this.start, this.state.tones);
      this.previewDue = false;
    }
    this.frames += 1;
    this.firstFrameMs ??= performance.now();
    if (!dragged || began - (this.told ?? -Infinity) > TELLING) this.tell(began);
    // An edit may take several frames, of which the last ones edit nothing.
    this.readingDue ||= all || edited;
    if (view.pending) this.changed("picture");
    else if (this.readingDue) {
      this.readingDue = false;
      this.readSoon();
    }
  }

  tell(now) {
    this.told = now;
    showState(this);
    showStatus(this);
    showPoint(this);
  }

  drawPlot() {
    const { state } = this, plot = by("plot");
    this.plot.draw({
      curve: this.curve, values: this.values, axis: this.axis, root: state.root, channel: state.channel, band: state.band,
      handles: state.tool === "handles" ? handlesOf(this.curve) : null, focused: document.activeElement === plot,
    });
  }

  /** The picture onto its canvas. */
  paint() {
    const { view, state, history } = this, canvas = by("canvas");
    if (!this.images.has(view)) {
      this.images.set(view, { image: Tones.empty(view), whole: [0, 1].map(() => new Float32Array(3 * view.width * view.height)) });
    }
    const { image, whole } = this.images.get(view), filled = (radiance, k) => view.surroundings.filled(view, radiance, whole[k]), cut = state.show === "split" ? Math.round(state.split * view.width) : view.width;
    const before = state.show === "after" ? null : view.other(history.kept[state.compare].state);
    this.tones.set(2 ** (this.stops + state.stops), state.tones);
    this.tones.paint(image.data, view.width, filled(view.radiance, 0), before && filled(before, 1), cut);
    if (canvas.width !== view.width || canvas.height !== view.height) {
      [canvas.width, canvas.height] = [view.width, view.height];
      by("picture").style.setProperty("--aspect", `${view.width} / ${view.height}`);
    }
    canvas.getContext("2d", { willReadFrequently: true }).putImageData(image, 0, 0);
    const box = this.box();
    by("settled").hidden = true;
    this.settleSoon();
    Object.assign(by("divider").style, { left: `${box.left + state.split * box.width}px`, top: `${box.top}px`, height: `${box.height}px`, bottom: "auto" });
  }

  /** Once nothing has moved for a moment. */
  settleSoon() {
    clearTimeout(this.settling);
    if (!this.settled) return;
    this.settling = setTimeout(() => {
      if (this.step || this.view.pending || this.pending !== null) this.settleSoon();
      else this.settle();
    }, SETTLING);
  }

  /** The picture in the window's own pixels, over the small one. */
  settle() {
    const { view, state, history, settled } = this, ratio = Math.min(window.devicePixelRatio || 1, 2), { width, height } = this.box();
    if (!settled || !(width > 0)) return;
    const before = state.show === "after" ? null : view.other(history.kept[state.compare].state), cut = state.show === "split" ? state.split : 1;
    settled.draw(view, view.radiance, before, cut, [width * ratio, height * ratio], 2 ** (this.stops + state.stops), state.tones);
    by("settled").hidden = false;
    showStatus(this);
  }

  /** Where the picture lies in its place, in CSS pixels: as large as fits. */
  box() {
    const { clientWidth, clientHeight } = by("canvas"), { width, height } = this.view, scale = Math.min(clientWidth / width, clientHeight / height);
    return { left: (clientWidth - scale * width) / 2, top: (clientHeight - scale * height) / 2, width: scale * width, height: scale * height };
  }

  /** The albedo takes longer than a frame may: once nothing has moved for a moment, and now and then in a drag. */
  readSoon() {
    clearTimeout(this.reading);
    const since = performance.now() - (this.read ?? -Infinity);
    this.reading = setTimeout(() => {
      this.read = performance.now();
      const furnace = this.furnaces[this.state.material];
      showAlbedo(furnace, furnace.albedo(this.history.state), this.data.channels);
      if (!this.step) this.tell(performance.now());
    }, this.step ? Math.max(QUIET, READING - since) : QUIET);
  }
}

async function begin() {
  const data = JSON.parse(by("data").textContent), curves = curvesOf(data);
  const scene = await unpackMeshes(data), furnaces = await Promise.all(data.materials.map((material, number) => unpackFurnace(material, number, data, curves)));
  const [views, materials] = await Promise.all([unpackScene(data, curves, new Senders(data, furnaces), ...scene), unpackPreviews(data, curves)]);
  const page = new Page(data, curves, views, furnaces, materials, scene);
  // For programs that drive the page.
  return {
    page,
    state: page.state,
    bandedFormula,
    FORMULAS,
    shapes: { drawn, pulled, bell, hatOf, handlesOf, shaped },
    /** Radiance of a view with the curves as they are, all columns in. */
    radiance(number) {
      page.views[number].update(page.history.state);
      return page.views[number].radiance;
    },
    changed: (what = "all") => page.changed(what),
    get firstFrameMs() { return page.firstFrameMs; },
    get frames() { return page.frames; },
  };
}

startPage(begin);
