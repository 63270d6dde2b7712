// A chart: every fit a dot that opens its page; by keys from dot to dot. The dots of a method are few paths, since
// thousands of elements are slow, and so is one path of thousands of dots; a ring, which is the link, goes to the dot next to the pointer.

const EDGE = { left: 58, right: 12, top: 22, bottom: 44 }, REACH = 12, PIECE = 64;

class Plot {
  /** `x` gives a fit's place along the axis, `title` says what it is, `words` writes one of its values. */
  constructor(place, x, title, words) {
    Object.assign(this, { place, x, title, words, dots: [], chosen: -1, wide: 0 });
    this.svg = svg("svg", { tabindex: "0", role: "group" });
    this.reading = element("p", { class: "reading quiet", "aria-live": "polite" });
    place.append(this.svg, this.reading);
    this.svg.addEventListener("keydown", (event) => this.key(event));
    for (const name of ["pointermove", "pointerdown"]) this.svg.addEventListener(name, (event) => this.point(event));
    // A finger's tap may have begun before the ring was there.
    this.svg.addEventListener("click", (event) => { if (this.near && !event.target.closest("a")) location.href = addressOf(this.dots[this.chosen].fit); });
    new ResizeObserver(() => { if (this.metric && this.place.clientWidth !== this.wide) this.draw(this.fits, this.metric); }).observe(place);
  }

  draw(fits, metric) {
    Object.assign(this, { fits, metric, wide: this.place.clientWidth });
    [this.width, this.height] = [Math.max(this.wide, 240), Math.min(360, Math.max(230, 0.6 * this.wide))];
    this.svg.setAttribute("viewBox", `0 0 ${this.width} ${this.height}`);
    const y = (fit) => fit.figures[metric.index];
    const across = makeAxis(fits.map(this.x), true);
    const up = makeAxis(fits.map(y).filter((value) => value !== null), metric.good !== "high");
    const inner = [this.width - EDGE.left - EDGE.right, this.height - EDGE.top - EDGE.bottom];
    const left = (value) => EDGE.left + inner[0] * across.at(value), top = (value) => this.height - EDGE.bottom - inner[1] * up.at(value);
    const seen = fits.filter((fit) => across.shows(this.x(fit)) && up.shows(y(fit)));
    const parts = [...this.rules(across, up, left, top, metric)];
    this.dots = seen.map((fit) => ({ fit, left: left(this.x(fit)), top: top(y(fit)) })).sort((a, b) => a.left - b.left || a.top - b.top);
    const drawn = new Map();
    for (const { fit, left, top } of this.dots) {
      const kind = 2 * fit.label + fit.trusted;
      if (!drawn.has(kind)) drawn.set(kind, { fit, texts: [] });
      drawn.get(kind).texts.push(`M${left.toFixed(1)},${top.toFixed(1)}${shapeOf(fit.label)}`);
    }
    for (const [, { fit, texts }] of [...drawn].sort((a, b) => a[0] - b[0])) {
      const style = `stroke: ${colourOf(fit.label)}; fill: ${fit.trusted ? colourOf(fit.label) : "none"}`;
      for (let k = 0; k < texts.length; k += PIECE) parts.push(svg("path", { class: "dots", d: texts.slice(k, k + PIECE).join(""), style }));
    }
    this.ring = svg("a", { tabindex: "-1", visibility: "hidden" }, svg("circle", { r: 8, class: "chosen" }));
    this.near = false;
    this.svg.replaceChildren(...parts, this.ring);
    this.svg.setAttribute("aria-label", `${metric.words} against ${this.title}: ${seen.length} fits. Arrow keys go from dot to dot, Enter opens one.`);
    this.chosen = -1;
    const missing = fits.length - seen.length;
    this.resting = missing ? `${whole(missing)} of ${whole(fits.length)} fits are not in the chart: their figure is missing, unknown or 0.` : "Point at a dot to read its figures.";
    this.reading.textContent = this.resting;
  }

  *rules(across, up, left, top, metric) {
    const [bottom, right] = [this.height - EDGE.bottom, this.width - EDGE.right];
    const few = this.width < 420 && across.ticks.length > 5 ? 2 : 1;
    for (const value of across.ticks.filter((_, k) => k % few === 0)) {
      yield svg("line", { class: "rule", x1: left(value), x2: left(value), y1: EDGE.top, y2: bottom });
      yield svg("text", { x: left(value), y: bottom + 16, "text-anchor": "middle" }, this.words(value));
    }
    for (const value of up.ticks) {
      yield svg("line", { class: "rule", x1: EDGE.left, x2: right, y1: top(value), y2: top(value) });
      yield svg("text", { x: EDGE.left - 7, y: top(value) + 4, "text-anchor": "end" }, figureOf(metric, value));
    }
    const ideal = up.at(1);
    if (metric.good === "one" && ideal > 0 && ideal < 1) yield svg("line", { class: "ideal", x1: EDGE.left, x2: right, y1: top(1), y2: top(1) });
    yield svg("line", { class: "axis", x1: EDGE.left, x2: right, y1: bottom, y2: bottom });
    yield svg("text", { x: right, y: this.height - 8, "text-anchor": "end" }, this.title);
    yield svg("text", { x: 0, y: 11 }, metric.words);
  }

  /** The pointer has moved: the dot next to it is chosen, if one is within reach. */
  point(event) {
    const box = this.svg.getBoundingClientRect(), scale = this.width / box.width;
    const [x, y] = [(event.clientX - box.left) * scale, (event.clientY - box.top) * scale];
    let found = -1, least = (REACH * scale) ** 2;
    for (const [k, { left, top }] of this.dots.entries()) {
      const far = (left - x) ** 2 + (top - y) ** 2;
      if (far < least) [found, least] = [k, far];
    }
    this.near = found >= 0;
    if (this.near && found !== this.chosen) this.choose(found);
  }

  choose(number) {
    this.chosen = number;
    const { fit, left, top } = this.dots[number];
    for (const [name, value] of [["href", addressOf(fit)], ["transform", `translate(${left},${top})`], ["visibility", "visible"]]) this.ring.setAttribute(name, value);
    const figures = `${this.metric.words} ${figureOf(this.metric, fit.figures[this.metric.index])}, ${whole(fit.bytes)} bytes, ${figure(fit.seconds)} s`;
    this.reading.replaceChildren(link(fit, `${fit.material.name}, ${fit.method}`), `${fit.words}: ${figures}`);
  }

  key(event) {
    if (!this.dots.length) return;
    const last = this.dots.length - 1, step = { ArrowRight: 1, ArrowLeft: -1, ArrowUp: 1, ArrowDown: -1 }[event.key];
    if (step) this.choose(this.chosen < 0 ? (step > 0 ? 0 : last) : Math.min(last, Math.max(0, this.chosen + step)));
    else if (event.key === "Home") this.choose(0);
    else if (event.key === "End") this.choose(last);
    else if (event.key === "Enter" && this.chosen >= 0) location.href = addressOf(this.dots[this.chosen].fit);
    else return;
    event.preventDefault();
  }
}
