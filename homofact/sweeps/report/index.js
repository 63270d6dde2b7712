// Begins: reads the data, fills the page, and draws anew what a choice concerns.

const NAMES = new Intl.Collator("en", { numeric: true, sensitivity: "base" });

function fitOf(data, several) {
  return ([material, label, seed, bytes, seconds, fetches, textures, epsilon, trusted, key, viewer, ...figures], number) => ({
    number, material: data.materials[material], label, method: data.labels[label], seed, bytes, seconds, fetches, textures, epsilon,
    trusted: Boolean(trusted), key, viewer, figures: figures.map(read), words: several ? `, seed ${seed}` : "",
  });
}

function columnsOf(data, several, epsilons) {
  const number = (title, wide, value, cell = value, hint = null) => ({ title, wide, hint, value, cell: (fit) => String(cell(fit)) });
  return [
    { title: "Material", wide: 22 + widest(data.materials.map((each) => each.name), 60, 260), left: true, value: (fit) => fit.material.name, cell: (fit) => element("a", { href: addressOf(fit), tabindex: "-1", title: fit.material.name }, fit.material.name) },
    { title: "Method", wide: 40 + widest(data.labels, 60, 320), left: true, value: (fit) => fit.method, cell: (fit) => element("span", { title: fit.method }, keyOf(fit.label), fit.method) },
    ...(several ? [number("Seed", 52, (fit) => fit.seed)] : []),
    number("Bytes", 66, (fit) => fit.bytes, (fit) => whole(fit.bytes)),
    number("Fit, s", 62, (fit) => fit.seconds, (fit) => figure(fit.seconds)),
    number("Fetches", 64, (fit) => fit.fetches),
    ...(epsilons.size > 1 ? [number("ε", 62, (fit) => fit.epsilon, (fit) => figure(fit.epsilon), "ε of the fit's logarithms")] : []),
    number("Trusted", 62, (fit) => Number(fit.trusted), (fit) => (fit.trusted ? "yes" : "no")),
    ...data.metrics.map((metric, k) => number(metric.title, 79, (fit) => fit.figures[k], (fit) => figureOf(metric, fit.figures[k]), metric.words)),
    ...(data.fits.some((each) => each[10]) ? [{ title: "Viewer", wide: 56, value: (fit) => Number(Boolean(fit.viewer)), cell: (fit) => (fit.viewer ? element("a", { href: `fits/${fit.viewer}`, tabindex: "-1" }, "open") : "–") }] : []),
  ];
}

function begin() {
  const data = JSON.parse(document.getElementById("data").textContent);
  const byId = (name) => document.getElementById(name);
  const several = new Set(data.fits.map((each) => each[2])).size > 1;
  const fits = data.fits.map(fitOf(data, several));
  const epsilons = new Set(fits.map((fit) => fit.epsilon));
  const metrics = data.metrics.map((metric, index) => ({ ...metric, index }));
  const state = { metric: metrics[0], methods: new Set(data.labels.keys()), find: "" };
  const bytes = new Plot(byId("bytes-plot"), (fit) => fit.bytes, "bytes of textures", whole);
  const seconds = new Plot(byId("seconds-plot"), (fit) => fit.seconds, "seconds of fitting", figure);
  const table = new FitTable(byId("table"), columnsOf(data, several, epsilons));

  const chosen = () => fits.filter((fit) => state.methods.has(fit.label));
  const drawTable = () => {
    const wanted = state.find.trim().toLowerCase();
    const rows = chosen().filter((fit) => !wanted || `${fit.material.name} ${fit.method}`.toLowerCase().includes(wanted));
    byId("found").textContent = `${rows.length === fits.length ? "" : `${whole(rows.length)} of `}${whole(fits.length)} ${fits.length === 1 ? "fit" : "fits"}`;
    table.show(rows);
  };
  const drawWorst = () => fillWorst(byId("worst"), data.worst[state.metric.name][Number(byId("worst-of").value)].map((k) => fits[k]), state.metric);
  const drawMetric = () => {
    for (const plot of [bytes, seconds]) plot.draw(chosen(), state.metric);
    fillBest(byId("best"), chosen(), state.metric);
    byId("epsilons").hidden = epsilons.size < 2 || !state.metric.log;
    drawWorst();
    fillComparison(data, fits, state.metric);
  };

  byId("metric").append(...metrics.map((metric) => element("option", { value: metric.name }, metric.words)));
  byId("metric").addEventListener("change", (event) => {
    state.metric = metrics[event.target.selectedIndex];
    drawMetric();
  });
  byId("worst-of").append(...["all methods", ...data.labels].map((label, k) => element("option", { value: k }, label)));
  byId("worst-of").addEventListener("change", drawWorst);
  byId("find").addEventListener("input", (event) => {
    state.find = event.target.value;
    drawTable();
  });
  for (const [label, words] of data.labels.entries()) {
    const button = element("button", { type: "button", "aria-pressed": "true" }, keyOf(label), words);
    button.addEventListener("click", () => {
      if (!state.methods.delete(label)) state.methods.add(label);
      button.setAttribute("aria-pressed", String(state.methods.has(label)));
      for (const plot of [bytes, seconds]) plot.draw(chosen(), state.metric);
      fillBest(byId("best"), chosen(), state.metric);
      drawTable();
    });
    byId("methods").append(button);
  }
  byId("notes").append(...data.notes.map((note) => element("p", {}, note)));
  byId("median-notes").append(...data.median_notes.map((note) => element("p", {}, note)));
  fillMedians(byId("medians"), data);
  fillAside(data);
  fillFiles(byId("files"), data.files);
  drawTable();
  drawMetric();
  return { drawnMs: performance.now(), plots: { bytes, seconds } };
}

const began = begin();
// For programs that drive the page: when it was drawn, when a frame of it was, and the charts with their dots.
window.homofact = {
  ...began, ready: new Promise((done) => requestAnimationFrame(() => setTimeout(() => done({ shownMs: performance.now() })))),
};
