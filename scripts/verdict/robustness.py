"""Test which bad cells of the atlas an option repairs: outliers, gains, clipped samples and noise.

    python scripts/verdict/robustness.py [--seeds 3] [--only outliers clipped] [--out docs/robustness.md]

A cell is one of `homofact research stability`: its material, settings, clean samples, and what it calls bad (light off
by over 15% in a band of angles, or under 90% of the clean logarithms explained). Gains have a mean log of 0, since no
sample tells how bright the lamp was altogether. The goniometer's cells measure on 12 rings of θi and 18 of θo.
"""

import math
import sys
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import torch
from torch import Tensor

from homofact.brdf.quality.clipping import marked
from homofact.brdf.quality.gains import calibrated
from homofact.brdf.symmetry import RING_WIDTH
from homofact.evaluation.machine import machine
from homofact.geometry.directions import from_spherical, to_spherical
from homofact.stability.atlas import BASE_SETTINGS, FULL, SHORT, SHORT_SETTINGS
from homofact.stability.cells import BAD_LIGHT, LEAST_EXPLAINED, fit_row, judge_fit, method_for
from homofact.stability.fault import generator_of, uniform
from homofact.stability.faults import FAULTS
from homofact.stability.problem import BASE, Problem, Scale, faulted, samples_at, unstressed

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from scripts.shared.harness import markdown, parser_of, progress, write

METHODS = ("search", "mccool")
Stress = Callable[[float, int, Scale], Problem]
Mend = Callable[[Problem], Problem]


@dataclass(frozen=True)
class Kind:
    """What goes wrong, `strengths` of it, and the `option` with which it is fitted: a setting, or mended samples."""

    name: str
    title: str
    option: str
    strengths: tuple[float, ...]
    stress: Stress
    mend: Mend


def clean(strength: float, seed: int, scale: Scale) -> Problem:
    """Nothing wrong."""
    return unstressed(seed, scale)


def goniometer(strength: float, seed: int, scale: Scale) -> Problem:
    """Nothing wrong, measured on rings of θi and of θo in the plane of incidence and around it."""
    count = 13 if scale == FULL else 5
    theta_i, theta_o, phi = (
        torch.linspace(low, high, steps, dtype=torch.float64).deg2rad()
        for low, high, steps in ((5, 80, 12), (0, 84, 18), (0, 180, count))
    )
    one, two, turn = (each.reshape(-1) for each in torch.meshgrid(theta_i, theta_o, phi, indexing="ij"))
    wi, wo = from_spherical(one, torch.zeros_like(one)), from_spherical(two, turn)
    return replace(unstressed(seed, scale), samples=samples_at(BASE, wi, wo), kind="measurement", key="goniometer")


def with_gain(problem: Problem, logs: Tensor) -> Problem:
    """The values times a gain (N,), given by its log, whose mean is taken off."""
    return problem.with_values(problem.samples.values * torch.exp(logs - logs.mean())[:, None])


def rings(strength: float, seed: int, scale: Scale) -> Problem:
    """Each ring of θi with a gain of its own, normal in its log."""
    problem = goniometer(0, seed, scale)
    return with_gain(problem, strength * _by_ring(problem.samples.wi, seed))


def both_rings(strength: float, seed: int, scale: Scale) -> Problem:
    """Each ring of θi and each of θo with a gain of its own."""
    problem = goniometer(0, seed, scale)
    logs = _by_ring(problem.samples.wi, seed) + _by_ring(problem.samples.wo, seed + 1)
    return with_gain(problem, strength * logs)


def lamp(strength: float, seed: int, scale: Scale) -> Problem:
    """A lamp whose gain falls by `strength` from the normal to 90°, samples anywhere."""
    problem = unstressed(seed, scale)
    return with_gain(problem, torch.log1p(-strength * to_spherical(problem.samples.wi)[0] / (math.pi / 2)))


def drift(strength: float, seed: int, scale: Scale) -> Problem:
    """A lamp whose gain falls by `strength` from the first row to the last, rows ring after ring of θi."""
    problem = goniometer(0, seed, scale)
    return with_gain(problem, torch.log1p(-strength * torch.linspace(0, 1, len(problem.samples), dtype=torch.float64)))


def clipped(strength: float, seed: int, scale: Scale) -> Problem:
    """Every channel cut at a quantile, so that a share of its values are equal."""
    problem = unstressed(seed, scale)
    at = problem.samples.values.quantile(1 - strength, dim=0)
    return problem.with_values(torch.minimum(problem.samples.values, at))


def _by_ring(directions: Tensor, seed: int) -> Tensor:
    """A standard normal number for every ring of θ, the same for all samples on it (N,)."""
    rank = torch.unique((to_spherical(directions)[0] / RING_WIDTH).round(), return_inverse=True)[1]
    draw = torch.randn(int(rank.max()) + 1, dtype=torch.float64, generator=torch.Generator().manual_seed(77 + seed))
    return draw[rank]


def bright_outliers(strength: float, seed: int, scale: Scale) -> Problem:
    """A share of the samples 300 times too bright."""
    problem = unstressed(seed, scale)
    struck = uniform(scale.samples, generator_of(seed)) < strength
    return problem.with_values(problem.samples.values * torch.where(struck, 300.0, 1.0)[:, None])


def _setting(name: str, value: object) -> Mend:
    return lambda problem: replace(problem, settings=({name: value},), key="mended")


def _gains(kind: str) -> Mend:
    return lambda problem: problem.measuring(calibrated(problem.samples, (kind,)))


def _marked(problem: Problem) -> Problem:
    return problem.measuring(marked(problem.samples, "found"))


robust, by_rings, by_rows = _setting("robust", True), _gains("rings"), _gains("rows")
KINDS = (
    Kind("clean", "nothing wrong", "--robust", (0,), clean, robust),
    Kind("clean", "nothing wrong", "--calibrate rings", (0,), clean, by_rings),
    Kind("clean", "nothing wrong, a goniometer", "--calibrate rings", (0,), goniometer, by_rings),
    Kind("clean", "nothing wrong, a goniometer", "--calibrate rows", (0,), goniometer, by_rows),
    Kind("clean", "nothing wrong", "--epsilon floor", (0,), clean, _setting("epsilon", "floor")),
    Kind("outliers", "share × 300", "--robust", (0.02, 0.05, 0.2), bright_outliers, robust),
    Kind("outliers", "share × 1000", "--robust", (0.005, 0.02, 0.05), faulted(FAULTS["outliers"]), robust),
    Kind("zeros", "share × 0", "--robust", (0.05, 0.1, 0.2, 0.5), faulted(FAULTS["zeros"]), robust),
    Kind("rings", "σ of the log gain, rings of θi", "--calibrate rings", (0.2, 0.4, 0.8), rings, by_rings),
    Kind("rings", "σ of the log gain, of θi and θo", "--calibrate rings", (0.4,), both_rings, by_rings),
    Kind("lamp", "fall of the gain over θi", "--calibrate rings", (0.5, 0.8), lamp, by_rings),
    Kind("drift", "fall of the gain along the rows", "--calibrate rows", (0.5, 0.8), drift, by_rows),
    Kind("clipped", "share of the values clipped", "--clipped found", (0.05, 0.1, 0.15, 0.2, 0.3), clipped, _marked),
    Kind("noise", "σ over the mean, added", "--epsilon floor", (0.5, 0.7, 1, 2), faulted(FAULTS["additive-noise"]),
         _setting("epsilon", "floor")),
)  # fmt: skip
NAMES = tuple(dict.fromkeys(kind.name for kind in KINDS))


@dataclass(frozen=True)
class Found:
    """One fit: its light over the clean in the band farthest off, and the explained share of the clean logarithms."""

    off: float
    explained: float

    @property
    def good(self) -> bool:
        """Whether it is not bad as the atlas says it."""
        return abs(self.off - 1) <= BAD_LIGHT and self.explained >= LEAST_EXPLAINED


def found(problem: Problem, method: str, settings: dict) -> Found:
    """The fit of a problem, judged."""
    made = method_for(method, problem, settings)
    assert made is not None
    judged = judge_fit(problem, made, fit_row)
    return Found(judged.off, judged.explained)


def words(fits: list[Found]) -> list[str]:
    """The worst light, the least explained, and how many are good."""
    worst = max((each.off for each in fits), key=lambda off: abs(math.log(max(off, 1e-6))))
    explained = min(each.explained for each in fits)
    return [f"{worst:.3g}", f"{explained:.0%}" if explained > 0 else "0%", f"{sum(f.good for f in fits)}/{len(fits)}"]


def main(arguments: list[str] | None = None) -> int:
    """Fit every cell both ways, print the table, and write it where it is asked for."""
    parser = parser_of(__doc__, "out")
    parser.add_argument("--seeds", type=int, default=3, help="draws of samples and stress (%(default)s)")
    parser.add_argument("--only", nargs="*", choices=NAMES, default=NAMES)
    parser.add_argument("--methods", nargs="*", choices=METHODS, default=METHODS)
    options = parser.parse_args(arguments)
    scale, settings = (SHORT, SHORT_SETTINGS) if options.short else (FULL, BASE_SETTINGS)
    seeds = 1 if options.short else options.seeds
    rows, turned, bad, spoiled = [], 0, 0, 0
    for kind in (each for each in KINDS if each.name in options.only):
        for strength in kind.strengths[-1:] if options.short else kind.strengths:
            for method in options.methods:
                both: tuple[list[Found], list[Found]] = ([], [])
                for seed in range(seeds):
                    problem, own = kind.stress(strength, seed, scale), settings | {"seed": seed}
                    both[0].append(found(problem, method, own))
                    both[1].append(found(kind.mend(problem), method, own))
                for without, mended in zip(*both, strict=True):
                    bad += not without.good
                    turned += mended.good and not without.good
                    spoiled += without.good and not mended.good
                rows.append([kind.title, f"{strength:g}", kind.option, method, *words(both[0]), *words(both[1])])
                progress(*rows[-1])
    header = ["what is wrong", "strength", "option", "method", "light", "explained", "good", "light with it",
              "explained with it", "good with it"]  # fmt: skip
    count = seeds * len(rows)
    said = (
        f"Without the option, {bad} of {count} fits are bad. With the option, {turned} of these {bad} are good."
        f" {spoiled} of the {count - bad} fits that are good without the option {'is' if spoiled == 1 else 'are'}"
        " bad with it."
    )
    table = f"{said}\n\n{markdown(header, rows, 4)}\n\nMeasured on {machine()}.\n"
    print(table)
    if options.out is not None:
        write(options.out, f"{HEAD.format(seeds=seeds)}\n{table}")
    return 0


HEAD = """\
<!-- Made by `python scripts/verdict/robustness.py --out docs/robustness.md`: change the words there, not here. -->
# Repair bad measurements

Read this page if `homofact info` or a verdict reports outliers, gains (unknown scale factors of parts of the data),
clipped values or noise. Four options of `homofact factorize` repair such data in part. The [last section](#results)
shows how well they work on simulated faults.

    homofact factorize samples.csv --robust --calibrate rings+rows --epsilon floor --out out/repaired

## Exclude outliers

`--robust` (`homofact/brdf/quality/outliers.py`) excludes samples whose values are far from those of all their
neighbours. It does so before homofact computes anything from the samples. It keeps highlights, because the samples of a
highlight agree with each other. The entry `outliers` in the details of the fit gives the excluded share of the total
sample weight.

- If the sample nearest to the mirror direction is an outlier, it looks like a highlight and is kept. One such sample
  can spoil a search. Expect this if 5% or more of the samples are outliers.
- If many samples are zero, for example half of them, `--robust` does not treat them as outliers.

## Divide out gains

`--calibrate rings` (`homofact/brdf/quality/gains.py`) estimates one gain for every ring of equal θi and of equal θo. It
fits the gains and a smooth reciprocal BRDF at the same time, and then divides the samples by the gains. `--calibrate
rows` does the same for blocks of consecutive rows of the file. Use it if the lamp drifted.

- Two parts of the gains cannot be determined: their mean logarithm, and a smooth gain that depends in the same way on
  θi and θo. Samples with such a gain are also valid samples of another material. If both the θi rings and the θo
  rings have random gains, this smooth gain remains, and the fit may not improve.
- homofact reports gains that could also come from the material itself, and does not divide them out. Clean samples
  therefore stay bit-identical.
- If only a few rings are bad, homofact treats them one by one. For each ring that `homofact info` suspects, it divides
  out the step between this ring and its neighbours. It does this for at most four rings. The other rings stay
  bit-identical. With fewer than eight angles of the light, homofact tests single rings first. It divides out gains of
  all rings only if it suspects no single ring, since one bad ring would shift them all.

## Treat clipped values as bounds

Use `--clipped found` to detect the clipping level, or give the level in sr⁻¹ (`homofact/brdf/quality/clipping.py`). The
fit then uses clipped values as lower bounds: they raise a fit that is below them, and never lower a fit that is above
them. Where values are clipped, smoothing extrapolates the flank of the highlight. This is a guess. The search still
takes the clipped values as exact when it chooses projections. We also tried a search that ignores the clipped
values. It chose projections whose highlight was up to ten times too bright.

## Set ε from the noise

`--epsilon floor` (`homofact/brdf/quality/noise_floor.py`) sets ε from the scatter of the darkest quarter of the
samples. It compares repeated samples of the same pair of directions, samples with light and viewer swapped, and
neighbouring samples. A constant offset of all values looks like Lambertian reflection, so homofact cannot detect it. If
the noise is as large as the mean, setting negative values to zero has already made the dark samples too bright on
average. No ε can repair that.

## Results

The table compares fits without and with the option. Material, settings and clean samples are those of [Where fits
fail](stability.md). Some of the faults and strengths are different. Each row is one combination of a fault, its
strength and a method, fitted for {seeds} random draws. `light` is the total reflected light of the fit, divided by
the light of the clean material, in the band of incidence angles where this ratio is farthest from
1. `explained` is the share of the variance of the clean logarithms that the fit explains. Both columns give the
worst of the {seeds}
draws. A fit is good if `light` is within 15% of 1 and `explained` is at least 90%. "Share × 300" multiplies a random
share of the samples by 300. "σ of the log gain" and "fall of the gain" give rings or rows different gains. "σ over the
mean, added" adds Gaussian noise.
"""


if __name__ == "__main__":
    sys.exit(main())
