"""Measure energy, albedo and highlight of glossy fits: default settings, and those of version 0.1.0 (`--before`).

The RGL paints and neural surrogates of the MERL materials (Sztrajman et al. 2021; never MERL itself), every STEP-th of
them, with 3 textures of 32² and with 2 of 16². Held out are 20% of the samples; the figures are integrals of fit and
source over both hemispheres and pictures of both (`evaluation.appearance`), the Cole error is of 45,000 other pairs
drawn in the discs, with the fit's own ε and A.

    python scripts/accuracy/kept_light.py [--step 5] [--before] [--data FOLDER] [--out FILE.md]
"""

import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from statistics import median

from homofact.brdf.formats.nbrdf import material_names
from homofact.brdf.source import open_source
from homofact.evaluation.appearance import appearance
from homofact.evaluation.energy import EnergyErrors
from homofact.evaluation.machine import machine
from homofact.evaluation.metrics import measure
from homofact.linear.normal import warm_up
from homofact.methods.search import Search

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from scripts.shared.harness import data_folder, figure, finish, markdown, parser_of, progress

SHAPES = ((3, 32), (2, 16))
RGL = ("chm_light_blue_rgb", "aurora_white_rgb", "vch_golden_yellow_rgb", "irid_flake_paint1_rgb")
NETWORKS = Path("nbrdf") / "merl_nbrdf_weights.npz"
# Also where STEP leaves them out: metals, whose highlight is narrower than most.
NAMED = ("chrome", "steel", "tungsten-carbide", "nickel", "alum-bronze", "gold-metallic-paint")

INTRODUCTION = """\
This page shows how accurately default fits reproduce total reflected light, albedo and highlight. The materials are
four measured paints of the RGL database and neural surrogates of MERL materials (networks of Sztrajman et al.
2021). homofact does not use MERL's own measurements here. For your own material, `homofact factorize` reports the
same errors ([results](results.md)).

Each section has two tables. The first summarizes the errors of all materials: the median, p90 (nine of ten fits are
at least this good) and the worst fit. The second has one fit per row. Its ratios are fit over source, so 1 is
right:

- **energy**: total reflected light, over all angles of incidence.
- **albedo**: directional albedo at five incidence angles from 5 to 75°. "Worst channel" is the ratio farthest from
  1 among all angles and channels. "Mean" is the ratio farthest from 1 among the angles, for the mean of the
  channels.
- **highlight**: flux in the source's brightest directions. For each incidence, these are the directions with the
  largest f that together carry 1% of the source's flux. **bright half**: the same for 50% of the flux.

The other columns:

- **RMS**: relative root mean square error, √(∫∫(f̂ − f)² cosθi cosθo / ∫∫ f² cosθi cosθo), where f̂ is the fit and
  f the source. **floor**: the smallest RMS that a reciprocal fit can have. The floors of [Straighten a
  measurement](straightening.md) are of f cosθi cosθo, which gives grazing angles less weight, so they are smaller.
- **sky dB**: PSNR of a sphere under a sky.
- **Cole error** ([glossary](glossary.md)): measured at pairs of directions that were not fitted. These pairs are
  uniform in the parabolic discs of both directions.
- **search**: "reciprocal" if the fit is reciprocal, "free" if the search dropped reciprocity. **textures**: how
  many textures the fit has. A fit has fewer textures than allowed if one more texture would not lower the
  validation error. **s**: time of the fit in seconds."""
LIMITATIONS = """\
Each fit ran on one thread while other programs ran, so the times are longer than on an idle machine."""


@dataclass(frozen=True)
class Row:
    """One fit: what it is of, its figures, its Cole error on the discs, and the seconds of the fit."""

    name: str
    energy: EnergyErrors
    sky: float
    cole: float
    seconds: float
    reciprocal: bool
    textures: int

    @property
    def albedo_mean(self) -> float:
        """The mean over channels that is farthest from the source's."""
        return max(self.energy.albedo_mean, key=lambda ratio: abs(ratio - 1))


def sources(folder: Path, step: int) -> Iterator[tuple[str, str]]:
    """(name, path) of what is there."""
    for name in RGL:
        path = folder / "rgl" / f"{name}.bsdf"
        if path.is_file():
            yield name, str(path)
        else:
            print(f"skipped {name}: no {path} (--data FOLDER or HOMOFACT_DATA)", file=sys.stderr)
    networks = folder / NETWORKS
    if not networks.is_file():
        print(f"skipped the surrogates: no {networks} (--data FOLDER or HOMOFACT_DATA)", file=sys.stderr)
        return
    for number, name in enumerate(material_names(networks)):
        if number % step == 0 or name in NAMED:
            yield name, f"{networks}#{name}"


def fitted(name: str, path: str, textures: int, size: int, effort: str | float, before: bool, count: int) -> Row:
    """A fit of the source at `path`, with the settings of today or those of 0.1.0."""
    source = open_source(path, count=count, scheme="discs" if before else "lobe")
    train, _ = source.samples.split(0.2, 0)
    older = {"objective": "log", "reciprocal": True} if before else {}
    method = Search(textures=textures, size=size, effort=effort, epsilon=source.default_epsilon, **older)
    began = time.perf_counter()
    fit = method.fit(train).factorization
    seconds = time.perf_counter() - began
    found = appearance(fit, source)
    assert found is not None
    discs = open_source(path, count=count, scheme="discs", seed=7).samples.rotated_at_random(0)
    cole = measure(fit, discs, fit.transform).log_mse
    reciprocal = fit.terms[0].projection.reciprocal
    return Row(name, found.energy, found.psnr_sky, cole, seconds, reciprocal, len(fit.terms))


def told(row: Row) -> tuple[str, ...]:
    """A line of the table."""
    energy = row.energy
    numbers = (energy.energy_overall, energy.albedo_worst, row.albedo_mean, energy.highlight, energy.bright_half)
    words = "reciprocal" if row.reciprocal else "free"
    return (
        row.name, words, str(row.textures), *(f"{value:.3f}" for value in numbers), f"{energy.rms:.3f}",
        f"{energy.floor:.3f}", f"{row.sky:.1f}", figure(row.cole), f"{row.seconds:.1f}",
    )  # fmt: skip


def summary(rows: list[Row]) -> str:
    """How far all ratios are off, and what else the rows hold."""
    ratios = {
        "total energy": [row.energy.energy_overall for row in rows],
        "albedo, worst channel": [row.energy.albedo_worst for row in rows],
        "albedo, mean of channels": [row.albedo_mean for row in rows],
        "highlight (brightest 1% of the flux)": [row.energy.highlight for row in rows],
    }
    lines: list[tuple[str, ...]] = [
        (name, *(f"{100 * value:.2g}%" for value in ranked([abs(each - 1) for each in values])))
        for name, values in ratios.items()
    ]
    others = {
        "relative RMS": ([row.energy.rms for row in rows], 3, False),
        "PSNR under a sky, dB": ([row.sky for row in rows], 1, True),
        "seconds of the fit": ([row.seconds for row in rows], 1, False),
    }
    for name, (values, digits, low) in others.items():
        lines.append((name, *(f"{value:.{digits}f}" for value in ranked(values, low=low))))
    return markdown((f"off by, {len(rows)} materials", "median", "p90", "worst"), lines)


def ranked(values: list[float], *, low: bool = False) -> tuple[float, float, float]:
    """(median, 90th percentile, worst), the worst being the largest, or the lowest where that is worse."""
    ordered = sorted(values, reverse=low)
    return median(ordered), ordered[round(0.9 * (len(ordered) - 1))], ordered[-1]


def main(arguments: list[str] | None = None) -> int:
    """Fit, print the tables, and write them where they are asked for."""
    parser = parser_of(__doc__, "data", "effort", "out")
    parser.add_argument("--step", type=int, default=1, help="every how many surrogates (%(default)s)")
    parser.add_argument("--before", action="store_true", help="with the settings of version 0.1.0 instead")
    options = parser.parse_args(arguments)
    shapes, count = (((1, 4),), 400) if options.short else (SHAPES, 45_000)
    step, effort = (50, 5.0) if options.short else (options.step, options.effort)
    warm_up()
    header = (
        "material", "search", "textures", "energy", "albedo, worst channel", "albedo, mean", "highlight", "bright half",
        "RMS", "floor", "sky dB", "Cole error", "s",
    )  # fmt: skip
    kind = "the settings of version 0.1.0" if options.before else "default settings"
    made = "python scripts/accuracy/kept_light.py" + (" --before" if options.before else "")
    parts = [
        "# Energy, albedo and highlight of default fits",
        INTRODUCTION,
        f"`{made}` makes these tables. It uses {kind}: effort {effort}, {count} pairs, seed 0, and the default ε of"
        f" each source. {LIMITATIONS} Machine: {machine()}",
    ]
    found = list(sources(data_folder(options.data), step))
    if options.short:
        found = found[:2]
    for textures, size in shapes:
        rows = []
        for name, path in found:
            rows.append(fitted(name, path, textures, size, effort, options.before, count))
            progress(*told(rows[-1]))
        if rows:
            parts += [f"## {textures} textures of {size}²", summary(rows), markdown(header, map(told, rows), 2)]
    return finish(parts, options)


if __name__ == "__main__":
    sys.exit(main())
