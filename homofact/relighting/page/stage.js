// What is drawn: the sky, the objects over it, the reference beside them.

const SHOWS = ["picture", "split", "reference", "difference"];
const RAMP = ["#15161a", "#4b3471", "#a54a78", "#ec8350", "#fbe58a"];
const SAMPLES = 4;
// Rows of the small picture of the sky: background.js's cube map has about 77 texels over a field of 36°.
const SMALL = 160;

class Stage {
  constructor(canvas, objects, lights) {
    this.canvas = canvas;
    this.gl = openContext(canvas);
    const { gl } = this;
    this.objects = objects.map((object) => new ObjectOnGpu(gl, object));
    this.cells = objects.some((object) => object.lobe) ? new CellsOnGpu(gl) : null;
    this.shadows = lights.length ? new ShadowsOnGpu(gl, lights, this.objects) : null;
    this.lamps = lights.some((light) => light.position) ? new LampsOnGpu(gl, lights) : null;
    this.skies = new Map();
    this.sky = makeProgram(gl, shaderText(SKY_VERTEX), shaderText(SKY_FRAGMENT), "the sky");
    this.copy = makeProgram(gl, shaderText(COPY_VERTEX), shaderText(COPY_FRAGMENT), "the sky");
    this.square = wholePicture(gl);
    gl.bindVertexArray(null);
    this.small = { frame: gl.createFramebuffer(), picture: makeTexture(gl, gl.TEXTURE_2D, gl.LINEAR), width: 0, height: 0 };
    this.smooth = { frame: gl.createFramebuffer(), parts: [gl.createRenderbuffer(), gl.createRenderbuffer()], width: 0, height: 0 };
    this.samples = Math.min(SAMPLES, gl.getParameter(gl.MAX_SAMPLES));
    this.ramp = Float32Array.from(RAMP.flatMap((c) => [1, 3, 5].map((k) => parseInt(c.slice(k, k + 2), 16) / 255)));
    this.radius = objects.reduce((most, { positions }) => {
      for (let p = 0; p < positions.length; p += 3) most = Math.max(most, Math.hypot(positions[p], positions[p + 1], positions[p + 2]));
      return most;
    }, 0) * 1.001;
    this.meter = new Meter(this);
    for (const { position, radius } of lights) if (position) this.radius = Math.max(this.radius, 1.01 * (Math.hypot(...position) + radius));
  }

  /** The K-tuples of all objects, anew. */
  upload() {
    for (const each of this.objects) each.upload();
  }

  /**
   * Draws into the whole canvas; `view` has the state, orbit and current sky. Edges are `smooth` or not; `coarse` draws
   * fewer triangles, and the sky, which is soft, from a smaller picture: both for a picture that moves.
   */
  draw(view, smooth = true, coarse = false) {
    const { gl } = this, { width, height } = this.canvas;
    this.prepare(view, coarse);
    if (coarse && !smooth) this.drawSmallSky(view, width, height);
    gl.bindFramebuffer(gl.FRAMEBUFFER, smooth ? this.smoothFrame(width, height) : null);
    gl.viewport(0, 0, width, height);
    gl.clear(gl.DEPTH_BUFFER_BIT);
    this.drawScene(view, width, height, coarse, !coarse || smooth);
    if (smooth) this.show();
  }

  /** Brings what vertices shine, and shadows, in line with a view. */
  prepare(view, coarse = false) {
    for (const each of this.objects) if (each.lobe || !each.pixelwise(view)) each.shade(view, coarse);
    this.shadows?.draw(view.state.turn);
  }

  /** Draws the sky, unless it is there, lamps and objects into a picture of this size: its alpha is what objects cover. */
  drawScene(view, width, height, coarse = false, sky = true) {
    const { gl } = this;
    gl.colorMask(true, true, true, false);
    if (sky) this.drawSky(view, width / height);
    gl.enable(gl.DEPTH_TEST);
    if (this.lamps && view.shown !== "difference") this.lamps.draw(this, view, width / height);
    gl.colorMask(true, true, true, true);
    // What ends softly comes last, over the others' background.
    const ordered = this.objects.toSorted((a, b) => Boolean(a.object.fade) - Boolean(b.object.fade));
    for (const each of ordered) this.drawObject(view, each, width, height, coarse);
    gl.bindVertexArray(null);
  }

  /** Brings the picture of several samples a pixel to the canvas. */
  show() {
    const { gl } = this, { width, height } = this.canvas;
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    // A canvas that was shown counts as empty until something is drawn into it, and then a copy does not.
    gl.clear(gl.COLOR_BUFFER_BIT);
    gl.bindFramebuffer(gl.READ_FRAMEBUFFER, this.smooth.frame);
    gl.blitFramebuffer(0, 0, width, height, 0, 0, width, height, gl.COLOR_BUFFER_BIT, gl.NEAREST);
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
  }

  /** Draws rows of separate lobes and of normal maps once more, computed at each pixel, over the smooth picture that is there. */
  drawBetween(view, from, rows) {
    const { gl } = this, { width, height } = this.canvas;
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.smoothFrame(width, height));
    gl.viewport(0, 0, width, height);
    gl.enable(gl.SCISSOR_TEST);
    gl.scissor(0, from, width, rows);
    gl.enable(gl.DEPTH_TEST);
    // Only what is seen.
    gl.depthFunc(gl.LEQUAL);
    for (const each of this.objects) if (each.fine) this.drawObject(view, each, width, height, false, true);
    gl.depthFunc(gl.LESS);
    gl.disable(gl.SCISSOR_TEST);
    gl.bindVertexArray(null);
    this.show();
  }

  /** What vertices shine for `drawBetween`: the terms alone. */
  shadeBetween(view) {
    for (const each of this.objects) if (each.lobe && !each.bumps && !each.pixelwise(view)) each.shadeSurface(view, each.corners, "TERMS");
  }

  /** The sky alone, by way of a picture of at most `SMALL` rows: its own texels are larger. */
  drawSmallSky(view, width, height) {
    const { gl, small } = this, part = Math.min(1, SMALL / height);
    const own = [width, height].map((x) => Math.max(1, Math.round(x * part)));
    gl.bindFramebuffer(gl.FRAMEBUFFER, small.frame);
    if (small.width !== own[0] || small.height !== own[1]) {
      [small.width, small.height] = own;
      gl.bindTexture(gl.TEXTURE_2D, small.picture);
      gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA8, ...own, 0, gl.RGBA, gl.UNSIGNED_BYTE, null);
      gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, small.picture, 0);
    }
    gl.viewport(0, 0, ...own);
    this.drawSky(view, width / height);
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    gl.viewport(0, 0, width, height);
    gl.useProgram(this.copy.program);
    gl.bindTexture(gl.TEXTURE_2D, small.picture);
    gl.uniform1i(this.copy.at("u_picture"), 0);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
  }

  /** A picture of several samples a pixel. */
  smoothFrame(width, height) {
    const { gl, smooth } = this;
    if (smooth.width === width && smooth.height === height) return smooth.frame;
    Object.assign(smooth, { width, height });
    gl.bindFramebuffer(gl.FRAMEBUFFER, smooth.frame);
    const kinds = [[gl.RGB8, gl.COLOR_ATTACHMENT0], [gl.DEPTH_COMPONENT24, gl.DEPTH_ATTACHMENT]];
    kinds.forEach(([format, place], k) => {
      gl.bindRenderbuffer(gl.RENDERBUFFER, smooth.parts[k]);
      gl.renderbufferStorageMultisample(gl.RENDERBUFFER, this.samples, format, width, height);
      gl.framebufferRenderbuffer(gl.FRAMEBUFFER, place, gl.RENDERBUFFER, smooth.parts[k]);
    });
    return smooth.frame;
  }

  tones(view, program) {
    const { gl } = this, { state } = view;
    gl.uniform1f(program.at("u_exposure"), 2 ** (view.stops + state.stops));
    gl.uniform1i(program.at("u_filmic"), state.curve === "filmic" ? 1 : 0);
    gl.uniform1i(program.at("u_linear"), state.curve === "linear" ? 1 : 0);
  }

  drawSky(view, aspect) {
    const { gl, sky } = this;
    if (!this.skies.has(view.sky)) this.skies.set(view.sky, skyTexture(gl, view.sky.picture));
    const { texture, scale } = this.skies.get(view.sky);
    gl.disable(gl.DEPTH_TEST);
    gl.useProgram(sky.program);
    this.tones(view, sky);
    gl.bindTexture(gl.TEXTURE_CUBE_MAP, texture);
    gl.uniform1i(sky.at("u_picture"), 0);
    gl.uniform1f(sky.at("u_scale"), scale);
    gl.uniform1i(sky.at("u_plain"), view.shown === "difference" ? 1 : 0);
    gl.uniform3fv(sky.at("u_ground"), this.ramp.subarray(0, 3));
    const [right, up, forward] = view.orbit.axes, half = Math.tan((view.orbit.field * DEGREE) / 2);
    const axes = [scaled(right, half * aspect), scaled(up, half), forward].map((axis) => turnedBack(axis, view.state.turn));
    gl.uniform3fv(sky.at("u_axes"), Float32Array.from(axes.flat()));
    const levels = view.shining, suns = view.suns.map((sun, q) => ({ ...sun, level: levels[q] })).filter(({ level }) => level > 0);
    gl.uniform1i(sky.at("u_suns"), suns.length);
    if (suns.length) {
      gl.uniform4fv(sky.at("u_discs"), Float32Array.from(suns.flatMap(({ direction, radius }) => [...direction, Math.cos(radius)])));
      gl.uniform3fv(sky.at("u_disc_light"), Float32Array.from(suns.flatMap(({ irradiance, radius, level }) => scaled(irradiance, level / (Math.PI * Math.sin(radius) ** 2)))));
    }
    gl.bindVertexArray(this.square);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
  }

  drawObject(view, each, width, height, coarse = false, between = false) {
    const { gl } = this, { state, orbit } = view, { object } = each;
    // Under a normal map pixels have terms of their own.
    const tilted = between && each.bumps, byPixel = each.pixelwise(view), compared = view.shown !== "picture";
    const surface = between ? each.corners : each.surface(coarse), chosen = byPixel && surface !== each.whole;
    const coloured = between ? !byPixel && !tilted : !byPixel || each.lobe;
    const program = each.program(...(byPixel ? ["BY_PIXEL"] : []), ...(coloured ? ["COLOURED"] : []), ...(chosen ? ["CHOSEN"] : []), ...(compared ? ["COMPARED"] : []), ...(between ? ["BETWEEN"] : []));
    gl.useProgram(program.program);
    this.tones(view, program);
    if (byPixel || between) each.bind(program, view);
    if (between) each.lobe?.bind(program, this.cells);
    each.bumps?.bind(program);
    if (each.tint && !compared) each.tint.bind(program);
    if (each.sunTables) {
      this.shadows.bind(program, each.sunTables, object.sunlight, view.shining);
      gl.uniform3f(program.at("u_eye"), ...orbit.eye);
    }
    gl.uniformMatrix4fv(program.at("u_camera"), false, orbit.matrix(width / height, this.radius));
    gl.uniform1i(program.at("u_signal"), state.signal ? 1 : 0);
    gl.uniform2f(program.at("u_fade"), ...(object.fade ?? [0, 0]));
    if (compared) {
      gl.uniform1i(program.at("u_show"), SHOWS.indexOf(view.shown));
      gl.uniform1f(program.at("u_split"), state.split * width);
      gl.uniform1f(program.at("u_range"), state.range);
      gl.uniform3fv(program.at("u_ramp"), this.ramp);
    }
    // Of a closed surface the back is never seen; a plane that ends softly is not there from below.
    if (object.closed || object.fade) gl.enable(gl.CULL_FACE);
    if (object.fade && !between) {
      gl.enable(gl.BLEND);
      gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
    }
    gl.bindVertexArray(surface.drawing);
    gl.drawElements(gl.TRIANGLES, surface.indices, gl.UNSIGNED_INT, 0);
    gl.disable(gl.CULL_FACE);
    gl.disable(gl.BLEND);
  }

  /** Waits for the card: a pixel read back. */
  finish() {
    const { gl } = this;
    gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(4));
  }

  /** The bytes (rows from below × 4) of the picture just drawn, in the same turn of the page's thread. */
  pixels() {
    const { gl } = this, { width, height } = this.canvas, bytes = new Uint8Array(4 * width * height);
    gl.readPixels(0, 0, width, height, gl.RGBA, gl.UNSIGNED_BYTE, bytes);
    return bytes;
  }
}

/** A direction in the frame of a sky that is turned by degrees about y, from +z towards +x: where it looks into the sky. */
function turnedBack([x, y, z], degrees) {
  const a = degrees * DEGREE, [s, c] = [Math.sin(a), Math.cos(a)];
  return [c * x - s * z, y, s * x + c * z];
}
