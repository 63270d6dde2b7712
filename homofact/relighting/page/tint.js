// A base-colour texture: what it makes of a material, at the vertices on the processor and at pixels on the graphics card
// (scene/tint.py, lobe_table.py's `under`).

const TINT_UNIT = 9;

/** Unpacks a texture (RGB bytes by sRGB's curve, times a scale) with its tints at the vertices (V × 3). */
async function unpackTint(packed) {
  const [bytes, uv] = await Promise.all([unpack(packed.texels), unpack(packed.uv)]);
  const tint = { ...packed, bytes, uv };
  return { ...tint, vertices: tintsAt(tint, uv) };
}

const LINEAR = Float32Array.from({ length: 256 }, (_, code) => (code <= 10 ? code / 255 / 12.92 : ((code / 255 + 0.055) / 1.055) ** 2.4));

/** Tints (N × 3) at texture coordinates (N × 2): bilinear, the texture repeated. */
function tintsAt({ width, height, bytes, scale }, uv) {
  const count = uv.length / 2, found = new Float32Array(3 * count), around = (k, size) => ((k % size) + size) % size;
  for (let n = 0; n < count; n++) {
    const x = (uv[2 * n] - Math.floor(uv[2 * n])) * width - 0.5, y = (uv[2 * n + 1] - Math.floor(uv[2 * n + 1])) * height - 0.5;
    const left = Math.floor(x), top = Math.floor(y), a = x - left, b = y - top;
    for (const [row, column, share] of [[top, left, (1 - a) * (1 - b)], [top, left + 1, a * (1 - b)], [top + 1, left, (1 - a) * b], [top + 1, left + 1, a * b]]) {
      const texel = 3 * (around(row, height) * width + around(column, width));
      for (let k = 0; k < 3; k++) found[3 * n + k] += share * LINEAR[bytes[texel + k]] * scale[k];
    }
  }
  return found;
}

/** What a table's light is multiplied by, in channel k at a vertex (3 v = p) towards a view of cosine `oz`; 1 without a texture. */
function tintOf({ tinted, levels }, tint, p, oz, k) {
  if (!tint || !tinted) return 1;
  const level = placeOfView(oz) * (levels - 1);
  const low = Math.min(Math.floor(level), levels - 2), up = Math.min(level - low, 1);
  return 1 + (tinted[low][k] * (1 - up) + tinted[low + 1][k] * up) * (tint.vertices[p + k] - 1);
}

/** The parts of a table that a texture tints, as a constant of a shader; nothing without a texture. */
function tintedParts(name, { tinted }) {
  if (!tinted) return "";
  const rows = tinted.map((row) => `vec3(${row.map((x) => x.toFixed(6)).join(", ")})`);
  return `const vec3 ${name}[${rows.length}] = vec3[${rows.length}](${rows.join(", ")});\n`;
}

/** A texture of bytes, three a texel, that repeats and has smaller copies for what is far away. */
function repeatedTexture(gl, form, width, height, bytes) {
  const texels = new Uint8Array(4 * width * height).fill(255);
  for (let t = 0; t < width * height; t++) texels.set(bytes.subarray(3 * t, 3 * t + 3), 4 * t);
  const texture = makeTexture(gl, gl.TEXTURE_2D, gl.LINEAR);
  gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.LINEAR_MIPMAP_LINEAR);
  for (const name of [gl.TEXTURE_WRAP_S, gl.TEXTURE_WRAP_T]) gl.texParameteri(gl.TEXTURE_2D, name, gl.REPEAT);
  gl.texImage2D(gl.TEXTURE_2D, 0, form, width, height, 0, gl.RGBA, gl.UNSIGNED_BYTE, texels);
  gl.generateMipmap(gl.TEXTURE_2D);
  return texture;
}

// A base-colour texture on the graphics card.
class TintOnGpu {
  constructor(gl, { width, height, bytes, scale }) {
    Object.assign(this, { gl, scale });
    this.texture = repeatedTexture(gl, gl.SRGB8_ALPHA8, width, height, bytes);
  }

  /** Binds what the surface's shader reads. */
  bind(program) {
    const { gl } = this;
    gl.activeTexture(gl.TEXTURE0 + TINT_UNIT);
    gl.bindTexture(gl.TEXTURE_2D, this.texture);
    gl.uniform1i(program.at("u_tint"), TINT_UNIT);
    gl.activeTexture(gl.TEXTURE0);
    gl.uniform3f(program.at("u_tint_scale"), ...this.scale);
  }
}
