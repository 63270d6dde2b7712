"""A relit scene on disk: relight.npz with everything that relighting reads, relight.json, and a picture a camera."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch

from homofact.containers.png import write_png
from homofact.errors import BadInput
from homofact.export.manifest import write_json
from homofact.files.archive import member_names, read_arrays, read_header, write_archive
from homofact.files.folder import check_new_folder, write_folder
from homofact.files.kinds import RELIT
from homofact.files.reading import read_bytes
from homofact.meshes.mesh import Mesh
from homofact.render.sphere import SphereImage
from homofact.render.tonemap import choose_exposure, tonemap
from homofact.scene.placed import Camera
from homofact.scene.transport.build import RelitObject
from homofact.scene.transport.clusters import Clustered
from homofact.scene.transport.factors import InOutFactors
from homofact.scene.transport.page.skies import PageSky, page_sky
from homofact.scene.transport.precompute import Transport, TransportSettings
from homofact.scene.transport.scene import RelightScene

REPORT = "relight.json"
_EXPECTED = "a relit scene that homofact wrote"
_FORMAT, _VERSION = "homofact relit scene", 1
_VECTORS = ("start", "index", "number", "scale")
_FACTORS = ("light", "view", "strength")


@dataclass(frozen=True)
class SavedScene:
    """What `relight` wrote: objects, their sky, cameras, the report.

    `reference` is each object's light (V, 3) towards the first camera by the dense sum, NaN where it is not seen.
    """

    name: str
    objects: tuple[RelitObject, ...]
    sky: PageSky
    reference: tuple[np.ndarray, ...] | None
    cameras: tuple[Camera, ...]
    report: dict[str, Any]


def write_relit(
    folder: Path,
    scene: RelightScene,
    objects: Sequence[RelitObject],
    report: dict[str, Any],
    pictures: Sequence[tuple[np.ndarray, np.ndarray]],
    force: bool = False,
    reference: Sequence[np.ndarray] | None = None,
) -> None:
    """Write the folder, whole or not at all; `reference` as in `SavedScene`.

    Raises BadInput as `files.folder.write_folder`.
    """
    check_new_folder(folder, RELIT, force)

    def fill(place: Path) -> None:
        save_scene(place / RELIT.mark, scene, objects, report, reference)
        write_json(place / REPORT, report)
        for number, each in enumerate(pictures, 1):
            write_png(place / f"picture_{number}.png", displayed_picture(*each))

    write_folder(folder, RELIT, fill, force)


def displayed_picture(radiance: np.ndarray, coverage: np.ndarray, exposure: float | None = None) -> np.ndarray:
    """8-bit sRGB (H, W, 3) of a picture, at the exposure that suits its objects unless one is given."""
    shown = torch.from_numpy(np.maximum(radiance, 0))
    chosen = choose_exposure(SphereImage(shown, torch.from_numpy(coverage))) if exposure is None else exposure
    whole = SphereImage(shown, torch.ones(coverage.shape, dtype=torch.float64))
    return tonemap(whole, chosen).pixels.numpy()


def save_scene(
    file: Path,
    scene: RelightScene,
    objects: Sequence[RelitObject],
    report: dict[str, Any],
    reference: Sequence[np.ndarray] | None = None,
) -> None:
    """Write one archive of everything."""
    sky = page_sky(scene.light.name, scene.light, scene.settings.cube)
    arrays: dict[str, np.ndarray] = {"sky_cube": sky.cube, "sky_picture": sky.picture}
    arrays |= {f"reference_{k}": each.astype(np.float32) for k, each in enumerate(reference or ())}
    entries = []
    for number, each in enumerate(objects):
        made, factors = each.transport, each.transport.factors
        own = {"positions": each.mesh.positions, "normals": each.mesh.normals, "triangles": each.mesh.triangles}
        own |= {"frames": made.frames} | {name: getattr(made, name) for name in _VECTORS}
        own |= {f"factors_{name}": getattr(factors, name) for name in _FACTORS}
        if each.compact is not None:
            own |= {f"basis_{name}": getattr(each.compact.basis, name) for name in _VECTORS}
            own |= {name: getattr(each.compact, name) for name in ("cluster", "weights", "steps")}
        arrays |= {f"object_{number}_{name}": array for name, array in own.items()}
        entries.append(
            {
                "name": each.mesh.name,
                "material": each.material,
                "channels": list(factors.channels),
                "energy": factors.energy,
                "compact": each.compact is not None,
            }
        )
    settings = scene.settings
    header = {
        "format": _FORMAT,
        "version": _VERSION,
        "name": scene.name,
        "sky": sky.name,
        "objects": entries,
        "settings": {
            "cube": settings.cube, "rays": settings.rays, "kept": settings.kept, "tolerance": settings.tolerance,
        },
        "cameras": [
            {"eye": list(c.eye), "target": list(c.target), "field": c.field, "pixels": list(c.pixels)}
            for c in scene.cameras
        ],
        "report": report,
    }  # fmt: skip
    write_archive(file, header, arrays)


def open_relit(place: Path) -> SavedScene:
    """The scene in a folder that `relight` wrote, or in its relight.npz. Raises BadInput where there is none."""
    file = place / RELIT.mark if place.is_dir() else place
    raw = read_bytes(file, _EXPECTED)
    arrays = read_arrays(file, raw, member_names(file, raw, _EXPECTED), _EXPECTED)
    header = read_header(file, arrays, _EXPECTED)
    if header.get("format") != _FORMAT or header.get("version") != _VERSION:
        raise BadInput(f"{file}: found {header.get('format')} {header.get('version')}, expected {_EXPECTED}")
    try:
        settings = TransportSettings(**header["settings"])
        objects = tuple(_object(arrays, number, each, settings) for number, each in enumerate(header["objects"]))
        cameras = tuple(
            Camera(tuple(c["eye"]), tuple(c["target"]), c["field"], tuple(c["pixels"])) for c in header["cameras"]
        )
        sky = PageSky(header["sky"], arrays["sky_cube"], arrays["sky_picture"])
        reference = None
        if "reference_0" in arrays:
            reference = tuple(arrays[f"reference_{number}"] for number in range(len(objects)))
        return SavedScene(header["name"], objects, sky, reference, cameras, header["report"])
    except (KeyError, TypeError, ValueError, IndexError) as error:
        raise BadInput(f"{file}: its parts do not belong together ({error}), expected {_EXPECTED}") from error


def is_relit(place: Path) -> bool:
    """Whether a folder or file is a relit scene rather than a fit."""
    return (place / RELIT.mark).is_file() if place.is_dir() else place.name == RELIT.mark


def _object(
    arrays: dict[str, np.ndarray], number: int, entry: dict[str, Any], settings: TransportSettings
) -> RelitObject:
    def part(name: str) -> np.ndarray:
        return arrays[f"object_{number}_{name}"]

    light, view, strength = (part(f"factors_{name}") for name in _FACTORS)
    factors = InOutFactors(light, view, strength, entry["energy"], tuple(entry["channels"]))
    mesh = Mesh(part("positions"), part("normals"), part("triangles"), entry["name"])
    positions, rows = mesh.positions.astype(np.float32), part("frames")
    made = Transport(positions, rows, factors, settings, *(_checked(part(n), n) for n in _VECTORS))
    _check(made, len(mesh.positions))
    compact = None
    if entry["compact"]:
        steps, weights, cluster = part("steps"), part("weights"), part("cluster")
        count = len(steps) * (weights.shape[1] + 1)
        empty = np.zeros((count, 3), np.float32)
        basis = Transport(
            empty, np.zeros((count, 3, 3), np.float32), factors, settings, *(part(f"basis_{n}") for n in _VECTORS)
        )
        _check(basis, count)
        if len(cluster) != len(positions) or len(weights) != len(positions) or cluster.max() >= len(steps):
            raise ValueError("clusters of other vertices")
        compact = Clustered(positions, rows, factors, basis, cluster, weights, steps)
    return RelitObject(mesh, entry["material"], made, compact)


def _checked(array: np.ndarray, name: str) -> np.ndarray:
    if array.ndim != 1:
        raise ValueError(f"{name} has {array.ndim} dimensions")
    return array


def _check(made: Transport, vertices: int) -> None:
    """Compiled loops read what these arrays say: they must not say more than there is. Raises ValueError."""
    vectors = vertices * made.factors.terms
    size = 6 * made.settings.cube**2
    if len(made.scale) != vectors or len(made.start) != vectors + 1 or len(made.frames) != vertices:
        raise ValueError("vectors of other vertices")
    if made.start[0] != 0 or (np.diff(made.start) < 0).any() or made.start[-1] != len(made.index):
        raise ValueError("vectors that overlap")
    if len(made.index) != len(made.number) or (len(made.index) and int(made.index.max()) >= size):
        raise ValueError("coefficients beyond the cube map")
