// Numbers and names for people, colours and shapes of methods, and where a fit's page is.

// From a dot's middle on.
const SHAPES = [
  "m-4,0a4,4 0 1,0 8,0a4,4 0 1,0 -8,0z", "m-3.5,-3.5h7v7h-7z", "m0,-4.6l4.4,8h-8.8z", "m0,-5l5,5l-5,5l-5,-5z",
];
const colourOf = (label) => `var(--c${label % 8})`;
const shapeOf = (label) => SHAPES[(label + Math.floor(label / 8)) % 4];

function keyOf(label) {
  const mark = svg("path", { d: `M0,0${shapeOf(label)}`, style: `fill: ${colourOf(label)}` });
  return svg("svg", { viewBox: "-6 -6 12 12", class: "key", "aria-hidden": "true" }, mark);
}

/** Three significant digits, as Python's `figure` writes them. */
function figure(value) {
  if (value === null) return "–";
  const size = Math.abs(value);
  if (size !== 0 && (size < 1e-4 || size >= 1e5)) return value.toExponential(1).replace("-", "−");
  if (size >= 1000) return String(Math.round(Number(value.toPrecision(3)))).replace("-", "−");
  return String(Number(value.toPrecision(3))).replace("-", "−");
}

/** The next multiple of a step, without the last digits of floats. */
const roundedUp = (value, step) => Math.ceil(Number((value / step).toFixed(6))) * step;

/** A limit of the verdict, rounded up as Python's `limit_figure` does. */
function limitFigure(value) {
  if (value === null) return "–";
  if (value === Infinity) return "unknown";
  if (value > 1) return `×${Number(roundedUp(1 + value, 10 ** (Math.floor(Math.log10(1 + value)) - 1)).toPrecision(2))}`;
  return `${Number(roundedUp(100 * Math.max(value, 0.001), value < 0.05 ? 0.1 : 1).toPrecision(3))}%`;
}

const figureOf = (metric, value) => (metric.limit ? limitFigure : figure)(value);
/** A figure of the data: JSON has no infinite numbers. */
const read = (value) => (value === "unknown" ? Infinity : value);

/** The pixels that the longest of some texts takes in a table, from `least` to `most`. */
function widest(texts, least, most) {
  const pen = document.createElement("canvas").getContext("2d");
  pen.font = `12.5px ${getComputedStyle(document.body).fontFamily}`;
  return Math.ceil(texts.reduce((wide, text) => Math.min(most, Math.max(wide, pen.measureText(text).width)), least));
}

const whole = (value) => value.toLocaleString("en-US");
const addressOf = (fit) => `materials/${fit.material.page}.html#${fit.key}`;
const link = (fit, ...words) => element("a", { href: addressOf(fit) }, ...words);
