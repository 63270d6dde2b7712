// What hands do: dragging, keys, buttons and dropped files change the state; every change asks for one redrawing.

class Controls {
  constructor(view) {
    this.view = view;
    const { state } = view;
    const set = (name, read = (value) => value, what = "picture") => (value) => { state[name] = read(value); view.changed(what); };
    const options = (...pairs) => pairs.map(([value, title, hint]) => ({ value, title, hint }));
    this.choices = {
      pieces: makeChoice(by("pieces"), options(["true", "In pieces", "Largest coefficients first, a few milliseconds a frame"], ["false", "Whole", "All at once"]), set("pieces", (value) => value === "true")),
      show: makeChoice(by("show"), options(["picture", "Page"], ["split", "Split"], ["reference", "Ref."], ["difference", "Diff."]), set("show")),
      interpolation: makeChoice(by("interpolation"), options(["vertex", "By vertex", "Colours are interpolated, as in the paper"], ["pixel", "By pixel", "K-tuples and directions are interpolated"]), set("interpolation")),
      signal: makeChoice(by("signal"), options(["false", "Black"], ["true", "In magenta"]), set("signal", (value) => value === "true")),
      suns: makeChoice(by("suns"), options(["true", "On"], ["false", "Off"]), set("suns", (value) => value === "true", "light-shown")),
      lamps: makeChoice(by("lamps"), options(["true", "On"], ["false", "Off"]), set("lamps", (value) => value === "true", "light-shown")),
      curve: makeChoice(by("tones"), options(["filmic", "Filmic"], ["srgb", "sRGB"]), set("curve", undefined, "light-shown")),
    };
    by("interpolation").lastChild.disabled = !view.stage.objects.some((each) => each.byPixel);
    by("suns").closest(".field").hidden = !view.suns.length;
    by("lamps").closest(".field").hidden = !view.lamps.length;
    this.levels = makeLevels(by("levels"), view.lights, (q, level) => { state.levels = state.levels.with(q, level); view.changed("picture"); });
    by("terms").max = view.mostTerms;
    by("kept").max = view.keptSteps.length - 1;
    const slide = (id, act) => by(id).addEventListener("input", () => act(Number(by(id).value)));
    slide("turn", (value) => this.turnTo(value));
    slide("terms", (value) => { state.terms = value; view.changed("picture"); });
    slide("kept", (value) => { state.kept = view.keptSteps[value]; view.changed("kept"); });
    slide("exposure", (value) => { state.stops = value; view.changed("picture"); });
    const click = (id, act) => by(id).addEventListener("click", act);
    click("turn-zero", () => this.turnTo(0));
    click("terms-all", () => { state.terms = view.mostTerms; view.changed("picture"); });
    click("kept-all", () => { state.kept = view.mostKept; view.changed("kept"); });
    click("exposure-auto", () => view.auto());
    click("play-button", () => this.play());
    click("reset-button", () => this.reset());
    click("help-button", () => by("help").showModal());
    click("go-reference", () => view.goToReference());
    by("file").addEventListener("change", () => { for (const file of by("file").files) this.open(file); by("file").value = ""; });
    this.skies();
    document.addEventListener("keydown", (event) => this.key(event));
    this.follow(by("canvas"));
    followDivider(by("divider"), () => ({ left: 0, width: by("picture").getBoundingClientRect().width }), () => state.split,
      (to) => { state.split = to; view.changed("picture"); });
    receiveFiles(by("drop"), (file) => this.open(file));
  }

  skies() {
    makeSkies(by("skies"), this.view, (k) => this.choose(k), () => by("file").click());
  }

  choose(k) {
    this.view.state.sky = k;
    this.say(`sky ${this.view.skies[k].name}`);
    this.view.changed("light");
  }

  say(words) {
    by("announce").textContent = words;
  }

  turnTo(degrees) {
    this.view.state.turn = wrapped(degrees);
    this.view.changed("light");
  }

  play() {
    this.view.state.turning = !this.view.state.turning;
    this.view.changed("picture");
  }

  reset() {
    this.view.orbit.reset();
    this.view.changed("moving");
  }

  /** Lights the scene by a file; what is wrong with it is said beside the skies, and the light stays as it was. */
  async open(file) {
    const note = by("light-note");
    try {
      this.view.addSky(new Uint8Array(await file.arrayBuffer()), file.name);
      note.textContent = `${file.name} lights the scene.`;
      note.className = "note";
    } catch (error) {
      note.textContent = error instanceof Trouble ? `${error.message} ${error.remedy}` : `${file.name}: ${error.message}`;
      note.className = "note wrong";
    }
  }

  key(event) {
    const { view } = this, { state, orbit } = view;
    if (event.ctrlKey || event.metaKey || event.altKey || by("help").open) return;
    const arrows = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };
    if (event.key in arrows) {
      // A focused slider keeps its arrows.
      if (event.target.matches?.("input, [role=slider]")) return;
      const [x, y] = arrows[event.key];
      event.preventDefault();
      if (event.shiftKey) this.turnTo(state.turn + 5 * x);
      else { orbit.turn(5 * x, 5 * y); view.changed("moving"); }
      return;
    }
    // A focused button keeps its space bar.
    if (event.key === " " && event.target.matches?.("button, input")) return;
    const next = (list, now) => list[(list.indexOf(now) + 1) % list.length];
    const sharp = (to) => { state.kept = view.keptSteps[clamped(view.keptSteps.indexOf(state.kept) + to, 0, view.keptSteps.length - 1)]; view.changed("kept"); };
    const terms = (to) => { state.terms = clamped(state.terms + to, 1, view.mostTerms); view.changed("picture"); };
    const zoom = (factor) => { orbit.zoom(factor); view.changed("moving"); };
    const picture = (name, value) => { state[name] = value; this.say(`${name} ${value}`); view.changed(name === "curve" ? "light-shown" : "picture"); };
    const actions = {
      " ": () => this.play(), l: () => this.choose((state.sky + 1) % view.skies.length), r: () => this.reset(),
      v: () => { if (view.atReference) picture("show", next(SHOWS, state.show)); },
      s: () => { if (view.suns.length) picture("suns", !state.suns); },
      m: () => { if (view.lamps.length) picture("lamps", !state.lamps); },
      "[": () => this.bracket(-1), "]": () => this.bracket(1), k: () => terms(-1), K: () => terms(1), n: () => sharp(-1), N: () => sharp(1),
      p: () => picture("interpolation", state.interpolation === "pixel" ? "vertex" : "pixel"), b: () => picture("signal", !state.signal),
      e: () => this.expose(-1 / 3), E: () => this.expose(1 / 3), a: () => view.auto(),
      t: () => picture("curve", state.curve === "filmic" ? "srgb" : "filmic"),
      "+": () => zoom(1.15), "=": () => zoom(1.15), "-": () => zoom(1 / 1.15), "?": () => by("help").showModal(),
    };
    view.skies.forEach((_, k) => { if (k < 9) actions[k + 1] = () => this.choose(k); });
    const action = actions[event.key] ?? actions[event.key.toLowerCase()];
    if (!action) return;
    event.preventDefault();
    action();
  }

  bracket(to) {
    const { state } = this.view;
    if (state.show === "difference") state.range = clamped(state.range * 2 ** to, 0.005, 1);
    else state.split = clamped(state.split + 0.05 * to, 0, 1);
    this.view.changed("picture");
  }

  expose(stops) {
    const { state } = this.view;
    state.stops = clamped(Math.round(10 * (state.stops + stops)) / 10, -6, 6);
    this.view.changed("picture");
  }

  /** Pointers on the picture: one turns the camera, with Shift or the right button the sky; two turn it and pinch. */
  follow(canvas) {
    const { view } = this, down = new Map();
    const place = (event) => ({ x: event.offsetX, y: event.offsetY });
    canvas.addEventListener("pointerdown", (event) => {
      canvas.setPointerCapture(event.pointerId);
      down.set(event.pointerId, place(event));
    });
    canvas.addEventListener("pointermove", (event) => {
      const before = down.get(event.pointerId), now = place(event), degrees = 180 / canvas.clientHeight;
      if (!before) return;
      const across = (now.x - before.x) * degrees;
      down.set(event.pointerId, now);
      if (down.size === 2) {
        const [other] = [...down].filter(([id]) => id !== event.pointerId).map(([, point]) => point);
        const apart = (point) => Math.hypot(point.x - other.x, point.y - other.y);
        if (apart(before) > 8 && apart(now) > 8) view.orbit.zoom(apart(now) / apart(before));
        this.turnTo(view.state.turn + across / 2);
      } else if (event.shiftKey || event.buttons & 2) {
        this.turnTo(view.state.turn + across);
      } else {
        view.orbit.turn(-across, (now.y - before.y) * degrees);
        view.changed("moving");
      }
    });
    for (const name of ["pointerup", "pointercancel"]) canvas.addEventListener(name, (event) => down.delete(event.pointerId));
    canvas.addEventListener("dblclick", () => this.reset());
    canvas.addEventListener("contextmenu", (event) => event.preventDefault());
    canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      view.orbit.zoom(Math.exp(-0.0015 * event.deltaY * (event.deltaMode === 1 ? 16 : 1)));
      view.changed("moving");
    }, { passive: false });
  }
}
