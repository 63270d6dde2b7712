"""Compare the searched fit with McCool's projections and a scattered-data interpolant.

Four tables, as Markdown on stdout:

* blue paint: 45,000 pairs uniform in the parabolic discs (r² < 0.98), green channel, ε = 1e-5, error on a second draw;
* Cornell paints: ε = 1e-2, held-out 20% turned at random, mean over five splits, for both ways of judging a mix (by
  left-out rings, the default, and at random), with an RBF interpolant of the same training samples whose smoothing is
  tuned on a fold of them;
* anisotropic models: 45,000 pairs, 20% held out;
* rings: fixed mixes on the paints, cross-validated on the training samples by samples and by whole rings.

    python scripts/accuracy/against_interpolant.py [--short] [--only blue,cornell,anisotropic,rings]
"""

import argparse
import sys
from dataclasses import replace
from pathlib import Path
from statistics import mean, median

import torch

from homofact.brdf.log_transform import LogTransform
from homofact.brdf.materials import material
from homofact.brdf.sampling import sample_model
from homofact.brdf.scattered import Scattered
from homofact.brdf.source import MEASURED_EPSILON, NOISE_FREE_EPSILON, Source, open_source
from homofact.evaluation.compare import fit_and_measure
from homofact.evaluation.machine import machine
from homofact.evaluation.metrics import measure
from homofact.factor.projection import Warp, fixed_projection
from homofact.factor.textures import LogSamples, texture_shape
from homofact.methods.effort import FitBudget
from homofact.methods.folded import Folded
from homofact.methods.mccool import McCool
from homofact.methods.method import Method
from homofact.methods.search import Search
from homofact.methods.table import mccool_like
from homofact.methods.validation import partitions_of

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from scripts.shared.harness import cornell_files, data_folder, figure, markdown


def blue(short: bool) -> str:
    """Two textures on blue paint, several draws."""
    count, draws = (3000, 1) if short else (45_000, 3)
    model = material("lafortune-blue-paint").model
    rows = []
    for draw in range(draws):
        train = sample_model(model, count=count, seed=2 * draw).channel("G")
        test = sample_model(model, count=count, seed=2 * draw + 1).channel("G")
        for method in (
            McCool(epsilon=NOISE_FREE_EPSILON),
            Search(textures=2, epsilon=NOISE_FREE_EPSILON, effort="quick" if short else "normal"),
        ):
            fit = method.fit(train)
            transform = fit.factorization.transform
            errors = [measure(fit.factorization, samples, transform).log_mse for samples in (train, test)]
            kinds = " · ".join(term.projection.coordinates for term in fit.factorization.terms)
            numbers = [figure(value) for value in (*errors, fit.report.seconds)]
            rows.append((draw, method.name, kinds, *numbers, fit.report.status.value))
    return markdown(("draw", "method", "coordinates", "train", "second draw", "seconds", "ended"), rows)


def interpolant_error(source: Source, seed: int) -> float:
    """Held-out Cole error of an RBF interpolant, its smoothing tuned on a fold of the training samples."""
    train, test = source.samples.split(0.2, seed)
    transform = LogTransform.of(train, MEASURED_EPSILON)
    inner, fold = train.split(0.2, seed + 1000)
    choices = (1e-5, 1e-4, 1e-3, 1e-2, 1e-1, 1.0)
    tuned = min(choices, key=lambda s: measure(Scattered(inner, smoothing=s), fold, transform).log_mse)
    return measure(Scattered(train, smoothing=tuned), test.rotated_at_random(seed), transform).log_mse


def cornell(short: bool) -> str:
    """Two and three textures on the three paints, against McCool and the interpolant."""
    files, missing = cornell_files(data_folder(None))
    seeds = range(1 if short else 5)
    rows = []
    for file in files[:1] if short else files:
        paint = file.stem
        source = open_source(str(file))
        base = Search(epsilon=MEASURED_EPSILON, effort="quick" if short else "normal")

        def errors(settings: Method, source: Source = source) -> list[float]:
            return [fit_and_measure(source, replace(settings, seed=s)).held_out.log_mse for s in seeds]

        mccool = errors(mccool_like(base))
        rbf = [interpolant_error(source, seed) for seed in seeds]

        def row(name: str, found: list[float], mccool: list[float] = mccool, paint: str = paint) -> tuple[str, ...]:
            ratio = mean(found) / mean(mccool)
            return (
                paint,
                name,
                figure(mean(found)),
                figure(median(found)),
                figure(ratio),
                " ".join(map(figure, found)),
            )

        rows += [row("McCool", mccool), row("RBF interpolant", rbf)]
        for textures in (2, 3):
            for validation in ("rings", "random"):
                found = errors(replace(base, textures=textures, validation=validation))
                rows.append(row(f"search, at most {textures}, judged by {validation}", found))
    table = markdown(("paint", "method", "mean", "median", "mean / McCool's", "splits"), rows, text_columns=2)
    return "\n".join([table, *missing])


def anisotropic(short: bool) -> str:
    """Two and four textures on two anisotropic models."""
    rows = []
    for name in ("ward-brushed", "ashikhmin-shirley-wang"):
        source = open_source(f"material:{name}", count=3000 if short else 45_000)
        mccool = fit_and_measure(source, McCool()).held_out.log_mse
        rows.append((name, "mccool", "wi · h", figure(mccool), 1, "", ""))
        for textures in (2,) if short else (2, 4):
            row = fit_and_measure(source, Search(textures=textures, effort="quick" if short else "normal"))
            kinds = " · ".join(term.projection.coordinates for term in row.factorization.terms)
            error = row.held_out.log_mse
            numbers = [figure(value) for value in (error, error / mccool, row.seconds_fit)]
            rows.append((name, f"search, {textures}", kinds, *numbers, row.report.status.value))
    return markdown(("material", "method", "coordinates", "held out", "/ McCool's", "seconds", "ended"), rows)


def rings(short: bool) -> str:
    """Fixed mixes on the paints, judged by left-out samples and by left-out rings: where a second texture helps."""
    files, missing = cornell_files(data_folder(None))
    mixes = (("theta_h-theta_d",), ("theta_h-theta_d", "theta_i"), ("theta_h-theta_d", "theta_i-theta_o"))
    rows = []
    for file in files[:1] if short else files:
        train, _ = open_source(str(file)).samples.split(0.2, 0)
        logs = LogSamples.of(train, LogTransform.of(train, MEASURED_EPSILON))
        for kinds in mixes:
            projections = tuple(
                fixed_projection(kind, True, Warp(0.03) if kind == "theta_h-theta_d" else None) for kind in kinds
            )
            shapes = tuple(texture_shape(projection, 16) for projection in projections)
            for by_rings in (False, True):
                folded = Folded.of(logs, partitions_of(train, 4, 0, rings=by_rings), projections, shapes)
                smoothing, together = folded.best_smoothing((1e-3,) * len(kinds), FitBudget())
                _, error = folded.best_each(smoothing, FitBudget())
                judged = "rings" if by_rings else "samples"
                rows.append((file.stem, " · ".join(kinds), judged, figure(together), figure(error)))
    header = ("paint", "mix", "left out", "error, one λ", "error, λ for each")
    return "\n".join([markdown(header, rows, text_columns=3), *missing])


TABLES = {"blue": blue, "cornell": cornell, "anisotropic": anisotropic, "rings": rings}


def main(arguments: list[str] | None = None) -> None:
    """Print the tables asked for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--short", action="store_true", help="a smoke test: few samples, one split, seconds")
    parser.add_argument("--only", default=",".join(TABLES), help="tables, joined by commas")
    chosen = parser.parse_args(arguments)
    torch.set_num_threads(1)
    print(machine())
    for name in chosen.only.split(","):
        print(f"\n## {name}\n\n{TABLES[name](chosen.short)}", flush=True)


if __name__ == "__main__":
    main()
