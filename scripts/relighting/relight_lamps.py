"""Compare a scene with lamps with the full sum, for lamps of several sizes.

    python scripts/relighting/relight_lamps.py [--rows 40] [--scene SCENE.toml] [--picture FILE.png]

The radii of the scene's lamps are multiplied by each factor; their intensities stay as they are. "Whole picture" is the
relative RMS and PSNR of the first camera's picture against the sum over every texel and many directions of each lamp,
with the reflectance itself. "Stated" are the errors `picture` and `lamps` of each object, as `homofact relight` prints
them, the largest of the objects.
"""

import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from homofact.containers.png import write_png
from homofact.evaluation.machine import machine
from homofact.relighting.build import RelightScene, RelitObject, open_relight_scene, relit_objects
from homofact.relighting.cube import environment_cube
from homofact.relighting.errors import scene_errors
from homofact.relighting.picture import displayed_picture, picture
from homofact.relighting.scene_file import read_relight_scene
from homofact.relighting.sunlight import Sunlight
from homofact.relighting.whole_picture import picture_likeness

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from scripts.shared.harness import finish, markdown, parser_of, progress

SCENE = Path(__file__).resolve().parents[2] / "configs" / "scenes" / "relight_lamps.toml"
FACTORS = (0.25, 1.0, 2.0)
VERTICES = 64
HEADER = ("radii", "whole picture", "PSNR", "stated, picture", "stated, lamps")


def main(arguments: list[str] | None = None) -> int:
    """Relight the scene once, and measure lamps of every size."""
    parser = parser_of(__doc__, "out")
    parser.add_argument("--rows", type=int, default=40, help="of the pictures that are summed in full (%(default)s)")
    parser.add_argument("--scene", type=Path, default=SCENE, help="a scene with lamps (%(default)s)")
    parser.add_argument("--picture", type=Path, help="a PNG to write the scene's picture to")
    chosen = parser.parse_args(arguments)
    factors, rows = ((1.0,), 8) if chosen.short else (FACTORS, chosen.rows)
    progress("relighting")
    scene = open_relight_scene(read_relight_scene(chosen.scene))
    objects = relit_objects(scene)
    if chosen.picture is not None:
        write_png(chosen.picture, shot(scene, objects))
    lines = []
    for factor in factors:
        progress(f"radii times {factor:g}")
        lines.append(measured(*with_radii(scene, objects, factor), rows))
    return finish([machine(), markdown(HEADER, lines)], chosen)


def with_radii(
    scene: RelightScene, objects: Sequence[RelitObject], factor: float
) -> tuple[RelightScene, tuple[RelitObject, ...]]:
    """The scene and its objects under lamps with larger or smaller radii; transport is the same for all."""
    lamps = tuple(replace(lamp, radius=lamp.radius * factor) for lamp in scene.file.lamps)
    found = []
    for each in objects:
        assert each.sunlight is not None
        given = each.sunlight.tables, each.mesh, scene.occluder, lamps
        found.append(replace(each, sunlight=Sunlight.traced(each.sunlight.suns, *given)))
    return replace(scene, file=replace(scene.file, lamps=lamps)), tuple(found)


def measured(scene: RelightScene, objects: Sequence[RelitObject], rows: int) -> Sequence[str]:
    """A line of the table."""
    whole = picture_likeness(scene, objects, rows)
    stated = [each.errors for each in scene_errors(scene, objects, VERTICES, ("lamps", "picture")) if each is not None]
    assert whole is not None
    radii = ", ".join(f"{lamp.radius:g}" for lamp in scene.file.lamps)
    return (
        radii, f"{whole.error:.1%}", f"{whole.psnr:.1f} dB", f"{max(each['picture'] for each in stated):.1%}",
        f"{max(each['lamps'] for each in stated):.1%}",
    )  # fmt: skip


def shot(scene: RelightScene, objects: Sequence[RelitObject]) -> np.ndarray:
    """The picture of the first camera as 8-bit sRGB."""
    radiance, camera = environment_cube(scene.file.light, scene.file.settings.cube), scene.file.cameras[0]
    lit = [each.lit(radiance) for each in objects]
    colours = [each.terms(camera.eye) for each in lit]
    given = [each.mesh for each in objects], colours, scene.occluder, camera, scene.file.light, lit
    return displayed_picture(*picture(*given))


if __name__ == "__main__":
    raise SystemExit(main())
