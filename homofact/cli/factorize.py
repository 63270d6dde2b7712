"""`homofact factorize`: a BRDF in, a folder with its textures, pictures and figures out."""

from typing import TYPE_CHECKING

from rich.text import Text

from homofact.cli import options as o
from homofact.cli.screen import Screen, say_ending, say_subset
from homofact.cli.subject import source_of
from homofact.cli.tables import appearance_tables, cost_table, error_table
from homofact.cli.verdicts import names_of, strictness, verdict_lines
from homofact.errors import BadInput

if TYPE_CHECKING:
    from homofact.config import Config


@o.configured("source.path", "output", "source", "evaluate", "fit", "seed")
def factorize(
    settings: "Config",
    strict: o.Strict = "",
    refuse: o.Refuse = "",
    as_json: o.AsJson = False,
    quiet: o.Quiet = False,
) -> None:
    """Fit a BRDF and write its textures, pictures and errors to a folder.

    The folder gets factorization.npz (homofact.load reads it back),
    manifest.json, every texture as EXR and PNG, report.json, and
    compare.png: source, fit and McCool's projections on a lit sphere.
    """
    source = source_of(settings)
    if settings.output.folder is None:
        raise BadInput("none given", where="out", expected="a folder for the result (--out, or folder under [output])")
    method = settings.fit.method_alone()

    from homofact.api.factorizing import factorize

    screen = Screen(as_json, quiet)
    with screen.progress() as progress:
        found = factorize(
            source, settings.output.folder, method, held_out=settings.evaluate.held_out, seed=settings.seed,
            strict=strictness(strict), refuse=names_of(refuse), force=settings.output.force, progress=progress,
        )  # fmt: skip
    if found.left_out:
        screen.note(f"homofact: {found.left_out}")
    say_ending(screen, found.row.report)
    say_subset(screen, found.report)
    if not quiet:
        from homofact.brdf.quality.mending import mending_lines

        records = found.records()
        screen.show(*map(Text, mending_lines(found.source.samples.provenance)))
        screen.show(
            error_table(records),
            *appearance_tables(records),
            cost_table(records),
            *(Text(line) for line in verdict_lines(found.row.verdict)),
            f"{found.folder}: factorization.npz, manifest.json, report.json"
            + ", every texture as .exr and .png" * (not found.left_out),
            *([f"The picture: {found.picture}"] if found.picture else []),
        )
    screen.answer(found.record())
