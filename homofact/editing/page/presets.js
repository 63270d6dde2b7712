// Slider values worth beginning from, by the sliders' names.

// n and k of metals for red, green and blue, as renderers have them.
const METALS = {
  Silver: { n: [0.155, 0.117, 0.138], k: [4.828, 3.122, 2.147] },
  Gold: { n: [0.143, 0.375, 1.442], k: [3.983, 2.386, 1.603] },
  Copper: { n: [0.2, 0.924, 1.102], k: [3.913, 2.448, 2.142] },
  Aluminium: { n: [1.657, 0.88, 0.521], k: [9.224, 6.27, 4.837] },
};

const PRESETS = {
  "sigma": (count) => ({ Polished: { sigma: 0.04 }, Satin: { sigma: 0.12 }, Matte: { sigma: 0.4 } }),
  "n,k": (count) => ({
    "Plastic, n = 1.5": { n: Array(count).fill(1.5), k: Array(count).fill(0) },
    "Diamond, n = 2.42": { n: Array(count).fill(2.42), k: Array(count).fill(0) },
    ...(count === 3 ? METALS : {}),
  }),
  "nu": () => ({ Wide: { nu: 10 }, Middle: { nu: 100 }, Narrow: { nu: 1000 } }),
  "nv": () => ({ Wide: { nv: 10 }, Middle: { nv: 100 }, Narrow: { nv: 1000 } }),
};

/** [[title, slider values], …] for a curve; none where it has no sliders. */
function presetsOf(curve) {
  return curve.formula ? Object.entries(PRESETS[Object.keys(curve.sliders).join()](curve.channels)) : [];
}
