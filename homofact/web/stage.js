// What is drawn: the state of the view, the passes that gather radiance, and the pictures made of it.

const RADIUS = 0.94;               // of half the picture's shorter side, as in the project's own renderer
const GROUND = 0.024;              // linear grey behind the object, likewise
const PASSES = {
  directional: { sphere: 1, mesh: 16 }, overcast: { sphere: 48, mesh: 48 }, studio: { sphere: 64, mesh: 64 },
  sky: { sphere: 96, mesh: 96 },
};
// From this pass on each pixel has all samples of the set (lighting.js), and the picture is no longer smoothed.
const SMOOTH_PASSES = 16;
const LIGHTS = ["directional", "overcast", "studio", "sky"];
const MODES = ["off", "signed", "absolute", "ratio"];
const FACTORS = ["1", "2", "4", "8", "16", "32", "64", "128", "256"];

// Nine colours from one end to the other, safe for colour-blind eyes: lightness alone tells them apart.
const RAMPS = {
  signed: ["#7cc4ff", "#4a9be8", "#2f6fb5", "#25476f", "#222326", "#6b4423", "#b0672a", "#e8923c", "#ffc27a"],
  absolute: ["#1d1e22", "#2c2a4a", "#4b3471", "#783d7f", "#a54a78", "#cf5f63", "#ec8350", "#f8b255", "#fbe58a"],
};

// The angle of a vector, of any length, from the normal.
const fromNormal = (w) => Math.atan2(Math.hypot(w[0], w[1]), w[2]);
const azimuthal = (n) => (Math.hypot(n[0], n[2]) > 1e-6 ? normalized([n[2], 0, -n[0]]) : [1, 0, 0]);
/** The unit vector of an azimuth from +z towards +x and an elevation, in degrees. */
function direction({ azimuth, elevation }) {
  const a = (azimuth * Math.PI) / 180, e = (elevation * Math.PI) / 180;
  return [Math.cos(e) * Math.sin(a), Math.sin(e), Math.cos(e) * Math.cos(a)];
}

class Stage {
  constructor(canvas, layers, mesh) {
    this.canvas = canvas;
    this.gl = openFloatContext(canvas);
    const gl = this.gl;
    // Sums of passes are blended; where 32 bits do not blend, 16 do.
    this.format = gl.getExtension("EXT_float_blend") ? gl.RGBA32F : gl.RGBA16F;
    this.layers = new Map(layers.map((layer) => [layer.key, new LayerOnGpu(gl, layer)]));
    this.mesh = mesh ? new MeshOnGpu(gl, mesh) : null;
    this.reach = mesh?.reach ?? 1;
    this.targets = new Map(layers.map((layer) => [layer.key, new Target(gl, this.format, Boolean(mesh))]));
    this.display = compileProgram(gl, CORNERS, DISPLAY, "the picture");
    this.square = wholePicture(gl);
    gl.bindVertexArray(null);
    this.passes = 0;
    this.sky = null;
    this.ramps = Object.fromEntries(Object.entries(RAMPS).map(([name, colours]) => [name, Float32Array.from(
      colours.flatMap((c) => [1, 3, 5].map((k) => parseInt(c.slice(k, k + 2), 16) / 255)))]));
  }

  /** Lights everything by a sky of `skyLight` from now on. Throws Trouble for one that is too large. */
  setSky(sky) {
    const gl = this.gl;
    if (Math.max(sky.rows, sky.columns) > gl.getParameter(gl.MAX_TEXTURE_SIZE)) {
      throw new Trouble(`${sky.name}: it is larger than this machine's textures.`, "Make it smaller.");
    }
    const old = this.sky;
    this.sky = {
      map: upload2D(gl, { type: "float32", rows: sky.rows, columns: sky.columns, texels: sky.texels }),
      drawn: uploadExactly(gl, 64, DRAWN / 64, sky.drawn),
    };
    gl.bindTexture(gl.TEXTURE_2D, this.sky.map);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_WRAP_S, gl.REPEAT);
    for (const texture of Object.values(old ?? {})) gl.deleteTexture(texture);
  }

  /** Binds the sky for a program in use. */
  useSky(state, program, units) {
    const gl = this.gl;
    for (const [name, unit, texture] of [["u_sky", units[0], this.sky.map], ["u_drawn", units[1], this.sky.drawn]]) {
      gl.activeTexture(gl.TEXTURE0 + unit);
      gl.bindTexture(gl.TEXTURE_2D, texture);
      gl.uniform1i(program.at(name), unit);
    }
    gl.uniform1f(program.at("u_turn"), (state.lightFrom.azimuth * Math.PI) / 180);
  }

  /** Right, up and towards the viewer as columns. */
  camera(state) {
    const forward = direction(state.camera), right = azimuthal(forward);
    return [...right, ...cross(forward, right), ...forward];
  }

  /** Radius of the unit sphere in a picture of this size, in its pixels; a mesh's longest side is as long as a ball's. */
  radius(state, width, height) {
    return (RADIUS * 0.5 * Math.min(width, height) * state.zoom) / (state.surface === "mesh" ? this.reach : 1);
  }

  /** Finds the shadow that the mesh casts on itself, where it is lit from all around. */
  findShadows(state) {
    if (state.surface === "mesh" && state.light !== "directional") this.mesh.findBlocked(this.format);
  }

  passesWanted(state) {
    return PASSES[state.light][state.surface];
  }

  /** Adds a pass to the sums of `keys`, or begins them anew; `scale` of the picture's pixels are drawn. */
  gather(state, keys, width, height, scale, anew) {
    const gl = this.gl;
    this.findShadows(state);
    if (anew) this.passes = 0;
    this.scale = scale;
    const small = [Math.max(1, Math.floor(width * scale)), Math.max(1, Math.floor(height * scale))];
    for (const key of keys) {
      const target = this.targets.get(key);
      target.resize(width, height);
      target.bind();
      gl.viewport(0, 0, ...small);
      if (this.passes === 0) {
        gl.clearColor(0, 0, 0, 0);
        gl.clear(gl.COLOR_BUFFER_BIT);
      }
      if (this.mesh) gl.clear(gl.DEPTH_BUFFER_BIT);
      this.drawLayer(state, key, small, this.passes);
    }
    this.passes += 1;
  }

  drawLayer(state, key, [width, height], pass) {
    const gl = this.gl;
    const program = this.layers.get(key).use(state.surface);
    // Where in the pixel a surface is looked at: the centre first, then anywhere.
    const shift = pass === 0 ? [0, 0]
      : [((pass * 0.7548776662) % 1) - 0.5, ((pass * 0.569840291) % 1) - 0.5];
    gl.uniform2f(program.at("u_size"), width, height);
    gl.uniform2f(program.at("u_shift"), ...shift);
    gl.uniform1f(program.at("u_radius"), this.radius(state, width, height));
    gl.uniformMatrix3fv(program.at("u_camera"), false, this.camera(state));
    gl.uniform3f(program.at("u_towards"), ...direction(state.lightFrom));
    gl.uniform1i(program.at("u_light"), LIGHTS.indexOf(state.light));
    gl.uniform1i(program.at("u_pass"), pass);
    // A layer's own textures are from unit 2 on.
    this.useSky(state, program, [0, 1]);
    if (state.surface === "mesh") {
      // Depth first, so that only what is seen is shaded, and added to the sums once.
      gl.colorMask(false, false, false, false);
      this.mesh.draw();
      gl.colorMask(true, true, true, true);
      gl.depthFunc(gl.EQUAL);
    }
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.ONE, pass > 0 ? gl.ONE : gl.ZERO);
    if (state.surface === "mesh") {
      this.mesh.draw();
    } else {
      gl.bindVertexArray(this.square);
      gl.drawArrays(gl.TRIANGLES, 0, 3);
    }
    gl.disable(gl.BLEND);
    gl.depthFunc(gl.LESS);
  }

  /** Puts the picture of a layer, or its difference to `reference`, onto a 2D canvas. */
  show(state, key, reference, context) {
    const gl = this.gl, { width, height } = this.targets.get(key);
    if (this.canvas.width !== width || this.canvas.height !== height) {
      [this.canvas.width, this.canvas.height] = [width, height];
    }
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    gl.viewport(0, 0, width, height);
    gl.useProgram(this.display.program);
    for (const [unit, name, of] of [[0, "u_here", key], [1, "u_there", reference ?? key]]) {
      gl.activeTexture(gl.TEXTURE0 + unit);
      gl.bindTexture(gl.TEXTURE_2D, this.targets.get(of).texture);
      gl.uniform1i(this.display.at(name), unit);
    }
    this.useSky(state, this.display, [2, 3]);
    gl.uniform1i(this.display.at("u_under_sky"), Number(state.light === "sky"));
    gl.uniformMatrix3fv(this.display.at("u_camera"), false, this.camera(state));
    const mode = reference ? MODES.indexOf(state.difference) : 0;
    gl.uniform2f(this.display.at("u_size"), width, height);
    gl.uniform1f(this.display.at("u_scale"), this.scale);
    gl.uniform1f(this.display.at("u_passes"), this.passes);
    // The first passes' noise is averaged over pixels whose starts of samples complete each other (lighting.js).
    const across = state.light === "directional" || this.passes >= SMOOTH_PASSES ? 1 : this.passes >= 4 ? 2 : 4;
    gl.uniform1f(this.display.at("u_width"), across);
    gl.uniform1f(this.display.at("u_exposure"), 2 ** state.stops);
    gl.uniform3f(this.display.at("u_ground"), GROUND, GROUND, GROUND);
    gl.uniform1i(this.display.at("u_mode"), mode);
    gl.uniform1f(this.display.at("u_range"), differenceRange(state));
    gl.uniform3fv(this.display.at("u_ramp"), this.ramps[state.difference === "absolute" ? "absolute" : "signed"]);
    gl.bindVertexArray(this.square);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
    context.drawImage(this.canvas, 0, 0);
  }

  /** The stops of the automatic exposure of a layer's picture, in tenths. */
  autoStops(state, key) {
    const gl = this.gl, isPoint = state.light === "directional", [side, passes] = isPoint ? [96, 1] : [48, 16];
    this.findShadows(state);
    this.small ??= new Target(gl, this.format, Boolean(this.mesh));
    this.small.resize(side, side);
    this.small.bind();
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT);
    for (let pass = 0; pass < passes; pass++) {
      gl.clear(gl.DEPTH_BUFFER_BIT);
      this.drawLayer({ ...state, zoom: 1 }, key, [side, side], pass);
    }
    const pixels = new Float32Array(4 * side * side);
    gl.readPixels(0, 0, side, side, gl.RGBA, gl.FLOAT, pixels);
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    const covered = [];
    for (let i = 0; i < pixels.length; i += 4) {
      if (!(pixels[i + 3] > 0)) continue;
      for (let k = 0; k < 3; k++) covered.push(pixels[i + k] / pixels[i + 3]);
    }
    return Math.round(10 * automaticStops(covered, 3)) / 10;
  }

  /** {width, height, values}: the sums of a layer's passes, four numbers a pixel (radiance, coverage), from below. */
  radiance(key) {
    const gl = this.gl, target = this.targets.get(key), { width, height } = target;
    const values = new Float32Array(4 * width * height);
    target.bind();
    gl.readPixels(0, 0, width, height, gl.RGBA, gl.FLOAT, values);
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    return { width, height, values };
  }

  /** BRDF values (3 N, in sr⁻¹) of a layer at N pairs of unit local directions (3 N each), as its shader gives them. */
  evaluate(key, wi, wo) {
    const gl = this.gl, count = wi.length / 3;
    if (wi.length !== wo.length || !Number.isInteger(count)) throw new RangeError("wi and wo: expected 3 N numbers each");
    if (!this.layers.has(key)) throw new RangeError(`no layer ${key}, expected one of ${[...this.layers.keys()]}`);
    if (count === 0) return new Float32Array(0);
    const width = Math.min(count, 1024), height = Math.ceil(count / width);
    const program = this.layers.get(key).use("evaluate");
    const inputs = [wi, wo].map((directions, unit) => {
      const padded = new Float32Array(4 * width * height);
      for (let i = 0; i < count; i++) padded.set([directions[3 * i], directions[3 * i + 1], directions[3 * i + 2]], 4 * i);
      gl.activeTexture(gl.TEXTURE0 + unit);
      return uploadExactly(gl, width, height, padded);
    });
    const target = new Target(gl, gl.RGBA32F, false);
    target.resize(width, height);
    target.bind();
    inputs.forEach((id, unit) => {
      gl.activeTexture(gl.TEXTURE0 + unit);
      gl.bindTexture(gl.TEXTURE_2D, id);
    });
    gl.uniform1i(program.at("u_wi"), 0);
    gl.uniform1i(program.at("u_wo"), 1);
    gl.bindVertexArray(this.square);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
    const pixels = new Float32Array(4 * width * height);
    gl.readPixels(0, 0, width, height, gl.RGBA, gl.FLOAT, pixels);
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    [...inputs, target.texture].forEach((id) => gl.deleteTexture(id));
    gl.deleteFramebuffer(target.frame);
    const values = new Float32Array(3 * count);
    for (let i = 0; i < count; i++) values.set(pixels.subarray(4 * i, 4 * i + 3), 3 * i);
    return values;
  }

  /** θi, θo and the local directions at a pixel (from the top left) of a picture, or null beside the object. */
  pointAt(state, x, y, width, height) {
    const camera = this.camera(state), radius = this.radius(state, width, height);
    const [right, up, forward] = [0, 3, 6].map((k) => camera.slice(k, k + 3));
    let normal;
    if (state.surface === "mesh") {
      normal = this.mesh.normalAt(x, height - y, width, height, radius, camera);
    } else {
      const a = (x - width / 2) / radius, b = (height / 2 - y) / radius, c = 1 - a * a - b * b;
      if (c > 0) normal = [0, 1, 2].map((k) => right[k] * a + up[k] * b + forward[k] * Math.sqrt(c));
    }
    if (!normal) return null;
    const tangent = azimuthal(normal), binormal = cross(normal, tangent), towards = direction(state.lightFrom);
    const local = (w) => normalized([dot(tangent, w), dot(binormal, w), dot(normal, w)]);
    return { wi: local(towards), wo: local(forward) };
  }
}

/** What full colour stands for: luminance as a part of the picture's white, or stops. */
function differenceRange(state) {
  return (state.difference === "ratio" ? 4 : 1) / state.factor;
}
