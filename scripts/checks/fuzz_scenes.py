"""Open damaged files of scenes and pages: each must raise a BadInput of one line, or work.

    python scripts/checks/fuzz_scenes.py [--count 20000] [--seed 0] [--kind mesh sky relight edit relit prepared …]

As `fuzz_results.py` does, from whole files: meshes (OBJ, PLY, glTF), skies (.hdr, .exr), scene files of relighting and
editing, relit and prepared scenes, edited curves; and, in node where there is one, the page's own reader of skies and
the view that a link holds (`fuzz_pages.py`). What opens is used: a mesh is prepared for shadows, a relit scene is lit,
and every 64th scene is shown in a page.
"""

import base64
import json
import random
import shutil
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import torch

from homofact.brdf.analytic.metallic_roughness import MetallicRoughness
from homofact.brdf.analytic.phong import Phong
from homofact.containers.exr import write_exr
from homofact.editing.curves_file import read_curves, write_curves
from homofact.editing.models import from_reflectance
from homofact.editing.page.build import write_edit_page
from homofact.editing.picture import image, radiance, starting_curves
from homofact.editing.precompute import prepare
from homofact.editing.scene import EditObject, EditScene
from homofact.editing.scene_file import read_edit_scene
from homofact.editing.store import read_prepared, write_prepared
from homofact.exporting.engines.gltf import glb
from homofact.meshes.mesh import read_mesh
from homofact.meshes.prepare import prepared
from homofact.meshes.shapes import sphere
from homofact.relighting.build import open_relight_scene, relit_objects
from homofact.relighting.cube import environment_cube
from homofact.relighting.page.relit_page import write_relit_page
from homofact.relighting.result import RelightResult, open_relit, save_scene
from homofact.relighting.scene_file import read_relight_scene
from homofact.rendering.environment import read_environment
from homofact.scene.cameras import Camera
from homofact.scene.lighting import Lighting, named_environment, named_lighting

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from scripts.checks.fuzz_pages import page_kinds
from scripts.checks.fuzz_results import Kind, json_damaged, npz_damaged, run, texts
from scripts.checks.fuzzing import DAMAGES

ROOT = Path(__file__).resolve().parents[2]
NAMES = "mesh, sky, relight, edit, relit, prepared, curves, page-sky, link"
SCENE = """
[[object]]
mesh = "box.obj"
albedo = [0.5]
[ground]
albedo = [0.2, 0.4, 0.6]
half = 1.5
steps = 2
[lighting]
named = "studio"
[[camera]]
eye = [0, 1.5, 3]
pixels = [12, 9]
[transport]
cube = 8
kept = 12
"""
FORMS = ("", "clusters = 2\ncomponents = 2\n")
OBJ = "".join(f"v {x} {y} {z}\n" for x in (0, 1) for y in (0, 1) for z in (0, 1)) + "".join(
    f"f {side}\n" for side in ("1 2 4 3", "5 7 8 6", "1 5 6 2", "3 4 8 7", "1 3 7 5", "2 6 8 4")
)
PLY_HEAD = (
    "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\nelement face 4\n"
    "property list uchar int vertex_indices\nend_header\n"
)
CORNERS = ((0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1))
FACES = ((0, 1, 2), (0, 1, 3), (1, 2, 3), (0, 2, 3))


def any_byte(wholes: list[bytes]) -> Callable[[random.Random, Path], None]:
    """What puts one of some files with one or two damages at a path."""

    def put(dice: random.Random, path: Path) -> None:
        raw = dice.choice(DAMAGES)(bytearray(dice.choice(wholes)), dice)
        path.write_bytes(dice.choice(DAMAGES)(bytearray(raw), dice) if raw and dice.random() < 0.2 else raw)

    return put


def meshes() -> Callable[[random.Random, Path], None]:
    """Damage to any byte of OBJ, PLY and glTF; of glTF to the JSON's entries too."""
    binary = glb(MetallicRoughness((0.4, 0.3, 0.2), 0.2, 0.5), "a ball", rings=4)
    size = int.from_bytes(binary[12:16], "little")
    header, body = json.loads(binary[20 : 20 + size]), binary[28 + size :]
    header["buffers"][0]["uri"] = "data:application/octet-stream;base64," + base64.b64encode(body).decode()
    text = (
        PLY_HEAD + "".join(f"{x} {y} {z}\n" for x, y, z in CORNERS) + "".join(f"3 {a} {b} {c}\n" for a, b, c in FACES)
    )
    packed = PLY_HEAD.replace("ascii", "binary_little_endian").encode() + np.array(CORNERS, "<f4").tobytes()
    packed += b"".join(b"\3" + np.array(face, "<i4").tobytes() for face in FACES)
    plain = any_byte([OBJ.encode(), text.encode(), packed, binary, json.dumps(header).encode()])

    def put(dice: random.Random, path: Path) -> None:
        if dice.random() < 0.6:
            plain(dice, path)
        else:
            path.write_bytes(json.dumps(json_damaged(header, dice)).encode(errors="surrogatepass"))

    return put


def skies(folder: Path) -> tuple[list[bytes], list[bytes]]:
    """(.hdr files, .exr files)."""
    rng = np.random.default_rng(0)
    rgbe = rng.integers(2, 256, (4, 8, 4)).astype(np.uint8)
    rgbe[..., 3] = 128
    head = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\nEXPOSURE=1.5\n\n-Y 4 +X 8\n"
    runs = b"".join(bytes((2, 2, 0, 8)) + b"".join(bytes((136, value)) for value in (9, 8, 7, 128)) for _ in range(4))
    old = bytes((9, 8, 7, 128, 1, 1, 1, 31))
    write_exr(folder / "sky.exr", rng.random((4, 8, 3)).astype(np.float32), ("R", "G", "B"))
    return [head + rgbe.tobytes(), head + runs, head + old], [(folder / "sky.exr").read_bytes()]


def relit_archives(folder: Path) -> list[dict[str, np.ndarray]]:
    """Small relit scenes, with clusters and without."""
    (folder / "box.obj").write_text(OBJ)
    found = []
    for form in FORMS:
        (folder / "scene.toml").write_text(SCENE + form)
        file = read_relight_scene(folder / "scene.toml")
        objects = relit_objects(open_relight_scene(file))
        one = {"mesh": "box", "material": "albedo 0.5", "vertices": 8, "terms": 1, "bytes": 7}
        report = {"objects": [one | {"coefficients_per_vector": 3.5, "error": {"together": 0.1}}], "scene": "scene"}
        sums = [np.full((len(each.mesh.positions), 3), 0.5) for each in objects]
        save_scene(folder / "relit.npz", RelightResult.of(file, objects, report, (), sums))
        with np.load(folder / "relit.npz") as archive:
            found.append({name: archive[name] for name in archive.files})
    return found


def edit_scene() -> EditScene:
    """A ball of one term under the studio's lamps."""
    material = from_reflectance(Phong((0.2,), (0.4,), exponent=10, channels=("Y",)), ("theta_h",), "paint", (32,))
    camera = Camera((0.0, 1.2, 4.0), (0.0, 0.0, 0.0), 40, (12, 12), "front")
    return EditScene((EditObject(sphere(8), material),), named_lighting("studio"), (camera,))


def use_mesh(path: Path, _: int) -> None:
    """What `relight` does with a mesh before it traces it."""
    found, _notes = prepared(read_mesh(path))
    if not (np.isfinite(found.positions).all() and np.isfinite(found.normals).all()):
        raise ArithmeticError("a mesh that is not finite")


def use_sky(path: Path, _: int) -> None:
    """What theory and relighting make of a sky first."""
    found = read_environment(path)
    if not bool(torch.isfinite(Lighting("sky", (found,)).coefficients).all()):
        raise ArithmeticError("light that is not finite")


def kinds(folder: Path) -> list[Kind]:
    """All kinds with their whole files."""
    scene = edit_scene()
    write_prepared(folder / "prepared.npz", prepare(scene, 20), 20)
    with np.load(folder / "prepared.npz") as archive:
        stored = {name: archive[name] for name in archive.files}
    curves = {(each.name, *place): bands for each in scene.materials for place, bands in each.banded_start().items()}
    write_curves(folder / "curves.json", scene.materials, curves)
    whole_curves = json.loads((folder / "curves.json").read_text())
    archives, (pictures, exrs) = relit_archives(folder), skies(folder)
    light = environment_cube(named_environment("studio"), 8)
    relight, edit = (
        [
            each.read_bytes().replace(b"../..", str(ROOT).encode())
            for each in sorted(ROOT.glob(f"configs/scenes/{name}*"))
        ]
        for name in ("relight", "edit")
    )

    def use_relit(path: Path, number: int) -> None:
        found = open_relit(path)
        for each in found.objects:
            if each.transport.settings.cube == 8 and not np.isfinite(each.lit(light).tuples).all():
                raise ArithmeticError("light that is not finite")
        if number % 64 == 0:
            write_relit_page(folder / "page.html", found)

    def use_prepared(path: Path, number: int) -> None:
        found = read_prepared(path, scene)
        for view in range(len(found.pixels)):
            values, _ = image(found, view, radiance(found, view, starting_curves(found)))
            if not bool(torch.isfinite(values).all()):
                raise ArithmeticError("a picture that is not finite")
        if number % 64 == 0:
            write_edit_page(folder / "page.html", found, title="a scene")

    def put_archive(some: list[dict[str, np.ndarray]]) -> Callable[[random.Random, Path], None]:
        return lambda dice, path: discard(path.write_bytes(npz_damaged(dice.choice(some), dice)))

    def put_curves(dice: random.Random, path: Path) -> None:
        raw = json.dumps(json_damaged(whole_curves, dice)).encode(errors="surrogatepass")
        path.write_bytes(raw if dice.random() < 0.8 else dice.choice(DAMAGES)(bytearray(raw), dice))

    found = [
        Kind("mesh", meshes(), use_mesh),
        Kind("sky", any_byte([*pictures, *exrs]), use_sky),
        Kind("relight", texts(relight), lambda path, _: discard(read_relight_scene(path))),
        Kind("edit", texts(edit), lambda path, _: discard(read_edit_scene(path))),
        Kind("relit", put_archive(archives), use_relit),
        Kind("prepared", put_archive([stored]), use_prepared),
        Kind("curves", put_curves, lambda path, _: discard(read_curves(path, scene.materials))),
    ]
    if shutil.which("node") is None:
        print("no node: the page's reader of skies and its links are left out")
        return found
    return [*found, *page_kinds(folder, any_byte(pictures))]


def discard(_: Any) -> None:
    """What is read is enough."""


def main(arguments: list[str] | None = None) -> int:
    """Run the fuzzing and print a line a kind. Returns 1 where anything was wrong."""
    return run(arguments, __doc__, NAMES, kinds)


if __name__ == "__main__":
    sys.exit(main())
