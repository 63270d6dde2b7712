// Separate lobes and normal maps at each pixel of a picture at rest: strip by strip over the one that has them at vertices.

// A frame's share for strips, in milliseconds; milliseconds a pixel until some were measured.
const STRIP_BUDGET = 40, FIRST_PACE = 0.03;

class Highlights {
  constructor(view) {
    this.view = view;
    this.asked = null;
    this.pace = FIRST_PACE;
    // Programs that drive the page may do without.
    this.wanted = true;
  }

  /** Whether strips are still to be drawn. */
  get pending() {
    return this.asked !== null;
  }

  /** Begins anew, a frame later. A reference is known at vertices: beside it the lobe stays there too. */
  begin() {
    this.stop();
    if (!this.wanted || !this.view.stage.objects.some((each) => each.fine) || this.view.shown !== "picture") return;
    this.covered = null;
    this.ask();
  }

  stop() {
    cancelAnimationFrame(this.asked);
    this.asked = null;
    showDrawing(this.view);
  }

  /** The part of the pixels that is drawn. */
  get share() {
    return this.all > 0 ? this.done / this.all : 0;
  }

  ask() {
    this.asked = requestAnimationFrame(() => {
      this.asked = null;
      // Another picture is about to be drawn.
      if (this.view.pending !== null) return;
      try {
        this.advance();
      } catch (error) {
        showTrouble(error);
      }
    });
  }

  /** Strips for a frame: one on a slow card, all on a fast one. */
  advance() {
    const { view } = this, { stage } = view, began = performance.now();
    if (!this.covered) {
      this.covered = coveredRows(stage, view.orbit);
      this.from = this.done = 0;
      this.all = this.covered.reduce((sum, pixels) => sum + pixels, 0);
      stage.shadeBetween(view);
    }
    while (this.from < this.covered.length) {
      const start = performance.now(), [rows, pixels] = this.strip();
      if (pixels > 0) {
        stage.drawBetween(view, this.from, rows);
        stage.finish();
        this.pace = clamped((performance.now() - start) / pixels, this.pace / 4, this.pace * 4);
      }
      this.from += rows;
      this.done += pixels;
      if (performance.now() - began > STRIP_BUDGET / 2) break;
    }
    if (this.from < this.covered.length) this.ask();
    showDrawing(view);
  }

  /** [rows, pixels of lobes in them] of the next strip: as many as the last one's pace lets into a frame. */
  strip() {
    const { covered, from } = this, most = STRIP_BUDGET / this.pace;
    let rows = 0, pixels = 0;
    // Two rows at a time: cards shade pixels in squares of four.
    while (from + rows < covered.length) {
      const two = covered[from + rows] + (covered[from + rows + 1] ?? 0);
      if (rows > 0 && pixels + two > most) break;
      pixels += two;
      rows += 2;
    }
    return [rows, pixels];
  }
}

/** About how many pixels lobes cover in each row of the picture, from below: their triangles' area. */
function coveredRows({ objects, canvas, radius }, orbit) {
  const { width, height } = canvas, covered = new Float64Array(height), m = orbit.matrix(width / height, radius);
  for (const { object, fine } of objects) {
    if (!fine) continue;
    const { positions, triangles } = object, x = new Float32Array(object.vertices), y = new Float32Array(object.vertices);
    for (let v = 0, p = 0; v < x.length; v++, p += 3) {
      const at = (k) => m[k] * positions[p] + m[4 + k] * positions[p + 1] + m[8 + k] * positions[p + 2] + m[12 + k];
      const w = Math.max(at(3), 1e-6);
      x[v] = (at(0) / w + 1) * 0.5 * width;
      y[v] = (at(1) / w + 1) * 0.5 * height;
    }
    for (let t = 0; t < triangles.length; t += 3) {
      const a = triangles[t], b = triangles[t + 1], c = triangles[t + 2];
      const area = 0.5 * ((x[b] - x[a]) * (y[c] - y[a]) - (x[c] - x[a]) * (y[b] - y[a]));
      if (area < 0 && object.closed) continue;
      const low = Math.max(Math.floor(Math.min(y[a], y[b], y[c])), 0), high = Math.min(Math.floor(Math.max(y[a], y[b], y[c])), height - 1);
      const share = Math.min(Math.abs(area) / (high - low + 1), width);
      for (let row = low; row <= high; row++) covered[row] += share;
    }
  }
  return covered;
}
