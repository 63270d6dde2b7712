// Lamps themselves, as glowing spheres: what is behind them they hide, what is before them hides them.

const LAMP_RINGS = 16, LAMP_SPOKES = 24;

class LampsOnGpu {
  constructor(gl, lights) {
    Object.assign(this, { gl, lights });
    this.program = makeProgram(gl, shaderText(LAMP_VERTEX), shaderText(LAMP_FRAGMENT), "the lamps");
    const places = [], triangles = [];
    for (let i = 0; i <= LAMP_RINGS; i++) {
      const polar = (Math.PI * i) / LAMP_RINGS;
      for (let j = 0; j < LAMP_SPOKES; j++) {
        const turn = (2 * Math.PI * j) / LAMP_SPOKES, next = (j + 1) % LAMP_SPOKES, row = LAMP_SPOKES * i;
        places.push(Math.sin(polar) * Math.cos(turn), Math.cos(polar), Math.sin(polar) * Math.sin(turn));
        if (i < LAMP_RINGS) triangles.push(row + j, row + next, row + LAMP_SPOKES + j, row + next, row + LAMP_SPOKES + next, row + LAMP_SPOKES + j);
      }
    }
    this.count = triangles.length;
    this.drawing = gl.createVertexArray();
    gl.bindVertexArray(this.drawing);
    gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ARRAY_BUFFER, Float32Array.from(places), gl.STATIC_DRAW);
    gl.enableVertexAttribArray(0);
    gl.vertexAttribPointer(0, 3, gl.FLOAT, false, 0, 0);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, Uint16Array.from(triangles), gl.STATIC_DRAW);
    gl.bindVertexArray(null);
    gl.bindBuffer(gl.ARRAY_BUFFER, null);
  }

  /** Draws those that shine over what is there, by depth. */
  draw(stage, view, aspect) {
    const { gl, program } = this, levels = view.shining;
    gl.useProgram(program.program);
    stage.tones(view, program);
    gl.uniformMatrix4fv(program.at("u_camera"), false, view.orbit.matrix(aspect, stage.radius));
    gl.bindVertexArray(this.drawing);
    this.lights.forEach(({ position, radius, intensity }, q) => {
      if (!position || !levels[q]) return;
      gl.uniform4f(program.at("u_lamp"), ...position, radius);
      gl.uniform3f(program.at("u_light"), ...scaled(intensity, levels[q] / (Math.PI * radius ** 2)));
      gl.drawElements(gl.TRIANGLES, this.count, gl.UNSIGNED_SHORT, 0);
    });
    gl.bindVertexArray(null);
  }
}
