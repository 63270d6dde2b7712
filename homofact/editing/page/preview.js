// The preview: the edited material on a sphere under one light, to be turned. It is for looking at; pictures are exact.

const PREVIEW_START = { azimuth: 0, elevation: 15, light: { azimuth: 40, elevation: 45 } };

class Preview {
  /** `materials` hold each its terms with unpacked tables, and its curves. Throws Trouble without WebGL 2. */
  constructor(canvas, materials, channels) {
    this.canvas = canvas;
    this.channels = channels;
    this.gl = openContext(canvas);
    const { gl } = this;
    this.floats = Boolean(gl.getExtension("EXT_color_buffer_float"));
    this.square = wholePicture(gl);
    this.curves = makeTexture(gl, gl.TEXTURE_2D, gl.NEAREST);
    this.materials = materials.map((material) => ({ ...material, made: null, stops: null }));
    this.reset();
  }

  reset() {
    Object.assign(this, { azimuth: PREVIEW_START.azimuth, elevation: PREVIEW_START.elevation, light: { ...PREVIEW_START.light } });
  }

  turn(across, up) {
    this.azimuth = wrapped(this.azimuth + across);
    this.elevation = clamped(this.elevation + up, -89, 89);
  }

  move(across, up) {
    this.light = { azimuth: wrapped(this.light.azimuth + across), elevation: clamped(this.light.elevation + up, -89, 89) };
  }

  /** Right, up and towards the viewer as columns. */
  get axes() {
    const forward = towards(this), right = normalized([forward[2], 0, -forward[0]]);
    return [...right, ...cross(forward, right), ...forward];
  }

  /** A material's program and tables, made when it is first looked at. */
  made(number) {
    const material = this.materials[number], { gl } = this;
    material.made ??= {
      program: makeProgram(gl, shaderText(CORNER_VERTEX), shaderText(previewFragment(material.terms, material.curves)), "the preview"),
      tables: material.terms.map((term) => this.table(term)),
    };
    return material.made;
  }

  table({ sizes: [half, difference, about, around], halves }) {
    const { gl } = this, texture = makeTexture(gl, gl.TEXTURE_3D, gl.LINEAR), { channels } = this, count = halves.length / channels;
    gl.texParameteri(gl.TEXTURE_3D, gl.TEXTURE_WRAP_R, gl.CLAMP_TO_EDGE);
    const texels = new Uint16Array(4 * count);
    for (let i = 0; i < count; i++) for (let c = 0; c < 3; c++) texels[4 * i + c] = halves[i * channels + (channels === 3 ? c : 0)];
    gl.texImage3D(gl.TEXTURE_3D, 0, gl.RGBA16F, half, difference, about * around, 0, gl.RGBA, gl.HALF_FLOAT, texels);
    return texture;
  }

  /** Brings a material's curves over, a row each. */
  upload(curves, state) {
    const { gl, channels } = this, width = Math.max(...curves.map((curve) => curve.bands)), texels = new Float32Array(4 * width * curves.length);
    curves.forEach((curve, row) => {
      const { values } = state[curve.index];
      for (let j = 0; j < curve.bands; j++) {
        for (let c = 0; c < 3; c++) texels[4 * (row * width + j) + c] = values[j * channels + (channels === 3 ? c : 0)];
      }
    });
    gl.activeTexture(gl.TEXTURE0);
    gl.bindTexture(gl.TEXTURE_2D, this.curves);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA32F, width, curves.length, 0, gl.RGBA, gl.FLOAT, texels);
  }

  render(number, state, width, height, raw, stops, curve) {
    const { gl } = this, { program, tables } = this.made(number);
    gl.viewport(0, 0, width, height);
    gl.useProgram(program.program);
    this.upload(this.materials[number].curves, state);
    gl.uniform1i(program.at("u_curves"), 0);
    tables.forEach((texture, t) => {
      gl.activeTexture(gl.TEXTURE1 + t);
      gl.bindTexture(gl.TEXTURE_3D, texture);
      gl.uniform1i(program.at(`u_quotient_${t}`), 1 + t);
    });
    gl.uniform2f(program.at("u_size"), width, height);
    gl.uniformMatrix3fv(program.at("u_axes"), false, this.axes);
    gl.uniform3f(program.at("u_light"), ...towards(this.light));
    gl.uniform1i(program.at("u_raw"), raw ? 1 : 0);
    gl.uniform1f(program.at("u_exposure"), 2 ** stops);
    gl.uniform1i(program.at("u_filmic"), curve === "filmic" ? 1 : 0);
    gl.bindVertexArray(this.square);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
  }

  /** Draws a material with the curves of `state`; its exposure is that of the curves of `start`, so that edits show. */
  draw(number, state, start, curve) {
    const material = this.materials[number], { canvas } = this, ratio = Math.min(window.devicePixelRatio || 1, 2);
    const size = Math.max(16, Math.round(canvas.clientWidth * ratio));
    if (canvas.width !== size) canvas.width = canvas.height = size;
    material.stops ??= this.stops(number, start);
    this.gl.bindFramebuffer(this.gl.FRAMEBUFFER, null);
    this.render(number, state, size, size, false, material.stops, curve);
  }

  /** The automatic exposure of the sphere, as that of the pictures. */
  stops(number, start) {
    if (!this.floats) return 0;
    const covered = this.radiance(number, start, 64).filter((_, i, all) => i % 4 < 3 && all[i | 3] > 0);
    return automaticStops(covered, 3);
  }

  /** Radiance (size² × 4, rows from below; the fourth says whether the sphere is there). */
  radiance(number, state, size) {
    const { gl } = this, frame = gl.createFramebuffer(), texture = makeTexture(gl, gl.TEXTURE_2D, gl.NEAREST);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA32F, size, size, 0, gl.RGBA, gl.FLOAT, null);
    gl.bindFramebuffer(gl.FRAMEBUFFER, frame);
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, texture, 0);
    this.render(number, state, size, size, true, 0, "srgb");
    const found = new Float32Array(4 * size * size);
    gl.readPixels(0, 0, size, size, gl.RGBA, gl.FLOAT, found);
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    gl.deleteFramebuffer(frame);
    gl.deleteTexture(texture);
    return found;
  }
}

/** The unit vector of an azimuth from +z towards +x and an elevation. */
function towards({ azimuth, elevation }) {
  const a = azimuth * DEGREE, e = elevation * DEGREE;
  return [Math.cos(e) * Math.sin(a), Math.sin(e), Math.cos(e) * Math.cos(a)];
}

/** Materials with what the preview needs of them: terms { name, sizes, scale, halves, error } and curves. */
async function unpackPreviews(data, curves) {
  return Promise.all(data.materials.map(async (material, number) => ({
    terms: await Promise.all(material.terms.map(async ({ name, quotient }) => ({
      name, sizes: quotient.sizes, scale: quotient.scale, error: quotient.error, halves: await unpack(quotient.values),
    }))),
    curves: curves.filter((curve) => curve.material === number),
  })));
}
