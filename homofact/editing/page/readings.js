// What the page says in words and figures: its controls' state, the point of the curve, the albedo, the numbers.

/** Puts buttons in a place anew: [[title, hint, act], …]. */
function fillButtons(place, buttons) {
  place.replaceChildren(...buttons.map(([title, hint, act]) => {
    const button = element("button", { type: "button", title: hint || null }, title);
    button.addEventListener("click", act);
    return button;
  }));
}

const curveInWords = (curve, all) => (all.some((other) => other.term !== curve.term) ? `${curve.term}: ${curve.name}` : curve.name);

/** The line under the plot: where the point is, and what the curve is there. */
function showPoint({ curve, values, state }) {
  const degrees = 90 * shareAt(curve, state.band + 0.5), own = [...values.subarray(state.band * curve.channels, (state.band + 1) * curve.channels)];
  const start = [...curve.start.values.subarray(state.band * curve.channels, (state.band + 1) * curve.channels)];
  const words = `${curve.letters} ${degrees.toFixed(1)}°: ${own.map(valueInWords).join(", ")} (start ${start.map(valueInWords).join(", ")})`;
  by("point").textContent = words;
  const plot = by("plot");
  plot.setAttribute("aria-label", `Curve ${curve.name} of ${curve.materialName} over ${curve.letters}`);
  plot.setAttribute("aria-valuenow", String(levelAt(values, curve.channels, state.band, state.channel)));
  plot.setAttribute("aria-valuetext", words);
}

/** The albedo: its largest value, where that is, a chart over the angle, and a warning above 1. */
function showAlbedo(furnace, albedo, channelNames) {
  const { value, degrees, channel, exceeds } = furnace.largest(albedo);
  by("albedo").textContent = value.toFixed(2);
  by("albedo-words").textContent = `largest albedo, at ${degrees}°${channelNames.length > 1 ? ` in ${channelNames[channel]}` : ""}`;
  by("albedo-warning").textContent = exceeds
    ? `Albedo ${value.toFixed(2)} at ${degrees} degrees in ${channelNames[channel]}: more light comes back than falls in.` : "";
  by("albedo-chart").replaceChildren(albedoChart(furnace, albedo));
}

function albedoChart(furnace, albedo) {
  const top = Math.max(1.1, ...albedo), x = (degrees) => 18 + (degrees / 90) * 152, y = (value) => 78 - (value / top) * 72, { channels } = furnace;
  const line = (value, colour) => svg("line", { x1: 18, x2: 170, y1: y(value), y2: y(value), stroke: colour, "stroke-width": 1 });
  const curves = Array.from({ length: channels }, (_, c) => svg("polyline", {
    fill: "none", stroke: channels === 1 ? GREY_COLOUR : CHANNEL_COLOURS[c], "stroke-width": 1.6,
    points: furnace.degrees.map((degrees, i) => `${x(degrees)},${y(albedo[i * channels + c])}`).join(" "),
  }));
  const words = [[0, 0, 14], [1, 0, 14]].map(([value, , at]) => svg("text", { x: at, y: y(value) + 3.5, "text-anchor": "end" }, String(value)));
  const marks = [0, 45, 90].map((degrees) => svg("text", { x: x(degrees), y: 92, "text-anchor": "middle" }, `${degrees}°`));
  return svg("svg", { viewBox: "0 0 176 96", role: "img", "aria-label": "Albedo over the angle of the light" }, line(0, "#2c2f35"), line(1, "#8a5a3c"), ...curves, ...words, ...marks);
}

/** What the preview shows, and how far off the table is that it draws the material from. */
function previewInWords(terms) {
  const error = Math.max(...terms.map((term) => term.error)), shown = "The sphere shows the material under one light, without shadows.";
  if (error < 5e-4) return shown;
  return `${shown} It reads the material from a coarse table, so its brightness is off by ${percent(error)} (relative RMS before edits). The picture of the scene does not use this table.`;
}

/** Brings buttons, sliders and words in line with the page's state. */
function showState(page) {
  const { state, history, controls, material } = page;
  const choices = { views: state.view, show: state.show, materials: state.material, curves: state.curve, tool: state.tool,
    channel: state.channel ?? "all", scale: state.logs, root: state.root, compare: state.compare, tones: state.tones };
  for (const [name, value] of Object.entries(choices)) controls.choices[name]?.([String(value)]);
  by("undo").disabled = history.now === 0;
  by("redo").disabled = history.now + 1 >= history.states.length;
  by("save").disabled = !history.changed.length;
  by("reset").disabled = sameValues(page.values, page.curve.start.values);
  by("exposure").value = state.stops;
  by("exposure-value").textContent = `${stopsInWords(state.stops)} stops`;
  by("divider").hidden = state.show !== "split";
  by("divider").setAttribute("aria-valuenow", String(Math.round(100 * state.split)));
  by("canvas").setAttribute("aria-label", `View ${page.view.name}, ${state.show}; ${history.changed.length} curves edited`);
  controls.showSliders();
  by("preview-note").textContent = [page.preview ? previewInWords(page.materials[state.material].terms) : "", ...material.notes].filter(Boolean).join(" ");
}

/** The line over the picture: edits, the time of the last one, and how far the picture is. */
function showStatus({ view, times, history, settled }) {
  const changed = history.changed.length, edits = changed === 0 ? "nothing edited" : changed === 1 ? "1 curve edited" : `${changed} curves edited`;
  const time = times.edit === null ? "" : ` · ${times.edit < 9.95 ? times.edit.toFixed(1) : times.edit.toFixed(0)} ms`;
  const size = ({ width, height }) => `${width} × ${height} pixels`, finished = settled && !by("settled").hidden;
  const picture = finished ? `finished, ${size(settled.canvas)}` : settled ? `draft, ${size(view)}` : size(view);
  by("status").textContent = `${edits}${view.pending ? ` · ${view.pending} pending` : ""}${time} · ${picture}`;
}
