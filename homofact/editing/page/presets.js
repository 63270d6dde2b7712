// Slider values worth beginning from, by the name of the formula.

// n and k of metals for red, green and blue, as renderers have them.
const METALS = {
  Silver: { n: [0.155, 0.117, 0.138], k: [4.828, 3.122, 2.147] },
  Gold: { n: [0.143, 0.375, 1.442], k: [3.983, 2.386, 1.603] },
  Copper: { n: [0.2, 0.924, 1.102], k: [3.913, 2.448, 2.142] },
  Aluminium: { n: [1.657, 0.88, 0.521], k: [9.224, 6.27, 4.837] },
};

const widths = (name, polished, satin, matte) => () => ({ Polished: { [name]: polished }, Satin: { [name]: satin }, Matte: { [name]: matte } });
const exponents = (name) => () => ({ Wide: { [name]: 10 }, Middle: { [name]: 100 }, Narrow: { [name]: 1000 } });

const PRESETS = {
  beckmann: widths("sigma", 0.04, 0.12, 0.4),
  fresnel: (count) => ({
    "Plastic, n = 1.5": { n: Array(count).fill(1.5), k: Array(count).fill(0) },
    "Diamond, n = 2.42": { n: Array(count).fill(2.42), k: Array(count).fill(0) },
    ...(count === 3 ? METALS : {}),
  }),
  cosine_power_u: exponents("nu"),
  cosine_power_v: exponents("nv"),
  phong: exponents("exponent"),
  blinn: exponents("exponent"),
  facet_gaussian: widths("sigma", 0.04, 0.12, 0.4),
  ward: widths("alpha", 0.04, 0.12, 0.4),
  ward_x: widths("alpha_x", 0.04, 0.12, 0.4),
  ward_y: widths("alpha_y", 0.04, 0.12, 0.4),
  sharpened: () => ({ "As it is": { sharpening: 0 }, Narrower: { sharpening: 50 }, "Much narrower": { sharpening: 300 } }),
};

/** [[title, slider values], …] for a curve; none where it has no sliders. */
function presetsOf(curve) {
  return curve.formula ? Object.entries(curve.presets(curve.channels)) : [];
}
