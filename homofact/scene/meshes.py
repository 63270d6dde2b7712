"""The meshes of a scene: opened by the name of a file or shape, and joined into one that blocks light."""

from collections.abc import Callable, Sequence
from functools import cached_property

import numpy as np

from homofact.errors import BadInput
from homofact.files.reading import split_member
from homofact.meshes.gltf_parts import gltf_part, is_gltf
from homofact.meshes.mesh import Mesh, read_mesh
from homofact.meshes.occlusion import Occluder, extent
from homofact.meshes.shapes import sphere, torus_knot

SHAPE_PREFIX = "shape:"
_WIDEST = 3.0  # times the largest mesh that is no plane
_SHAPES: dict[str, Callable[[], Mesh]] = {"sphere": sphere, "knot": torus_knot}


def open_mesh(text: str) -> Mesh:
    """Return a mesh's file, a part of a glTF file as "FILE#PART", or a shape by its name with `SHAPE_PREFIX`.

    Raises BadInput for what cannot be read.
    """
    if text.startswith(SHAPE_PREFIX):
        return shape(text, "mesh")()
    return gltf_part(text).mesh if split_member(text)[1] is not None and is_gltf(text) else read_mesh(text)


def shape(text: str, where: str) -> Callable[[], Mesh]:
    """Return the function that makes the shape `name`. Raises BadInput, beginning with `where`, otherwise."""
    name = text.removeprefix(SHAPE_PREFIX)
    if name not in _SHAPES:
        names = ", ".join(SHAPE_PREFIX + known for known in _SHAPES)
        raise BadInput(where=where, found=repr(text), expected=f"a file or one of {names}")
    return _SHAPES[name]


def lowest(meshes: Sequence[Mesh]) -> float:
    """Return the height of the lowest vertex of some meshes that a triangle uses."""
    return min(float(mesh.positions[np.unique(mesh.triangles), 1].min()) for mesh in meshes)


def faded(mesh: Mesh) -> tuple[float, float] | None:
    """Return the distances from the y axis between which a level plane ends softly; None of any other mesh."""
    if float(np.ptp(mesh.positions[:, 1])) > 0:
        return None
    half = float(np.abs(mesh.positions[:, ::2]).max())
    return 0.55 * half, 0.98 * half


class MeshGroup:
    """Several meshes as one: all `positions`, `normals` (V, 3) and `triangles` (T, 3), and the mesh that each is of.

    `owners` (T,) number the meshes; `uv` (V, 2) are texture coordinates, 0 where a mesh has none. `occluder` raises
    BadInput as `meshes.occlusion.Occluder` does.
    """

    def __init__(self, meshes: Sequence[Mesh]) -> None:
        starts = np.cumsum([0, *(len(mesh.positions) for mesh in meshes)])
        self.positions = np.concatenate([mesh.positions for mesh in meshes])
        self.normals = np.concatenate([mesh.normals for mesh in meshes])
        self.uv = np.concatenate([np.zeros((len(m.positions), 2)) if m.uv is None else m.uv for m in meshes])
        pairs = zip(meshes, starts, strict=False)
        self.triangles = np.concatenate([mesh.triangles + start for mesh, start in pairs])
        self._solid = [mesh for mesh in meshes if faded(mesh) is None]
        self.owners = np.repeat(np.arange(len(meshes)), [len(mesh.triangles) for mesh in meshes])

    @cached_property
    def occluder(self) -> Occluder:
        """Return the occluder of all meshes, for tracing rays."""
        return Occluder(self.positions, self.triangles, self._size())

    def _size(self) -> float | None:
        """What rays' offset is a part of: a wide ground would lift those of what stands on it too far off."""
        whole = [extent(mesh.positions, mesh.triangles) for mesh in self._solid if len(mesh.triangles)]
        return min(extent(self.positions, self.triangles), _WIDEST * max(whole)) if whole else None
