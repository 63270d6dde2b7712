"""Relighting from Python in five lines: a mesh of one material, its transport, lights and views of it.

knot = homofact.transport("knot.ply", "material:lafortune-blue-paint", error=0.02)
knot.relight("sky.hdr")                       # or "studio", an EnvironmentMap, a cube map of radiance
colours = knot.shade((0.6, 0.9, 3.6))         # (V, 3), radiance of knot.mesh's vertices towards the eye
knot.ask("overcast")                          # piece by piece instead: the largest changes first
left = knot.step(256)
"""

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from homofact.brdf.reflectance import Reflectance
from homofact.errors import BadInput
from homofact.meshes.mesh import Mesh
from homofact.meshes.occlusion import Occluder
from homofact.meshes.prepare import prepared
from homofact.render.light import EnvironmentMap
from homofact.scene.lighting import open_environment
from homofact.scene.placed import open_mesh, open_reflectance
from homofact.scene.transport.build import together
from homofact.scene.transport.factoring import MAP_SIZE, SHARE, factor
from homofact.scene.transport.precompute import KEPT, Transport, TransportSettings
from homofact.scene.transport.precompute import transport as precomputed
from homofact.scene.transport.relight import Relit

Light = EnvironmentMap | np.ndarray | str | Path


class RelitMesh(Relit):
    """`Relit` with its `mesh`, whose vertices it shades; lights may be names and files too.

    A light is an `EnvironmentMap`, a cube map of radiance (6, n, n, 3), a .hdr or .exr file, or the name of one of
    `scene.lighting.NAMED` that is a map.
    """

    def __init__(self, mesh: Mesh, transport: Transport, notes: tuple[str, ...] = ()) -> None:
        super().__init__(transport)
        self.mesh, self.notes = mesh, notes

    def relight(self, light: Light) -> None:
        """Change to another light at once, from nothing. Raises BadInput for what is no light."""
        super().relight(_opened(light))

    def ask(self, light: Light) -> None:
        """Name the light that `step` will lead to. Raises BadInput for what is no light."""
        super().ask(_opened(light))


def transport(
    mesh: Mesh | str | Path,
    material: Reflectance | str | Path,
    *,
    terms: int | None = None,
    error: float | None = None,
    share: float = SHARE,
    light: EnvironmentMap | str | Path | None = None,
    map_size: int = MAP_SIZE,
    cube: int = 64,
    rays: int = 1,
    kept: int = KEPT,
    tolerance: float | None = None,
    among: Sequence[Mesh] = (),
    folder: str | Path | None = None,
    progress: Callable[[int, int], object] | None = None,
) -> RelitMesh:
    """The light transport of a mesh of one material, still in the dark: `relight` it, then `shade` it.

    `mesh` is a `Mesh`, an OBJ, PLY or glTF file, shape:sphere or shape:knot; `material` any `Reflectance` (a model, a
    measurement, a fit), "material:NAME", or the file of a measurement or of a fit. Of its in-out factors there are
    `terms`, or as many as leave an expected `error` under `light` (natural light unless given), or as many as hold
    `share` of its energy; `map_size`, `cube`, `rays`, `kept` and `tolerance` as in `factoring.factor` and
    `TransportSettings`. Other meshes `among` which it stands throw shadows on it. `folder` keeps finished blocks for a
    later run; `progress` is told (blocks done, blocks). Raises BadInput for what cannot be read and numbers that are no
    choice, MissingDependency without Embree.
    """
    settings = TransportSettings(cube, rays, kept, tolerance)
    given, notes = prepared(mesh if isinstance(mesh, Mesh) else open_mesh(str(mesh)))
    reflectance = open_reflectance(str(material)) if isinstance(material, str | Path) else material
    reckoned = open_environment(light) if isinstance(light, str | Path) else light
    factors = factor(reflectance, terms, share, map_size, error, reckoned)
    occluder = Occluder(*together([given, *among]))
    place = None if folder is None else Path(folder)
    return RelitMesh(given, precomputed(given, factors, settings, occluder, place, progress), notes)


def _opened(light: Light) -> EnvironmentMap | np.ndarray:
    if isinstance(light, str | Path):
        return open_environment(light)
    if not isinstance(light, EnvironmentMap | np.ndarray):
        raise BadInput(f"light: found {light!r}, expected an EnvironmentMap, a cube map, a file or a name")
    return light
