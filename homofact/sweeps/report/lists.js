// The smaller parts of the page: the best of each material, medians, the worst, what changed, what was set aside, the files.

const MOST_CHANGES = 50, MOST_BEST = 200;

/** Titles are texts or metrics, whose full words appear under the pointer. */
function plainTable(titles, rows) {
  const head = titles.map((title, k) => element("th", { scope: "col", class: rows[0]?.[k]?.className === "left" ? "left" : null, title: title.words ?? null }, title.title ?? title));
  const lines = rows.map(([first, ...rest]) =>
    element("tr", {}, element("th", { scope: "row" }, first), ...rest.map((each) => (each instanceof Node && each.nodeName === "TD" ? each : element("td", {}, each)))));
  return element("table", { class: "plain" }, element("thead", {}, element("tr", {}, ...head)), element("tbody", {}, ...lines));
}

/** Greater where a figure is worse; of a ratio that should be 1, its distance from 1 either way. */
function badness(metric, value) {
  if (metric.good === "one") return value > 0 ? Math.max(value, 1 / value) : Infinity;
  return metric.good === "low" ? value : -value;
}

/** A name in a table, which takes a second line only if it is long. */
const named = (...children) => element("span", { class: "name" }, ...children);

/** A row for each material: the fit with the best figure, of equal ones that of fewest bytes. */
function fillBest(place, fits, metric) {
  const best = new Map();
  for (const fit of fits) {
    const value = fit.figures[metric.index];
    if (value === null) continue;
    const rank = [badness(metric, value), fit.bytes], known = best.get(fit.material.page);
    if (!known || rank[0] < known.rank[0] || (rank[0] === known.rank[0] && rank[1] < known.rank[1])) best.set(fit.material.page, { fit, rank });
  }
  const rows = [...best.values()].slice(0, MOST_BEST).map(({ fit }) => [
    named(link(fit, fit.material.name)), element("td", { class: "left" }, named(keyOf(fit.label), `${fit.method}${fit.words}`)),
    figureOf(metric, fit.figures[metric.index]), whole(fit.bytes), figure(fit.seconds), fit.trusted ? "yes" : "no"]);
  place.replaceChildren(plainTable(["Material", "Method", metric, "Bytes", "Fit, s", "Trusted"], rows));
  if (best.size > MOST_BEST) place.append(element("p", { class: "quiet" }, `${whole(best.size - MOST_BEST)} more are in fits.csv.`));
}

function fillMedians(place, data) {
  const rows = data.methods.map(([label, count, trusted, bytes, seconds, ...figures], k) => [
    named(keyOf(k), label), whole(count), whole(trusted), whole(Math.round(bytes)), figure(seconds), ...figures.map((value, each) => figureOf(data.metrics[each], read(value)))]);
  place.replaceChildren(plainTable(["Method", "Fits", "Trusted", "Bytes", "Fit, s", ...data.metrics], rows));
}

function fillWorst(place, fits, metric) {
  place.replaceChildren(...fits.map((fit) => element("li", {}, link(fit, element("strong", {}, fit.material.name),
    element("em", {}, figureOf(metric, fit.figures[metric.index])), element("span", {}, `${fit.method}${fit.words}`)))));
  if (!fits.length) place.append(element("li", { class: "quiet" }, "None of these fits has this figure."));
}

function fillComparison(data, fits, metric) {
  const { comparison } = data;
  document.getElementById("comparison").hidden = !comparison;
  if (!comparison) return;
  const versions = comparison.versions.join(", ");
  document.getElementById("comparison-words").textContent =
    `Against ${comparison.name}, homofact ${versions}: ${whole(comparison.pairs)} fits of the same source, method and seed are in both, ` +
    `${whole(comparison.only_now)} are new, ${whole(comparison.only_before)} are gone. An error that differs by less than 1%, a ratio by less than 0.01, a PSNR by less than 0.1 dB is the same.`;
  const counted = data.metrics.flatMap((each) => {
    const { better, same, worse } = comparison.counts[each.name];
    return better + same + worse === 0 ? [] : [[each.words, element("td", { class: better ? "better" : null }, whole(better)), whole(same), element("td", { class: worse ? "worse" : null }, whole(worse))]];
  });
  document.getElementById("comparison-counts").replaceChildren(plainTable(["Metric", "Better", "Same", "Worse"], counted));
  const changed = comparison.changes[metric.name].filter((each) => each[3] !== "same");
  const place = document.getElementById("comparison-changes");
  place.replaceChildren(element("h3", {}, `${metric.words}: ${changed.length ? "the largest changes" : "no change"}`));
  if (!changed.length) return;
  const rows = changed.slice(0, MOST_CHANGES).map(([number, before, now, word]) => {
    const fit = fits[number];
    return [link(fit, fit.material.name), `${fit.method}${fit.words}`, figureOf(metric, read(before)), figureOf(metric, read(now)), element("td", { class: word }, word)];
  });
  place.append(plainTable(["Material", "Method", "Before", "Now", ""], rows));
  if (changed.length > MOST_CHANGES) place.append(element("p", { class: "quiet" }, `${whole(changed.length - MOST_CHANGES)} more are in comparison.csv.`));
}

function fillAside(data) {
  document.getElementById("aside").hidden = !data.aside.length && !data.left;
  document.getElementById("left").textContent = data.left ? `${whole(data.left)} ${data.left === 1 ? "fit is" : "fits are"} missing. Run the same homofact sweep command again to continue.` : "";
  if (!data.aside.length) return;
  const rows = data.aside.map(([name, label, seed, reason, deaths]) => [
    name, element("td", { class: "left" }, label), String(seed), String(deaths), element("td", { class: "words" }, reason)]);
  document.getElementById("aside-table").replaceChildren(plainTable(["Material", "Method", "Seed", "Workers died", "Why"], rows));
}

function fillFiles(place, files) {
  place.replaceChildren(...files.flatMap((name, k) => [k ? ", " : "", element("a", { href: name, download: true }, name)]));
}
