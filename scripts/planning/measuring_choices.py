"""Compare the directions that `homofact measure` chooses with baselines, on measurements that its prior has not seen.

Ten RGL files, of whose families the prior has no surrogate, and three Cornell paints, whose directions are chosen among
the measured ones. Every choice is completed by the same posterior, so that only the directions differ; "PCA, own
completion" is the method of Nielsen, Jensen and Ramamoorthi (2015) with their ridge regression. The PSNR is that of
`evaluation.appearance`: a sphere under a lamp and under a sky, together by their mean squared error.

    python scripts/planning/measuring_choices.py [--data FOLDER] [--out FILE.md] [--coverage]
"""

import math
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch

from homofact.brdf.source import Source, open_source
from homofact.evaluation.appearance import appearance
from homofact.geometry.directions import draw_in_discs, from_half_difference, from_spherical
from homofact.measuring.aims import measuring_aims
from homofact.measuring.choosing import chosen_rows, uncertainties
from homofact.measuring.completed import CompletedBrdf
from homofact.measuring.foretelling import aim_errors, foretold
from homofact.measuring.goniometer import Goniometer, directions_of
from homofact.measuring.posterior import BrdfPosterior, after_values, before_samples
from homofact.measuring.prior import EPSILON, BrdfPrior, read_prior
from homofact.measuring.rounds import next_round

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from scripts.planning.measuring_prior import measured_files, measured_rounds, values_at
from scripts.shared.harness import cornell_files, data_folder, finish, markdown, parser_of, progress

DIRECTIONS, INCIDENCES, STARTS = 20, 5, 8
RIDGE = 0.01
Rows = np.ndarray
Pair = tuple[torch.Tensor, torch.Tensor]


# ---- baselines: which rows of the candidates (N, n) they take


def principal_rows(prior: BrdfPrior, matrix: object, count: int) -> np.ndarray:
    """The principal components of the log-mapped materials at the candidates (N, K), scaled by deviations."""
    return np.asarray(matrix @ prior.vectors[:count].T)


def condition(rows: np.ndarray) -> np.ndarray:
    """The condition numbers of matrices (..., k, K)."""
    values = np.linalg.svd(rows, compute_uv=False)
    return values[..., 0] / np.maximum(values[..., -1], 1e-300)


def by_exchange(rows: np.ndarray, count: int) -> list[int]:
    """Nielsen et al. (2015, section 4): exchanges that lower the condition number, best of several starts."""
    best, found = math.inf, list(range(count))
    for start in range(STARTS):
        chance = np.random.default_rng(start)
        own = chance.choice(len(rows), count, replace=False).tolist()
        level = float(condition(rows[own]))
        for _ in range(4):
            before = level
            for place in range(count):
                tried = chance.choice(len(rows), min(200, len(rows)), replace=False)
                several = np.repeat(rows[own][None], len(tried), 0)
                several[:, place] = rows[tried]
                levels = condition(several)
                if levels.min() < level:
                    level, own[place] = float(levels.min()), int(tried[levels.argmin()])
            if level > 0.995 * before:
                break
        if level < best:
            best, found = level, own
    return found


def by_condition(rows: np.ndarray, count: int) -> list[int]:
    """Greedily the row after which the condition number is least, with as many components as rows."""
    own = [int(np.abs(rows[:, 0]).argmax())]
    while len(own) < count:
        kept = min(len(own) + 1, rows.shape[1])
        several = np.concatenate((np.repeat(rows[own][None, :, :kept], len(rows), 0), rows[:, None, :kept]), 1)
        levels = condition(several)
        levels[own] = np.inf
        own.append(int(levels.argmin()))
    return own


def in_discs(count: int, seed: int) -> Pair:
    """Pairs uniform in the discs, both directions within 80°."""
    return draw_in_discs(count, torch.Generator().manual_seed(seed), math.tan(math.radians(40)) ** 2)


def by_habit(count: int) -> Pair:
    """Four incidences with views in the plane of incidence, evenly spaced."""
    views = count // 4
    angles = [[i, o, 180.0] for i in (10.0, 30.0, 50.0, 70.0) for o in np.linspace(0, 80, views)]
    return directions_of(np.array(angles))


def as_merl(count: int) -> Pair:
    """θh spaced as MERL's tables, θd in turn 10 to 70°, φd 90°."""
    half = torch.from_numpy(np.radians(75) * ((np.arange(count) + 0.5) / count) ** 2)
    difference = torch.from_numpy(np.radians(np.array([10, 50, 30, 70]))[np.arange(count) % 4].copy())
    wi, wo = from_half_difference(
        from_spherical(half, torch.full_like(half, math.pi / 2)), from_spherical(difference, torch.zeros_like(half))
    )
    above = (wi[:, 2] > 0.02) & (wo[:, 2] > 0.02)
    return wi[above], wo[above]


# ---- what an estimate is worth


@dataclass(frozen=True)
class Worth:
    """PSNR in dB of the sphere under both lights, the lamp and the sky, and the albedo's mean log error."""

    both: float
    lamp: float
    sky: float
    albedo: float


def worth(source: Source, posterior: BrdfPosterior, prior: BrdfPrior) -> Worth:
    """How good an estimate is, by `evaluation.appearance`."""
    found = appearance(CompletedBrdf(prior.grid, posterior, ("R", "G", "B")), source)
    assert found is not None
    lamp, sky = found.psnr_light, found.psnr_sky
    both = -10 * math.log10((10 ** (-lamp / 10) + 10 ** (-sky / 10)) / 2)
    albedo = float(np.mean([abs(math.log(ratio)) for ratio in found.energy.albedo_mean]))
    return Worth(both, lamp, sky, albedo)


class Ridge:
    """Nielsen's completion: coefficients of the components by ridge regression, as an estimate's posterior."""

    def __init__(self, prior: BrdfPrior) -> None:
        """The components of a prior."""
        self.prior = prior

    def after(self, matrix: object, values: np.ndarray) -> BrdfPosterior:
        """What the components make of values (N, C)."""
        prior = self.prior
        rows = np.asarray(matrix @ prior.vectors.T)
        logs = np.log(values + EPSILON) - np.asarray(matrix @ prior.mean)[:, None]
        found = np.linalg.solve(rows.T @ rows + RIDGE * np.eye(rows.shape[1]), rows.T @ logs)
        nodes = np.exp(np.minimum(prior.mean[:, None] + prior.vectors.T @ found, 15))
        level = nodes.mean(1)
        known = before_samples(prior, values.shape[1])
        return BrdfPosterior(
            np.ones(1), np.log(level)[None], np.ones(1), known.covariance, (nodes / level[:, None]).T,
            known.colour_covariance,
        )  # fmt: skip


def choices(prior: BrdfPrior, goniometer: Goniometer) -> dict[str, list[Pair]]:
    """The directions of each baseline, of several seeds where it has chance."""
    candidates = goniometer.directions()
    matrix = prior.grid.matrix(*directions_of(candidates))
    rows = principal_rows(prior, matrix, DIRECTIONS)
    start = before_samples(prior, 3)
    weights = measuring_aims(prior.grid).weights(start)
    once = chosen_rows(uncertainties(start, weights), matrix, DIRECTIONS)
    return {
        "measure, all at once": [directions_of(candidates[once])],
        "PCA": [directions_of(candidates[by_exchange(rows, DIRECTIONS)])],
        "condition number": [directions_of(candidates[by_condition(rows, DIRECTIONS)])],
        "MERL's spacing": [as_merl(DIRECTIONS)],
        "rings by habit": [by_habit(DIRECTIONS)],
        "uniform": [in_discs(DIRECTIONS, seed) for seed in range(3)],
    }


def mean_worth(several: Sequence[Worth]) -> Worth:
    """The mean of each figure."""
    return Worth(
        *(float(np.mean([getattr(each, name) for each in several])) for name in ("both", "lamp", "sky", "albedo"))
    )


@dataclass
class Measured:
    """What is gathered over materials: worth by method, whether intervals covered, and CPU seconds of a round."""

    worth: dict[str, list[Worth]]
    covered: dict[tuple[int, str], list[float]]
    seconds: list[float]


def directions_table(sources: Sequence[Source], prior: BrdfPrior, gathered: Measured) -> str:
    """The table of single directions on whole measurements."""
    goniometer = Goniometer()
    fixed = choices(prior, goniometer)
    ridge = Ridge(prior)
    for source in sources:
        material = source.reflectance
        *_, (_, _, posterior) = measured_rounds(prior, material, goniometer, DIRECTIONS)
        gathered.worth.setdefault("measure, rounds of 5", []).append(worth(source, posterior, prior))
        began = time.process_time()
        next_round(prior, posterior, goniometer, directions=5)
        gathered.seconds.append(time.process_time() - began)
        for name, several in fixed.items():
            ways: list[tuple[str, Callable[..., BrdfPosterior]]] = [(name, lambda m, v: after_values(prior, m, v))]
            if name == "PCA":
                ways.append(("PCA, own completion", ridge.after))
            for label, complete in ways:
                own = [
                    worth(source, complete(prior.grid.matrix(wi, wo), values_at(material, wi, wo)), prior)
                    for wi, wo in several
                ]
                gathered.worth.setdefault(label, []).append(mean_worth(own))
        progress(source.name, *(f"{name} {each[-1].both:.1f}" for name, each in gathered.worth.items()))
    return worth_table(gathered.worth, "measure, rounds of 5")


def _note_cover(gathered: Measured, count: int, told: object, was: object) -> None:
    for name in ("albedo", "highlight"):
        inside = np.abs(getattr(was, name)) <= np.log(getattr(told, f"{name}_factor"))
        gathered.covered.setdefault((count, name), []).append(float(np.mean(inside)))
    gathered.covered.setdefault((count, "psnr"), []).append(float(was.psnr >= told.psnr_least))  # type: ignore[attr-defined]


def worth_table(found: Mapping[str, Sequence[Worth]], ours: str) -> str:
    """Medians of each method, and the median of our gain over it."""
    rows = []
    for name, own in found.items():
        medians = [f"{np.median([getattr(each, kind) for each in own]):.1f}" for kind in ("both", "lamp", "sky")]
        albedo = f"{np.expm1(np.median([each.albedo for each in own])):.0%}"
        gains = [mine.both - each.both for mine, each in zip(found[ours], own, strict=True)]
        beaten = sum(gain > 0 for gain in gains)
        gain = "" if name == ours else f"{np.median(gains):+.1f}"
        rows.append([name, *medians, albedo, gain, "" if name == ours else f"{beaten} of {len(gains)}"])
    header = ["choice", "PSNR, both (dB)", "lamp", "sky", "albedo error", "gain of measure (dB)", "better in"]
    return markdown(header, rows)


def incidences_table(sources: Sequence[Source], prior: BrdfPrior) -> str:
    """The table of whole incidences."""
    goniometer = Goniometer()
    fixed = {
        "evenly spaced": (8.0, 24.0, 40.0, 56.0, 72.0),
        "by habit": (10.0, 20.0, 30.0, 45.0, 60.0),
        "evenly in the disc": tuple(np.degrees(np.arcsin(np.sqrt((np.arange(5) + 0.5) / 5 * 0.97))).tolist()),
    }
    found: dict[str, list[Worth]] = {}
    for source in sources:
        material, own = source.reflectance, before_samples(prior, 3)
        rings: list[np.ndarray] = []
        while len(rings) < INCIDENCES:
            step = next_round(prior, own, goniometer, incidences=min(2, INCIDENCES - len(rings)))
            rings += [goniometer.ring(angle) for angle in step.incidences]
            own = _measured(prior, material, np.concatenate(rings))
        found.setdefault("measure, rounds of 2", []).append(worth(source, own, prior))
        once = next_round(prior, before_samples(prior, 3), goniometer, incidences=INCIDENCES).angles
        found.setdefault("measure, all at once", []).append(worth(source, _measured(prior, material, once), prior))
        for name, angles in fixed.items():
            rows = np.concatenate([goniometer.ring(angle) for angle in angles])
            found.setdefault(name, []).append(worth(source, _measured(prior, material, rows), prior))
        progress(source.name, *(f"{name} {each[-1].both:.1f}" for name, each in found.items()))
    return worth_table(found, "measure, rounds of 2")


def _measured(prior: BrdfPrior, material: object, angles: np.ndarray) -> BrdfPosterior:
    wi, wo = directions_of(angles)
    return after_values(prior, prior.grid.matrix(wi, wo), values_at(material, wi, wo))  # type: ignore[arg-type]


def paints_table(files: Sequence[Path], prior: BrdfPrior) -> str:
    """The Cornell paints: directions among the measured ones, errors at all others."""
    rows = []
    aims = measuring_aims(prior.grid)
    for file in files:
        source = open_source(str(file))
        samples = source.samples
        matrix = prior.grid.matrix(samples.wi, samples.wo)
        values = samples.values.numpy()
        components = principal_rows(prior, matrix, DIRECTIONS)
        picks: list[int] = []
        posterior = before_samples(prior, values.shape[1])
        while len(picks) < DIRECTIONS:
            blocks = uncertainties(posterior, aims.weights(posterior))
            left = np.setdiff1d(np.arange(len(values)), picks)
            picks += left[chosen_rows(blocks, matrix[left], 5)].tolist()
            posterior = after_values(prior, matrix[picks], values[picks])
        chance = np.random.default_rng(0)
        several = {
            "measure, rounds of 5": [picks],
            "PCA": [by_exchange(components, DIRECTIONS)],
            "condition number": [by_condition(components, DIRECTIONS)],
            "uniform": [chance.choice(len(values), DIRECTIONS, replace=False).tolist() for _ in range(5)],
        }
        # The interpolant of all samples stands for the paint.
        truth = values_at(source.reflectance, aims.wi, aims.wo)
        for name, chosen in several.items():
            errors, pictures = [], []
            for own in chosen:
                known = after_values(prior, matrix[own], values[own])
                rest = np.setdiff1d(np.arange(len(values)), own)
                logs = np.log(known.values(matrix[rest]) + 0.01) - np.log(values[rest] + 0.01)
                errors.append(float(np.sqrt((logs**2).mean())))
                pictures.append(aim_errors(aims, truth, known.values(aims.matrix)).psnr)
            rows.append([file.stem, name, f"{np.mean(errors):.2f}", f"{np.mean(pictures):.1f}"])
        progress(file.stem, *(row[-1] for row in rows[-len(several) :]))
    return markdown(["paint", "choice", "RMS log error, left-out samples", "PSNR (dB)"], rows, 2)


def note_coverage(source: Source, prior: BrdfPrior, gathered: Measured) -> None:
    """Note whether the intervals cover after each round of a material."""
    aims = measuring_aims(prior.grid)
    truth = values_at(source.reflectance, aims.wi, aims.wo)
    for count, _, posterior in measured_rounds(prior, source.reflectance, Goniometer(), DIRECTIONS):
        told, was = foretold(prior, posterior, aims), aim_errors(aims, truth, posterior.values(aims.matrix))
        _note_cover(gathered, count, told, was)
    progress(source.name)


def coverage_parts(gathered: Measured, files: int) -> list[str]:
    """The table of how often the intervals cover."""
    counts = sorted({count for count, _ in gathered.covered})
    names = {"albedo": "albedo", "highlight": "highlight", "psnr": "least PSNR"}
    rows = [[str(n), *(f"{np.mean(gathered.covered[n, key]):.0%}" for key in names)] for n in counts]
    rows.append(["all", *(f"{np.mean([np.mean(gathered.covered[n, key]) for n in counts]):.0%}" for key in names)])
    head = f"How often the 90% intervals cover, on {files} files on which they were not set:"
    return [head, markdown(["directions", *names.values()], rows)]


def main(arguments: list[str] | None = None) -> int:
    """Print all tables."""
    parser = parser_of(__doc__, "data", "out")
    parser.add_argument("--coverage", action="store_true", help="only how often the intervals cover")
    options = parser.parse_args(arguments)
    folder, prior = data_folder(options.data), read_prior()
    files = sorted((folder / "rgl").glob("*.bsdf"))
    paints, missing = cornell_files(folder)
    if options.short:
        files, paints = files[:1], paints[:1]
    sources = [open_source(str(file), count=1000) for file in files]
    used = measured_files(folder)
    tests = [source for file, source in zip(files, sources, strict=True) if file not in used or options.short]
    gathered = Measured({}, {}, [])
    for source in tests:
        note_coverage(source, prior, gathered)
    coverage = coverage_parts(gathered, len(tests))
    if options.coverage:
        return finish(coverage, options)
    parts = [
        f"{DIRECTIONS} directions, {len(sources)} RGL materials (medians):", directions_table(sources, prior, gathered),
        f"{INCIDENCES} incidences, the same materials:", incidences_table(sources, prior),
        f"{DIRECTIONS} of the measured directions of the Cornell paints:", paints_table(paints, prior), *missing,
    ]  # fmt: skip
    parts += coverage
    parts.append(
        f"A round takes {np.median(gathered.seconds):.1f} s of CPU time, at most {max(gathered.seconds):.1f} s."
    )
    return finish(parts, options)


if __name__ == "__main__":
    sys.exit(main())
