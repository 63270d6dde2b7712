// The mesh on the GPU, and finding the normal under the pointer on it.

/** Positions in 16 bits of the unit cube, octahedral normals in 16 bits, indices as differences. */
async function unpackMesh(packed) {
  const [positions, normals, indices] = await Promise.all(
    [packed.positions, packed.normals, packed.triangles].map(unpack));
  accumulate(indices, 1, indices.length);
  // Half the longest side of its box, where 1 is the radius of the sphere round it.
  const reach = positions.reduce((most, p) => Math.max(most, Math.abs((2 * p) / 65535 - 1)), 0);
  return { name: packed.name, positions, normals, indices, reach };
}

class MeshOnGpu {
  constructor(gl, mesh) {
    this.gl = gl;
    this.count = mesh.indices.length;
    this.vertices = mesh.positions.length / 3;
    this.array = gl.createVertexArray();
    gl.bindVertexArray(this.array);
    gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ARRAY_BUFFER, mesh.positions, gl.STATIC_DRAW);
    gl.enableVertexAttribArray(0);
    gl.vertexAttribPointer(0, 3, gl.UNSIGNED_SHORT, true, 0, 0);
    gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ARRAY_BUFFER, mesh.normals, gl.STATIC_DRAW);
    gl.enableVertexAttribArray(1);
    gl.vertexAttribPointer(1, 2, gl.SHORT, true, 0, 0);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, new Uint32Array(mesh.indices), gl.STATIC_DRAW);
    gl.bindVertexArray(null);
    this.probe = null;
    this.blocked = null;
  }

  /** Finds what the mesh blocks of its own light, once. Binds a framebuffer of its own. */
  findBlocked(format) {
    if (this.blocked) return;
    const gl = this.gl;
    this.blocked = blockedHarmonics(gl, this, format);
    const stored = Int16Array.from(this.blocked, (x) => Math.round((32767 * clamped(x, -HARMONICS_SCALE, HARMONICS_SCALE)) / HARMONICS_SCALE));
    gl.bindVertexArray(this.array);
    gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ARRAY_BUFFER, stored, gl.STATIC_DRAW);
    for (let k = 0; k < 4; k++) {
      gl.enableVertexAttribArray(2 + k);
      gl.vertexAttribPointer(2 + k, 4, gl.SHORT, true, 32, 8 * k);
    }
    gl.bindVertexArray(null);
  }

  draw() {
    const gl = this.gl;
    gl.enable(gl.DEPTH_TEST);
    gl.bindVertexArray(this.array);
    gl.drawElements(gl.TRIANGLES, this.count, gl.UNSIGNED_INT, 0);
    gl.disable(gl.DEPTH_TEST);
  }

  /** The normal in the world that the pixel (x, y from below) of a picture shows, or null beside the mesh. */
  normalAt(x, y, width, height, radius, camera) {
    const gl = this.gl;
    this.probe ??= { ...compileProgram(gl, MESH_VERTEX, MESH_PROBE, "the mesh"), target: new Target(gl, gl.RGBA32F, true) };
    this.probe.target.resize(1, 1);
    this.probe.target.bind();
    gl.viewport(-Math.floor(x), -Math.floor(y), width, height);
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.useProgram(this.probe.program);
    gl.uniform2f(this.probe.at("u_size"), width, height);
    gl.uniform2f(this.probe.at("u_shift"), 0, 0);
    gl.uniform1f(this.probe.at("u_radius"), radius);
    gl.uniformMatrix3fv(this.probe.at("u_camera"), false, camera);
    this.draw();
    const found = new Float32Array(4);
    gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.FLOAT, found);
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    return found[3] > 0 ? [found[0], found[1], found[2]] : null;
  }
}
