"""`homofact info`: what is in a file, the folder of a result, plan or scene, or what a named material is."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.text import Text

from homofact.cli import options as o
from homofact.cli.flags import with_options
from homofact.cli.layout import hanging
from homofact.cli.materials import list_materials
from homofact.cli.screen import Screen
from homofact.cli.subject import sources_of
from homofact.cli.tables import facts_table
from homofact.errors import BadInput

if TYPE_CHECKING:
    from homofact.api.describing import InfoResult
    from homofact.config import Config

# How a command is given a TOML file.
_READING = {
    "factorize": "factorize --config {file}",
    "compare": "compare --config {file}",
    "sweep": "sweep {file} --out FOLDER",
    "plan": "plan {file}",
    "relight": "relight {file} --out FOLDER",
    "edit": "edit {file} --out FOLDER",
}


@o.configured("compare.sources", "source", "seed", but=("source.path", "source.subset"))
def info(
    settings: "Config",
    drawing: Annotated[
        Path | None,
        typer.Option(
            "--plot",
            metavar="FILE.png",
            help="Draw a slice, lobes and a lit sphere of SOURCE. Without SOURCE, draw a sphere of each named"
            " material.",
        ),
    ] = None,
    as_json: o.AsJson = False,
    quiet: o.Quiet = False,
) -> None:
    """Describe measurement files, named materials, or the folders of fits, plans or scenes.

    Without SOURCE it lists the named materials. Use one as SOURCE by writing material:NAME. With several SOURCEs it
    describes one after another. For a result folder (from homofact factorize) it prints the fit and its error bars at
    each incidence angle. For the folder of a plan (homofact plan) it prints the choice for each material, its bytes and
    errors. For the folder of a scene (homofact relight, homofact edit) it prints the contents and their errors. For a
    TOML file (a configuration, a sweep, a scene) it names the command that reads it.
    """
    screen = Screen(as_json, quiet)
    if settings.source.path is None and not settings.compare.sources:
        list_materials(drawing, screen)
        return
    sources = sources_of(settings, settings.compare.sources)
    if drawing is not None and len(sources) > 1:
        raise BadInput(where="plot", found=f"it with {len(sources)} sources", expected="one source")

    from homofact.api.describing import info

    with screen.progress() as progress:
        every = [info(source, plot=drawing, seed=settings.seed, progress=progress) for source in sources]
    for number, found in enumerate(every):
        screen.show(*([""] if number else []))
        _show(found, screen)
    asked = list(dict.fromkeys(question for found in every for question in found.asked))
    if asked:
        heading = "Please check:" if len(every) == 1 else "\nPlease check for each measurement:"
        screen.show(heading, *(hanging(f"- {question}", len("- ")) for question in asked))
    records = [found.record() for found in every]
    screen.answer(records[0] if len(records) == 1 else {"sources": records})


def _show(found: "InfoResult", screen: Screen) -> None:
    rows = found.rows
    if "read_by" in found.facts:
        commands = [f"homofact {_READING[name].format(file=found.facts['file'])}" for name in found.facts["read_by"]]
        rows = rows | {"read_by": commands}
    screen.show(facts_table(found.name, rows), *(Text(with_options(line)) for line in found.mended))
    if found.suspected:
        lines = [hanging(f"- {suspicion.line()}", len("- ")) for suspicion in found.suspected]
        screen.show("Suspected faults of the data, with the odds of each:", *lines)
        names = "+".join(suspicion.name for suspicion in found.suspected)
        screen.show(f"If you have checked these and the data are right, add --dismiss {names}, also when you fit.")
