"""Read a mesh from a Wavefront OBJ, PLY or glTF file; the file's content determines its format.

Unless the caller requests the file's own units, positions are moved and scaled: the bounding box is centred at the
origin, and the farthest vertex lies on the unit sphere. Normals in the file are kept. Otherwise each vertex gets the
area-weighted sum of its triangles' normals, over all vertices at the same position, because an OBJ file splits vertices
along texture seams. Before that, triangles wound against their neighbours are flipped (`meshes.winding`), and a mesh
that encloses a negative volume is turned inside out. Finally, every triangle is wound to face the side of its normals.
Polygons become triangle fans. Colours, groups and materials are ignored, and texture coordinates of OBJ and PLY files
too.
"""

import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from homofact.errors import BadInput
from homofact.files.reading import read_bytes
from homofact.meshes.files import parse_obj, parse_ply
from homofact.meshes.gltf import parse_gltf
from homofact.meshes.parsed import Parsed
from homofact.meshes.winding import wound_alike

# Of coordinates: a box that is wider is not finite; in the file's own units, squares are to be finite in float32.
_MOST, _MOST_OWN = 1e300, 1e9


@dataclass(frozen=True)
class Mesh:
    """`positions` (V, 3), unit `normals` (V, 3) float64, vertex indices `triangles` (T, 3) int64, and a `name`.

    `remarks` list the repairs during reading. `uv` (V, 2) are texture coordinates, v downwards, if the mesh has any.
    `tangents` (V, 4) are unit tangents with the sign of the binormal, if a normal map needs them. `origins` (V, 3) are
    the points at which the light of the vertices is computed, if some vertices lie inside other parts
    (`meshes.buried`).
    """

    positions: np.ndarray
    normals: np.ndarray
    triangles: np.ndarray
    name: str
    remarks: tuple[str, ...] = ()
    uv: np.ndarray | None = None
    tangents: np.ndarray | None = None
    origins: np.ndarray | None = None

    @property
    def lit_at(self) -> np.ndarray:
        """The points (V, 3) at which the light of the vertices is computed: `origins` if given, else `positions`."""
        return self.positions if self.origins is None else self.origins


def read_mesh(path: str | os.PathLike[str], fitted: bool = True) -> Mesh:
    """Read an OBJ, PLY or glTF file as the module's docstring describes; in the file's units unless `fitted`.

    Raises BadInput, with a one-line message, for a file that is unreadable, of another format, damaged, or truncated;
    and for a mesh without triangles, with invalid indices, or with coordinates that are too large or not finite.
    """
    target = Path(path)
    data = read_bytes(target, "an OBJ, PLY or glTF mesh")
    if data[:4] in (b"ply\n", b"ply\r"):
        parsed = parse_ply(data, str(target))
    elif data[:4] == b"glTF" or data.lstrip()[:1] == b"{":
        parsed = parse_gltf(target, data)
    else:
        parsed = parse_obj(data, str(target))
    return mesh_of(parsed, target, fitted)


def mesh_of(parsed: Parsed, target: Path, fitted: bool = True) -> Mesh:
    """Return the mesh of parsed file content. Raises BadInput as `read_mesh` does."""
    positions, normals, triangles, uv, tangents = parsed
    if not len(triangles):
        raise BadInput("no triangles in it", where=target, expected="a mesh")
    for what, values in (("position", positions), ("normal", normals)):
        most = _MOST if fitted else _MOST_OWN
        if values is not None and not (bounded := np.abs(values) <= most).all():
            row = int(np.argwhere(~bounded)[0, 0])
            found = f"{what} {row + 1} is {', '.join(f'{value:g}' for value in values[row])}"
            raise BadInput(found, where=target, expected=f"finite numbers of at most {most:g}")
    if triangles.min() < 0 or triangles.max() >= len(positions):
        wrong = int(triangles.min() if triangles.min() < 0 else triangles.max())
        raise BadInput(f"a face names vertex {wrong}", where=target, expected=f"0 to {len(positions) - 1}")
    used = positions[np.unique(triangles)]
    low, high = used.min(0), used.max(0)
    if not (high - low).any():
        raise BadInput("all vertices are at one place", where=target, expected="a mesh with an extent")
    # Before anything is squared: coordinates may be of any size.
    middle, extent = (low + high) / 2, (high - low).max()
    positions = (positions - middle) / extent
    radius = np.linalg.norm(positions[np.unique(triangles)], axis=1).max()
    positions /= radius
    if normals is not None:
        # Before lengths: they are squares.
        largest = np.abs(normals).max(1, keepdims=True)
        normals = normals / np.where(largest > 0, largest, 1.0)
    remarks: tuple[str, ...] = ()
    if normals is None or not np.linalg.norm(normals, axis=1).all():
        triangles, turned = wound_alike(positions, triangles)
        if turned:
            wound = f"{turned} of {len(triangles)} triangles are wound against their neighbours; they are turned"
            remarks = (f"{target.name}: {wound}",)
        triangles = _outward(positions, triangles)
        computed = _vertex_normals(positions, triangles)
        given = np.zeros(len(positions), bool) if normals is None else np.linalg.norm(normals, axis=1) > 0
        normals = computed if normals is None else np.where(given[:, None], normals, computed)
    normals = normals / np.linalg.norm(normals, axis=1, keepdims=True)
    triangles = _facing(positions, normals, triangles)
    placed = positions if fitted else positions * (radius * extent) + middle
    return Mesh(placed, normals, triangles, target.name, remarks, uv, tangents)


def _face_normals(positions: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Return normals (T, 3) whose length is twice the triangle's area."""
    a, b, c = (positions[triangles[:, k]] for k in range(3))
    return np.cross(b - a, c - a)


def _outward(positions: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Return the triangles, all flipped if they enclose a negative volume."""
    volume = (positions[triangles[:, 0]] * _face_normals(positions, triangles)).sum()
    return triangles if volume >= 0 else triangles[:, ::-1].copy()


def _vertex_normals(positions: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Return nonzero vertex normals (V, 3): sums of face normals per vertex position, or z if a sum is 0."""
    _, place = np.unique(positions, axis=0, return_inverse=True)
    place = place.reshape(-1)
    total = np.zeros((place.max() + 1, 3))
    faces = _face_normals(positions, triangles)
    for corner in range(3):
        np.add.at(total, place[triangles[:, corner]], faces)
    total[np.linalg.norm(total, axis=1) == 0] = (0, 0, 1)
    return total[place]


def _facing(positions: np.ndarray, normals: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Return the triangles, each wound to face the side of its vertices' normals."""
    away = (_face_normals(positions, triangles) * normals[triangles].sum(1)).sum(1) < 0
    return np.where(away[:, None], triangles[:, ::-1], triangles)
