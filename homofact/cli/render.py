"""`homofact render`: the sphere of a result again, under another light."""

from pathlib import Path
from typing import TYPE_CHECKING

from homofact.cli import options as o
from homofact.cli.places import check_file, check_result
from homofact.cli.screen import Screen
from homofact.errors import BadInput

if TYPE_CHECKING:
    from homofact.config import Config


@o.configured("render", "seed")
def render(
    settings: "Config",
    result: o.Result,
    as_json: o.AsJson = False,
    quiet: o.Quiet = False,
) -> None:
    """Draw a result's sphere under a directional light or an environment map."""
    if settings.render.file is None:
        raise BadInput("out: none given, expected a picture's file (--out, or file under [render])")
    target = Path(settings.render.file)
    check_file(target, ".png")
    check_result(result)

    from homofact.brdf.channels import display_of
    from homofact.export.result import open_result
    from homofact.figures.compare_picture import caption, sphere_picture
    from homofact.render.environment import read_environment
    from homofact.render.light import DEFAULT_LIGHT, DirectionalLight

    screen = Screen(as_json, quiet)
    with screen.bar() as bar:
        bar.stage("reading")
        factorization = open_result(result)
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
            factorization,
            light=lit,
            size=settings.render.size,
            to_rgb=display_of(factorization.channels),
            seed=settings.seed,
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
            "clipped": report.clipped[0],
            "seed": settings.seed,
        }
    )
