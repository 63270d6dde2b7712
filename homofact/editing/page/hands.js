// Pointer and keys on the plot: freehand, brush and handles. Every drag is one step of the history.

const TOOLS = ["draw", "brush", "handles"];
// The brush's width as a share of the bands.
const BRUSH = 1 / 15;

class Hands {
  /** `page` has state { tool, channel, logs, root, band }, the curve that is edited, and takes its new values. */
  constructor(canvas, plot, page) {
    Object.assign(this, { canvas, plot, page });
    this.drag = null;
    canvas.addEventListener("pointerdown", (event) => this.down(event));
    canvas.addEventListener("pointermove", (event) => this.move(event));
    for (const name of ["pointerup", "pointercancel"]) canvas.addEventListener(name, () => this.up());
    canvas.addEventListener("keydown", (event) => this.key(event));
    for (const name of ["focus", "blur"]) canvas.addEventListener(name, () => page.changed("plot"));
  }

  place(event) {
    return this.plot.at(event.offsetX, event.offsetY);
  }

  get values() {
    return this.page.values;
  }

  /** The bands about one that move with it, and how much. */
  weights(band) {
    const { curve } = this.page, { tool } = this.page.state;
    if (tool === "handles") {
      const handles = handlesOf(curve);
      return hatOf(curve.bands, handles, handles.indexOf(nearest(handles, band)));
    }
    return bell(curve.bands, band, Math.max(BRUSH * curve.bands, 0.6));
  }

  down(event) {
    const { page } = this;
    if (event.button) return;
    this.canvas.setPointerCapture(event.pointerId);
    const at = this.place(event), { tool, channel } = page.state;
    if (tool === "handles") at.band = this.nearestHandle(event.offsetX);
    page.state.band = at.band;
    this.drag = { last: at, from: this.values, weights: tool === "draw" ? null : this.weights(at.band) };
    page.beginStep();
    // Brush and handles take the curve where it is, so that nothing jumps; what is nothing comes to the pointer.
    const before = levelAt(this.values, page.curve.channels, at.band, channel);
    this.drag.shift = before > LEAST ? at.level / before : 1;
    this.drag.offset = before > LEAST ? at.level - before : 0;
    this.apply(at);
  }

  nearestHandle(x) {
    const { plot, page } = this, handles = handlesOf(page.curve), far = (j) => Math.abs(plot.middle(j) - x);
    return handles.reduce((best, j) => (far(j) < far(best) ? j : best));
  }

  move(event) {
    if (!this.drag) return;
    // Where the pointer was between two frames counts too.
    const events = event.getCoalescedEvents?.() ?? [];
    for (const each of this.page.state.tool === "draw" && events.length ? events : [event]) this.apply(this.place(each));
  }

  apply(at) {
    const { page, drag } = this, { state, curve } = page;
    let values;
    if (state.tool === "draw") {
      values = drawn(this.values, curve.channels, state.channel, drag.last, at, state.logs);
      page.state.band = at.band;
      drag.last = at;
    } else {
      const level = state.logs ? at.level / drag.shift : Math.max(at.level - drag.offset, 0);
      values = pulled(drag.from, curve.channels, state.channel, state.band, level, drag.weights, state.logs);
    }
    page.setValues(values);
  }

  up() {
    if (!this.drag) return;
    this.drag = null;
    this.page.endStep();
  }

  /** ← → the point, Shift by more; ↑ ↓ its level, Shift by less; Home, End. */
  key(event) {
    const { page } = this, { state, curve } = page, { bands } = curve;
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const along = { ArrowLeft: -1, ArrowRight: 1 }[event.key], up = { ArrowUp: 1, ArrowDown: -1, PageUp: 5, PageDown: -5 }[event.key];
    const handles = handlesOf(curve), here = handles.indexOf(nearest(handles, state.band));
    if (along) {
      state.band = state.tool === "handles" ? handles[clamped(here + along, 0, handles.length - 1)]
        : clamped(state.band + along * (event.shiftKey ? Math.ceil(bands / 32) : 1), 0, bands - 1);
      page.changed("plot");
    } else if (event.key === "Home" || event.key === "End") {
      state.band = event.key === "Home" ? 0 : bands - 1;
      page.changed("plot");
    } else if (up) {
      if (state.tool === "handles") state.band = handles[here];
      this.raise(up * (event.shiftKey ? 0.2 : 1));
    } else return;
    event.preventDefault();
    event.stopPropagation();
  }

  /** The level at the point by so many steps: 5% in logarithms, a fiftieth of the axis else. */
  raise(steps) {
    const { page } = this, { state, curve } = page, before = levelAt(this.values, curve.channels, state.band, state.channel), { axis } = page;
    const level = state.logs ? Math.max(before, axis.low) * 1.05 ** steps : Math.max(before + (steps * axis.high) / 50, 0);
    const weights = state.tool === "draw" ? [[state.band, 1]] : this.weights(state.band);
    page.beginStep();
    page.setValues(pulled(this.values, curve.channels, state.channel, state.band, level, weights, state.logs));
    page.endStep();
  }
}

function nearest(list, value) {
  return list.reduce((best, each) => (Math.abs(each - value) < Math.abs(best - value) ? each : best));
}
