// What lies on the graphics card: an object's buffers and textures.

class ObjectOnGpu {
  constructor(gl, object) {
    this.gl = gl;
    this.object = object;
    this.programs = new Map();
    this.makeBuffers();
    this.makeMaps();
    this.makeTuples();
  }

  makeBuffers() {
    const { gl, object } = this;
    const fill = (place, width, values, use = gl.STATIC_DRAW) => {
      const buffer = gl.createBuffer();
      gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
      gl.bufferData(gl.ARRAY_BUFFER, values, use);
      gl.enableVertexAttribArray(place);
      gl.vertexAttribPointer(place, width, gl.FLOAT, false, 0, 0);
      return buffer;
    };
    // Shading reads what a vertex is, drawing what it shines: a buffer must not be read while it is written.
    this.shading = gl.createVertexArray();
    gl.bindVertexArray(this.shading);
    const given = [object.positions, object.normals, object.tangents].map((values, place) => fill(place, 3, values));
    this.drawing = gl.createVertexArray();
    gl.bindVertexArray(this.drawing);
    given.forEach((buffer, place) => {
      gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
      gl.enableVertexAttribArray(place);
      gl.vertexAttribPointer(place, 3, gl.FLOAT, false, 0, 0);
    });
    this.colours = fill(4, 3, 12 * object.vertices, gl.DYNAMIC_COPY);
    if (object.reference) {
      fill(3, 3, object.reference);
      fill(5, 1, object.seen);
    }
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, new Uint32Array(object.triangles), gl.STATIC_DRAW);
    gl.bindVertexArray(null);
    gl.bindBuffer(gl.ARRAY_BUFFER, null);
  }

  /** The view maps as layers of a texture; one channel is grey. */
  makeMaps() {
    const { gl } = this, { size, channels, texels } = this.object.map, { terms } = this.object;
    const layers = new Float32Array(4 * terms * size * size);
    for (let t = 0; t < size * size; t++) {
      for (let k = 0; k < terms; k++) {
        for (let c = 0; c < 3; c++) layers[4 * (k * size * size + t) + c] = texels[(t * terms + k) * channels + (channels === 3 ? c : 0)];
      }
    }
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

  /** Whether K-tuples fit beside the rest into what a vertex may pass to pixels. */
  get byPixel() {
    return this.object.quads + 5 <= this.gl.getParameter(this.gl.MAX_VARYING_VECTORS);
  }

  /** The program for surfaces, "BY_PIXEL" and "COMPARED" or neither; or for shading vertices. */
  program(...kinds) {
    const { gl, object } = this, key = kinds.join();
    if (!this.programs.has(key)) {
      const defines = Object.fromEntries([["QUADS", object.quads], ...kinds.map((kind) => [kind, 1]), ...(object.fade ? [["FADES", 1]] : [])]);
      const [vertex, fragment] = kinds[0] === "SHADES" ? [shadeVertex(object), NOTHING] : [surfaceVertex(object), surfaceFragment(object)];
      this.programs.set(key, makeProgram(gl, shaderText(vertex, defines), shaderText(fragment, defines), object.name, kinds[0] === "SHADES" ? "v_colour" : null));
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

  /** Shades every vertex once, into the buffer that drawing reads. */
  shade(view) {
    const { gl } = this, program = this.program("SHADES");
    this.feedback ??= gl.createTransformFeedback();
    gl.useProgram(program.program);
    this.bind(program, view);
    gl.bindVertexArray(this.shading);
    gl.bindTransformFeedback(gl.TRANSFORM_FEEDBACK, this.feedback);
    gl.bindBufferBase(gl.TRANSFORM_FEEDBACK_BUFFER, 0, this.colours);
    gl.enable(gl.RASTERIZER_DISCARD);
    gl.beginTransformFeedback(gl.POINTS);
    gl.drawArrays(gl.POINTS, 0, this.object.vertices);
    gl.endTransformFeedback();
    gl.disable(gl.RASTERIZER_DISCARD);
    gl.bindBufferBase(gl.TRANSFORM_FEEDBACK_BUFFER, 0, null);
    gl.bindTransformFeedback(gl.TRANSFORM_FEEDBACK, null);
    gl.bindVertexArray(null);
  }

  /** The colours (3 V) that the last shading made. */
  read() {
    const { gl } = this, found = new Float32Array(3 * this.object.vertices);
    gl.bindBuffer(gl.ARRAY_BUFFER, this.colours);
    gl.getBufferSubData(gl.ARRAY_BUFFER, 0, found);
    gl.bindBuffer(gl.ARRAY_BUFFER, null);
    return found;
  }
}
