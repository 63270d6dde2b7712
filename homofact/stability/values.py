"""Stressors of the values: noise, outliers, zeros, precision, scale, contradictions, and unusual values."""

from collections.abc import Callable
from dataclasses import replace

import torch

from homofact.brdf.samples import Samples
from homofact.stability.fault import generator_of, uniform
from homofact.stability.faults import FAULTS
from homofact.stability.problem import Problem, Scale, Stress, Stressor, faulted, unstressed


def epsilon(strength: float, seed: int, scale: Scale) -> Problem:
    """Return a problem with ε = `strength`, in which one sample in fifty is exactly zero."""
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
    """Return a problem with a lobe towards the light, `strength` times as bright as the diffuse part."""
    problem = unstressed(seed, scale)

    def lit(samples: Samples) -> Samples:
        back = (samples.wi * samples.wo).sum(1).clamp(0, 1) ** 60
        return replace(samples, values=samples.values + (strength * 0.1 * back)[:, None])

    return problem.both(lit)


STRESSORS = (
    Stressor(
        "zeros", "exact zeros",
        "A share of the samples is exactly zero.",
        "The log transform of zero is log ε, far below all other values, and least squares counts the square of this"
        " distance. A few zeros therefore darken whole neighbourhoods.",
        "Remove zeros that mean missing data, use `robust=True` if at most a tenth of the samples is zero ([Repair bad"
        " measurements](robustness.md#results)), or set ε to the noise divided by A (1e-2).",
        "share", (0.001, 0.01, 0.1, 0.5, 0.9), faulted(FAULTS["zeros"]),
    ),
    Stressor(
        "epsilon", "the choice of ε",
        "The ε of the log transform falls from 0.1 to 1e-8. In all steps, 2% of the samples are exactly zero.",
        "ε decides how far below the mean a zero lies. At 1e-8, every zero is 18 below the mean in natural"
        " logarithms, and it darkens its neighbours by orders of magnitude. At 0.1, the dark values of the material"
        " are below εA, so their log transform is nearly constant.",
        "Set ε to the noise floor of the measurement divided by A: 1e-2 for a goniometer, 1e-5 only for noise-free"
        " models.",
        "ε", (1e-1, 1e-2, 1e-3, 1e-5, 1e-8), epsilon,
    ),
    Stressor(
        "multiplicative-noise", "multiplicative noise",
        "Every value is multiplied by a log-normal factor.",
        "In log space this is ordinary noise, and least squares averages it: the error grows as σ²·texels/samples."
        " Strong noise also multiplies the mean A by exp(σ²/2). This raises εA, and values below εA are lost.",
        "Use more samples per texel, more smoothing, or fewer textures.",
        "σ of the logarithm", (0.01, 0.1, 0.3, 1, 3), faulted(FAULTS["noise"]),
    ),
    Stressor(
        "additive-noise", "additive noise",
        "Gaussian noise is added to every value; its σ is a multiple of the mean. Values below zero are set to zero.",
        "Noise destroys dark samples first. In log space their noise is large and skewed, and a smaller ε makes it"
        " worse. Cutting at zero also creates many exact zeros.",
        "Set ε to the noise floor (σ divided by the mean), so that smaller values have no influence. The setting"
        " `epsilon=\"floor\"` does this.",
        "σ over the mean", (0.001, 0.01, 0.1, 0.5, 2), faulted(FAULTS["additive-noise"]),
    ),
    Stressor(
        "outliers", "outliers",
        "A share of the samples is a thousand times too bright, for example because of stray light.",
        "Least squares does not limit the influence of one sample, and a factor of 1000 is an error of 7 in natural"
        " logarithms. Outliers also raise the mean A, and with it εA. Values below εA then have no influence on the"
        " fit.",
        "Repair the measurement. Otherwise use `robust=True`, which excludes outliers ([Repair bad"
        " measurements](robustness.md)).",
        "share", (0.001, 0.01, 0.05, 0.2, 0.5), faulted(FAULTS["outliers"]),
    ),
    Stressor(
        "out-of-gamut", "negative and out-of-gamut values, cut",
        "A colour is so saturated that one channel has negative values. The file readers set these to zero.",
        "A whole region of the channel is then zero. At the edge of this region, the logarithm drops steeply. A"
        " texture cannot represent such an edge, so the fit is wrong beside it as well.",
        "Use a wider colour space or `channels='spectral'`. An ε of at least 1e-2 keeps the drop at the edge small."
        " `homofact info` counts the cut values.",
        "multiple of (R − G) subtracted from G", (0.1, 0.5, 0.8, 1.2, 3), _out_of_gamut,
    ),
    Stressor(
        "negative", "negative values, not cut",
        "A share of the samples is negative and is not cut to zero.",
        "A reflectance below zero has no logarithm.",
        "homofact refuses such samples and prints the row. If measurement noise causes the negative values, set them"
        " to zero. The file readers do this themselves, and `homofact info` shows how many values they set to zero.",
        "share", (0, 0.001, 0.1, 0.5), _uncut_negative,
    ),
    Stressor(
        "precision", "float32 against float64",
        "Directions and values are rounded to fewer mantissa bits.",
        "Rounding the values is harmless as long as the rounding error is below the noise. Directions with fewer"
        " than about 20 bits are no longer unit vectors. If you normalise them again, an angular error of the size"
        " of the rounding remains: 1e-3 for float16, which is a fraction of a texel.",
        "homofact solves in float64, whatever the stored precision. It refuses directions whose length differs from"
        " 1 by more than 1e-6, so normalise them when you read them.",
        "bits", (52, 23, 10, 5, 3), faulted(FAULTS["precision"]),
    ),
    Stressor(
        "channel-scale", "badly scaled channels",
        "The test problem has two channels. One is multiplied by s, the other is divided by s.",
        "The transform divides every channel by its own mean, and all channels share one matrix, so their scale does"
        " not matter to the fit. It does matter to every error measure that averages linear values (in sr⁻¹) over"
        " channels.",
        "No action is needed. Compare linear errors channel by channel.",
        "s", (1.5, 1e2, 1e4, 1e6, 1e8), _scaled(lambda s: (s, 1 / s)),
    ),
    Stressor(
        "dark-channel", "a channel goes dark",
        "One channel is multiplied by smaller and smaller factors, finally by zero.",
        "The log transform divides each channel by its own mean, so a dark channel fits as well as any other. Only"
        " `nmf` fails at a factor of 1e-300. A channel of zeros has no mean to divide by.",
        "homofact refuses a channel that is zero everywhere and names it. Leave it out with the `channels` setting.",
        "factor", (1e-8, 1e-100, 1e-300, 0), _scaled(lambda s: (1.0, s)),
    ),
    Stressor(
        "contradiction", "duplicated and contradictory samples",
        "Half of the samples occur twice, with different values.",
        "The fit returns the log-space mean of contradictory values. Duplicates with equal values do not harm the"
        " fit. However, a split may put one copy into the training set and the other into the held-out set. The fit"
        " has then seen the held-out samples, so their error is no independent check.",
        "Merge repeated measurements before the fit, or divide one sample's weight among the copies.",
        "factor between the two", (1, 2, 10, 100, 1e4), faulted(FAULTS["contradiction"]),
    ),
    Stressor(
        "non-reciprocal", "non-reciprocal data in a reciprocal fit",
        "The values f are multiplied by exp(s (cosθi − cosθo)), which makes them non-reciprocal.",
        "A reciprocal fit also reads every texture at the swapped pair (ωo, ωi), so it can only return the geometric"
        " mean of f(ωi, ωo) and f(ωo, ωi). The remaining error cannot be lowered by any texture.",
        "First look for a fault of the measurement ([Check units and conventions](suspicion.md)). If you find"
        " none, use `reciprocal=False`.",
        "s", (0.03, 0.3, 1, 3), _non_reciprocal,
    ),
    Stressor(
        "retroreflection", "retroreflection",
        "A lobe reflects light back towards the source.",
        "If the viewer is in the direction of the light, the half vector equals both directions (θd = 0). A"
        " retroreflective lobe is therefore a ridge at θd = 0 for all θh. It is thin in θd, and a texture over h"
        " alone cannot represent it.",
        "Use a texture over θd (`search` finds one), more texels, or one more texture.",
        "lobe over diffuse value", (0.1, 1, 10, 100), retroreflection,
    ),
    Stressor(
        "tilted-frame", "a tilted normal",
        "All directions are given in a frame whose normal is tilted.",
        "In half-vector coordinates, the highlight is then not centred on the normal. The data are no longer isotropic."
        " Textures over angles from the normal blur the highlight. Some samples near the horizon appear below it.",
        "Align the measurement so that the half vector of the brightest samples becomes the normal. homofact can undo"
        " a tilt itself only if it is at most 0.6° and in the plane of incidence of all samples ([Straighten a"
        " measurement](straightening.md)). In this test the plane of incidence differs from sample to sample.",
        "degrees", (0.1, 1, 5, 20), faulted(FAULTS["tilted"]),
    ),
)  # fmt: skip
