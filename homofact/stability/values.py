"""Stressors of what was measured: noise, outliers, zeros, precision, scale, contradiction, things no fit expects."""

from collections.abc import Callable
from dataclasses import replace

import torch

from homofact.brdf.samples import Samples
from homofact.stability.fault import generator_of, uniform
from homofact.stability.faults import FAULTS
from homofact.stability.problem import Problem, Scale, Stress, Stressor, faulted, unstressed


def epsilon(strength: float, seed: int, scale: Scale) -> Problem:
    """Return ε of the log transform, where one sample in fifty is exactly zero."""
    return replace(faulted(FAULTS["zeros"])(0.02, seed, scale), settings=({"epsilon": strength},))


def _out_of_gamut(strength: float, seed: int, scale: Scale) -> Problem:
    """A saturated colour, measured and clean: `strength` · (R − G) taken off G, what falls below zero cut."""
    problem = unstressed(seed, scale)

    def cut(samples: Samples) -> Samples:
        red, green = samples.values.unbind(1)
        return replace(samples, values=torch.stack((red, (green - strength * (red - green)).clamp_min(0)), 1))

    return problem.both(cut)


def _uncut_negative(strength: float, seed: int, scale: Scale) -> Problem:
    """A share of the samples negative, and handed over so."""
    problem = unstressed(seed, scale)
    below = uniform(scale.samples, generator_of(seed)) < strength
    values = torch.where(below[:, None], -problem.samples.values, problem.samples.values)
    return problem.measuring(replace(problem.samples, values=values))


def _scaled(factors: Callable[[float], tuple[float, float]]) -> Stress:
    """The channels times their factors, measured and clean."""

    def stress(strength: float, seed: int, scale: Scale) -> Problem:
        scales = torch.tensor(factors(strength), dtype=torch.float64)
        return unstressed(seed, scale).both(lambda samples: replace(samples, values=samples.values * scales))

    return stress


def _non_reciprocal(strength: float, seed: int, scale: Scale) -> Problem:
    """f · exp(strength · (cosθi − cosθo)), measured and clean, given to a reciprocal fit."""
    problem = unstressed(seed, scale)

    def tilted(samples: Samples) -> Samples:
        tilt = torch.exp(strength * (samples.wi[:, 2] - samples.wo[:, 2]))
        return replace(samples, values=samples.values * tilt[:, None])

    return problem.both(tilted)


def retroreflection(strength: float, seed: int, scale: Scale) -> Problem:
    """Return a lobe back towards the light, `strength` times as bright as the ground, measured and clean."""
    problem = unstressed(seed, scale)

    def lit(samples: Samples) -> Samples:
        back = (samples.wi * samples.wo).sum(1).clamp(0, 1) ** 60
        return replace(samples, values=samples.values + (strength * 0.1 * back)[:, None])

    return problem.both(lit)


STRESSORS = (
    Stressor(
        "zeros", "exact zeros",
        "A share of the samples is exactly zero.",
        "The logarithm of zero is log ε, far below all other values, and least squares weighs such a distance by its"
        " square. A few zeros therefore darken whole neighbourhoods.",
        "Remove zeros that mean missing data, use `robust=True`, or set ε to the order of the noise (1e-2).",
        "share", (0.001, 0.01, 0.1, 0.5, 0.9), faulted(FAULTS["zeros"]),
    ),
    Stressor(
        "epsilon", "the choice of ε",
        "ε of the log transform falls from 0.1 to 1e-8, and 2% of the samples are exactly zero.",
        "ε decides how far below the mean a zero lies. At 1e-8, every zero is 18 natural units below the mean and"
        " darkens its neighbours by orders of magnitude. At 0.1, the dark part of the material lies below ε, so its"
        " logarithm is flat.",
        "Set ε to the noise floor of the measurement: 1e-2 for a goniometer, 1e-5 only for noise-free models.",
        "ε", (1e-1, 1e-2, 1e-3, 1e-5, 1e-8), epsilon,
    ),
    Stressor(
        "multiplicative-noise", "multiplicative noise",
        "Every value is multiplied by a log-normal factor.",
        "In log space this is ordinary noise, and least squares averages it: the error grows as σ²·texels/samples."
        " Strong noise also raises the mean A by exp(σ²/2), and with it εA, below which dark values are lost.",
        "Use more samples per texel, more smoothing, or fewer textures.",
        "σ of the logarithm", (0.01, 0.1, 0.3, 1, 3), faulted(FAULTS["noise"]),
    ),
    Stressor(
        "additive-noise", "additive noise",
        "Normal noise, given as a share of the mean, is added to every value. Values below zero are cut to zero.",
        "Dark samples are lost first. In log space their noise is large and lopsided, and more so at a smaller ε."
        " Cutting at zero also creates many exact zeros.",
        "Set ε to the noise floor (σ over the mean), so that smaller values do not matter.",
        "σ over the mean", (0.001, 0.01, 0.1, 0.5, 2), faulted(FAULTS["additive-noise"]),
    ),
    Stressor(
        "outliers", "outliers",
        "A share of the samples is a thousand times too bright, as by stray light or a saturated sensor.",
        "Least squares does not limit the influence of one sample, and a factor of 1000 is 7 natural units. Outliers"
        " also raise the mean A, and with it the floor εA, below which values do not matter.",
        "Repair the measurement. Otherwise `robust=True` gives outliers little weight.",
        "share", (0.001, 0.01, 0.05, 0.2, 0.5), faulted(FAULTS["outliers"]),
    ),
    Stressor(
        "out-of-gamut", "negative and out-of-gamut values, cut",
        "A colour is so saturated that one channel falls below zero, where readers cut it to zero.",
        "Cutting leaves only zeros in a whole region of the channel, with an edge at which the logarithm drops"
        " steeply. A texture cannot represent such an edge, so its neighbourhood is wrong as well.",
        "Use a wider colour space or `channels='spectral'`. An ε of at least 1e-2 keeps the edge low. `homofact info`"
        " counts the cut values.",
        "(R − G) taken off G", (0.1, 0.5, 0.8, 1.2, 3), _out_of_gamut,
    ),
    Stressor(
        "negative", "negative values, not cut",
        "A share of the samples is negative and is not cut to zero.",
        "A reflectance below zero has no logarithm.",
        "homofact refuses such samples and names the row. If the negative values are the measurement's noise, cut them"
        " at zero. The file readers do this, and `homofact info` shows how many values they cut.",
        "share", (0, 0.001, 0.1, 0.5), _uncut_negative,
    ),
    Stressor(
        "precision", "float32 against float64",
        "Directions and values are rounded to fewer bits of mantissa.",
        "Values may be rounded as much as they are noisy. Directions of fewer than about 20 bits are no longer unit"
        " vectors. Normalising them again leaves an angular error of the size of the rounding: 1e-3 for float16, a"
        " fraction of a texel.",
        "homofact solves in float64, whatever the stored precision. It refuses directions whose length is off 1 by"
        " more than 1e-6: normalise them when reading.",
        "bits", (52, 23, 10, 5, 3), faulted(FAULTS["precision"]),
    ),
    Stressor(
        "channel-scale", "badly scaled channels",
        "One channel is multiplied by s, the other divided by s.",
        "The transform divides every channel by its own mean, and all channels share one matrix, so their scale does"
        " not matter to the fit. It matters to every figure that averages over channels in sr⁻¹.",
        "Nothing is needed. Compare linear errors channel by channel.",
        "s", (1.5, 1e2, 1e4, 1e6, 1e8), _scaled(lambda s: (s, 1 / s)),
    ),
    Stressor(
        "dark-channel", "a channel goes dark",
        "One channel shrinks, and is zero at last.",
        "Relative to its own mean, a small channel is as good as any, down to the smallest floating-point numbers. At"
        " zero it has no mean to divide by.",
        "homofact refuses a channel that is zero everywhere and names it. Leave it out (`channels`).",
        "factor", (1e-8, 1e-100, 1e-300, 0), _scaled(lambda s: (1.0, s)),
    ),
    Stressor(
        "contradiction", "duplicated and contradictory samples",
        "Half of the samples occur twice, with different values.",
        "The fit returns the mean in log space of contradictory values. Duplicates with equal values do no harm to the"
        " fit. However, if a split puts one copy into training and one into the held-out part, the held-out samples"
        " are known, and the gap between the two errors means nothing.",
        "Merge repeated measurements before the fit, or divide the weight between them.",
        "factor between the two", (1, 2, 10, 100, 1e4), faulted(FAULTS["contradiction"]),
    ),
    Stressor(
        "non-reciprocal", "non-reciprocal data in a reciprocal fit",
        "The values are f · exp(s (cosθi − cosθo)).",
        "A reciprocal fit also reads every texture at the conjugate pair, so it can only return what both directions"
        " have in common: the geometric mean. The rest remains as an error that no texture can lower.",
        "Use `reciprocal=False`, after you have checked that the material, not the measurement, is non-reciprocal.",
        "s", (0.03, 0.3, 1, 3), _non_reciprocal,
    ),
    Stressor(
        "retroreflection", "retroreflection",
        "A lobe reflects light back towards the source.",
        "If the viewer looks along the light, the half vector equals both directions. A retroreflective lobe is"
        " therefore a ridge along θh at θd = 0. It is thin in θd, and a texture over h alone cannot represent it.",
        "Use a texture over θd (`search` finds one), more texels, or one more texture.",
        "brightness over the ground", (0.1, 1, 10, 100), retroreflection,
    ),
    Stressor(
        "tilted-frame", "a tilted normal",
        "All directions are given in a frame whose normal is tilted.",
        "The highlight is then not at the normal, and the material is no longer isotropic. Textures over angles from"
        " the normal blur the highlight, and samples near the horizon are on its wrong side.",
        "Align the measurement: the half vector of the brightest samples is the normal.",
        "degrees", (0.1, 1, 5, 20), faulted(FAULTS["tilted"]),
    ),
)  # fmt: skip
