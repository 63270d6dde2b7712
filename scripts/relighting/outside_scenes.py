"""Relight and edit glTF files that were made elsewhere, to the end, and print errors, time and sizes of the pages.

    python scripts/relighting/outside_scenes.py FILE.glb ... [--light studio] [--size 2] [--only relight]

Each file becomes a scene of its own: its meshes are scaled to `--size`, stand on grey ground (without one for `edit`)
and are seen by one camera. "Relit" is the relative RMS error and PSNR of the whole picture against the sum over every
texel, with the reflectance itself; "worst object" is the largest error of the pixels of one mesh. "Edited" is the
largest error of a part's low rank, and that of the triangles of light with the bands. Three files to begin with are in
the npm package @webxr-input-profiles/assets (MIT): `npm pack @webxr-input-profiles/assets`, then
package/dist/profiles/oculus-touch-v3/left.glb, valve-index/left.glb and htc-vive/none.glb.
"""

import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

import homofact
from homofact.evaluation.machine import machine

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from scripts.shared.harness import finish, markdown, parser_of, progress

HEADER = (
    "file", "meshes", "relit", "PSNR", "worst object", "seconds", "page, MB", "edited, rank", "lights and bands",
    "seconds", "page, MB",
)  # fmt: skip
SCENE = """lighting = {{ named = "{light}" }}

[[object]]
mesh = "{mesh}"
size = {size}
{more}
[[camera]]
eye = [{eye}]
target = [0, {middle}, 0]
field = 36
pixels = [{pixels}]
"""
GROUND = "\n[ground]\nhalf = 100\nalbedo = [0.4, 0.4, 0.4]\n"
COARSE = "\n[transport]\ncube = 8\nkept = 60\n"
EDIT = "\n[edit]\ntriangles = {triangles}\n"


def scene_of(file: Path, place: Path, light: str, size: float, more: str, pixels: tuple[int, int]) -> Path:
    """Write the scene of one glTF file beside `place`, and return its place."""
    eye = ", ".join(f"{size * each:g}" for each in (1.1, 1.3, 2.6))
    mesh = file.resolve().as_posix()
    numbers = {"eye": eye, "middle": f"{size * 0.35:g}", "pixels": f"{pixels[0]}, {pixels[1]}", "size": f"{size:g}"}
    place.write_text(SCENE.format(light=light, mesh=mesh, more=more, **numbers), encoding="utf-8")
    return place


def relit(scene: Path, place: Path) -> tuple[str, ...]:
    """The cells of a file that is relit."""
    began = time.perf_counter()
    report = homofact.relight(scene, to=place, page=True, every_stage=True).report
    seconds, whole = time.perf_counter() - began, report["picture"]
    # A part of the file may have vertices in sight and no pixel of the picture.
    worst = max(each["error"]["picture"] for each in report["objects"] if each["error"] and "picture" in each["error"])
    return (
        str(len(report["objects"])), f"{whole['error']:.1%}", f"{whole['psnr']:.1f} dB", f"{worst:.1%}",
        f"{seconds:.0f}", megabytes(place / "view.html"),
    )  # fmt: skip


def edited(scene: Path, place: Path) -> tuple[str, ...]:
    """The cells of a file that is edited."""
    began = time.perf_counter()
    error = homofact.edit(scene, to=place, page=True).report["error"]
    seconds = time.perf_counter() - began
    lights = max(error["lights_and_bands"].values())
    return f"{error['low_rank']:.2%}", f"{lights:.2%}", f"{seconds:.0f}", megabytes(place / "view.html")


def megabytes(file: Path) -> str:
    """The size of a file."""
    return f"{file.stat().st_size / 1e6:.1f}"


def main(arguments: Sequence[str] | None = None) -> int:
    """Relight and edit each file, and print the table."""
    parser = parser_of(__doc__, "out")
    parser.add_argument("files", nargs="+", type=Path, help="glTF files (.glb, .gltf)")
    parser.add_argument("--light", default="studio", help="the lighting's name (%(default)s)")
    parser.add_argument("--size", type=float, default=2.0, help="of the scene's largest side (%(default)s)")
    parser.add_argument("--only", choices=("relight", "edit"), help="one of both")
    parser.add_argument("--results", type=Path, help="keep the results in this folder")
    chosen = parser.parse_args(arguments)
    pixels, triangles = ((48, 36), 40) if chosen.short else ((480, 360), 200)
    ground = GROUND + COARSE * chosen.short
    lines = []
    with tempfile.TemporaryDirectory() as scratch:
        folder = chosen.results or Path(scratch)
        folder.mkdir(parents=True, exist_ok=True)
        for number, file in enumerate(chosen.files):
            name = f"{number}-{file.parent.name}"
            cells = ("",) * 6
            if chosen.only != "edit":
                progress("relighting", file)
                scene = scene_of(file, folder / f"{name}.relight.toml", chosen.light, chosen.size, ground, pixels)
                cells = relit(scene, folder / f"{name}.relit")
            more = ("",) * 4
            if chosen.only != "relight":
                progress("editing", file)
                part = EDIT.format(triangles=triangles)
                scene = scene_of(file, folder / f"{name}.edit.toml", chosen.light, chosen.size, part, pixels)
                more = edited(scene, folder / f"{name}.edited")
            lines.append((f"{file.parent.name}/{file.name}", *cells, *more))
    return finish([machine(), markdown(HEADER, lines, 1)], chosen)


if __name__ == "__main__":
    sys.exit(main())
