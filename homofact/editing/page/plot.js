// The picture of a curve: axes in degrees and values, linear or logarithmic, the start in grey, the hand's point.

const CHANNEL_COLOURS = ["#ff8a7d", "#7fd99a", "#86b7ff"];
const GREY_COLOUR = "#e7e8ea", START_COLOUR = "#7d838d", MEAN_COLOUR = "#f2c14e";
const MARGIN = { left: 52, right: 14, top: 10, bottom: 38 };
const DECADES = 6;

/** The values that an axis goes to and its marks, for curves (each J × C). */
function axisOf(tables, logs) {
  let high = 0, low = Infinity;
  for (const table of tables) {
    for (const value of table) {
      high = Math.max(high, value);
      if (value > 0) low = Math.min(low, value);
    }
  }
  if (!(high > 0)) [low, high] = [0.1, 1];
  if (logs) {
    const top = Math.ceil(Math.log10(high) + 0.15), bottom = Math.min(Math.max(Math.floor(Math.log10(low) - 0.05), top - DECADES), top - 2);
    const marks = [];
    for (let decade = bottom; decade <= top; decade++) marks.push(10 ** decade);
    return { logs, low: 10 ** bottom, high: 10 ** top, marks };
  }
  const rough = (1.3 * high) / 4, unit = 10 ** Math.floor(Math.log10(rough)), step = [1, 2, 2.5, 5, 10].find((m) => m * unit >= rough) * unit;
  return { logs, low: 0, high: 4 * step, marks: [0, 1, 2, 3, 4].map((k) => k * step) };
}

/** A value in few letters. */
function valueInWords(value) {
  if (value === 0) return "0";
  const size = Math.abs(value);
  if (size >= 1e4 || size < 1e-3) return Number(value.toPrecision(3)).toExponential().replace("e+", "e").replace("-", "−");
  return String(Number(value.toPrecision(3)));
}

class Plot {
  constructor(canvas) {
    this.canvas = canvas;
    this.axis = axisOf([], false);
    this.root = false;
    this.curve = { bands: 256, finer: false };
  }

  /** The size in CSS pixels, with as many of the screen's as it has. */
  fit() {
    const { canvas } = this, ratio = Math.min(window.devicePixelRatio || 1, 2);
    this.width = canvas.clientWidth;
    this.height = canvas.clientHeight;
    const [width, height] = [Math.round(this.width * ratio), Math.round(this.height * ratio)];
    if (canvas.width !== width || canvas.height !== height) [canvas.width, canvas.height] = [width, height];
    // Drawn by the processor: lines and letters by a graphics card that is software take several times as long.
    const context = canvas.getContext("2d", { willReadFrequently: true });
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    return context;
  }

  /** Across the plot, 0 … 1, to CSS pixels; and from the share of [0, 90°] to it. */
  x(share) {
    return MARGIN.left + (this.root ? Math.sqrt(share) : share) * (this.width - MARGIN.left - MARGIN.right);
  }

  /** The middle of a band. */
  middle(band) {
    return this.x(shareAt(this.curve, band + 0.5));
  }

  y(value) {
    const { low, high, logs } = this.axis;
    const share = logs ? Math.log(Math.max(value, low * 1e-3) / low) / Math.log(high / low) : (value - low) / (high - low);
    return this.height - MARGIN.bottom - share * (this.height - MARGIN.top - MARGIN.bottom);
  }

  /** The band and level under a place in CSS pixels, kept within the axes. */
  at(x, y) {
    const across = clamped((x - MARGIN.left) / (this.width - MARGIN.left - MARGIN.right), 0, 1), share = this.root ? across ** 2 : across;
    const up = clamped((this.height - MARGIN.bottom - y) / (this.height - MARGIN.top - MARGIN.bottom), 0, 1), { low, high, logs } = this.axis;
    return { band: Math.min(Math.floor(placeAt(this.curve, share)), this.curve.bands - 1), level: logs ? low * (high / low) ** up : low + up * (high - low) };
  }

  /** Draws `values` over `start` with a mark at `band`; `handles` are bands or null, `channel` is the one being edited. */
  draw({ curve, values, axis, root, channel, band, handles, focused }) {
    const context = this.fit();
    Object.assign(this, { axis, root, curve });
    context.clearRect(0, 0, this.width, this.height);
    this.drawAxes(context, curve);
    const bottom = this.height - MARGIN.bottom;
    context.save();
    context.beginPath();
    context.rect(MARGIN.left, MARGIN.top - 1, this.width - MARGIN.left - MARGIN.right, bottom - MARGIN.top + 2);
    context.clip();
    const { channels } = curve, order = channel === null ? [...Array(channels).keys()] : [...Array(channels).keys()].sort((a) => (a === channel ? 1 : -1));
    for (const c of order) this.line(context, curve.start.values, channels, c, START_COLOUR, 1, [4, 3]);
    const grey = values.every((value, i) => value === values[i - (i % channels)]);
    for (const c of order) {
      const inHand = channel === null || c === channel;
      this.line(context, values, channels, c, grey ? GREY_COLOUR : CHANNEL_COLOURS[c], inHand ? 2 : 1, [], inHand ? 1 : 0.45);
    }
    context.restore();
    const point = (j, size, filled) => {
      context.beginPath();
      context.arc(this.middle(j), clamped(this.y(levelAt(values, channels, j, channel)), MARGIN.top, bottom), size, 0, 2 * Math.PI);
      context.fillStyle = filled;
      context.fill();
      context.strokeStyle = "#101114";
      context.lineWidth = 1;
      context.stroke();
    };
    for (const j of handles ?? []) point(j, 4.5, GREY_COLOUR);
    if (band !== null) {
      context.strokeStyle = focused ? "#8fbcff" : "#5b616b";
      context.lineWidth = 1;
      context.setLineDash([2, 3]);
      context.beginPath();
      context.moveTo(this.middle(band), MARGIN.top);
      context.lineTo(this.middle(band), bottom);
      context.stroke();
      context.setLineDash([]);
      point(band, 5, MEAN_COLOUR);
    }
  }

  drawAxes(context, curve) {
    const bottom = this.height - MARGIN.bottom, right = this.width - MARGIN.right;
    context.font = `11px ${getComputedStyle(document.documentElement).fontFamily}`;
    context.textBaseline = "middle";
    context.lineWidth = 1;
    context.strokeStyle = "#2c2f35";
    context.fillStyle = "#9fa4ad";
    context.textAlign = "right";
    for (const mark of this.axis.marks) {
      const y = Math.round(this.y(mark)) + 0.5;
      context.beginPath();
      context.moveTo(MARGIN.left, y);
      context.lineTo(right, y);
      context.stroke();
      context.fillText(valueInWords(mark), MARGIN.left - 7, y);
    }
    context.textAlign = "center";
    for (const degrees of this.root ? [0, 1, 5, 10, 20, 30, 45, 60, 90] : [0, 15, 30, 45, 60, 75, 90]) {
      const x = Math.round(this.x(degrees / 90)) + 0.5;
      context.beginPath();
      context.moveTo(x, MARGIN.top);
      context.lineTo(x, bottom);
      context.stroke();
      context.fillText(`${degrees}°`, Math.min(x, right - 8), bottom + 11);
    }
    context.fillText(`${curve.letters} in degrees${this.root ? " (square-root scale)" : ""}`, (MARGIN.left + right) / 2, bottom + 28);
    context.save();
    context.translate(9, (MARGIN.top + bottom) / 2);
    context.rotate(-Math.PI / 2);
    context.fillText(this.axis.logs ? "value (logarithmic scale)" : "value", 0, 0);
    context.restore();
  }

  /** A channel as the steps that its bands are. */
  line(context, values, channels, c, colour, width, dashes, opacity = 1) {
    context.globalAlpha = opacity;
    context.strokeStyle = colour;
    context.lineWidth = width;
    context.lineJoin = "round";
    context.setLineDash(dashes);
    context.beginPath();
    for (let j = 0; j < this.curve.bands; j++) {
      const y = this.y(values[j * channels + c]);
      context[j ? "lineTo" : "moveTo"](this.x(shareAt(this.curve, j)), y);
      context.lineTo(this.x(shareAt(this.curve, j + 1)), y);
    }
    context.stroke();
    context.setLineDash([]);
    context.globalAlpha = 1;
  }
}
