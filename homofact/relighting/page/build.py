"""The file of the page: a relit scene in one HTML page, with its transport, its skies and its numbers.

    write_page(Path("bunny.html"), [PageObject("bunny", mesh, transport, "blue paint")], [page_sky("grace", light, 64)],
               numbers={"Bunny": {"vertices": 35947}}, camera=Camera((0.0, 0.6, 3.2)))

The page contains the WaveletTransport exactly. Each vector is sorted by index, with indices stored as differences; the
page sorts its coefficients by magnitude. Positions are rounded to 1/65535 of their box, surface frames to about
1/30000, skies, the reference and the tables of separate lobes to half floats. Nothing else is rounded. Arrays that
several objects have, as tables of one material and textures of one file, are written once.

The page is `page.html` with what all pages of scenes have (`web.scene_page`) and the scripts of `SHARED` and `SCRIPTS`.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from scipy.spatial.transform import Rotation

from homofact.brdf.source_names import MATERIAL_PREFIX
from homofact.errors import BadInput
from homofact.meshes.mesh import Mesh
from homofact.relighting.build import RelitObject
from homofact.relighting.clusters import Clustered
from homofact.relighting.harmonic import Harmonic
from homofact.relighting.lobe import SeparateLobe
from homofact.relighting.lobe_table import LobeTable
from homofact.relighting.page.coarse import coarse_triangles
from homofact.relighting.page.order import cached_order
from homofact.relighting.page.skies import PageSky
from homofact.relighting.precompute import WaveletTransport
from homofact.relighting.sight import sight_words
from homofact.relighting.sunlight import Sunlight
from homofact.relighting.texel_pattern import texel_divisions
from homofact.relighting.tilted_view import TiltedView
from homofact.rendering.tonemap import encode_srgb
from homofact.scene.cameras import Camera
from homofact.scene.meshes import faded
from homofact.scene.normal_map import SurfaceNormals
from homofact.scene.tint import SurfaceTint
from homofact.web.packing import boxed, differences, halves, pack, without_repeats
from homofact.web.scene_page import Numbers, write_scene_page

PACKAGE = "homofact.relighting.page"
SHARED = ("hdr.js", "latlong.js")
SCRIPTS = (
    "cube.js", "sky.js", "turner.js", "tint.js", "lobe.js", "suns.js", "transport.js", "relit.js", "shade.js",
    "lobe_gpu.js", "bumps.js", "suns_gpu.js", "lamps_gpu.js", "shaders.js", "gpu.js", "background.js", "meter.js",
    "stage.js", "highlights.js", "camera.js", "readings.js", "controls.js", "page.js",
)  # fmt: skip
# Endings of files that a name is shown without.
_ENDINGS = (".ply", ".obj", ".gltf", ".glb", ".hdr", ".exr")
MOST_TEXELS = 512  # of a texture, along a side
CAMERA = Camera((0.0, 0.5, 3.4), field=36.0)


@dataclass(frozen=True)
class PageObject:
    """A mesh with the transport at its vertices, and the separate `lobe` of its material where it has one.

    It fades out between the distances `fade` (near, far) from the y axis. `tint` is the effect of a texture on its
    material, `bumps` its normal map, and `tilted` the effect of tilted normals on the terms.
    """

    name: str
    mesh: Mesh
    transport: WaveletTransport | Clustered
    material: str
    fade: tuple[float, float] | None = None
    lobe: SeparateLobe | None = None
    sunlight: Sunlight | None = None
    tint: SurfaceTint | None = None
    bumps: SurfaceNormals | None = None
    tilted: TiltedView | None = None

    @property
    def basis(self) -> WaveletTransport:
        """Return the sparse vectors that are multiplied with the light."""
        return self.transport.basis if isinstance(self.transport, Clustered) else self.transport


@dataclass(frozen=True)
class PageReference:
    """The reference of the page's error: `colours`, radiance (V, 3) of each object's vertices towards the camera.

    Vertices without a value are NaN and left out, as are those that face away. The reference was computed under the sky
    of index `sky` without rotation; `words` describe how it was computed.
    """

    colours: Sequence[np.ndarray]
    sky: int = 0
    words: str = "sum over all texels of the cube map with the fit itself"


def page_objects(objects: Sequence[RelitObject]) -> list[PageObject]:
    """The objects of a relit scene, in their compact form where they have one; a level plane ends softly."""
    found = []
    for each in objects:
        made = each.transport if each.compact is None else each.compact
        if isinstance(made, Harmonic):
            made = made.clustered()
        name, material = shown_name(each.mesh.name), shown_name(each.material)
        more = (faded(each.mesh), each.lobe, each.sunlight, each.tint, each.bumps, each.tilted)
        found.append(PageObject(name, each.mesh, made, material, *more))
    return found


def shown_name(text: str) -> str:
    """A mesh's, a sky's or a material's name without what only a program needs: folder, ending, "material:"."""
    name = Path(text.removeprefix(MATERIAL_PREFIX)).name
    return name.rpartition(".")[0] if name.lower().endswith(_ENDINGS) else name


def write_page(
    target: Path,
    objects: Sequence[PageObject],
    skies: Sequence[PageSky],
    numbers: Numbers,
    reference: PageReference | None = None,
    *,
    title: str = "Relighting",
    subtitle: str = "",
    camera: Camera = CAMERA,
    new: bool = False,
) -> int:
    """Write the page atomically and return its size in bytes; `new` forbids replacing a file.

    The page shows `numbers` as one table per section. Raises BadInput for no objects or skies, objects on cube maps of
    different sizes, transport of another mesh, a reference of another shape, and a place that cannot be written.
    """
    _check(objects, skies)
    if reference is not None:
        _check_reference(reference, objects, skies)
    colours = [None] * len(objects) if reference is None else reference.colours
    data = {
        "cube": objects[0].basis.settings.cube,
        "suns": [] if objects[0].sunlight is None else [sun.record() for sun in objects[0].sunlight.suns],
        "lamps": [] if objects[0].sunlight is None else [lamp.record() for lamp in objects[0].sunlight.lamps],
        "camera": {"eye": camera.eye, "target": camera.target, "field": camera.field},
        "objects": [_object(each, own) for each, own in zip(objects, colours, strict=True)],
        "skies": [_sky(sky) for sky in skies],
        "reference": None if reference is None else {"sky": reference.sky, "words": reference.words},
    }
    return write_scene_page(
        target, PACKAGE, SCRIPTS, without_repeats(data), numbers, title=title, subtitle=subtitle, shared=SHARED,
        policy="; worker-src blob:", new=new,
    )  # fmt: skip


def _check(objects: Sequence[PageObject], skies: Sequence[PageSky]) -> None:
    if not objects or not skies:
        wanted = "at least one of each"
        raise BadInput(where="page", found=f"{len(objects)} objects and {len(skies)} skies", expected=wanted)
    size = objects[0].basis.settings.cube
    for each in objects:
        given = each.transport
        if each.basis.settings.cube != size:
            found = f"a cube map of {each.basis.settings.cube} texels"
            raise BadInput(where=each.name, found=found, expected=f"{size} as the others")
        if given.positions.shape != each.mesh.positions.shape or not np.allclose(
            given.positions, each.mesh.positions, atol=1e-5
        ):
            raise BadInput(where=each.name, found="transport of another mesh", expected=f"that of {each.mesh.name}")
        seen = (len(each.mesh.positions), sight_words(size))
        if each.lobe is not None and each.lobe.sight.shape != seen:
            found = f"what vertices see of shape {each.lobe.sight.shape}"
            raise BadInput(where=each.name, found=found, expected=seen)
    for sky in skies:
        if sky.cube.shape != (6, size, size, 3):
            found = f"a cube map of shape {sky.cube.shape}"
            raise BadInput(where=f"sky {sky.name}", found=found, expected=f"(6, {size}, {size}, 3)")
        if not all(np.isfinite(each).all() and each.min() >= 0 for each in (sky.cube, sky.picture)):
            found = "radiance that is negative or not finite"
            raise BadInput(where=f"sky {sky.name}", found=found, expected="finite numbers >= 0")


def _check_reference(reference: PageReference, objects: Sequence[PageObject], skies: Sequence[PageSky]) -> None:
    shapes = [np.shape(each) for each in reference.colours]
    expected = [(len(each.mesh.positions), 3) for each in objects]
    if shapes != expected:
        raise BadInput(where="reference", found=f"colours of shape {shapes}", expected=expected)
    if not 0 <= reference.sky < len(skies):
        raise BadInput(where="reference", found=f"sky {reference.sky}", expected=f"0 to {len(skies) - 1}")
    if any(np.isinf(each).any() for each in reference.colours):
        wanted = "finite numbers, or NaN where there is none"
        raise BadInput(where="reference", found="infinite radiance", expected=wanted)
    if not any((np.nan_to_num(each) != 0).any() for each in reference.colours):
        raise BadInput(where="reference", found="no light at any vertex", expected="some")


def _object(given: PageObject, colours: np.ndarray | None) -> dict[str, Any]:
    transport, mesh = given.transport, given.mesh
    mix = None
    if isinstance(transport, Clustered):
        mix = {
            "cluster": pack(transport.cluster),
            "weights": pack(np.ascontiguousarray(transport.weights.T)),
            "steps": pack(transport.steps),
        }
    view, few = transport.factors.packed_view, coarse_triangles(mesh)
    parts = (given.lobe, given.sunlight, given.tint, given.bumps, given.tilted)
    beside = [each for each in parts if each is not None]
    return {
        "name": given.name,
        "material": given.material,
        "fade": given.fade,
        "closed": closed(mesh.triangles),
        "vertices": len(mesh.positions),
        "terms": transport.factors.terms,
        "bounced": transport.factors.bounced,
        **boxed(mesh.positions),
        "frames": pack(turns(transport.frames)),
        "triangles": _triangles(mesh.triangles),
        "coarse": None if few is None else _triangles(few),
        "map": {"size": view.shape[0], "channels": view.shape[3], "texels": pack(view)},
        "basis": _basis(given.basis),
        "mix": mix,
        "reference": None if colours is None else _halves(colours),
        "lobe": None if given.lobe is None else _lobe(given.lobe, given.basis.settings.cube),
        "sunlight": None if given.sunlight is None else _sunlight(given.sunlight, mesh.positions),
        "tint": None if given.tint is None else _tint(given.tint, transport.factors.tinted),
        "bumps": None if given.bumps is None or given.tilted is None else _bumps(given.bumps, given.tilted),
        "bytes": transport.nbytes + sum(each.nbytes for each in beside),
    }


def _lobe(lobe: SeparateLobe, size: int) -> dict[str, Any]:
    """Return a lobe's data for the page, with the visibility masks as little-endian bytes.

    `divisions` is how often texels of a cube map of `size` are subdivided. A mask is a 64-bit word for 64 texels; this
    byte order compresses best.
    """
    sight = pack(np.ascontiguousarray(lobe.sight.plain, "<u8").view(np.uint8))
    return {**_table(lobe.table), "divisions": texel_divisions(lobe.table.half_width, size), "sight": sight}


def _table(table: LobeTable) -> dict[str, Any]:
    levels, turns, along, around = table.values.shape[:4]
    numbers = {**table.record(), "levels": levels, "turns": turns, "along": along, "around": around}
    return {**numbers, "values": _halves(table.values)}


def _sunlight(lit: Sunlight, positions: np.ndarray) -> dict[str, Any]:
    """Return the visible shares of the discs as bytes, where 255 is the whole disc, and counts of directions."""
    seen = np.rint(lit.seen * 255).astype(np.uint8)
    counts = [lit.directions(light, positions) for light in lit.lights]
    bounced = None if lit.bounced is None else _halves(lit.bounced)
    tables = [_table(table) for table in lit.tables]
    return {"tables": tables, "seen": pack(seen), "directions": counts, "width": lit.width, "bounced": bounced}


def _tint(tint: SurfaceTint, terms: int) -> dict[str, Any]:
    """Return the texture, at most `MOST_TEXELS` a side, as sRGB-encoded bytes relative to its largest tint."""
    texels = _smaller(tint.tints.astype(np.float64))
    scale = texels.max((0, 1)).clip(1e-12)
    codes = np.rint(255 * encode_srgb(torch.from_numpy(texels / scale)).numpy()).astype(np.uint8)
    return {
        "height": texels.shape[0], "width": texels.shape[1], "scale": scale.tolist(), "texels": pack(codes),
        "uv": pack((tint.uv - np.floor(tint.uv.min(0))).astype(np.float32)), "terms": terms,
    }  # fmt: skip


def _bumps(bumps: SurfaceNormals, tilted: TiltedView) -> dict[str, Any]:
    """Return the normal map as bytes with offset 128, at most `MOST_TEXELS` a side, and the tilted-view data."""
    normals = _smaller(bumps.vectors.astype(np.float64))
    normals /= np.linalg.norm(normals, axis=2, keepdims=True).clip(1e-6)
    return {
        "height": normals.shape[0], "width": normals.shape[1],
        "texels": pack(np.rint(127 * normals + 128).astype(np.uint8)),
        "uv": pack((bumps.uv - np.floor(bumps.uv.min(0))).astype(np.float32)),
        "tangents": pack(bumps.tangents.astype(np.float32)), "reach": tilted.reach, "nodes": len(tilted.tilts),
        "view": pack(np.ascontiguousarray(tilted.view.transpose(1, 2, 0, 3))), "tilts": pack(tilted.tilts),
        "entries": pack(tilted.entries),
    }  # fmt: skip


def _smaller(texels: np.ndarray) -> np.ndarray:
    """Halve a texture (H, W, 3) along each side longer than `MOST_TEXELS`, by means of two texels.

    The last row or column of an odd number is omitted.
    """
    while max(texels.shape[:2]) > MOST_TEXELS:
        across = [2 if size > MOST_TEXELS else 1 for size in texels.shape[:2]]
        rows, columns = (size // step for size, step in zip(texels.shape[:2], across, strict=True))
        even = texels[: rows * across[0], : columns * across[1]]
        texels = even.reshape(rows, across[0], columns, across[1], 3).mean((1, 3))
    return texels


def _triangles(triangles: np.ndarray) -> dict[str, str]:
    return pack(differences(cached_order(triangles).astype(np.int32).reshape(-1), (0,)))


def closed(triangles: np.ndarray) -> bool:
    """Return whether a surface is closed, so that its back is invisible: under 1% of edges have one triangle."""
    edges = np.sort(np.concatenate([triangles[:, pair] for pair in ([0, 1], [1, 2], [2, 0])]), 1)
    _, count = np.unique(edges, axis=0, return_counts=True)
    return bool((count == 1).mean() < 0.01)


def turns(rows: np.ndarray) -> np.ndarray:
    """Surface frames (V, 3, 3), rows tangent, binormal, normal, as unit quaternions (V, 4) int16, x y z w of 32767."""
    return np.rint(Rotation.from_matrix(rows.astype(np.float64)).as_quat() * 32767).astype(np.int16)


def _basis(basis: WaveletTransport) -> dict[str, Any]:
    """Encode indices as differences within each vector, and numbers with the sign in the lowest bit."""
    count = np.diff(basis.start)
    place = differences(basis.index, (0,))
    first = basis.start[:-1][count > 0]
    place[first] = basis.index[first]
    signed = (basis.number << 1 ^ basis.number >> 15).view(np.uint16)
    return {
        "count": pack(count.astype(np.uint16)),
        "place": pack(place),
        "number": pack(signed),
        "scale": pack(basis.scale),
    }


def _sky(sky: PageSky) -> dict[str, Any]:
    return {
        "name": sky.name,
        "cube": _halves(sky.cube),
        "picture": _halves(sky.picture),
        "rows": sky.picture.shape[0],
        "columns": sky.picture.shape[1],
    }


def _halves(values: np.ndarray) -> dict[str, Any]:
    stored, scale = halves(np.asarray(values, np.float64))
    return {"scale": scale, "values": pack(stored)}
