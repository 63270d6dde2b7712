// What the page says in words and figures: the state of its controls, the error, the numbers of the scene.

function makeSkies(place, view, onChoose, onOpen) {
  place.replaceChildren(...view.skies.map((sky, k) => {
    const button = element("button", { type: "button", "data-sky": String(k), title: k < 9 ? `Key ${k + 1}` : null },
      skyThumbnail(sky.picture, 96, 48), element("span", {}, sky.name));
    button.addEventListener("click", () => onChoose(k));
    return button;
  }));
  const open = element("button", { type: "button", class: "open", title: "A lat-long Radiance picture; or drop it on the page" }, "Open .hdr …");
  open.addEventListener("click", onOpen);
  place.append(open);
}

/**
 * A slider of brightness for each sun and lamp: `onChange(q, level)` has 0 … 4 times its own. A function that shows levels. A
 * slider's place is the level's square root, so that its middle is the scene's own.
 */
function makeLevels(place, lights, onChange) {
  const fields = lights.map((light, q) => {
    const kind = light.position ? "Lamp" : "Sun", alike = lights.filter((other) => Boolean(other.position) === Boolean(light.position));
    const id = `level-${q}`, name = alike.length > 1 ? `${kind} ${alike.indexOf(light) + 1}` : `${kind} level`;
    const slider = element("input", { type: "range", id, min: "0", max: "2", step: "0.05" }), output = element("output", { for: id });
    const own = element("button", { type: "button", class: "small", title: "As in the scene’s file" }, "100%");
    slider.addEventListener("input", () => onChange(q, Number(slider.value) ** 2));
    own.addEventListener("click", () => onChange(q, 1));
    place.append(element("div", { class: "field slider" }, element("label", { class: "name", for: id }, name), slider, output, own));
    return { slider, output };
  });
  return (levels) => fields.forEach(({ slider, output }, q) => {
    slider.value = Math.sqrt(levels[q]);
    output.textContent = `${Math.round(100 * levels[q])}%`;
  });
}

/** Brings sliders, buttons and words in line with the view's state. */
function showState(view) {
  const { state, orbit } = view;
  for (const button of by("skies").children) button.setAttribute("aria-pressed", String(button.dataset.sky === String(state.sky)));
  by("turn").value = state.turn;
  by("turn-value").textContent = inWords(Math.round(state.turn), "°");
  by("terms").value = state.terms;
  by("terms-value").textContent = `${state.terms} of ${view.mostTerms}`;
  by("kept").value = view.keptSteps.indexOf(state.kept);
  // All there are may have five digits: they stand on the button.
  by("kept-value").textContent = grouped(state.kept);
  by("kept-all").title = `${grouped(view.mostKept)} in the longest vector`;
  view.controls.levels(state.levels);
  by("exposure").value = state.stops;
  by("exposure-value").textContent = `${stopsInWords(state.stops)} stops`;
  by("play-button").setAttribute("aria-pressed", String(state.turning));
  by("angles").textContent = inWords(`Camera azimuth ${orbit.azimuth.toFixed(0)}°, elevation ${orbit.elevation.toFixed(0)}°`);
  for (const [name, choice] of Object.entries(view.controls.choices)) choice([String(state[name])]);
  for (const button of by("show").children) button.disabled = button.dataset.value !== "picture" && !view.atReference;
  by("divider").hidden = view.shown !== "split";
  by("divider").style.left = `${100 * state.split}%`;
  by("divider").setAttribute("aria-valuenow", String(Math.round(100 * state.split)));
  showScale(view);
}

/** The bar under a difference. */
function showScale(view) {
  const scale = by("scale"), { range } = view.state;
  scale.hidden = view.shown !== "difference";
  if (scale.hidden) return;
  const number = (x) => String(Number((100 * x).toPrecision(3)));
  scale.replaceChildren("luminance, |this page − reference|", element("i", { style: `background: linear-gradient(90deg, ${RAMP.join(", ")})` }),
    element("span", {}, element("span", {}, "0"), element("span", {}, number(range / 2)), element("span", {}, `${number(range)}% of white`)));
}

/** "ball, gold and clay · ground, grey": each mesh once, with the materials of the objects that share it. */
function objectsInWords(objects) {
  const known = new Map();
  for (const { name, material } of objects) known.set(name, (known.get(name) ?? new Set()).add(material));
  return [...known].map(([name, materials]) => {
    const all = [...materials], last = all.pop();
    return `${name}, ${all.length ? `${all.join(", ")} and ${last}` : last}`;
  }).join(" · ");
}

/** In the picture's corner: how much of the highlights is refined; nothing once all are, or where one frame is enough for them. */
function showDrawing({ highlights }) {
  const place = by("drawing");
  place.hidden = !highlights.pending || !highlights.covered;
  place.textContent = place.hidden ? "" : `Refining highlights … ${Math.floor(100 * highlights.share)}%`;
}

/** The line over the picture: what is pending, and how long things take. */
function showStatus(view) {
  const { relit, times } = view, pending = relit.pending;
  // What has not been timed yet is left out.
  const timed = ["light", "view"].filter((name) => times[name] !== null).map((name) => {
    const x = times[name];
    return `${name} ${x < 9.95 ? x.toFixed(1) : x.toFixed(0)} ms`;
  });
  by("status").textContent = [`${grouped(pending)} of ${grouped(relit.coefficients)} coefficients pending`, ...timed].join(" · ");
}

/** The error against the reference where there is one for this light and camera, and the light below zero. */
function showError(view, statistics) {
  const { reference } = view;
  by("below").textContent = `Light below zero: ${percent(statistics.below)} of the light at the vertices that face the camera, drawn black${view.state.signal ? ", and in magenta where below −1/255 of white" : ""}.`;
  by("show-field").hidden = !reference;
  by("go-reference").hidden = !reference || view.atReference;
  if (!reference) {
    by("error").textContent = "";
    by("error-words").textContent = `This page has no reference, because relight ran without --reference. Run it again with --reference to compare the picture with the full sum.${view.judged ? " The errors that relight measured are among the numbers below." : ""}`;
    return;
  }
  by("error").textContent = statistics.error === null ? "–" : percent(statistics.error);
  const sky = view.skies[reference.sky].name;
  by("error-words").textContent = !view.atReference
    ? `The reference holds only for ${sky}, not turned, seen from the first camera${view.lightsAsGiven ? "" : ", with suns and lamps as bright as in the scene’s file"}.`
    : statistics.error === null ? "Light is still coming in."
      : `relative RMS over the vertices in view${eachError(view, statistics.errors)}, against the ${reference.words}. Each vertex counts alike, also at the rim, where a picture has few pixels${view.judged ? "; the error over pixels is among the numbers below" : ""}.`;
}

/** " (bunny 2.3%, ground 7.1%)" of several objects. */
function eachError(view, errors) {
  return errors.length < 2 ? "" : ` (${view.objects.map(({ name }, o) => `${name} ${percent(errors[o])}`).join(", ")})`;
}
