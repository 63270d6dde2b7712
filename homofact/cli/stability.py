"""`homofact research stability`: the atlas of where fits and linear solvers fail."""

from pathlib import Path
from typing import Annotated

import typer

from homofact.api.places import check_file, check_place
from homofact.cli import options as o
from homofact.cli.screen import Screen
from homofact.errors import BadInput
from homofact.files.lock import claimed
from homofact.settings.options import MOST_SEED


def stability(
    out: Annotated[
        Path | None,
        typer.Option(metavar="FOLDER", help="Folder for the tables and pictures (required).", rich_help_panel="Output"),
    ] = None,
    document: Annotated[
        Path | None,
        typer.Option(metavar="FILE.md", help="Also write the results as a Markdown page.", rich_help_panel="Output"),
    ] = None,
    methods: Annotated[
        str | None, typer.Option(help="Names of methods, separated by commas. Default: all.", show_default=False)
    ] = None,
    stressors: Annotated[
        str | None, typer.Option(help="Names of stressors, separated by commas. Default: all.", show_default=False)
    ] = None,
    short: Annotated[
        bool,
        typer.Option(
            "--short", help="Test only the weakest and the strongest level of each stressor, on smaller problems."
        ),
    ] = False,
    seed: Annotated[int, typer.Option(min=0, max=MOST_SEED, help="Seed of the problems and the fits.")] = 0,
    as_json: o.AsJson = False,
    quiet: o.Quiet = False,
) -> None:
    """Fit difficult data by every method, and find wrong fits whose verdict does not warn.

    A stressor is a fault of the data or settings at several strengths. For each combination of method, stressor and
    strength, the fit is ok, degraded, refused, or silently wrong. The command writes atlas.csv, atlas.png,
    solvers.csv and solvers.png to FOLDER. While it runs, unfinished.csv contains the finished fits.
    For the stressors with real measurements, set the environment variable HOMOFACT_DATA to their folder.
    """
    if out is None:
        raise BadInput("none given", where="out", expected="a folder for the atlas", hint="--out")
    check_place(out)
    if document is not None:
        check_file(document, ".md")

    from homofact.evaluation.machine import machine
    from homofact.methods.table import METHODS
    from homofact.stability.atlas import Plan, estimate_atlas, run_atlas, write_csv
    from homofact.stability.cells import CellOutcome
    from homofact.stability.document import write_document
    from homofact.stability.picture import draw_atlas, draw_solvers
    from homofact.stability.solver_atlas import SolverOutcome, run_solvers
    from homofact.stability.stressors import STRESSORS

    plan = Plan(
        _names("methods", methods, tuple(METHODS)), _names("stressors", stressors, tuple(STRESSORS)), short, seed
    )
    screen = Screen(as_json, quiet)
    estimate = estimate_atlas(plan)
    with claimed(out), screen.bar() as bar:
        bar.estimate(estimate)

        def started(done: int, runs: int, name: str) -> None:
            estimate.begin(done)
            bar.run(name, done, runs, estimate.time_left())

        # What an interrupted run leaves; an atlas that is there stays until the new one is whole.
        unfinished = out / "unfinished.csv"
        out.mkdir(parents=True, exist_ok=True)
        atlas = run_atlas(plan, started, ended=lambda cells: write_csv(unfinished, cells))
        solvers = run_solvers(seed, short, lambda done, runs, name: bar.run(name, done, runs))
    files = [out / name for name in ("atlas.csv", "atlas.png", "solvers.csv", "solvers.png")]
    write_csv(files[0], atlas.cells)
    draw_atlas(files[1], atlas, plan.settings)
    write_csv(files[2], solvers)
    draw_solvers(files[3], solvers)
    unfinished.unlink(missing_ok=True)
    if document is not None:
        write_document(document, atlas, solvers, out, machine())
        files.append(document)
    for note in atlas.notes:
        screen.note(f"homofact: {note}")
    counts = atlas.counts()
    answers = {answer.value: sum(cell.answer is answer for cell in solvers) for answer in SolverOutcome}
    bad = [cell for cell in atlas.cells if cell.outcome in (CellOutcome.SILENT, CellOutcome.CRASHED)]
    worst = [
        *(f"{c.outcome.value}: {c.method} on {c.stressor} at {c.label} {c.message or f'×{c.factor:.3g}'}" for c in bad),
        *(
            f"{c.answer.value}: {c.solver} on {c.system} {c.message}"
            for c in solvers
            if c.answer in (SolverOutcome.SILENT, SolverOutcome.CRASHED)
        ),
    ]
    if not quiet:
        tally = (", ".join(f"{n} {name}" for name, n in each.items() if n) for each in (counts, answers))
        for what, text in zip(("fits", "linear solves"), tally, strict=True):
            screen.show(f"{what}: {text}")
        screen.show(*worst, *(f"{path}" for path in files))
    screen.answer({"fits": counts, "solves": answers, "failures": worst, "files": [str(path) for path in files]})


def _names(option: str, text: str | None, every: tuple[str, ...]) -> tuple[str, ...]:
    """The names of an option with commas, all where it is not given."""
    if text is None:
        return every
    names = tuple(dict.fromkeys(part.strip() for part in text.split(",") if part.strip()))
    if not names:
        raise BadInput(where=option, found="none", expected=f"some of {', '.join(every)}")
    return names
