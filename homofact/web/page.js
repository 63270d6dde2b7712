// Begins: unpacks the data, sets up the stage, draws when something has changed, and only then.

class View {
  constructor(layers, mesh, notes) {
    this.layers = layers;
    this.mesh = mesh;
    this.reference = layers.length < 2 ? null : layers.find((layer) => layer.key === "source") ?? layers.at(-1);
    this.measuredTo = layers.find((layer) => layer.measuredTo !== null)?.measuredTo ?? null;
    this.took = 0;
    this.state = {
      ...structuredClone(START), visible: layers.map((layer) => layer.key), surface: mesh?.first ? "mesh" : "sphere",
      light: "sky", drag: "camera", stops: 0, difference: "off", factor: 4,
    };
    this.stage = new Stage(document.createElement("canvas"), layers, mesh);
    this.setSky(skyLight("built-in sky", ownSky()));
    this.cards = makeCards(document.getElementById("cards"), layers);
    makeNumbers(document.getElementById("numbers"), layers);
    makeTextures(document.getElementById("textures"), layers);
    const place = document.getElementById("notes");
    for (const note of notes) place.append(element("p", {}, note));
    place.hidden = !notes.length;
    this.frames = 0;
    this.firstFrameMs = null;
    this.pointed = null;
    this.pending = null;
    // The first picture comes soon, of few pixels, and is then made whole.
    this.dirty = { anew: true, moving: true };
    this.pace = 0.5;
    this.burst = 1;
    this.controls = new Controls(this);
    this.auto(true);
    this.link = new Link(this);
    this.link.first = writeLink(this.state, this.link.fields);
    this.link.restore();
    new ResizeObserver(() => this.changed(this.frames ? "layout" : "moving")).observe(document.getElementById("cards"));
    this.stage.canvas.addEventListener("webglcontextlost", (event) => {
      event.preventDefault();
      showTrouble(new Trouble("The graphics driver stopped.", "Reload the page. If it happens again, close other pages that draw much."));
    });
  }

  auto(opening = false) {
    this.state.stops = clamped(this.stage.autoStops(this.state, (this.reference ?? this.layers[0]).key), -8, 8);
    this.changed(opening ? "moving" : "shown");
  }

  setSky(sky) {
    this.stage.setSky(sky);
    this.sky = sky;
  }

  /** Another light, exposed for itself. */
  relight(light) {
    this.state.light = light;
    this.auto();
    this.changed("picture");
  }

  /** Lights the object by a .hdr file; what is wrong with it is said, and the light stays as it was. */
  async open(file) {
    try {
      this.setSky(skyLight(file.name, readHdr(new Uint8Array(await file.arrayBuffer()), file.name)));
    } catch (error) {
      this.note(error instanceof Trouble ? `${error.message} ${error.remedy}` : `${file.name}: ${error.message}`, true);
      return;
    }
    this.note(`${file.name} lights the object. It stays in this page; a link does not hold it.`);
    this.relight("sky");
  }

  /** The pictures that are shown as a PNG file. */
  async save() {
    this.draw();
    const pictures = this.layers.filter((layer) => this.state.visible.includes(layer.key)).map((layer) => (
      { title: layer.title, canvas: this.cards.get(layer.key).canvas }));
    const canvas = composed(document.title, pictures), name = fileName(document.title, this.state.surface, this.state.light);
    try {
      await saveCanvas(canvas, name);
      this.note(`Saved as ${name}.`);
    } catch (error) {
      this.note(`${error.message} ${error.remedy ?? ""}`, true);
    }
  }

  /** A line beside the controls. */
  note(words, wrong = false) {
    const place = document.getElementById("note");
    place.textContent = words;
    place.className = wrong ? "note wrong" : "note";
  }

  /** "picture" and "layout": radiance anew; "moving": likewise, and quickly; "rest": finely again; "shown": colours only. */
  changed(what) {
    if (what !== "shown") this.dirty.anew = true;
    this.dirty.moving = what === "moving";
    this.dirty.drawn = false;
    this.controls?.show();
    this.link?.keep();
    this.pending ??= requestAnimationFrame(() => this.frame());
  }

  /** Whether nothing is left to draw. */
  get idle() {
    return this.pending === null && !this.dirty.moving;
  }

  size() {
    const canvas = this.cards.get(this.state.visible[0]).canvas;
    const ratio = Math.min(window.devicePixelRatio || 1, 2);
    return [Math.max(1, Math.round(canvas.clientWidth * ratio)), Math.max(1, Math.round(canvas.clientHeight * ratio))];
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
    const { state, stage, dirty } = this, began = performance.now();
    this.layOut();
    const [width, height] = this.size();
    const compares = state.difference !== "off" && this.reference;
    const keys = new Set(state.visible);
    if (compares) keys.add(this.reference.key);
    const wanted = stage.passesWanted(state);
    const scale = dirty.moving ? this.pace : 1;
    const beganAnew = dirty.anew;
    for (let pass = 0; pass < this.burst; pass++) {
      if (dirty.anew || stage.passes < wanted) stage.gather(state, keys, width, height, scale, dirty.anew);
      dirty.anew = false;
    }
    for (const key of state.visible) {
      const { canvas, context } = this.cards.get(key);
      if (canvas.width !== width || canvas.height !== height) [canvas.width, canvas.height] = [width, height];
      stage.show(state, key, compares && key !== this.reference.key ? this.reference.key : null, context);
    }
    this.frames += 1;
    this.firstFrameMs ??= this.finished();
    if (dirty.moving) {
      this.settle(this.finished() - began);
    } else if (stage.passes < wanted) {
      const took = this.finished() - began;
      this.took = took / this.burst;
      this.hurry(took);
      this.pending = requestAnimationFrame(() => this.frame());
    }
    this.caption();
    // What is read does not change from pass to pass.
    if (!dirty.moving && (beganAnew || stage.passes >= wanted)) this.read();
  }

  /** When the GPU is done: a pixel read back waits for it. */
  finished() {
    const gl = this.stage.gl;
    gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(4));
    return performance.now();
  }

  /**
   * While something moves, slow machines draw fewer pixels, and fast ones gather more light; a moment later the picture
   * is made whole.
   */
  settle(took) {
    if (took > 60 && this.burst === 1) this.pace = Math.max(0.25, this.pace / 1.5);
    else if (took < 20 && this.pace < 1) this.pace = Math.min(1, this.pace * 1.25);
    else this.hurry(took);
    clearTimeout(this.resting);
    this.resting = setTimeout(() => this.changed("rest"), 180);
  }

  /** More passes a frame where one takes no time, fewer where frames are late. */
  hurry(took) {
    if (took > 60) this.burst = Math.max(1, Math.floor(this.burst / 2));
    else if (took < 12) this.burst = Math.min(16, 2 * this.burst);
  }

  /** Shows the cards of the visible layers, and the scales of differences. */
  layOut() {
    const { state } = this;
    for (const layer of this.layers) {
      const { card, scale } = this.cards.get(layer.key);
      card.hidden = !state.visible.includes(layer.key);
      scale.hidden = !this.compared(layer);
      if (!scale.hidden) fillScale(scale, state, layer.title, this.reference.title);
    }
  }

  /** Whether a layer's card shows its difference from the reference. */
  compared(layer) {
    return this.state.difference !== "off" && this.reference && layer !== this.reference;
  }

  /** Says beside each title how far the picture is, and what it is once it is finished. */
  caption() {
    const progress = this.progress();
    for (const layer of this.layers) {
      const { subtitle } = this.cards.get(layer.key);
      subtitle.textContent = progress || (this.compared(layer) ? "difference" : layer.volume ? "as a table" : "");
      subtitle.title = progress && "The picture is not finished: grain fades until the last pass.";
    }
  }

  /** How far the pictures are, where all passes together take over a second and a half; "" when they are finished. */
  progress() {
    const { passes } = this.stage, wanted = this.stage.passesWanted(this.state);
    return passes < wanted && this.took * wanted > 1500 ? `pass ${passes} of ${wanted}` : "";
  }

  /** The pointer is at (x, y) of a picture, in CSS pixels. */
  point(key, x, y) {
    this.pointer = { key, x, y };
    this.pointing ??= requestAnimationFrame(() => { this.pointing = null; this.read(); });
  }

  /** Fills in the values under the pointer and the curves through them. */
  read() {
    const { state, stage } = this, visible = this.layers.filter((layer) => state.visible.includes(layer.key));
    let point = null;
    if (this.pointer) {
      const canvas = this.cards.get(this.pointer.key).canvas;
      const ratio = canvas.width / Math.max(canvas.clientWidth, 1);
      point = stage.pointAt(state, this.pointer.x * ratio, this.pointer.y * ratio, canvas.width, canvas.height);
    }
    const lit = point && point.wi[2] > 0;
    const ask = (layer, wi, wo) => stage.evaluate(layer.key, Float32Array.from(wi), Float32Array.from(wo));
    fillReading(document.getElementById("reading"), point,
      lit ? visible.map((layer) => ({ title: layer.title, values: ask(layer, point.wi, point.wo) })) : []);
    const wi = lit ? point.wi : [-Math.SQRT1_2, 0, Math.SQRT1_2];
    const { lights, views, degrees } = curveDirections(wi);
    const style = getComputedStyle(document.documentElement);
    const colour = (layer) => style.getPropertyValue(colourOf(this.layers, layer.key).slice(4, -1)).trim();
    const theta = (180 / Math.PI) * fromNormal(wi);
    const side = lit ? Math.sign(-(point.wi[0] * point.wo[0] + point.wi[1] * point.wo[1])) || 1 : 0;
    const mark = lit ? side * (180 / Math.PI) * fromNormal(point.wo) : null;
    // Drawn in the order of the page's back to front: the source under its fits.
    drawCurves(document.getElementById("curve"), degrees,
      visible.toReversed().map((layer) => ({ values: stage.evaluate(layer.key, lights, views), colour: colour(layer) })), mark, theta, this.measuredTo);
    document.getElementById("curve-title").textContent = `In the plane of incidence, θi = ${theta.toFixed(0)}°`;
    document.getElementById("curve-legend").replaceChildren(...visible.map((layer) =>
      element("span", { style: `--colour: ${colourOf(this.layers, layer.key)}` }, layer.title)));
    document.getElementById("curve-measured").textContent =
      this.measuredTo === null ? "" : `Hatched: beyond ${this.measuredTo.toFixed(0)}°, the largest measured angle. There the source is extrapolated.`;
  }
}

async function prepare(layer) {
  const textures = await Promise.all(layer.textures.map(async (texture) => ({
    ...texture, rows: texture.texels.shape[0], columns: texture.texels.shape[1], type: texture.texels.type,
    texels: await unpack(texture.texels), mask: texture.mask ? await unpack(texture.mask) : null,
  })));
  return { ...layer, prefix: layer.key, textures, volume: layer.volume ? await unpackVolume(layer.volume) : null };
}

async function begin() {
  const data = JSON.parse(document.getElementById("data").textContent);
  const layers = await Promise.all(data.layers.map(prepare));
  const mesh = data.mesh ? { ...await unpackMesh(data.mesh), first: data.mesh.first } : null;
  const view = new View(layers, mesh, data.notes);
  // For programs that drive the page.
  return {
    layers: layers.map((layer) => layer.key),
    state: view.state,
    evaluate: (key, wi, wo) => view.stage.evaluate(key, wi, wo),
    changed: () => view.changed("picture"),
    // What the mesh blocks of its own light, 16 harmonics a vertex; null before it was lit by a sky.
    get blocked() { return view.stage.mesh?.blocked ?? null; },
    radiance: (key) => view.stage.radiance(key),
    auto: () => view.auto(),
    open: (file) => view.open(file),
    get sky() { return view.sky; },
    get firstFrameMs() { return view.firstFrameMs; },
    get frames() { return view.frames; },
    get idle() { return view.idle; },
    get passes() { return view.stage.passes; },
  };
}

startPage(begin);
