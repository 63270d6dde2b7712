"""`homofact factorize`: a BRDF in, a folder with its textures, pictures and figures out."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.text import Text

from homofact.cli import options as o
from homofact.cli.places import check_folder
from homofact.cli.screen import Screen, plain, say_ending, say_subset
from homofact.cli.subject import check_source, open_subject, warmed_up
from homofact.cli.tables import appearance_tables, cost_table, error_table
from homofact.cli.verdicts import refuse_findings, refused_names, verdict_lines
from homofact.errors import BadInput
from homofact.evaluate.wording import counted, figure
from homofact.files import extras
from homofact.files.lock import claimed

if TYPE_CHECKING:
    from homofact.config import Config


@o.configured("source.path", "output", "source", "evaluate", "fit", "seed")
def factorize(
    settings: "Config",
    strict: o.Strict = False,
    refuse: o.Refuse = "",
    as_json: o.AsJson = False,
    quiet: o.Quiet = False,
) -> None:
    """Fit a BRDF and leave its textures, pictures and figures in a folder.

    The folder gets factorization.npz (homofact.load reads it back),
    manifest.json, every texture as EXR and PNG, report.json, and
    compare.png: source, fit and McCool's projections on a lit sphere.
    """
    refused = refused_names(refuse)
    check_source(settings)
    if settings.output.folder is None:
        raise BadInput("out: none given, expected a folder for the result (--out, or folder under [output])")
    folder = Path(settings.output.folder)
    drawn = extras.installed("matplotlib")
    fit = settings.fit.method_alone()
    check_folder(folder, settings.output.force)

    from homofact.brdf.channels import display_of
    from homofact.brdf.mending import mending_lines
    from homofact.evaluate.compare import fit_and_measure
    from homofact.export.images import LIBRARIES
    from homofact.export.result import write_result
    from homofact.methods.table import mccool_like

    screen = Screen(as_json, quiet)
    with claimed(folder), screen.bar() as bar:
        bar.stage("reading")
        subject = open_subject(settings)
        warmed_up(screen)
        bar.stage(fit.name)
        row = fit_and_measure(subject, fit, settings.evaluate.held_out, bar, settings.source.subset)
        refuse_findings(row.verdict, fit.name, strict, refused)
        rows = {fit.name: row}
        baseline = mccool_like(fit)
        if baseline != fit:
            bar.stage("McCool's projections")
            rows["McCool"] = fit_and_measure(
                subject, baseline, settings.evaluate.held_out, subset=settings.source.subset
            )
        records = {label: each.record() for label, each in rows.items()}
        mended = {name: subject.samples.provenance.get(name) for name in ("gains", "clipped")}
        record = {**records[fit.name], **mended, "opened": settings.source.path, "out": str(folder)}
        if "McCool" in records:
            record["mccool"] = records["McCool"]
        bar.stage("drawing and writing")
        panels = [(label, each.factorization, caption(records[label])) for label, each in rows.items()]

        def draw(place: Path) -> None:
            from homofact.figures.compare_picture import compare_picture

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
            pictures=draw if drawn else None,
            force=settings.output.force,
        )
    without = extras.left_out({**LIBRARIES, "pictures": "matplotlib"})
    if without:
        screen.note(f"homofact: {without}")
    say_ending(screen, row.report)
    say_subset(screen, record)
    if not quiet:
        screen.show(*map(Text, mending_lines(subject.samples.provenance)))
        screen.show(
            error_table(records),
            *appearance_tables(records),
            cost_table(records),
            *(Text(line) for line in verdict_lines(row.verdict)),
            f"{folder}: factorization.npz, manifest.json, report.json"
            + ", every texture as .exr and .png" * (not without),
            *([f"The picture: {folder / 'compare.png'}"] if drawn else []),
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
