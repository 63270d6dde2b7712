// What lies on the graphics card: an object's buffers and textures.

// The attributes that number the vertices of a surface of chosen ones, and the corners of a triangle; of textures what is
// shone where the tint is 1, the tint, and the place in the texture.
const NUMBER = 6, CORNERS = 7, TINTED = 8, TINT = 9, PLACE = 10;
// Of normal maps the tangent with the sign of the binormal, and the vertex's mapped normal.
const ALONG = 11, MAPPED = 12;

/** The values (`width` a vertex) of the chosen vertices; all where none are chosen. */
function picked(values, width, chosen) {
  if (!chosen) return values;
  const found = new Float32Array(width * chosen.length);
  chosen.forEach((v, k) => { for (let c = 0; c < width; c++) found[width * k + c] = values[width * v + c]; });
  return found;
}

/** The vertices that triangles use, in the order in which they do, and the triangles among these. */
function usedVertices(triangles, vertices) {
  const places = new Int32Array(vertices).fill(-1), chosen = [];
  const own = Uint32Array.from(triangles, (v) => (places[v] < 0 ? (places[v] = chosen.push(v) - 1) : places[v]));
  return [own, Uint32Array.from(chosen)];
}

// An object's triangles with what their vertices are and shine: all of them, the few that are drawn while it moves, or all
// with corners of their own.
class Surface {
  /** `chosen` numbers the vertices, in the object's arrays; all unless given. `corners` are three numbers of each. */
  constructor(gl, object, triangles, chosen = null, corners = null) {
    this.vertices = chosen ? chosen.length : object.vertices;
    this.indices = triangles.length;
    this.chosen = chosen;
    const attribute = (place, width, buffer, stride = 0, offset = 0) => {
      gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
      gl.enableVertexAttribArray(place);
      if (place === NUMBER || place === CORNERS) gl.vertexAttribIPointer(place, width, gl.UNSIGNED_INT, 0, 0);
      else gl.vertexAttribPointer(place, width, gl.FLOAT, false, stride, offset);
      return buffer;
    };
    const fill = (place, width, values, use = gl.STATIC_DRAW) => {
      const buffer = gl.createBuffer();
      gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
      gl.bufferData(gl.ARRAY_BUFFER, values, use);
      return attribute(place, width, buffer);
    };
    // Shading reads what a vertex is, drawing what it shines: a buffer must not be read while it is written.
    this.shading = gl.createVertexArray();
    gl.bindVertexArray(this.shading);
    const given = [object.positions, object.normals, object.tangents].map((values, place) => [place, 3, fill(place, 3, picked(values, 3, chosen))]);
    if (chosen) given.push([NUMBER, 1, fill(NUMBER, 1, chosen)]);
    if (object.bumps) given.push([MAPPED, 3, fill(MAPPED, 3, picked(object.bumps.mapped, 3, chosen))]);
    this.drawing = gl.createVertexArray();
    gl.bindVertexArray(this.drawing);
    for (const each of given) attribute(...each);
    if (object.tint) {
      this.colours = fill(4, 3, 24 * this.vertices, gl.DYNAMIC_COPY);
      attribute(4, 3, this.colours, 24);
      attribute(TINTED, 3, this.colours, 24, 12);
      fill(TINT, 3, picked(object.tint.vertices, 3, chosen));
    } else {
      this.colours = fill(4, 3, 12 * this.vertices, gl.DYNAMIC_COPY);
    }
    if (object.tint || object.bumps) fill(PLACE, 2, picked((object.tint ?? object.bumps).uv, 2, chosen));
    if (object.bumps) fill(ALONG, 4, picked(object.bumps.tangents, 4, chosen));
    if (corners) fill(CORNERS, 3, corners);
    if (object.reference && !corners) {
      fill(3, 3, picked(object.reference, 3, chosen));
      fill(5, 1, picked(object.seen, 1, chosen));
    }
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, triangles, gl.STATIC_DRAW);
    gl.bindVertexArray(null);
    gl.bindBuffer(gl.ARRAY_BUFFER, null);
  }
}

/** View maps, a texel's numbers side by side, as layers of four numbers a texel. */
function viewLayers(texels, size, channels) {
  const terms = texels.length / channels / size ** 2, layers = new Float32Array(4 * terms * size * size);
  for (let t = 0; t < size * size; t++) {
    for (let k = 0; k < terms; k++) {
      for (let c = 0; c < 3; c++) layers[4 * (k * size * size + t) + c] = texels[(t * terms + k) * channels + (channels === 3 ? c : 0)];
    }
  }
  return layers;
}

class ObjectOnGpu {
  constructor(gl, object) {
    this.gl = gl;
    this.object = object;
    this.programs = new Map();
    this.whole = new Surface(gl, object, new Uint32Array(object.triangles));
    this.coarse = object.coarse ? new Surface(gl, object, ...usedVertices(object.coarse, object.vertices)) : null;
    this.makeMaps();
    this.makeTuples();
    this.lobe = object.lobe ? new LobeOnGpu(gl, object.lobe) : null;
    this.tint = object.tint ? new TintOnGpu(gl, object.tint) : null;
    this.bumps = object.bumps ? new BumpsOnGpu(gl, object) : null;
    this.sunTables = object.sunlight?.tables.map((table) => ({ ...table, texture: tableTexture(gl, table) }));
  }

  /** Whether pixels have the terms: where the page is to do so and the K-tuples fit. */
  pixelwise({ state }) {
    return state.interpolation === "pixel" && this.byPixel;
  }

  /** Whether pixels have more than what is mixed from vertices: a separate lobe, or a normal map. */
  get fine() {
    return Boolean(this.lobe || this.bumps);
  }

  /** The triangles to draw: the few where there are any and they are asked for. */
  surface(coarse) {
    return (coarse && this.coarse) || this.whole;
  }

  /** All triangles with corners of their own, each of which knows all three: made where it is asked for. */
  get corners() {
    if (!this.apart) {
      const chosen = new Uint32Array(this.object.triangles), corners = new Uint32Array(3 * chosen.length);
      for (let k = 0; k < corners.length; k++) corners[k] = chosen[3 * Math.floor(k / 9) + (k % 3)];
      this.apart = new Surface(this.gl, this.object, Uint32Array.from(chosen, (_, k) => k), chosen, corners);
    }
    return this.apart;
  }

  /** The view maps as layers of a texture; one channel is grey. */
  makeMaps() {
    const { gl } = this, { size, channels, texels } = this.object.map, { terms } = this.object, layers = viewLayers(texels, size, channels);
    this.maps = makeTexture(gl, gl.TEXTURE_2D_ARRAY, gl.LINEAR);
    gl.texImage3D(gl.TEXTURE_2D_ARRAY, 0, gl.linearFloats ? gl.RGBA32F : gl.RGBA16F, size, size, terms, 0, gl.RGBA, gl.FLOAT, layers);
  }

  makeTuples() {
    const { gl, object } = this, texels = object.vertices * object.quads;
    this.width = Math.min(texels, 2048);
    this.height = Math.ceil(texels / this.width);
    this.padded = new Float32Array(4 * this.width * this.height);
    this.tuples = makeTexture(gl, gl.TEXTURE_2D, gl.NEAREST);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA32F, this.width, this.height, 0, gl.RGBA, gl.FLOAT, null);
  }

  /** Brings the K-tuples over. */
  upload() {
    const { gl } = this;
    this.padded.set(this.object.tuples);
    gl.bindTexture(gl.TEXTURE_2D, this.tuples);
    gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, 0, this.width, this.height, gl.RGBA, gl.FLOAT, this.padded);
  }

  /** Whether K-tuples fit beside the rest into what a vertex may pass to pixels; those of a normal map are never passed. */
  get byPixel() {
    return !this.bumps && this.object.quads + (this.lobe ? 6 : 5) + (this.tint ? 3 : 0) <= this.gl.getParameter(this.gl.MAX_VARYING_VECTORS);
  }

  /**
   * The program for surfaces: "COLOURED" by what their vertices were shaded with, "BY_PIXEL" or both, "COMPARED" too; or
   * for shading vertices, "SHADES", "ALONE" of a separate lobe, "TERMS" of the others; "CHOSEN" of a surface that
   * is not the whole one. "BETWEEN": by what vertices were shaded with or "BY_PIXEL", and such a lobe by pixel; with a
   * normal map the terms too. "TILTED" shades vertices with their mapped normals.
   */
  program(...kinds) {
    const { gl, object } = this, key = kinds.join();
    if (!this.programs.has(key)) {
      const defines = Object.fromEntries([["QUADS", object.quads], ...kinds.map((kind) => [kind, 1]), ...(object.fade ? [["FADES", 1]] : []), ...(object.sunlight ? [["SUNS", 1]] : []), ...(object.tint ? [["TINTED", 1]] : []), ...(object.bumps ? [["BUMPED", 1]] : [])]);
      const [vertex, fragment] = kinds[0] === "SHADES" ? [shadeVertex(object), NOTHING] : [surfaceVertex(object), surfaceFragment(object, kinds.includes("BETWEEN"), object.lights)];
      this.programs.set(key, makeProgram(gl, shaderText(vertex, defines), shaderText(fragment, defines), object.name, { kept: kinds[0] === "SHADES" ? (object.tint ? ["v_colour", "v_tinted"] : "v_colour") : null }));
    }
    return this.programs.get(key);
  }

  /** Binds what `outgoing` reads. */
  bind(program, view) {
    const { gl } = this;
    gl.activeTexture(gl.TEXTURE0);
    gl.bindTexture(gl.TEXTURE_2D, this.tuples);
    gl.uniform1i(program.at("u_tuples"), 0);
    gl.activeTexture(gl.TEXTURE1);
    gl.bindTexture(gl.TEXTURE_2D_ARRAY, this.maps);
    gl.uniform1i(program.at("u_maps"), 1);
    gl.activeTexture(gl.TEXTURE0);
    gl.uniform1i(program.at("u_terms"), Math.min(view.state.terms, this.object.terms));
    gl.uniform3f(program.at("u_eye"), ...view.orbit.eye);
  }

  /** Shades every vertex of a surface once, into the buffer that drawing reads: of the terms too unless pixels have them. */
  shade(view, coarse = false) {
    const alone = this.lobe && this.pixelwise(view);
    this.shadeSurface(view, this.surface(coarse), ...(alone ? ["ALONE"] : []), ...(this.bumps && view.shown !== "picture" ? ["TILTED"] : []));
  }

  shadeSurface(view, surface, ...kinds) {
    const { gl } = this, program = this.program("SHADES", ...kinds, ...(surface === this.whole ? [] : ["CHOSEN"]));
    this.feedback ??= gl.createTransformFeedback();
    gl.useProgram(program.program);
    this.bind(program, view);
    this.lobe?.bind(program, view.stage.cells);
    this.bumps?.bind(program);
    gl.bindVertexArray(surface.shading);
    gl.bindTransformFeedback(gl.TRANSFORM_FEEDBACK, this.feedback);
    gl.bindBufferBase(gl.TRANSFORM_FEEDBACK_BUFFER, 0, surface.colours);
    gl.enable(gl.RASTERIZER_DISCARD);
    gl.beginTransformFeedback(gl.POINTS);
    gl.drawArrays(gl.POINTS, 0, surface.vertices);
    gl.endTransformFeedback();
    gl.disable(gl.RASTERIZER_DISCARD);
    gl.bindBufferBase(gl.TRANSFORM_FEEDBACK_BUFFER, 0, null);
    gl.bindTransformFeedback(gl.TRANSFORM_FEEDBACK, null);
    gl.bindVertexArray(null);
  }

  /** The colours (3 a vertex) that the last shading of a surface made. */
  read(coarse = false) {
    const { gl, object } = this, surface = this.surface(coarse), width = object.tint ? 6 : 3, found = new Float32Array(width * surface.vertices);
    gl.bindBuffer(gl.ARRAY_BUFFER, surface.colours);
    gl.getBufferSubData(gl.ARRAY_BUFFER, 0, found);
    gl.bindBuffer(gl.ARRAY_BUFFER, null);
    if (!object.tint) return found;
    const tints = picked(object.tint.vertices, 3, surface.chosen);
    return tints.map((tint, p) => { const at = 6 * Math.floor(p / 3) + (p % 3); return found[at] + found[at + 3] * tint; });
  }
}
