// From radiance to the canvas: exposure, the filmic bend or none, sRGB, by a table over the numbers' own bits.

// Sign, exponent and 9 bits of the fraction: steps of 0.2%, well under one of 255.
const BITS = 14;

class Tones {
  constructor() {
    this.table = new Uint8ClampedArray(1 << (31 - BITS));
    this.key = null;
  }

  /** Makes the table for an exposure (a factor) and curve, unless it is there. */
  set(exposure, curve) {
    const key = `${exposure} ${curve}`;
    if (this.key === key) return;
    this.key = key;
    const bits = new Uint32Array(1), value = new Float32Array(bits.buffer);
    for (let i = 0; i < this.table.length; i++) {
      // The middle of all numbers that begin with these bits.
      bits[0] = (i << BITS) + (1 << (BITS - 1));
      this.table[i] = value[0] < Infinity ? Math.round(255 * toneOf(value[0] * exposure, curve === "filmic")) : 255;
    }
  }

  /** Fills the bytes of a picture from whole ones (W·H × 3): `now` right of the column `cut`, `before` left of it. */
  paint(bytes, width, now, before, cut) {
    const { table } = this, code = new Uint32Array(now.buffer), other = before ? new Uint32Array(before.buffer) : code;
    for (let i = 0, to = 0; i < code.length; to++) {
      const from = before && (i / 3) % width < cut ? other : code;
      // Numbers below zero have the highest bit set: black.
      for (let k = 0; k < 3; k++, i++, to++) bytes[to] = from[i] >> 31 ? 0 : table[from[i] >>> BITS];
    }
  }

  /** A picture of a view, opaque. */
  static empty({ width, height }) {
    return new ImageData(new Uint8ClampedArray(4 * width * height).fill(255), width, height);
  }
}
