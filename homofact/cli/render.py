"""`homofact render`: draw a sphere of a result or a source, or a relit scene, under a light that you choose."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from homofact.cli import options as o
from homofact.cli.screen import Screen
from homofact.errors import BadInput

if TYPE_CHECKING:
    from homofact.config import Config

Drawn = Annotated[
    Path,
    typer.Argument(
        metavar="RESULT",
        help="A result folder or its factorization.npz; a source: a measurement file or material:NAME; or the folder of"
        " a relit scene.",
    ),
]


@o.configured("render")
def render(settings: "Config", result: Drawn, as_json: o.AsJson = False, quiet: o.Quiet = False) -> None:
    """Draw a sphere of a result or a source under a light, or a relit scene from any point under any sky."""
    asked = settings.render
    if asked.file is None:
        raise BadInput("none given", where="out", expected="a picture's file (--out, or file under [render])")

    from homofact.api.rendering import render

    screen = Screen(as_json, quiet)
    with screen.progress() as progress:
        found = render(
            result, asked.file, light=asked.light, environment=asked.environment, exposure=asked.exposure,
            tonemap=asked.tonemap, size=asked.size, camera=asked.camera, eye=asked.eye, target=asked.target,
            progress=progress,
        )  # fmt: skip
    if not quiet:
        screen.show(f"The picture: {found.file}", found.caption)
    screen.answer(found.record())
