// Reading what Python put into the page (packing.py): arrays in base64 of deflated bytes, grouped by significance.

const ARRAY_TYPES = {
  float32: Float32Array, float16: Uint16Array, uint8: Uint8Array, uint16: Uint16Array,
  int16: Int16Array, uint32: Uint32Array, int32: Int32Array,
};

/** What went wrong, for the page: a title, what to do about it, and the details for whoever wants them. */
class Trouble extends Error {
  constructor(title, remedy, details = "") {
    super(title);
    this.remedy = remedy;
    this.details = details;
  }
}

/** The typed array of a packed one; a float16 array comes as its bits. */
async function unpack(packed) {
  if (typeof DecompressionStream === "undefined") {
    throw new Trouble("This browser cannot unpack the page's data.",
      "It has no DecompressionStream. Chrome and Edge have it since version 80, Safari since 16.4, Firefox since 113.");
  }
  const letters = atob(packed.data), coded = new Uint8Array(letters.length);
  for (let i = 0; i < letters.length; i++) coded[i] = letters.charCodeAt(i);
  const stream = new Blob([coded]).stream().pipeThrough(new DecompressionStream("deflate"));
  const grouped = new Uint8Array(await new Response(stream).arrayBuffer());
  const Type = ARRAY_TYPES[packed.type];
  const count = grouped.length / Type.BYTES_PER_ELEMENT;
  const bytes = new Uint8Array(grouped.length);
  for (let k = 0; k < Type.BYTES_PER_ELEMENT; k++) {
    for (let i = 0; i < count; i++) bytes[i * Type.BYTES_PER_ELEMENT + k] = grouped[k * count + i];
  }
  return new Type(bytes.buffer);
}

/** A page's data with the arrays that several places have where they belong (without_repeats). */
function restored({ repeated, ...data }) {
  const inside = (node) => {
    if (Array.isArray(node)) return node.map(inside);
    if (node === null || typeof node !== "object") return node;
    if ("repeated" in node) return repeated[node.repeated];
    return Object.fromEntries(Object.entries(node).map(([name, each]) => [name, inside(each)]));
  };
  return inside(data);
}

/** Undoes the differences along the axis whose neighbours are `stride` apart, `length` long. In place. */
function accumulate(array, stride, length) {
  const block = stride * length;
  for (let i = 0; i < array.length; i++) if (i % block >= stride) array[i] += array[i - stride];
}

/** The number that 16 bits of a half float hold. */
function halfToFloat(bits) {
  const sign = bits & 0x8000 ? -1 : 1, exponent = (bits >> 10) & 31, fraction = bits & 1023;
  if (exponent === 0) return sign * fraction * 2 ** -24;
  if (exponent === 31) return fraction ? NaN : sign * Infinity;
  return sign * (1 + fraction / 1024) * 2 ** (exponent - 15);
}

/** Any texture's texels as numbers: float, half or byte. */
function toNumbers(texels, type) {
  return type === "float16" ? Float32Array.from(texels, halfToFloat) : texels;
}
