"""`homofact render`: the sphere of a result or a source, under a light of one's own."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from homofact.brdf.names import MATERIAL_PREFIX
from homofact.cli import options as o
from homofact.cli.places import check_file, check_measurement, check_result
from homofact.cli.screen import Screen
from homofact.errors import BadInput
from homofact.files.reading import split_member

if TYPE_CHECKING:
    from homofact.config import Config

Drawn = Annotated[
    Path,
    typer.Argument(
        metavar="RESULT",
        help="A result's folder, its factorization.npz; or a source: a measurement's file, or material:NAME.",
    ),
]
_FEW = 64  # samples of a model, which nothing here looks at


@o.configured("render")
def render(
    settings: "Config",
    result: Drawn,
    as_json: o.AsJson = False,
    quiet: o.Quiet = False,
) -> None:
    """Draw the sphere of a result or a source under a directional light or an environment map."""
    if settings.render.file is None:
        raise BadInput("out: none given, expected a picture's file (--out, or file under [render])")
    target = Path(settings.render.file)
    check_file(target, ".png")
    of_source = _is_source(result)
    if of_source:
        check_measurement(str(result))
    else:
        check_result(result)

    from homofact.brdf.channels import display_of
    from homofact.brdf.source import open_source
    from homofact.export.result import open_result
    from homofact.figures.sphere_picture import caption, sphere_picture
    from homofact.render.environment import read_environment
    from homofact.render.light import DEFAULT_LIGHT, DirectionalLight

    screen = Screen(as_json, quiet)
    with screen.bar() as bar:
        bar.stage("reading")
        drawn = open_source(str(result), count=_FEW).reflectance if of_source else open_result(result)
        if settings.render.environment is not None:
            lit = read_environment(settings.render.environment)
        elif settings.render.light is not None:
            lit = DirectionalLight(settings.render.light)
        else:
            lit = DEFAULT_LIGHT
        bar.stage("drawing")
        target.parent.mkdir(parents=True, exist_ok=True)
        report = sphere_picture(
            target,
            drawn,
            light=lit,
            stops=settings.render.exposure,
            curve=settings.render.tonemap,
            size=settings.render.size,
            to_rgb=display_of(drawn.channels),
        )
    if not quiet:
        screen.show(f"The picture: {target}", caption(lit, report))
    screen.answer(
        {
            "result": str(result),
            "picture": str(target),
            "size": settings.render.size,
            "light": lit.describe(),
            "exposure": report.exposure,
            "tonemap": report.curve,
            "clipped": report.clipped,
        }
    )


def _is_source(place: Path) -> bool:
    """Whether a source is meant: a material, one of several in a file, or a file that is no .npz."""
    text = str(place)
    if text.startswith(MATERIAL_PREFIX) or (split_member(text)[1] is not None and not place.exists()):
        return True
    return place.is_file() and place.suffix.lower() != ".npz"
