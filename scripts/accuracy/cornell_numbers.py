"""Compare McCool's projections, searched ones, and McCool's own published textures on the Cornell paints.

    python scripts/accuracy/cornell_numbers.py [--seeds 0 1 2] [--data FOLDER] [--short]

16², RGB, ε = 1e-2; a fifth of the measured samples is held out, the rest copied to other azimuths, the
held-out ones turned at random. Means over splits by seed. McCool's published 8-bit textures have no
established scale, so the last column gives everybody the best constant for each channel, found on the
training samples; they were made from the whole measurement, held-out samples included.
"""

import sys
from collections import defaultdict
from dataclasses import dataclass, replace
from pathlib import Path

from homofact.brdf.log_transform import LogTransform
from homofact.brdf.reflectance import Reflectance
from homofact.brdf.samples import Samples
from homofact.brdf.source import Source, open_source
from homofact.brdf.source_names import HELD_OUT
from homofact.evaluation.compare import ComparisonRow, fit_and_measure
from homofact.evaluation.machine import machine
from homofact.evaluation.metrics import SixErrors, six_errors
from homofact.methods.cole import Cole
from homofact.methods.table import mccool_like

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from scripts.accuracy.ladder import ladder, split
from scripts.data import waterloo
from scripts.shared.harness import cornell_files, data_folder, finish, markdown, parser_of, spread

COORDINATES = ("half-diff", "in-out")


@dataclass(frozen=True)
class Line:
    """One method on one paint and split: its errors as it is, and held out with the best constants."""

    paint: str
    method: str
    texels: str
    nbytes: int
    fetches: int
    train: SixErrors | None
    held_out: SixErrors | None
    scale_free: SixErrors


@dataclass(frozen=True)
class Split:
    """One split of one paint with the transform of the fits to it."""

    train: Samples
    test: Samples
    transform: LogTransform


def scale_free(reflectance: Reflectance, data: Split) -> SixErrors:
    """Held-out errors with a constant for each channel, found on the training samples."""
    found = reflectance.evaluate(data.train.wi, data.train.wo)
    constant = waterloo.best_constant(found, data.train.values, data.transform)
    return six_errors(reflectance.evaluate(data.test.wi, data.test.wo) * constant, data.test.values, data.transform)


def fitted_line(paint: str, row: ComparisonRow, data: Split) -> Line:
    """The line of a fit of ours."""
    settings = row.settings
    count = len(row.factorization.terms)
    name = f"cole, {settings.coordinates}" if isinstance(settings, Cole) else "McCool (ωi, h, ωo)"
    return Line(
        paint,
        f"{name}, {count} texture{'s' if count > 1 else ''}",
        f"{settings.size}²",
        row.factorization.nbytes,
        row.factorization.fetches,
        row.train,
        row.held_out,
        scale_free(row.factorization, data),
    )


def fits(source: Source, settings: Cole, counts: tuple[int, ...]) -> tuple[list[Line], Split]:
    """McCool's projections and the searched ones at the asked counts of textures, on one split."""
    paint = Path(source.name).stem
    mccool = fit_and_measure(source, mccool_like(settings))
    data = Split(*split(source, settings), mccool.factorization.transform)
    lines = [fitted_line(paint, mccool, data)]
    for coordinates in COORDINATES:
        rows = ladder(source, replace(settings, coordinates=coordinates, textures=max(counts)))
        lines += [fitted_line(paint, rows[count - 1], data) for count in counts]
        print(f"{paint}, seed {settings.seed}, {coordinates}: {rows[-1].seconds_fit:.0f} s", file=sys.stderr)
    return lines, data


def published_line(paint: str, textures: waterloo.PublishedTextures, data: Split) -> Line:
    """The line of McCool's own textures, calibrated on the training samples."""
    ready = waterloo.calibrated(textures, data.train, data.transform)
    return Line(
        paint,
        "McCool's own textures (8 bits)",
        f"{textures.p.shape[0]}²",
        textures.nbytes,
        textures.fetches,
        None,
        None,
        six_errors(ready.evaluate(data.test.wi, data.test.wo), data.test.values, data.transform),
    )


def table(lines: list[Line]) -> str:
    """One row for each paint and method, mean ± deviation over the splits."""
    groups: dict[tuple[str, str], list[Line]] = defaultdict(list)
    for line in lines:
        groups[line.paint, line.method].append(line)
    rows = []
    for (paint, name), group in groups.items():

        def over(part: str, metric: str, group: list[Line] = group) -> str:
            errors = [getattr(line, part) for line in group]
            return "–" if None in errors else spread([getattr(error, metric) for error in errors])

        rows.append(
            (
                paint,
                name,
                group[0].texels,
                group[0].nbytes,
                group[0].fetches,
                over("train", "log_mse"),
                over("held_out", "log_mse"),
                over("scale_free", "log_mse"),
                over("scale_free", "log_mae"),
            )
        )
    heads = ("bytes", "fetches", "training", "held out", "held out, scale-free", "log mae, scale-free")
    return markdown(("paint", "method", "texels", *heads), rows, 3)


def main(arguments: list[str] | None = None) -> int:
    """Print (and with --out write) the table; returns the exit code."""
    parser = parser_of(__doc__, "data", "out")
    parser.add_argument("--seeds", type=int, nargs="+", default=[0, 1, 2], help="one split and fit for each")
    chosen = parser.parse_args(arguments)
    settings = Cole(size=16, epsilon=1e-2)
    counts = (2, 5)
    if chosen.short:
        settings = replace(settings, size=6, restarts=1, search_size=4, search_samples=300, copies=2)
        counts, chosen.seeds = (1, 2), chosen.seeds[:1]
    folder = data_folder(chosen.data)
    paints, missing = cornell_files(folder)
    for message in missing:
        print(message, file=sys.stderr)
    if not paints:
        print("nothing to measure: none of the Cornell paints is there")
        return 0
    lines, published, notes = [], [], []
    for path in paints:
        source = open_source(str(path))
        measured = len(source.samples)
        own = folder / "waterloo"
        textures = waterloo.read(own, path.stem) if own.is_dir() else None
        for seed in chosen.seeds:
            found, data = fits(source, replace(settings, seed=seed), counts)
            lines += found
            if textures is not None:
                published.append((path.stem, textures, data))
        zeros = {name: int((source.samples.values[:, c] == 0).sum()) for c, name in enumerate("RGB")}
        notes.append(f"- {path.stem}: {measured} measured samples, exact zeros {zeros}")
    if published:
        # The first split alone decides, so that all splits read the textures in one way.
        first = {}
        for paint, textures, data in published:
            first.setdefault(paint, (textures, data.train, data.transform))
        ranking = waterloo.choose_convention(list(first.values()))
        (best, convention), (second, runner_up) = ranking[:2]
        notes.append(
            f"- published textures read as: {convention} (best of {len(ranking)} readings on the training samples of"
            f" seed {chosen.seeds[0]}, geometric mean Cole error {best:.3f}; next {second:.3f}: {runner_up})"
        )
        for paint, (textures, train, transform) in first.items():
            ready = waterloo.calibrated(replace(textures, convention=convention), train, transform)
            constants = ", ".join(f"{value:.3g}" for value in ready.constant)
            notes.append(
                f"- published {paint}: {textures.zeros} texel values of {textures.nbytes} are 0, read as"
                f" {'half of a step' if ready.zero else '0'}; constants R, G, B {constants};"
                f" mirror images and transposes differ by at most {textures.asymmetry}/255"
            )
        for paint, textures, data in published:
            lines.append(published_line(paint, replace(textures, convention=convention), data))
    else:
        notes.append(f"- no {folder / 'waterloo'}: McCool's published textures were skipped")
    kept = f"{1 - HELD_OUT:.0%} × {settings.copies * (2 if settings.mirrored else 1)} azimuth copies for training"
    order = [path.stem for path in paints]
    lines.sort(key=lambda line: order.index(line.paint))
    text = "\n".join(
        [
            "# Cornell paints: Cole error, training and held out",
            "",
            f"- ε = {settings.epsilon:g}; split by seeds {chosen.seeds} (mean ± deviation), {kept}, {HELD_OUT:.0%}"
            " held out and turned at random; linear sRGB of the measured spectra, float64",
            f"- search at {settings.search_size}² on {settings.search_samples} samples, {settings.restarts} restarts,"
            f" reciprocal, last {settings.joint_terms} jointly; smoothing {settings.smoothing:g}",
            *notes,
            f"- {machine()}",
            "",
            table(lines),
            "",
        ]
    )
    return finish(text, chosen)


if __name__ == "__main__":
    sys.exit(main())
