// The sky behind the objects: a cube map for the graphics card, softened as what is out of focus is.

const BACKGROUND = 192;
// The faces of a cube map in WebGL: axis, then the directions of the columns and of the rows.
const WEBGL_FACES = [
  [[1, 0, 0], [0, 0, -1], [0, -1, 0]], [[-1, 0, 0], [0, 0, 1], [0, -1, 0]],
  [[0, 1, 0], [1, 0, 0], [0, 0, 1]], [[0, -1, 0], [1, 0, 0], [0, 0, -1]],
  [[0, 0, 1], [1, 0, 0], [0, -1, 0]], [[0, 0, -1], [-1, 0, 0], [0, -1, 0]],
];

/** A sky's cube map with the number that its texels are to be multiplied by: half floats end at 65,504. */
function skyTexture(gl, picture) {
  const soft = softened(picture), scale = soft.values.reduce((most, x) => Math.max(most, x), 1e-30) / 60000;
  const texture = makeTexture(gl, gl.TEXTURE_CUBE_MAP, gl.LINEAR), size = BACKGROUND;
  const face = new Float32Array(3 * size * size);
  WEBGL_FACES.forEach(([axis, along, down], f) => {
    for (let i = 0, to = 0; i < size; i++) {
      const b = (2 * (i + 0.5)) / size - 1;
      for (let j = 0; j < size; j++, to += 3) {
        const a = (2 * (j + 0.5)) / size - 1;
        lookUp(soft, axis[0] + a * along[0] + b * down[0], axis[1] + a * along[1] + b * down[1], axis[2] + a * along[2] + b * down[2], 1 / scale, face, to);
      }
    }
    gl.texImage2D(gl.TEXTURE_CUBE_MAP_POSITIVE_X + f, 0, gl.RGB16F, size, size, 0, gl.RGB, gl.FLOAT, face);
  });
  return { texture, scale };
}
