"""`homofact factorize`: a BRDF in, a folder with its textures, pictures and figures out."""

from typing import TYPE_CHECKING

from rich.text import Text

from homofact.cli import options as o
from homofact.cli.flags import with_options
from homofact.cli.layout import hanging
from homofact.cli.screen import Screen, say_ending, say_subset
from homofact.cli.subject import source_of
from homofact.cli.tables import appearance_tables, cost_table, error_table
from homofact.cli.verdicts import (
    BULLET,
    advice_lines,
    cause_lines,
    figures_line,
    finding_lines,
    incidence_lines,
    names_of,
    strictness,
    tilt_lines,
    verdict_line,
    where_lines,
)
from homofact.errors import BadInput
from homofact.evaluation.wording import counted, figure, shapes

if TYPE_CHECKING:
    from homofact.api.factorizing import FactorizeResult
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

    The folder gets factorization.npz (homofact.load reads it back), manifest.json, every texture as EXR and PNG,
    report.json, and compare.png, which shows the source, the fit and a fit by McCool's projections on a lit sphere.
    """
    source = source_of(settings)
    if settings.output.folder is None:
        raise BadInput("none given", where="out", expected="a folder for the result (--out FOLDER)")
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

        records, verdict = found.records(), found.row.verdict
        # A tilt that was left in is a finding of the verdict.
        mended = mending_lines(found.source.samples.provenance, left_in=False)
        screen.show(*(Text(with_options(line)) for line in mended))
        # What was made and how good it is come first, the evidence after, and last what to do with it.
        screen.show(
            Text(_headline(found)),
            *(
                hanging(line, len("  "))
                for line in (verdict_line(verdict), *where_lines(verdict), *cause_lines(verdict))
            ),
            f"{found.folder}: factorization.npz, manifest.json, report.json"
            + ", every texture as .exr and .png" * (bool(found.row.factorization.textures) and not found.left_out),
            *([f"The picture: {found.picture}"] if found.picture else []),
            "",
            error_table(records),
            *appearance_tables(records),
            cost_table(records),
        )
        screen.show(
            *(hanging(line, len(BULLET)) if line.startswith(BULLET) else Text(line) for line in finding_lines(verdict)),
            *(hanging(line, len("  ")) for line in (*incidence_lines(verdict), figures_line(verdict))),
            "",
            *(hanging(line, len("  ")) for line in tilt_lines(verdict)),
            *([hanging(line, len("  ")) for line in advice_lines(found.row)] or _next_lines(found)),
        )
    screen.answer(found.record())


def _headline(found: "FactorizeResult") -> str:
    """What was fitted, by which method, and what the fit takes."""
    record = next(iter(found.records().values()))
    count, sizes = record["textures"], shapes(record["shapes"])
    of = f"of {sizes.removeprefix(f'{count} × ')}" if sizes.startswith(f"{count} × ") else f"({sizes})"
    made = f"{counted(count, 'texture')} {of}" if count else "a model without textures"
    twice = record["fetches"] - count
    read = f" ({counted(twice, 'texture')} read twice)" if 0 < twice <= count else ""
    texels = sum(rows * columns for rows, columns in record["shapes"])
    eight = f", {4 * texels} as 8-bit RGBA" if texels else ""
    return (
        f"{found.source.name}, fitted by {next(iter(found.rows))}: {made},"
        f" {counted(record['bytes'], 'byte')} as float32{eight},"
        f" {counted(record['fetches'], 'fetch')} per evaluation{read}"
    )


def _next_lines(found: "FactorizeResult") -> list[str]:
    """What to do with a fit that the verdict does not warn of, and which model may do as well."""
    model, own = found.model, found.row.held_out
    count = found.report["model"]["lobes"] if model is not None else 1
    lobes = f" --lobes {count}" if count > 1 else ""
    smaller = (
        [
            f"A GGX model of {model.factorization.nbytes} bytes is as good on the held-out samples, or better: log mse"
            f" {figure(model.held_out.log_mse)} instead of {figure(own.log_mse)}, mse {figure(model.held_out.mse)}"
            f" instead of {figure(own.mse)}. Try --method ggx{lobes}."
        ]
        if model is not None
        else []
    )
    return [
        *smaller,
        f"View it in a browser: homofact view {found.folder}",
        f"Export it to an engine: homofact export {found.folder} --out FOLDER --engine three",
    ]
