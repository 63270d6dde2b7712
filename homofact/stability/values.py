"""Stressors of what was measured: noise, outliers, zeros, precision, scale, contradiction, things no fit expects."""

from collections.abc import Callable
from dataclasses import replace

import torch

from homofact.brdf.samples import Samples
from homofact.stability.fault import generator_of, uniform
from homofact.stability.faults import FAULTS
from homofact.stability.problem import Problem, Scale, Stress, Stressor, faulted, unstressed


def epsilon(strength: float, seed: int, scale: Scale) -> Problem:
    """ε of the log transform, where one sample in fifty is exactly zero."""
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
    """A lobe back towards the light, `strength` times as bright as the ground, measured and clean."""
    problem = unstressed(seed, scale)

    def lit(samples: Samples) -> Samples:
        back = (samples.wi * samples.wo).sum(1).clamp(0, 1) ** 60
        return replace(samples, values=samples.values + (strength * 0.1 * back)[:, None])

    return problem.both(lit)


STRESSORS = (
    Stressor(
        "zeros", "exact zeros",
        "A share of the samples is exactly zero.",
        "The logarithm of zero is log ε, far under everything else, and least squares weighs such a distance by its"
        " square: a few zeros pull whole neighbourhoods down.",
        "Take zeros out as missing, use `robust=True`, or an ε of the order of the noise (1e-2).",
        "share", (0.001, 0.01, 0.1, 0.5, 0.9), faulted(FAULTS["zeros"]),
    ),
    Stressor(
        "epsilon", "the choice of ε",
        "ε of the log transform from 0.1 to 1e-8, with 2% of exact zeros.",
        "ε is how far down a zero is: at 1e-8 every zero stands 18 natural units under the mean and drags its"
        " neighbours by orders of magnitude; at 0.1 the dark part of the material is under ε, its logarithm flat.",
        "ε from the noise floor of the measurement: 1e-2 for what a goniometer gives, 1e-5 only for noise-free models.",
        "ε", (1e-1, 1e-2, 1e-3, 1e-5, 1e-8), epsilon,
    ),
    Stressor(
        "multiplicative-noise", "multiplicative noise",
        "Every value times a log-normal factor.",
        "In log space this is ordinary noise, and least squares averages it: the error grows as σ²·texels/samples."
        " Strong noise also lifts the mean A by exp(σ²/2), and εA with it buries what is dark.",
        "More samples per texel, more smoothing, fewer textures.",
        "σ of the logarithm", (0.01, 0.1, 0.3, 1, 3), faulted(FAULTS["noise"]),
    ),
    Stressor(
        "additive-noise", "additive noise",
        "Every value plus normal noise, in shares of the mean; what falls below zero is cut.",
        "Dark samples drown first. In log space their noise is huge and lopsided, the more so the smaller ε is, and"
        " the cut at zero leaves a heap of exact zeros.",
        "ε at the noise floor (σ over the mean), so that what is under it does not count.",
        "σ over the mean", (0.001, 0.01, 0.1, 0.5, 2), faulted(FAULTS["additive-noise"]),
    ),
    Stressor(
        "outliers", "outliers",
        "A share of the samples a thousand times too bright (stray light, a blinded sensor).",
        "Least squares has no limit to what one sample may pull, and a factor of 1000 is 7 natural units. They lift"
        " the mean A as well, and with it the floor εA under which nothing counts.",
        "`robust=True` gives them little weight; mending the measurement is better.",
        "share", (0.001, 0.01, 0.05, 0.2, 0.5), faulted(FAULTS["outliers"]),
    ),
    Stressor(
        "out-of-gamut", "negative and out-of-gamut values, cut",
        "A colour so saturated that one channel falls below zero and is cut, as readers do.",
        "Where a channel is cut nothing is left of it but zeros: a whole region, not single samples, with an edge at"
        " which the logarithm falls off a cliff. A texture cannot hold a cliff, so its neighbourhood is wrong as well.",
        "A wider colour space or `channels='spectral'`; an ε of 1e-2 and more keeps the cliff low. `homofact info`"
        " counts the cut values.",
        "(R − G) taken off G", (0.1, 0.5, 0.8, 1.2, 3), _out_of_gamut,
    ),
    Stressor(
        "negative", "negative values, not cut",
        "A share of the samples negative and handed over so.",
        "A reflectance below zero has no logarithm.",
        "It is refused with the row named. Cut the values at zero if they are the measurement's noise; the readers of"
        " files do, and count them among the faults that `homofact info` shows.",
        "share", (0, 0.001, 0.1, 0.5), _uncut_negative,
    ),
    Stressor(
        "precision", "float32 against float64",
        "Directions and values rounded to fewer bits of mantissa.",
        "Values bear any rounding that the noise does. Directions of fewer than about 20 bits are no unit vectors any"
        " more; normalised again they are off by the rounding, which is an angle: 1e-3 for float16, a fraction of a"
        " texel.",
        "Solves are in float64 whatever was stored. Directions that are off unit length by more than 1e-6 are refused:"
        " normalise them when reading.",
        "bits", (52, 23, 10, 5, 3), faulted(FAULTS["precision"]),
    ),
    Stressor(
        "channel-scale", "badly scaled channels",
        "One channel times s, the other over s.",
        "The transform divides every channel by its own mean, and all channels share one matrix, so their scale does"
        " not matter to the fit. It does to every figure that is a mean over channels in sr⁻¹.",
        "None is needed; compare linear errors channel by channel.",
        "s", (1.5, 1e2, 1e4, 1e6, 1e8), _scaled(lambda s: (s, 1 / s)),
    ),
    Stressor(
        "dark-channel", "a channel goes dark",
        "One channel smaller and smaller, and at last zero.",
        "Relative to its own mean a small channel is as good as any, down to where numbers themselves end. At zero it"
        " has no mean to be divided by.",
        "A channel that is zero throughout is refused by name: leave it out (`channels`).",
        "factor", (1e-8, 1e-100, 1e-300, 0), _scaled(lambda s: (1.0, s)),
    ),
    Stressor(
        "contradiction", "duplicated and contradictory samples",
        "Half of the samples stand a second time with other values.",
        "The fit returns the mean in log space of what contradicts. Duplicates alone are harmless; duplicates on both"
        " sides of a split make held-out samples known and the gap between the errors meaningless.",
        "Merge repeated measurements before the fit, or give each its share of the weight.",
        "factor between the two", (1, 2, 10, 100, 1e4), faulted(FAULTS["contradiction"]),
    ),
    Stressor(
        "non-reciprocal", "non-reciprocal data in a reciprocal fit",
        "f · exp(s (cosθi − cosθo)).",
        "A reciprocal fit looks the conjugate up beside every projection, so it can only return what both ways have in"
        " common: the geometric mean. The rest stays as error that no texture can lower.",
        "`reciprocal=False`, after asking whether the measurement rather than the material is at fault.",
        "s", (0.03, 0.3, 1, 3), _non_reciprocal,
    ),
    Stressor(
        "retroreflection", "retroreflection",
        "A lobe back towards the light.",
        "The half vector of a pair that looks back along the light is the direction itself: a retroreflective lobe is"
        " a ridge along θh with θd = 0, thin in θd, which a texture over h alone cannot see.",
        "A texture that knows θd (`search` finds one), more texels, one texture more.",
        "brightness over the ground", (0.1, 1, 10, 100), retroreflection,
    ),
    Stressor(
        "tilted-frame", "a normal that is off",
        "All directions in a frame whose normal is tilted.",
        "The highlight is then not at the normal and the material is isotropic no longer; textures over angles from"
        " the normal blur it, and every sample near the horizon is on the wrong side.",
        "Align the measurement: the half vector of the brightest samples is the normal.",
        "degrees", (0.1, 1, 5, 20), faulted(FAULTS["tilted"]),
    ),
)  # fmt: skip
