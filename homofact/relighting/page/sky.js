// A sky: its exact cube map as it stands, and a lat-long picture for everything else.

class Sky {
  /** `cube` (6 n² × 3) where it is known exactly; `picture` {values, rows, columns}. */
  constructor(name, picture, size, cube = null) {
    this.name = name;
    this.id = Sky.count = (Sky.count ?? 0) + 1;
    this.size = size;
    this.cube = cube ?? environmentCube(picture, size, 0);
    // Four rows a texel of the cube map are all that a turn needs; a large picture would make it slow.
    this.picture = reducedPicture(picture, 4 * size);
  }

  /** The light turned by degrees: its cube map and the Haar coefficients of it. */
  light(degrees) {
    const cube = degrees === 0 ? this.cube : environmentCube(this.picture, this.size, degrees * DEGREE);
    return { cube, coefficients: haarCoefficients(cube, this.size) };
  }

  coefficients(degrees) {
    return this.light(degrees).coefficients;
  }
}

async function unpackSky(packed, size) {
  const [cube, values] = await Promise.all([packed.cube, packed.picture].map(
    async (each) => fromHalves(await unpack(each.values), each.scale)));
  return new Sky(packed.name, { values, rows: packed.rows, columns: packed.columns }, size, cube);
}

/** A small picture of the sky for a button: its middle grey at the mean of the logarithms, bent by the filmic curve. */
function skyThumbnail(picture, width, height) {
  const canvas = element("canvas", { width, height, "aria-hidden": "true" });
  const context = canvas.getContext("2d"), image = context.createImageData(width, height);
  const at = (x, y) => 3 * (Math.floor(((y + 0.5) * picture.rows) / height) * picture.columns
    + Math.floor(((x + 0.5) * picture.columns) / width));
  const mean = (p) => (picture.values[p] + picture.values[p + 1] + picture.values[p + 2]) / 3;
  let logs = 0;
  for (let y = 0; y < height; y++) for (let x = 0; x < width; x++) logs += Math.log(Math.max(mean(at(x, y)), 1e-6));
  const exposure = 0.22 / Math.exp(logs / (width * height));
  for (let y = 0; y < height; y++) {
    for (let x = 0; x < width; x++) {
      for (let k = 0; k < 3; k++) {
        image.data[4 * (y * width + x) + k] = Math.round(255 * toneOf(picture.values[at(x, y) + k] * exposure, true));
      }
      image.data[4 * (y * width + x) + 3] = 255;
    }
  }
  context.putImageData(image, 0, 0);
  return canvas;
}
