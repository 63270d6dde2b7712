"""The file of the page: a prepared scene in one HTML page in which its curves are dragged.

    write_edit_page(Path("edit.html"), prepare(scene), title="Teapot")

The page holds what a picture needs: the transports at low rank (`coded`), the curves as they start in full, and which
band of θo each pixel has. For the picture in the window's own pixels (`enlarged`) it holds the meshes, positions
to 1/65535 of their box, the normals and distances of what the pixels see, and a small picture of the sky. Beside these
are tables of the white furnace (`furnace_table`), and for a preview on a sphere (`quotients`).

The page is `page.html` with what all pages of scenes have (`web.scene_page`), its own style and its `SCRIPTS`.
"""

from collections.abc import Callable
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from homofact.brdf.wavelengths import wavelengths_of
from homofact.editing import basis, curves_file, furnace
from homofact.editing.curves import band_of
from homofact.editing.enlarged import sky_behind
from homofact.editing.errors import rank_errors
from homofact.editing.furnace_table import factors, furnace_table
from homofact.editing.lowrank import LowRank
from homofact.editing.material import Editable, EditableTerm, Place, Slot
from homofact.editing.page.coded import coded
from homofact.editing.page.quotients import quotient_table
from homofact.editing.scene import PreparedScene, PreparedTerm
from homofact.editing.sender_albedo import mean_weights
from homofact.errors import BadInput
from homofact.factor.edited import LETTERS
from homofact.meshes.mesh import Mesh
from homofact.rendering.light import EnvironmentMap
from homofact.scene.lighting import Lighting, texel_directions
from homofact.scene.meshes import faded
from homofact.web.packing import boxed, differences, halves, pack
from homofact.web.scene_page import Numbers, percent, write_scene_page

PACKAGE = "homofact.editing.page"
SCRIPTS = (
    "formulas.js", "history.js", "transport.js", "settled.js", "scene.js", "tones.js", "furnace.js", "curves_file.js",
    "shapes.js", "plot.js", "hands.js", "preview_shader.js", "preview.js", "presets.js", "readings.js", "controls.js",
    "page.js",
)  # fmt: skip
_MOST_CODE, _SKY_ROWS = 65535, 128


def write_edit_page(
    target: Path,
    prepared: PreparedScene,
    *,
    title: str = "Editing",
    subtitle: str = "",
    numbers: Numbers | None = None,
    stage: Callable[[str], object] | None = None,
    new: bool = False,
) -> int:
    """Write the page atomically and return its size in bytes; `new` forbids replacing a file.

    The page shows `numbers` as one table per section, after the numbers of the scene. `stage` is called with the name
    of each step. Raises BadInput for uncompressed transports, for channels that are neither one nor red, green and
    blue, and for a path that cannot be written.
    """
    _check(prepared)
    tell = stage or (lambda words: None)
    tell("materials")
    materials = [_material(material) for material in prepared.scene.materials]
    tell("transports")
    data = {
        "channels": list(prepared.scene.channels),
        "floor": basis.FLOOR,
        "file": {"format": curves_file.FORMAT, "version": curves_file.FORMAT_VERSION, "most": curves_file.MOST_CURVES},
        "furnace": {"degrees": furnace.DEGREES, "slack": furnace.SLACK, "mean": mean_weights().tolist()},
        "senders": [{"thing": each.object, "terms": each.terms} for each in prepared.scene.senders],
        "materials": materials,
        "meshes": [_mesh(edited.mesh) for edited in prepared.scene.objects],
        "sky": _sky(prepared.scene.lighting),
        "views": [_view(prepared, number) for number in range(len(prepared.pixels))],
        "parts": [_part(prepared, part) for part in prepared.parts],
    }
    tell("writing the page")
    tables = {**scene_numbers(prepared), **(numbers or {})}
    return write_scene_page(
        target, PACKAGE, SCRIPTS, data, tables, title=title, subtitle=subtitle, shared=("latlong.js",),
        styles=("page.css",), new=new,
    )  # fmt: skip


def scene_numbers(prepared: PreparedScene) -> dict[str, dict[str, str | int | float]]:
    """Return the page's numbers of the scene: pixels, lights, ranks, and the low rank's error at the start."""
    pixels = sum(len(seen) for seen in prepared.pixels)
    found: dict[str, dict[str, str | int | float]] = {
        "Scene": {
            "covered pixels": pixels,
            "spherical triangles of light": prepared.lights.count,
            "triangles of the meshes": sum(len(edited.mesh.triangles) for edited in prepared.scene.objects),
            "bytes of the transports": prepared.nbytes,
        }
    }
    for part in rank_errors(prepared):
        view = f"{part.view}: " if len(prepared.pixels) > 1 else ""
        rows = found.setdefault(f"{view}{part.material}", {"pixels": part.pixels})
        bands = " × ".join(map(str, part.bands))
        rows[f"{part.words}, {bands} bands"] = f"rank {part.rank}, error {error_words(part.error)}"
    return found


def error_words(share: float) -> str:
    """Return an error in words; invisible errors get no exact number."""
    return "below 0.001%" if share < 1e-5 else percent(share)


def _check(prepared: PreparedScene) -> None:
    channels = prepared.scene.channels
    if len(channels) != 1 and (len(channels) != 3 or wavelengths_of(channels) is not None):
        raise BadInput(where="channels", found=", ".join(channels[:4]), expected="one, or red, green and blue")
    for part in prepared.parts:
        _low_rank(part)


def _low_rank(part: PreparedTerm) -> LowRank:
    if not isinstance(part.transport, LowRank):
        raise BadInput(where="page", found="transports in full", expected="them at low rank")
    return part.transport


def _material(material: Editable) -> dict[str, Any]:
    return {
        "name": material.name,
        "notes": list(material.notes),
        "terms": [_term(term) for term in material.terms],
        "curves": [
            _curve(place, material.slot(place), bands.values.tolist())
            for place, bands in material.banded_start().items()
        ],
    }


def _curve(place: Place, slot: Slot, values: list[list[float]]) -> dict[str, Any]:
    return {
        "term": place[0],
        "name": place[1],
        "angle": slot.angle,
        "letters": LETTERS[slot.angle],
        "bands": slot.bands,
        "finer": slot.finer,
        "also": slot.also_outgoing,
        "summed": slot.in_sum,
        "start": values,
        "sliders": None if slot.sliders is None else dict(slot.sliders.start),
        "formula": None if slot.sliders is None else slot.sliders.formula,
    }


def _term(term: EditableTerm) -> dict[str, Any]:
    table = quotient_table(term)
    values, scale = halves(table.values)
    sums = furnace_table(term)
    return {
        "name": term.name,
        "quotient": {"sizes": table.sizes, "scale": scale, "values": pack(values), "error": table.error(term)},
        "furnace": {
            "factors": [[number, name] for number, name, _ in factors(term)],
            "degrees": pack(sums.degrees),
            "bands": pack(np.ascontiguousarray(sums.bands.T)),
            "weights": pack(np.ascontiguousarray(sums.weights.T)),
        },
    }


def _view(prepared: PreparedScene, number: int) -> dict[str, Any]:
    camera, seen = prepared.scene.cameras[number], prepared.pixels[number]
    width, height = camera.pixels
    return {
        "name": prepared.scene.view_names[number],
        "width": width,
        "height": height,
        "numbers": pack(differences(seen.numbers.astype(np.uint32), (0,))),
        "objects": pack(seen.objects.astype(np.uint16)),
        "camera": {"eye": camera.eye, "target": camera.target, "field": camera.field},
        "normals": pack(_turned(seen.frames[:, 2])),
        "depth": pack(np.linalg.norm(seen.points - np.array(camera.eye), axis=1).astype(np.float32)),
    }


def _mesh(mesh: Mesh) -> dict[str, Any]:
    triangles = pack(differences(mesh.triangles.astype(np.int32).reshape(-1), (0,)))
    return {
        **boxed(mesh.positions),
        "normals": pack(_turned(mesh.normals)),
        "triangles": triangles,
        "fade": faded(mesh),
    }


def _turned(normals: np.ndarray) -> np.ndarray:
    return np.rint(normals * 32767).astype(np.int16)


def _sky(lighting: Lighting) -> dict[str, Any] | None:
    """Return the light's maps as one RGB lat-long picture, which the page blurs; None if the light has no map."""
    if not any(isinstance(light, EnvironmentMap) for light in lighting.lights):
        return None
    rows, finer = _SKY_ROWS, 4 * _SKY_ROWS
    radiance = sky_behind(lighting, texel_directions(finer, 2 * finer).numpy(), 3)
    stored, scale = halves(radiance.reshape(rows, 4, 2 * rows, 4, 3).mean((1, 3)))
    return {"rows": rows, "columns": 2 * rows, "scale": scale, "values": pack(stored)}


def _part(prepared: PreparedScene, part: PreparedTerm) -> dict[str, Any]:
    transport = _low_rank(part)
    material = prepared.scene.objects[part.object].material
    term, start = material.term(part.term), material.banded_start()
    found = coded(transport, [start[part.term, slot.name].values for slot in term.summed])
    bands_of = lru_cache(lambda count: pack(band_of(part.theta_o, count).numpy().astype(np.uint8)))
    pattern = None
    if part.factor is not None:
        factor = part.factor.expand(len(part.rows), len(prepared.scene.channels)).numpy()
        scale = max(float(factor.max()), 1e-300) / _MOST_CODE
        pattern = {"scale": scale, "values": pack(np.rint(factor / scale).astype(np.uint16))}
    return {
        "view": part.view,
        "thing": part.object,
        "term": part.term,
        "numbers": pack(found.numbers),
        "steps": found.steps.tolist(),
        "outward": pack(found.outward.reshape(-1, *transport.bands)),
        "rows": pack(found.rows),
        "columns": pack(found.columns),
        "outgoing": {slot.name: bands_of(slot.bands) for slot in term.slots if slot.also_outgoing or not slot.in_sum},
        "pattern": pattern,
        "received": None if part.senders is None else _received(part.rows, part.senders),
    }


def _received(rows: np.ndarray, senders: np.ndarray) -> dict[str, Any]:
    """Return the rows of a view's light from surfaces, and the sender's index for each row."""
    return {"rows": pack(differences(rows.astype(np.int32), (0,))), "senders": pack(senders.astype(np.uint16))}
