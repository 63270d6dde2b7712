"""Compare relit balls with a base-colour texture or a normal map with the full sum, and with balls without it.

    python scripts/relighting/relight_textures.py [--normals] [--rows 60] [--picture FILE.png]

The texture is a checkerboard of colours, 256 × 256 pixels, on balls of matt paint, glossy paint and metal over a grey
ground, under the embedded sky with its sun, with and without one bounce. "Texture" is the relative RMS of the whole
picture against the sum over every texel at each pixel, "mean colour" the same of the ball without its texture against
its own sum: what the texture adds to the error. "As mean" is the error of a picture in which the texture counts by its
mean colour.

With `--normals` the balls have one colour and a normal map of waves that tilt by up to 40°. "Map" is the error against
the sum with the mapped normal at each pixel, "no map" that of the ball without it, "functions" the stated stage
`normals`, and "as flat" how far the picture without the map is from that with it. There is no bounce.
"""

import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from homofact.containers.png import write_png
from homofact.containers.srgb import decode_srgb
from homofact.evaluation.machine import machine
from homofact.files import extras
from homofact.relighting.build import RelightScene, RelitObject, open_relight_scene, relit_objects
from homofact.relighting.cube import environment_cube
from homofact.relighting.errors import relative, scene_errors
from homofact.relighting.picture import displayed_picture, picture
from homofact.relighting.scene_file import read_relight_scene
from homofact.relighting.whole_picture import picture_likeness

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from scripts.shared.harness import finish, markdown, parser_of, progress

ROOT = Path(__file__).resolve().parents[2]
# Metallic and roughness.
KINDS = {"matt paint": (0.0, 0.8), "glossy paint": (0.0, 0.25), "metal": (1.0, 0.3)}
SCENE = """
[[object]]
mesh = "ball.glb"
[ground]
albedo = [0.5]
half = 4
[lighting]
environment = "{root}/data_synthetic/sky.hdr"
[[camera]]
eye = [0, 0.9, 3.9]
pixels = [{width}, {height}]
[transport]
bounces = {bounces}
"""
# Pixels, and around and down the ball; with --short a ball and a picture of a few.
SIZES, SHORT = ((320, 240), (96, 64)), ((80, 60), (32, 24))
Sizes = tuple[tuple[int, int], tuple[int, int]]
BALL, SHORT_BALL = (48, 32), (24, 16)  # with a normal map
BUMPY = ("ball", "terms", "MB", "map", "PSNR", "no map", "PSNR", "functions", "as flat")
HEADER = ("ball", "bounces", "K", "MB", "texture", "PSNR", "mean colour", "PSNR", "as mean")


def main(arguments: list[str] | None = None) -> int:
    """Measure every kind, without and with a bounce."""
    parser = parser_of(__doc__, "out")
    parser.add_argument("--rows", type=int, default=60, help="of the pictures that are summed in full (%(default)s)")
    parser.add_argument("--picture", type=Path, help="a PNG to write the balls to, side by side")
    parser.add_argument("--normals", action="store_true", help="measure normal maps instead of textures")
    chosen = parser.parse_args(arguments)
    kinds, bounces, rows, sizes = list(KINDS), (0, 1), chosen.rows, SIZES
    if chosen.short:
        kinds, bounces, rows, sizes = kinds[:1], (0,), 8, SHORT
    lines, shots = [], []
    for kind, count in [(kind, count) for kind in kinds for count in ((0,) if chosen.normals else bounces)]:
        progress(f"{kind}, {count} bounces")
        wanted = chosen.picture is not None
        if chosen.normals:
            line, shot = measured_bumps(kind, rows, wanted, (sizes[0], SHORT_BALL if chosen.short else BALL))
        else:
            line, shot = measured(kind, count, rows, wanted and count == bounces[-1], sizes)
        lines.append(line)
        shots += [] if shot is None else [shot]
    if chosen.picture is not None:
        write_png(chosen.picture, np.concatenate(shots, 1))
    return finish([machine(), markdown(BUMPY if chosen.normals else HEADER, lines)], chosen)


def measured(
    kind: str, bounces: int, rows: int, wanted: bool, sizes: Sizes = SIZES
) -> tuple[Sequence[str], np.ndarray | None]:
    """(a line of the table, the picture where it is wanted)."""
    flat, flat_objects = relit(kind, bounces, False, sizes)
    plain = picture_likeness(flat, flat_objects, rows)
    scene, objects = relit(kind, bounces, True, sizes)
    found = picture_likeness(scene, objects, rows)
    as_mean = picture_likeness(scene, [replace(each, tint=None) for each in objects], rows)
    assert found is not None
    assert plain is not None
    assert as_mean is not None
    ball, shot = objects[0], displayed_picture(*shown(scene, objects)) if wanted else None
    line = (
        kind, str(bounces), str(ball.transport.factors.terms), f"{ball.nbytes / 1e6:.1f}", f"{found.error:.1%}",
        f"{found.psnr:.1f} dB", f"{plain.error:.1%}", f"{plain.psnr:.1f} dB", f"{as_mean.error:.1%}",
    )  # fmt: skip
    return line, shot


def measured_bumps(kind: str, rows: int, wanted: bool, sizes: Sizes) -> tuple[Sequence[str], np.ndarray]:
    """(a line of the table of normal maps, the picture, of full size where it is wanted)."""
    small = of_rows(sizes, rows)
    flat, flat_objects = relit(kind, 0, False, small)
    plain, without = picture_likeness(flat, flat_objects, rows), shown(flat, flat_objects)
    scene, objects = relit(kind, 0, False, sizes if wanted else small, waves())
    found = picture_likeness(scene, objects, rows)
    errors = scene_errors(scene, objects, min(rows, 40), ("normals",))[0]
    assert found is not None
    assert plain is not None
    assert errors is not None
    with_map = shown(replace(scene, file=replace(scene.file, cameras=flat.file.cameras)), objects)
    inside = without[1] > 0.999
    line = (
        kind, str(objects[0].transport.factors.terms), f"{objects[0].nbytes / 1e6:.1f}", f"{found.error:.1%}",
        f"{found.psnr:.1f} dB", f"{plain.error:.1%}", f"{plain.psnr:.1f} dB", f"{errors.errors['normals']:.2%}",
        f"{relative(without[0][inside], with_map[0][inside]):.1%}",
    )  # fmt: skip
    return line, displayed_picture(*(shown(scene, objects) if wanted else with_map))


def of_rows(sizes: Sizes, rows: int) -> Sizes:
    """Sizes with a picture of so many rows, of the same shape."""
    (width, height), ball = sizes
    return (round(width * rows / height), rows), ball


def shown(scene: RelightScene, objects: Sequence[RelitObject]) -> tuple[np.ndarray, np.ndarray]:
    """(radiance (H, W, 3) of the first camera's picture, the part of each pixel that objects cover)."""
    radiance = environment_cube(scene.file.light, scene.file.settings.cube)
    lit, camera = [each.lit(radiance) for each in objects], scene.file.cameras[0]
    colours = [each.terms(camera.eye) for each in lit]
    return picture([each.mesh for each in objects], colours, scene.occluder, camera, scene.file.light, lit)


def relit(
    kind: str, bounces: int, textured: bool, sizes: Sizes = SIZES, normals: np.ndarray | None = None
) -> tuple[RelightScene, tuple[RelitObject, ...]]:
    """The scene with a ball that has the texture or its mean colour, and a normal map where one is given, relit."""
    (width, height), ball = sizes
    text = SCENE.format(root=ROOT, bounces=bounces, width=width, height=height)
    with TemporaryDirectory() as folder:
        write_ball(Path(folder) / "ball.glb", *KINDS[kind], textured, *ball, normals)
        (Path(folder) / "scene.toml").write_text(text)
        scene = open_relight_scene(read_relight_scene(Path(folder) / "scene.toml"))
    return scene, relit_objects(scene)


def write_ball(
    file: Path, metallic: float, roughness: float, textured: bool, around: int = 96, down: int = 64,
    normals: np.ndarray | None = None,
) -> None:  # fmt: skip
    """A ball about y with the texture or its mean colour, and a normal map where one is given, as a .glb file."""
    trimesh, image = extras.library("trimesh", "glTF"), extras.library("PIL.Image", "textures")
    u, v = (each.ravel() for each in np.meshgrid(np.linspace(0, 1, around + 1), np.linspace(0, 1, down + 1)))
    theta, phi = np.pi * (1 - v), 2 * np.pi * u
    points = np.stack((np.sin(theta) * np.sin(phi), np.cos(theta), np.sin(theta) * np.cos(phi)), 1)
    a = (np.arange(down)[:, None] * (around + 1) + np.arange(around)).ravel()
    b = a + around + 1
    upper, lower = np.stack((a, a + 1, b + 1), 1), np.stack((a, b + 1, b), 1)
    # At the poles one of the two has no area.
    faces = np.concatenate((upper[around:], lower[:-around]))
    mesh = trimesh.Trimesh(points, faces, process=False, vertex_normals=points)
    pixels = checkerboard()
    mean = decode_srgb(pixels / 255).mean((0, 1))
    colour = {"baseColorTexture": image.fromarray(pixels)} if textured else {"baseColorFactor": [*mean, 1.0]}
    colour |= {} if normals is None else {"normalTexture": image.fromarray(normals)}
    material = trimesh.visual.material.PBRMaterial(
        name="ball", metallicFactor=metallic, roughnessFactor=roughness, **colour
    )
    mesh.visual = trimesh.visual.TextureVisuals(uv=np.stack((u, v), 1), material=material)
    scene = trimesh.Scene()
    scene.add_geometry(mesh, geom_name="ball")
    file.write_bytes(scene.export(file_type="glb"))


def checkerboard(size: int = 256) -> np.ndarray:
    """Pixels (size, size, 3) of smooth colours, every other square of 16 × 8 darker."""
    y, x = np.mgrid[:size, :size] / size
    red = 0.55 + 0.4 * np.sin(6 * np.pi * x) * np.sin(2 * np.pi * y)
    green = 0.4 + 0.3 * np.cos(4 * np.pi * x + 3 * y)
    blue = 0.35 + 0.3 * np.sin(10 * np.pi * y)
    dark = ((x * 16).astype(int) + (y * 8).astype(int)) % 2
    colours = np.stack((red, green, blue), -1) * np.where(dark, 0.45, 1.0)[..., None]
    return np.rint(255 * colours.clip(0, 1)).astype(np.uint8)


def waves(size: int = 256) -> np.ndarray:
    """Pixels (size, size, 3) of a normal map of waves in both directions."""
    y, x = 2 * np.pi * np.mgrid[:size, :size] / size
    slopes = np.stack((0.6 * np.sin(12 * x) * np.cos(2 * y), 0.6 * np.sin(8 * y) * np.cos(3 * x)), -1)
    normals = np.concatenate((slopes, np.ones((size, size, 1))), 2)
    return np.rint(127 * normals / np.linalg.norm(normals, axis=2, keepdims=True) + 128).astype(np.uint8)


if __name__ == "__main__":
    raise SystemExit(main())
