// Buttons, sliders, keys, dropped files, the divider and the preview's pointer: all change the page's state.

const SHOWS = ["after", "split", "before"];

class Controls {
  constructor(page) {
    this.page = page;
    const { state } = page, flags = { true: true, false: false };
    const set = (name, read, what) => (value) => { state[name] = read(value); page.changed(what); };
    const options = (...pairs) => pairs.map(([value, title, hint]) => ({ value: String(value), title, hint }));
    const named = (list) => options(...list.map((name, k) => [k, name]));
    this.choices = {
      views: makeChoice(by("views"), named(page.views.map((view) => view.name)), (value) => this.look(Number(value))),
      show: makeChoice(by("show"), options(["after", "After"], ["split", "Split"], ["before", "Before"]), set("show", String, "picture")),
      materials: makeChoice(by("materials"), named(page.data.materials.map((material) => material.name)), (value) => this.edit(Number(value))),
      tool: makeChoice(by("tool"), options(["draw", "Drawing", "Freehand (D)"], ["brush", "Brush", "Pulls what is near, smoothly (B)"], ["handles", "Handles", "A few points, smooth between (H)"]), set("tool", String, "plot")),
      channel: makeChoice(by("channel"), options(["all", "All"], ...page.data.channels.map((name, c) => [c, name])), set("channel", (value) => (value === "all" ? null : Number(value)), "plot")),
      scale: makeChoice(by("scale"), options([false, "Linear"], [true, "Log"]), set("logs", (value) => flags[value], "plot")),
      root: makeChoice(by("root"), options([false, "Even"], [true, "√ angle", "Room for small angles"]), set("root", (value) => flags[value], "plot")),
      tones: makeChoice(by("tones"), options(["filmic", "Filmic"], ["srgb", "sRGB"]), (value) => { state.tones = value; page.expose(page.start); page.changed("all"); }),
    };
    by("views").hidden = page.views.length < 2;
    by("channel").parentElement.hidden = page.data.channels.length < 2;
    const click = (id, act) => by(id).addEventListener("click", act);
    click("undo", () => page.travel("undo"));
    click("redo", () => page.travel("redo"));
    click("reset", () => page.reset());
    click("reset-all", () => page.resetAll());
    click("keep", () => this.keep());
    click("save", () => this.save());
    click("open", () => by("file").click());
    click("help-button", () => by("help").showModal());
    click("exposure-auto", () => page.auto());
    by("exposure").addEventListener("input", () => { state.stops = Number(by("exposure").value); page.changed("picture"); });
    by("file").addEventListener("change", () => { for (const file of by("file").files) this.open(file); by("file").value = ""; });
    const shapes = Object.entries(SHAPES).map(([name, { title, hint }]) => [title, hint, () => page.shape(name)]);
    fillButtons(by("shapes"), [...shapes, ["Same albedo", "times what gives the material its mean albedo before the edits", () => page.keepAlbedo()]]);
    this.fillCurves();
    this.fillKept();
    this.follow(by("canvas"));
    followDivider(by("divider"), () => page.box(), () => state.split, (to) => { state.split = to; page.changed("picture"); });
    receiveFiles(by("drop"), (file) => this.open(file));
    document.addEventListener("keydown", (event) => this.key(event));
    if (page.preview) this.orbit(by("preview"));
  }

  say(words) {
    by("announce").textContent = words;
  }

  look(view) {
    this.page.state.view = view;
    this.say(`view ${this.page.view.name}`);
    this.page.changed("all");
  }

  /** Takes a material's first curve in hand, or a curve by its number. */
  edit(material, curve = null) {
    const { page } = this, { state } = page, own = page.curvesOf(material);
    state.material = material;
    state.curve = curve ?? own[0].index;
    state.band = Math.min(state.band, page.curve.bands - 1);
    page.note("");
    this.fillCurves();
    this.say(`${page.material.name}, ${page.curve.term}, ${page.curve.name}`);
    page.changed("all");
  }

  fillCurves() {
    const { page } = this, own = page.curvesOf(page.state.material);
    by("curves").replaceChildren();
    this.choices.curves = makeChoice(by("curves"), own.map((curve) => ({ value: String(curve.index), title: `${curveInWords(curve, own)} (${curve.letters})` })),
      (value) => this.edit(page.state.material, Number(value)));
    this.fillSliders();
  }

  /** A slider for each number of the curve's model: those of several channels for the channel in hand. */
  fillSliders() {
    const { page } = this, { curve } = page;
    this.sliders = [];
    by("sliders").replaceChildren();
    fillButtons(by("presets"), presetsOf(curve).map(([title, values]) => [title, "", () => page.slide(values)]));
    by("model").hidden = !curve.formula;
    if (!curve.formula) return;
    for (const [name, range] of Object.entries(curve.formula.ranges)) {
      const low = range.logs ? Math.log(range.low) : range.low, high = range.logs ? Math.log(range.high) : range.high;
      const input = element("input", { type: "range", id: `slider-${name}`, min: low, max: high, step: (high - low) / 400, "aria-label": `${name}, ${range.hint}` });
      const output = element("output", { for: `slider-${name}` });
      const number = () => Number((range.logs ? Math.exp(Number(input.value)) : Number(input.value)).toPrecision(4));
      input.addEventListener("input", () => {
        if (!page.step) page.beginStep();
        page.slide({ [name]: this.perChannel(name, number()) }, true);
      });
      input.addEventListener("change", () => page.endStep());
      by("sliders").append(element("div", { class: "field slider" }, element("label", { class: "name", for: `slider-${name}`, title: range.hint }, name), input, output));
      this.sliders.push({ name, range, input, output });
    }
  }

  /** A slider's number as its model takes it: for all channels, or one of them. */
  perChannel(name, number) {
    const { curve, state } = this.page, now = (this.page.shown.sliders ?? curve.sliders)[name];
    return Array.isArray(now) ? now.map((value, c) => (state.channel === null || state.channel === c ? number : value)) : number;
  }

  showSliders() {
    const { curve, shown, state } = this.page, values = shown.sliders ?? curve.sliders;
    for (const { name, range, input, output } of this.sliders) {
      const list = [values[name]].flat(), value = list[state.channel ?? 0] ?? list[0], clear = Math.max(value, range.low);
      input.value = String(range.logs ? Math.log(clear) : clear);
      output.textContent = state.channel === null && new Set(list).size > 1 ? list.map((each) => Number(each.toPrecision(2))).join(" ") : String(Number(value.toPrecision(3)));
      input.setAttribute("aria-valuetext", output.textContent);
    }
    by("model-note").textContent = curve.formula && !shown.sliders ? "Drawn by hand. A slider makes the curve anew." : "";
  }

  keep() {
    const { page } = this, number = page.history.keep();
    this.fillKept();
    page.note(`${page.history.kept[number].name}: the curves as they are.`);
    page.changed("picture");
  }

  fillKept() {
    const { page } = this, { kept } = page.history;
    fillButtons(by("kept"), kept.map(({ name, state }) => [`Go to ${name}`, "", () => { page.history.put([...state]); page.changed("all"); }]));
    by("compare").replaceChildren();
    by("compare").parentElement.hidden = kept.length < 2;
    this.choices.compare = makeChoice(by("compare"), kept.map(({ name }, k) => ({ value: String(k), title: name })),
      (value) => { page.state.compare = Number(value); page.changed("picture"); });
  }

  /** Saves the edited curves as a file. */
  save() {
    const { page } = this;
    if (!page.history.changed.length) {
      page.note("Nothing is edited: there are no curves to save.");
      return;
    }
    const link = element("a", { download: "curves.json", href: URL.createObjectURL(new Blob([page.text()], { type: "application/json" })) });
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 1000);
    page.note(`curves.json: ${page.history.changed.length} edited curves, for homofact edit --apply.`);
  }

  /** Takes a file's curves, as one step; what is wrong is said, and nothing changes then. */
  async open(file) {
    try {
      this.page.load(await file.text());
      this.page.note(`${file.name} is shown.`);
    } catch (error) {
      this.page.note(`${file.name}: ${error.message}`, true);
    }
  }

  key(event) {
    const { page } = this, { state } = page;
    if (event.altKey || by("help").open || (event.target.matches?.("input[type=file]"))) return;
    if (event.ctrlKey || event.metaKey) {
      const travel = { z: event.shiftKey ? "redo" : "undo", y: "redo" }[event.key.toLowerCase()];
      if (travel) { event.preventDefault(); page.travel(travel); }
      return;
    }
    const set = (name, value, what = "plot") => { state[name] = value; this.say(`${name} ${value}`); page.changed(what); };
    const next = (list, now) => list[(list.indexOf(now) + 1) % list.length];
    const own = page.curvesOf(state.material).map((curve) => curve.index), { materials, channels } = page.data;
    const actions = {
      z: () => page.travel("undo"), Z: () => page.travel("redo"), y: () => page.travel("redo"), r: () => page.reset(), R: () => page.resetAll(),
      k: () => this.keep(), s: () => this.save(), o: () => by("file").click(), p: () => by("plot").focus(),
      m: () => this.edit((state.material + 1) % materials.length), c: () => this.edit(state.material, next(own, state.curve)),
      d: () => set("tool", "draw"), b: () => set("tool", "brush"), h: () => set("tool", "handles"),
      n: () => { if (channels.length > 1) set("channel", next([null, 0, 1, 2], state.channel)); },
      l: () => set("logs", !state.logs), x: () => set("root", !state.root), v: () => set("show", next(SHOWS, state.show), "picture"),
      "[": () => set("split", clamped(state.split - 0.05, 0, 1), "picture"), "]": () => set("split", clamped(state.split + 0.05, 0, 1), "picture"),
      e: () => this.expose(-1 / 3), E: () => this.expose(1 / 3), a: () => page.auto(),
      t: () => { state.tones = state.tones === "filmic" ? "srgb" : "filmic"; page.expose(page.start); page.changed("all"); },
      "?": () => by("help").showModal(),
    };
    page.views.forEach((_, k) => { if (k < 9) actions[k + 1] = () => this.look(k); });
    const action = actions[event.key] ?? actions[event.key.toLowerCase()];
    if (!action) return;
    event.preventDefault();
    action();
  }

  expose(stops) {
    const { page } = this;
    page.state.stops = clamped(Math.round(10 * (page.state.stops + stops)) / 10, -6, 6);
    page.changed("picture");
  }

  /** A click in the picture takes the material there in hand. */
  follow(canvas) {
    canvas.addEventListener("click", (event) => {
      const { page } = this, { view } = page, box = page.box();
      const column = Math.floor(((event.offsetX - box.left) / box.width) * view.width), row = Math.floor(((event.offsetY - box.top) / box.height) * view.height);
      if (column < 0 || row < 0 || column >= view.width || row >= view.height) return;
      const thing = view.thingAt(column, row);
      if (thing !== null && thing !== page.state.material) this.edit(thing);
    });
  }

  /** The preview: dragging and arrows turn it, with Shift or the right button the light. */
  orbit(canvas) {
    const { page } = this, { preview } = page;
    const turn = (light, across, up) => { if (light) preview.move(across, up); else preview.turn(-across, up); page.changed("preview"); };
    let last = null;
    canvas.addEventListener("pointerdown", (event) => { canvas.setPointerCapture(event.pointerId); last = [event.clientX, event.clientY]; });
    canvas.addEventListener("pointermove", (event) => {
      if (!last) return;
      const degrees = 180 / canvas.clientHeight, light = event.shiftKey || event.buttons & 2;
      turn(light, (event.clientX - last[0]) * degrees, (light ? last[1] - event.clientY : event.clientY - last[1]) * degrees);
      last = [event.clientX, event.clientY];
    });
    for (const name of ["pointerup", "pointercancel"]) canvas.addEventListener(name, () => { last = null; });
    canvas.addEventListener("dblclick", () => { preview.reset(); page.changed("preview"); });
    canvas.addEventListener("contextmenu", (event) => event.preventDefault());
    canvas.addEventListener("keydown", (event) => {
      const step = { ArrowLeft: [-5, 0], ArrowRight: [5, 0], ArrowUp: [0, 5], ArrowDown: [0, -5] }[event.key];
      if (step) { event.preventDefault(); turn(event.shiftKey, ...step); }
    });
  }
}
