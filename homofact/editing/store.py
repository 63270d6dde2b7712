"""A prepared scene in one file (.npz) of some megabytes, written atomically.

The file stores low-rank transports in 16 bits (`block_floats`) and the visible surfaces of the views. Meshes, materials
and light are read from the scene again, and a digest of them detects a file that belongs to another scene. The digest
of a material covers its curves and its quotients at fixed pairs of directions.
"""

import hashlib
import os
from math import prod
from pathlib import Path

import numpy as np
import torch

from homofact.editing.block_floats import LARGEST, BlockFloats
from homofact.editing.lights import triangle_lights
from homofact.editing.lowrank import LowRank
from homofact.editing.scene import EditScene, PreparedScene, PreparedTerm
from homofact.editing.transport import FullTransport
from homofact.errors import BadInput
from homofact.files.archive import write_archive
from homofact.files.arrays import ANY, Arrays
from homofact.files.fields import Fields
from homofact.geometry.directions import draw_in_discs
from homofact.rendering.light import EnvironmentMap
from homofact.scene.folders import read_scene_archive
from homofact.scene.visibility import PIXEL_ARRAYS, VisiblePixels

FORMAT, FORMAT_VERSION = "homofact prepared scene", 3
_WHAT, _PAIRS = "a prepared scene", 200
# Places, scales and sums of a scene; unit vectors.
_MOST, _UNIT = 1e15, 1.0 + 1e-3


def digest_of(scene: EditScene, triangles: int) -> str:
    """Return the digest of a scene (SHA-256, hexadecimal)."""
    digest = hashlib.sha256()

    def tell(*values: object) -> None:
        for value in values:
            array = isinstance(value, np.ndarray)
            digest.update(np.ascontiguousarray(value).tobytes() if array else repr(value).encode())

    tell(triangles, *([f"bounces {scene.bounces}"] if scene.bounces else ()))
    digest.update(_views_text(scene).encode())
    tell(scene.channels)
    for light in scene.lighting.lights:
        tell(*((light.radiance.numpy(), light.turn) if isinstance(light, EnvironmentMap) else (light,)))
    wi, wo = draw_in_discs(_PAIRS, torch.Generator().manual_seed(0))
    for edited in scene.objects:
        tell(edited.mesh.positions, edited.mesh.normals, edited.mesh.triangles, edited.material.name)
        for name, pattern in edited.patterns.items():
            some = edited.mesh.positions[:100]
            tell(name, pattern(some, np.zeros((len(some), 2)) if edited.mesh.uv is None else edited.mesh.uv[:100]))
        for term in edited.material.terms:
            tell(term.name, term.quotient(wi, wo).numpy())
            for slot in term.slots:
                tell(slot.name, slot.angle, slot.bands, slot.finer, slot.also_outgoing)
        for bands in edited.material.banded_start().values():
            tell(bands.values.numpy())
    return digest.hexdigest()


def _views_text(scene: EditScene) -> str:
    """Return the text of the cameras that enters the digest of files of this version."""
    views = [
        f"FixedView(name={name!r}, position={camera.eye!r}, target={camera.target!r}, width={camera.pixels[0]!r},"
        f" height={camera.pixels[1]!r}, degrees={camera.field!r})"
        for name, camera in zip(scene.view_names, scene.cameras, strict=True)
    ]
    return f"({', '.join(views)}{',' if len(views) == 1 else ''})"


def write_prepared(path: str | os.PathLike[str], prepared: PreparedScene, triangles: int) -> None:
    """Write a prepared scene; `triangles` is the number that it was prepared with.

    Raises BadInput for a path that cannot be written, and for uncompressed transports, which are too large to store.
    """
    arrays: dict[str, np.ndarray] = {}
    for number, seen in enumerate(prepared.pixels):
        for name in PIXEL_ARRAYS:
            arrays[f"view_{number}_{name}"] = getattr(seen, name)
    parts = []
    for number, part in enumerate(prepared.parts):
        kept = part.transport
        if not isinstance(kept, LowRank):
            raise BadInput(where=path, found="transports in full", expected="them at low rank")
        own = f"part_{number}_"
        arrays |= {
            f"{own}rows": part.rows,
            **_written(f"{own}coefficients", kept.coefficients),
            **_written(f"{own}outward", kept.outward),
            f"{own}scale": kept.scale,
            f"{own}probe_rows": kept.rows,
            f"{own}probes": kept.probes.table,
        }
        parts.append({"view": part.view, "thing": part.object, "term": part.term})
        if part.senders is not None:
            arrays[f"{own}senders"] = part.senders
            parts[-1]["bounces"] = 1
    header = {
        "format": FORMAT,
        "format_version": FORMAT_VERSION,
        "digest": digest_of(prepared.scene, triangles),
        "triangles": triangles,
        "parts": parts,
    }
    write_archive(path, header, arrays)


def read_prepared(path: str | os.PathLike[str], scene: EditScene) -> PreparedScene:
    """Return what `write_prepared` wrote of this scene.

    Raises BadInput for a damaged or foreign file, and for a file of another scene, light, view or material.
    """
    arrays, header = read_scene_archive(Path(path), _WHAT)
    fields = Fields(f"{path}: ", header)
    fields.text("format", (FORMAT,))
    fields.version("format_version", FORMAT_VERSION)
    if header["format_version"] < FORMAT_VERSION:
        wanted = f"format version {FORMAT_VERSION}"
        raise BadInput("of an earlier homofact", where=path, expected=wanted, hint="prepare it again")
    triangles = fields.whole("triangles", 8, 10_000_000)
    if fields.text("digest") != digest_of(scene, triangles):
        what = "made of another scene, or of another state of it"
        raise BadInput(what, where=path, expected="this one", hint="prepare it again")
    found = Arrays(str(path), arrays)
    pixels = tuple(_pixels(found, scene, number) for number in range(len(scene.cameras)))
    parts = tuple(_part(scene, pixels, found, k, entry) for k, entry in enumerate(fields.inners("parts", 100_000)))
    return PreparedScene(scene, triangle_lights(scene.lighting, triangles, len(scene.channels)), pixels, parts)


def _pixels(arrays: Arrays, scene: EditScene, number: int) -> VisiblePixels:
    """Read a view's visible pixels and check their order and objects. Raises BadInput."""
    own, (width, height) = f"view_{number}_", scene.cameras[number].pixels
    numbers = arrays.stored(f"{own}numbers", np.int64, (ANY,), 0, width * height - 1)
    if (np.diff(numbers) <= 0).any():
        raise BadInput(f"{own}numbers holds a pixel twice", where=arrays.path, expected="pixels in their order")
    count = len(numbers)
    objects = arrays.stored(f"{own}objects", np.int64, (count,), 0, len(scene.objects) - 1)
    points = arrays.stored(f"{own}points", np.float64, (count, 3))
    frames = arrays.rotations(f"{own}frames", np.float64, count)
    wo = arrays.stored(f"{own}wo", np.float64, (count, 3), -_UNIT, _UNIT)
    if not (wo[:, 2] > 0).all():
        raise BadInput(f"{own}wo holds one below the surface", where=arrays.path, expected="viewers above it")
    uv = arrays.stored(f"{own}uv", np.float64, (count, 2))
    return VisiblePixels(numbers, objects, points, frames, wo, uv)


def _part(
    scene: EditScene, pixels: tuple[VisiblePixels, ...], arrays: Arrays, number: int, entry: Fields
) -> PreparedTerm:
    view = entry.whole("view", 0, len(pixels) - 1)
    which = entry.whole("thing", 0, len(scene.objects) - 1)
    material, own = scene.objects[which].material, f"part_{number}_"
    term = material.term(entry.text("term", [each.name for each in material.terms]))
    rows = arrays.stored(f"{own}rows", np.int64, (None,), 0, len(pixels[view]) - 1)
    senders = None
    if "bounces" in entry.found and entry.whole("bounces", 0, scene.bounces):
        senders = arrays.stored(f"{own}senders", np.int64, (len(rows),), 0, len(scene.senders) - 1)
    ordered = rows if senders is None else senders * len(pixels[view]) + rows
    if (np.diff(ordered) <= 0).any() or (pixels[view].objects[rows] != which).any():
        raise BadInput(f"{own}rows holds other objects' pixels", where=arrays.path, expected="each of its own once")
    sizes = tuple(slot.bands for slot in term.summed)
    channels, columns = len(scene.channels), prod(sizes)
    outward = _read(arrays, f"{own}outward", (None, 1, columns))
    coefficients = _read(arrays, f"{own}coefficients", (len(rows), channels, len(outward.codes)))
    scale = arrays.stored(f"{own}scale", np.float64, (channels, columns), -_MOST, _MOST)
    probed = arrays.stored(f"{own}probe_rows", np.int64, (ANY,), 0, len(rows) - 1)
    table = (len(probed), channels, *sizes, *((1,) * (2 - len(sizes))))
    probes = arrays.stored(f"{own}probes", np.float32, table, -_MOST, _MOST)
    kept = LowRank(coefficients, outward, scale, sizes, probed, FullTransport(probes, len(sizes)))
    return PreparedTerm.of(scene, pixels[view], view, which, term.name, rows, kept, senders)


def _written(name: str, found: BlockFloats) -> dict[str, np.ndarray]:
    return {f"{name}_codes": found.codes, f"{name}_rows": found.rows, f"{name}_columns": found.columns}


def _read(arrays: Arrays, name: str, shape: tuple[int | None, int, int]) -> BlockFloats:
    codes = arrays.stored(f"{name}_codes", np.int16, shape, -LARGEST, LARGEST)
    rows = arrays.stored(f"{name}_rows", np.float32, codes.shape[:2], 0, _MOST)
    return BlockFloats(codes, rows, arrays.stored(f"{name}_columns", np.float32, codes.shape[2:], 0, _MOST))
