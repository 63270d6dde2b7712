// The automatic exposure: that of a small picture of linear radiance, as `relight` chooses it for its own pictures.

// Pixels of the small picture; its shape does not follow the window's.
const METERED = [80, 60];
// Half floats end at 65,504: a picture further off than so many stops is measured again, nearer to its exposure.
const NEAR_STOPS = 6, ROUNDS = 4;

class Meter {
  constructor(stage) {
    const { gl } = stage;
    Object.assign(this, { stage, frame: null });
    if (!gl.getExtension("EXT_color_buffer_float")) return;
    this.frame = gl.createFramebuffer();
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.frame);
    // Where 32 bits do not blend, 16 do.
    const formats = [[gl.getExtension("EXT_float_blend") ? gl.RGBA32F : gl.RGBA16F, gl.COLOR_ATTACHMENT0], [gl.DEPTH_COMPONENT24, gl.DEPTH_ATTACHMENT]];
    for (const [format, place] of formats) {
      const part = gl.createRenderbuffer();
      gl.bindRenderbuffer(gl.RENDERBUFFER, part);
      gl.renderbufferStorage(gl.RENDERBUFFER, format, ...METERED);
      gl.framebufferRenderbuffer(gl.FRAMEBUFFER, place, gl.RENDERBUFFER, part);
    }
    if (gl.checkFramebufferStatus(gl.FRAMEBUFFER) !== gl.FRAMEBUFFER_COMPLETE) this.frame = null;
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
  }

  /** The stops for the objects in the picture that a view shows; for those of their vertices that shine where a card draws no floats. */
  stops(view) {
    if (!this.frame) return automaticStops(Float32Array.from(view.shade().flatMap(shiningVertices)), 3);
    let stops = 0;
    for (let round = 0; round < ROUNDS; round++) {
      const more = automaticStops(this.pixels(view, stops), 3);
      stops += more;
      if (Math.abs(more) < NEAR_STOPS) break;
    }
    return stops;
  }

  /** Radiance (3 P), exposed by so many stops, of the pixels that objects cover, as vertices shine and suns and lamps light each pixel. */
  pixels(view, stops) {
    const { stage, frame } = this, { gl } = stage, [width, height] = METERED;
    const plain = Object.create(view, {
      stops: { value: stops }, shown: { value: "picture" }, state: { value: { ...view.state, stops: 0, curve: "linear", signal: false } },
    });
    // Of fewer triangles: in software this is a part of the first picture's time.
    stage.prepare(plain, true);
    gl.bindFramebuffer(gl.FRAMEBUFFER, frame);
    gl.viewport(0, 0, width, height);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    stage.drawScene(plain, width, height, true);
    const found = new Float32Array(4 * width * height), covered = [];
    gl.readPixels(0, 0, width, height, gl.RGBA, gl.FLOAT, found);
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    for (let p = 0; p < found.length; p += 4) if (found[p + 3] > 0) covered.push(found[p], found[p + 1], found[p + 2]);
    return Float32Array.from(covered);
  }
}

/** The colours of an object's vertices (3 V) that shine at all: others face away. */
function shiningVertices(colours) {
  const found = [];
  for (let p = 0; p < colours.length; p += 3) {
    if (colours[p] || colours[p + 1] || colours[p + 2]) found.push(colours[p], colours[p + 1], colours[p + 2]);
  }
  return found;
}
