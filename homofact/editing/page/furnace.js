// The white furnace's albedo of a material with its curves as they are: what share of the light comes back.

class Furnace {
  /** `terms` hold their sums by bands; `curves` are the material's. */
  constructor(terms, degrees, slack, curves, channels) {
    Object.assign(this, { terms, degrees, slack, curves, channels });
  }

  /** Σ over the combinations of bands of all terms or of those named (angles × C). */
  albedo(state, names = null) {
    const { channels } = this, found = new Float64Array(this.degrees.length * channels);
    for (const { name, factors, degrees, bands, weights } of this.terms) {
      if (names && !names.includes(name)) continue;
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

  /** How often a curve multiplies: twice if it is over both directions. */
  times(curve) {
    const own = this.curves.filter(({ term }) => term === curve.term), { factors } = this.terms.find(({ name }) => name === curve.term);
    return factors.filter(([number]) => own[number] === curve).length;
  }

  /** Where most comes back: { value, degrees, channel, exceeds }. */
  largest(albedo) {
    const at = albedo.reduce((best, value, i) => (value > albedo[best] ? i : best), 0);
    return {
      value: albedo[at], degrees: this.degrees[Math.floor(at / this.channels)], channel: at % this.channels, exceeds: albedo[at] > 1 + this.slack,
    };
  }
}

/** Means over the light's angles, with their `weights`, of albedos (angles × C). */
function meanAlbedo(albedo, weights, channels) {
  const mean = new Float64Array(channels);
  albedo.forEach((value, i) => { mean[i % channels] += value * weights[Math.floor(i / channels)]; });
  return mean;
}

async function unpackFurnace(material, number, data, curves) {
  const terms = await Promise.all(material.terms.map(async ({ name, furnace }) => {
    const [degrees, bands, weights] = await Promise.all([unpack(furnace.degrees), unpack(furnace.bands), unpack(furnace.weights)]);
    return { name, factors: furnace.factors, degrees, bands, weights };
  }));
  return new Furnace(terms, data.furnace.degrees, data.furnace.slack, curves.filter((curve) => curve.material === number), data.channels.length);
}

/** The albedos under uniform light of what sends light to other surfaces (sender_albedo.py). */
class Senders {
  constructor(data, furnaces) {
    this.channels = data.channels.length;
    this.mean = data.furnace.mean;
    this.list = data.senders.map(({ thing, terms }) => {
      const furnace = furnaces[thing];
      return { furnace, terms, curves: furnace.curves.filter((curve) => terms.includes(curve.term)), kept: [] };
    });
    this.curves = this.list.flatMap(({ curves }) => curves);
  }

  /** ρ (senders × C) with these curves. */
  albedos(state) {
    const found = new Float64Array(this.list.length * this.channels);
    this.list.forEach((sender, number) => found.set(this.albedo(sender, state), number * this.channels));
    return found;
  }

  /** The two that were last asked for are kept: the picture as it is, and one to compare it with. */
  albedo(sender, state) {
    const now = sender.curves.map((curve) => state[curve.index]);
    const before = sender.kept.find((each) => each.now.every((curve, k) => curve === now[k]));
    if (before) return before.mean;
    const mean = meanAlbedo(sender.furnace.albedo(state, sender.terms), this.mean, this.channels);
    sender.kept = [{ now, mean }, ...sender.kept.slice(0, 1)];
    return mean;
  }
}
