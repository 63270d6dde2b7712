// What hands do: dragging, keys and buttons change the state; every change asks for one redrawing.

const START = {
  camera: { azimuth: 0, elevation: 0 },
  // The light of the project's own pictures, (0.5, 0.5, 0.7071).
  lightFrom: { azimuth: 35.264389682754654, elevation: 30 },
  zoom: 1,
};

/** Turns the camera or the light by degrees; what is dragged follows the pointer. */
function turn(state, what, across, up) {
  const sign = what === "camera" ? -1 : 1;
  const angles = state[what];
  angles.azimuth = wrapped(angles.azimuth + sign * across);
  angles.elevation = clamped(angles.elevation + sign * up, what === "camera" ? -89 : -90, what === "camera" ? 89 : 90);
}

class Controls {
  /** `view` has state, layers, cards, mesh and the functions changed(what), point(key, x, y), auto(). */
  constructor(view) {
    this.view = view;
    const { state, layers } = view;
    const set = (name) => (value) => { state[name] = value; view.changed("picture"); };
    this.choices = {
      layers: makeChoice(by("layers"), layers.map((layer, k) => ({ value: layer.key, title: layer.title, hint: `Key ${k + 1}` })), (key) => this.toggle(key)),
      surface: makeChoice(by("surface"), [{ value: "sphere", title: "Sphere" }, { value: "mesh", title: view.mesh ? view.mesh.name : "Mesh" }], set("surface")),
      light: makeChoice(by("light"), [["sky", "Sky"], ["directional", "Point"], ["overcast", "Overcast"], ["studio", "Studio"]].map(([value, title]) => ({ value, title })), (value) => view.relight(value)),
      drag: makeChoice(by("drag"), [{ value: "camera", title: "Turns camera" }, { value: "lightFrom", title: "Moves light" }], (value) => { state.drag = value; this.show(); }),
      difference: makeChoice(by("difference"), [["off", "Off"], ["signed", "Signed"], ["absolute", "Abs."], ["ratio", "Ratio"]].map(([value, title]) => ({ value, title })), set("difference")),
    };
    by("surface-field").hidden = !view.mesh;
    by("difference-field").hidden = by("factor-field").hidden = !view.reference;
    this.exposure = by("exposure");
    this.exposure.addEventListener("input", () => { state.stops = Number(this.exposure.value); view.changed("shown"); });
    by("exposure-auto").addEventListener("click", () => view.auto());
    this.factor = by("factor");
    this.factor.addEventListener("input", () => { state.factor = 2 ** Number(this.factor.value); view.changed("shown"); });
    by("textures-button").addEventListener("click", () => this.toggleTextures());
    by("reset-button").addEventListener("click", () => this.reset());
    by("save-button").addEventListener("click", () => view.save());
    by("open-button").addEventListener("click", () => by("file").click());
    by("file").addEventListener("change", () => { for (const file of by("file").files) view.open(file); by("file").value = ""; });
    receiveFiles(by("drop"), (file) => view.open(file));
    by("help-button").addEventListener("click", () => by("help").showModal());
    document.addEventListener("keydown", (event) => this.key(event));
    for (const [key, card] of view.cards) this.follow(key, card.canvas);
    this.show();
  }

  /** Brings the buttons, sliders and words in line with the state. */
  show() {
    const { state } = this.view, by = (id) => document.getElementById(id);
    this.choices.layers(state.visible);
    for (const name of ["surface", "light", "drag", "difference"]) this.choices[name]([state[name]]);
    this.exposure.value = state.stops;
    const stops = Math.abs(state.stops) < 0.05 ? "0" : `${state.stops > 0 ? "+" : "−"}${Math.abs(state.stops).toFixed(1)}`;
    by("exposure-value").textContent = `${stops} stops`;
    this.factor.value = Math.log2(state.factor);
    this.factor.disabled = state.difference === "off";
    by("factor-value").textContent = `× ${state.factor}`;
    const sign = (text) => text.replaceAll("-", "−"), at = ({ azimuth, elevation }) => `${azimuth.toFixed(0)}° / ${elevation.toFixed(0)}°`;
    const light = { directional: "light", studio: "key light", overcast: "zenith" }[state.light];
    const lit = light ? `${light} ${at(state.lightFrom)}` : `${this.view.sky.name} turned by ${state.lightFrom.azimuth.toFixed(0)}°`;
    by("angles").textContent = sign(`Azimuth / elevation: camera ${at(state.camera)}, `) + (light ? sign(lit) : lit);
    by("textures-button").setAttribute("aria-pressed", String(!by("textures").hidden));
  }

  say(words) {
    document.getElementById("announce").textContent = words;
  }

  toggle(key) {
    const { state, layers } = this.view;
    const now = new Set(state.visible);
    if (now.has(key) && now.size > 1) now.delete(key); else now.add(key);
    state.visible = layers.map((layer) => layer.key).filter((each) => now.has(each));
    this.view.changed("layout");
  }

  toggleTextures() {
    const place = document.getElementById("textures");
    if (!place.children.length) return;
    place.hidden = !place.hidden;
    this.view.changed("layout");
  }

  reset() {
    Object.assign(this.view.state, structuredClone(START));
    this.view.changed("picture");
  }

  zoom(factor) {
    this.view.state.zoom = clamped(this.view.state.zoom * factor, 0.3, 12);
    this.view.changed("moving");
  }

  key(event) {
    const { state, view } = { state: this.view.state, view: this.view };
    if (event.ctrlKey || event.metaKey || event.altKey || document.getElementById("help").open) return;
    const arrows = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };
    if (event.key in arrows) {
      // A focused slider keeps its arrows.
      if (event.target instanceof HTMLInputElement) return;
      const other = { camera: "lightFrom", lightFrom: "camera" };
      const what = event.shiftKey ? other[state.drag] : state.drag, [x, y] = arrows[event.key];
      turn(state, what, 5 * x, 5 * y);
      event.preventDefault();
      view.changed("moving");
      return;
    }
    const next = (list, now) => list[(list.indexOf(now) + 1) % list.length];
    const actions = {
      0: () => { state.visible = view.layers.map((layer) => layer.key); view.changed("layout"); },
      d: () => { if (view.reference) { state.difference = next(MODES, state.difference); this.say(`difference ${state.difference}`); view.changed("picture"); } },
      "[": () => { state.factor = Math.max(1, state.factor / 2); view.changed("shown"); },
      "]": () => { state.factor = Math.min(256, state.factor * 2); view.changed("shown"); },
      e: () => this.expose(-1 / 3), E: () => this.expose(1 / 3),
      a: () => view.auto(),
      l: () => { view.relight(next(LIGHTS, state.light)); this.say(`light ${state.light}`); },
      s: () => { if (view.mesh) { state.surface = state.surface === "sphere" ? "mesh" : "sphere"; view.changed("picture"); } },
      m: () => { state.drag = state.drag === "camera" ? "lightFrom" : "camera"; this.show(); },
      "+": () => this.zoom(1.15), "=": () => this.zoom(1.15), "-": () => this.zoom(1 / 1.15),
      t: () => this.toggleTextures(), r: () => this.reset(), p: () => view.save(), o: () => document.getElementById("file").click(),
      "?": () => document.getElementById("help").showModal(),
    };
    view.layers.forEach((layer, k) => { actions[k + 1] = () => this.toggle(layer.key); });
    const action = actions[event.key] ?? actions[event.key.toLowerCase()];
    if (!action) return;
    event.preventDefault();
    action();
  }

  expose(stops) {
    this.view.state.stops = clamped(Math.round(10 * (this.view.state.stops + stops)) / 10, -8, 8);
    this.view.changed("shown");
  }

  /** Pointers on one picture: one drags, two move the light and pinch, none is read from. */
  follow(key, canvas) {
    const { state, view } = { state: this.view.state, view: this.view };
    const down = new Map();
    const degrees = () => 180 / Math.min(canvas.clientWidth, canvas.clientHeight);
    canvas.addEventListener("pointerdown", (event) => {
      canvas.setPointerCapture(event.pointerId);
      down.set(event.pointerId, { x: event.offsetX, y: event.offsetY });
    });
    canvas.addEventListener("pointermove", (event) => {
      const before = down.get(event.pointerId);
      if (!before) {
        view.point(key, event.offsetX, event.offsetY);
        return;
      }
      const across = (event.offsetX - before.x) * degrees(), up = (before.y - event.offsetY) * degrees();
      if (down.size === 2) {
        const other = [...down].find(([id]) => id !== event.pointerId)[1];
        const apart = (p) => Math.hypot(p.x - other.x, p.y - other.y);
        const now = apart({ x: event.offsetX, y: event.offsetY });
        if (apart(before) > 8 && now > 8) state.zoom = clamped((state.zoom * now) / apart(before), 0.3, 12);
        turn(state, "lightFrom", across / 2, up / 2);
      } else {
        const other = { camera: "lightFrom", lightFrom: "camera" };
        turn(state, event.shiftKey || event.buttons & 2 ? other[state.drag] : state.drag, across, up);
      }
      down.set(event.pointerId, { x: event.offsetX, y: event.offsetY });
      view.changed("moving");
    });
    for (const name of ["pointerup", "pointercancel"]) {
      canvas.addEventListener(name, (event) => {
        down.delete(event.pointerId);
        if (!down.size) view.changed("rest");
      });
    }
    canvas.addEventListener("dblclick", () => this.reset());
    canvas.addEventListener("contextmenu", (event) => event.preventDefault());
    canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      this.zoom(Math.exp(-0.0015 * event.deltaY * (event.deltaMode === 1 ? 16 : 1)));
    }, { passive: false });
  }
}
