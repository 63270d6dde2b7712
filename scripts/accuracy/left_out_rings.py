"""Compare the default search with McCool's projections on left-out rings of the Cornell paints, at equal bytes.

A goniometer measures on rings of θi and of θo. Each inner ring is left out in turn, both methods are fitted to all
other samples, and the errors are those on the ring, turned to random azimuths: the Cole error with the training
samples' A, and the RMS weighted by cosθi cosθo, relative to that of the ring itself. Samples drawn at random instead
have neighbours on their own ring, which rewards the faults of each ring (see `methods.validation`).

    python scripts/accuracy/left_out_rings.py [--size 16] [--effort normal] [--data FOLDER] [--out FILE.md] [--short]
"""

import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from statistics import median

import torch

from homofact.brdf.reflectance import Reflectance
from homofact.brdf.samples import Samples
from homofact.brdf.source import open_source
from homofact.brdf.symmetry import ring_numbers
from homofact.evaluation.machine import machine
from homofact.evaluation.metrics import measure
from homofact.factor.factorization import Factorization
from homofact.geometry.directions import to_spherical
from homofact.methods.mccool import McCool
from homofact.methods.method import Method
from homofact.methods.search import Search

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from scripts.shared.harness import cornell_files, data_folder, figure, finish, markdown, parser_of, progress

SEARCH, MCCOOL = "search", "McCool"


@dataclass(frozen=True)
class Left:
    """A left-out ring of one direction ("θi" or "θo") at `degrees`, and what was measured beside it."""

    direction: str
    degrees: float
    train: Samples
    test: Samples


@dataclass(frozen=True)
class Errors:
    """Errors of one fit on its left-out ring, and its bytes."""

    cole: float
    rms: float
    nbytes: int


def left_out(samples: Samples) -> Iterator[Left]:
    """All inner rings of θi and of θo; the outermost stay, since beyond them is extrapolation."""
    for name, direction in (("θi", samples.wi), ("θo", samples.wo)):
        found = ring_numbers(direction)
        if found is None:
            continue
        rank, count = found
        degrees = to_spherical(direction)[0].rad2deg()
        for ring in range(1, count - 1):
            on = rank == ring
            test = samples.select(on).rotated_at_random(0)
            yield Left(name, float(degrees[on].mean()), samples.select(~on), test)


def relative_rms(found: torch.Tensor, test: Samples) -> float:
    """√(Σ w (f̂ − f)² / Σ w f²) over samples and channels, w = cosθi cosθo."""
    weight = (test.wi[:, 2] * test.wo[:, 2])[:, None]
    return float(((weight * (found - test.values) ** 2).sum() / (weight * test.values**2).sum()).sqrt())


def errors_of(fit: Factorization, test: Samples) -> Errors:
    """Errors of a fit on samples that it did not see."""
    reflectance: Reflectance = fit
    cole = measure(fit, test, fit.transform).log_mse
    return Errors(cole, relative_rms(reflectance.evaluate(test.wi, test.wo), test), fit.nbytes)


def methods(size: int, epsilon: float, effort: str | float) -> dict[str, Method]:
    """What is compared: two textures each."""
    return {
        MCCOOL: McCool(size=size, epsilon=epsilon),
        SEARCH: Search(textures=2, size=size, epsilon=epsilon, effort=effort),
    }


def compared(path: Path, size: int, effort: str | float, most: int | None) -> list[tuple[Left, dict[str, Errors]]]:
    """Both methods' errors on every ring of the measurement, or on the first `most`."""
    source = open_source(str(path))
    rows = []
    for number, ring in enumerate(left_out(source.samples)):
        if number == most:
            break
        both = {}
        for name, method in methods(size, source.default_epsilon, effort).items():
            fit = method.fit(ring.train).factorization
            assert isinstance(fit, Factorization)
            both[name] = errors_of(fit, ring.test)
        told = ", ".join(f"{name} {figure(e.cole)} {figure(e.rms)}" for name, e in both.items())
        progress(f"{path.stem}, {ring.direction} {ring.degrees:.0f}°: {told}")
        rows.append((ring, both))
    return rows


def summary(paint: str, rows: list[tuple[Left, dict[str, Errors]]]) -> list[tuple[str, ...]]:
    """Two lines a paint: the Cole error and the RMS, median and worst ring of each method, and of their ratio."""
    lines = []
    for what, word in (("cole", "Cole error"), ("rms", "relative RMS")):
        mccool, ours = ([float(getattr(both[name], what)) for _, both in rows] for name in (MCCOOL, SEARCH))
        ratios = [a / b for a, b in zip(ours, mccool, strict=True)]
        worst = max(range(len(rows)), key=lambda number: ratios[number])
        ring = rows[worst][0]
        lines.append(
            (
                paint,
                word,
                *(figure(part(values)) for values in (mccool, ours) for part in (median, max)),
                f"{median(ratios):.2f}",
                f"{ratios[worst]:.2f} ({ring.direction} {ring.degrees:.0f}°)",
                f"{sum(ratio <= 1 for ratio in ratios)} of {len(ratios)}",
            )
        )
    return lines


def main(arguments: list[str] | None = None) -> int:
    """Print (and with --out write) the tables; returns the exit code."""
    parser = parser_of(__doc__, "data", "effort", "out")
    parser.add_argument("--size", type=int, default=16, help="texels a side (%(default)s)")
    chosen = parser.parse_args(arguments)
    size, effort, most = (4, 5.0, 1) if chosen.short else (chosen.size, chosen.effort, None)
    paints, missing = cornell_files(data_folder(chosen.data))
    for message in missing:
        print(message, file=sys.stderr)
    if not paints:
        print("nothing to measure: none of the Cornell paints is there")
        return 0
    found = {path.stem: compared(path, size, effort, most) for path in paints[: 1 if chosen.short else None]}
    nbytes = {name: both[name].nbytes for rows in found.values() for _, both in rows for name in both}
    heads = ("McCool, median", "worst", "search, median", "worst", "ratio, median", "worst", "no worse")
    parts = [
        "# The Cornell paints by left-out rings",
        "Made by `python scripts/accuracy/left_out_rings.py`. It leaves out each inner ring of θi and of θo in turn;"
        " errors are those on the left-out ring. The ratio is the search's error over McCool's, ring by ring.",
        f"Two textures of {size}², {', '.join(f'{name} {count} bytes' for name, count in nbytes.items())}, effort"
        f" {effort}, ε of the source, seed 0. {machine()}",
        markdown(
            ("paint", "error", *heads), [line for paint, rows in found.items() for line in summary(paint, rows)], 2
        ),
        "## Ring by ring",
        markdown(
            ("paint", "ring", "McCool, Cole error", "search", "McCool, relative RMS", "search"),
            [
                (
                    paint,
                    f"{ring.direction} {ring.degrees:.0f}°",
                    *(figure(getattr(both[name], what)) for what in ("cole", "rms") for name in (MCCOOL, SEARCH)),
                )
                for paint, rows in found.items()
                for ring, both in rows
            ],
            2,
        ),
    ]
    return finish(parts, chosen)


if __name__ == "__main__":
    sys.exit(main())
