"""`homofact factorize`: a BRDF in, a folder with its textures, pictures and figures out."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import typer
from rich.text import Text

from homofact.cli import options as o
from homofact.cli.places import check_folder
from homofact.cli.screen import Screen, plain, say_ending, say_subset
from homofact.cli.subject import check_source, method_settings, open_subject, warmed_up
from homofact.cli.tables import cost_table, error_table
from homofact.cli.verdicts import refuse_findings, verdict_lines
from homofact.errors import BadInput
from homofact.evaluate.wording import figure


def factorize(
    context: typer.Context,
    source: o.Source = None,
    out: o.Out = None,
    force: o.Force = None,
    channels: o.Channels = None,
    count: o.Count = None,
    scheme: o.Scheme = None,
    subset: o.Subset = None,
    held_out: o.HeldOut = None,
    method: o.Method = None,
    textures: o.Textures = None,
    size: o.Size = None,
    parameterization: o.Parameterization = None,
    reciprocal: o.Reciprocal = None,
    solver: o.Solver = None,
    smoothing: o.Smoothing = None,
    epsilon: o.Epsilon = None,
    together: o.Together = None,
    restarts: o.Restarts = None,
    search: o.Search = None,
    validation: o.Validation = None,
    budget: o.Budget = None,
    refine: o.Refine = None,
    search_size: o.SearchSize = None,
    search_samples: o.SearchSamples = None,
    copies: o.Copies = None,
    mirrored: o.Mirrored = None,
    robust: o.Robust = None,
    confidence: o.Confidence = None,
    quantize: o.Quantize = None,
    bound: o.Bound = None,
    map: o.Map = None,
    decomposition: o.Decomposition = None,
    projections: o.Projections = None,
    seed: o.Seed = None,
    config: o.ConfigFile = None,
    strict: o.Strict = False,
    as_json: o.AsJson = False,
    quiet: o.Quiet = False,
) -> None:
    """Fit a BRDF and leave its textures, pictures and figures in a folder.

    The folder gets factorization.npz (homofact.load reads it back),
    manifest.json, every texture as EXR and PNG, report.json, and
    compare.png: source, fit and McCool's projections on a lit sphere.
    """
    from homofact.config import load_config

    settings = load_config(config, o.given(context))
    check_source(settings)
    if settings.output.folder is None:
        raise BadInput("out: none given, expected a folder for the result (--out, or folder under [output])")
    folder = Path(settings.output.folder)
    check_folder(folder, settings.output.force)
    fit = settings.fit
    listed = "+".join(fit.projections)
    fit = method_settings(fit, f"{fit.method}:{listed}" if listed else fit.method)

    from homofact.brdf.channels import display_of
    from homofact.evaluate.compare import fit_and_measure
    from homofact.export.result import write_result
    from homofact.figures.compare_picture import compare_picture

    screen = Screen(as_json, quiet)
    with screen.bar() as bar:
        bar.stage("reading")
        subject = open_subject(settings)
        warmed_up(screen)
        bar.stage(fit.method)
        row = fit_and_measure(subject, fit, settings.evaluate.held_out, bar, settings.source.subset)
        if strict:
            refuse_findings(row.verdict, fit.method)
        rows = {fit.method: row}
        baseline = replace(fit, method="mccool", projections=())
        if baseline != fit:
            bar.stage("McCool's projections")
            rows["McCool"] = fit_and_measure(
                subject, baseline, settings.evaluate.held_out, subset=settings.source.subset
            )
        records = {label: each.record() for label, each in rows.items()}
        record = {**records[fit.method], "opened": settings.source.path, "out": str(folder)}
        if "McCool" in records:
            record["mccool"] = records["McCool"]
        bar.stage("drawing and writing")
        panels = [(label, each.factorization, caption(records[label])) for label, each in rows.items()]

        def draw(place: Path) -> None:
            compare_picture(
                place / "compare.png",
                (subject.name, subject.reflectance),
                panels,
                to_rgb=display_of(subject.samples.channels),
            )

        write_result(
            folder,
            factorization=row.factorization,
            report=plain(record),
            pictures=draw,
            force=settings.output.force,
        )
    say_ending(screen, row.report)
    say_subset(screen, record)
    if not quiet:
        screen.show(
            error_table(records),
            cost_table(records),
            *(Text(line) for line in verdict_lines(row.verdict)),
            f"{folder}: factorization.npz, manifest.json, report.json, every texture as .exr and .png",
            f"The picture: {folder / 'compare.png'}",
        )
    screen.answer(record)


def caption(record: dict[str, Any]) -> list[str]:
    """The lines under a fit's sphere: its errors on the held-out samples and what it costs to evaluate."""
    held, train = record["error"]["held_out"], record["error"]["train"]
    return [
        f"log MSE {figure(held['log_mse'])} held out, {figure(train['log_mse'])} training",
        f"log MAE {figure(held['log_mae'])}, MAE {figure(held['mae'])} sr⁻¹ held out",
        f"{counted(record['textures'], 'texture')}, {record['bytes']} bytes, {counted(record['fetches'], 'fetch')}",
    ]


def counted(number: int, noun: str) -> str:
    """The number with its noun, in the plural where it is not 1."""
    plural = f"{noun}es" if noun.endswith("ch") else f"{noun}s"
    return f"{number} {noun if number == 1 else plural}"
