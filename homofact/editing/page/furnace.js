// The white furnace's albedo of a material with its curves as they are: what share of the light comes back.

class Furnace {
  /** `terms` hold their sums by bands; `curves` are the material's. */
  constructor(terms, degrees, slack, curves, channels) {
    Object.assign(this, { terms, degrees, slack, curves, channels });
  }

  /** Σ over the terms' combinations of bands (angles × C). */
  albedo(state) {
    const { channels } = this, found = new Float64Array(this.degrees.length * channels);
    for (const { name, factors, degrees, bands, weights } of this.terms) {
      const own = this.curves.filter((curve) => curve.term === name), count = degrees.length;
      const values = factors.map(([number]) => state[own[number].index].values);
      for (let i = 0; i < count; i++) {
        const to = degrees[i] * channels;
        for (let c = 0; c < channels; c++) {
          let value = weights[c * count + i];
          for (let f = 0; f < values.length; f++) value *= values[f][bands[f * count + i] * channels + c];
          found[to + c] += value;
        }
      }
    }
    return found;
  }

  /** Where most comes back: { value, degrees, channel, exceeds }. */
  largest(albedo) {
    const at = albedo.reduce((best, value, i) => (value > albedo[best] ? i : best), 0);
    return {
      value: albedo[at], degrees: this.degrees[Math.floor(at / this.channels)], channel: at % this.channels, exceeds: albedo[at] > 1 + this.slack,
    };
  }
}

async function unpackFurnace(material, number, data, curves) {
  const terms = await Promise.all(material.terms.map(async ({ name, furnace }) => {
    const [degrees, bands, weights] = await Promise.all([unpack(furnace.degrees), unpack(furnace.bands), unpack(furnace.weights)]);
    return { name, factors: furnace.factors, degrees, bands, weights };
  }));
  return new Furnace(terms, data.furnace.degrees, data.furnace.slack, curves.filter((curve) => curve.material === number), data.channels.length);
}
