"""Prepare a mesh for shadow rays, and report its faults, one line per finding."""

from dataclasses import replace

import numpy as np

from homofact.errors import BadInput
from homofact.meshes.mesh import Mesh

# Of the largest triangle's area: below it a triangle has no direction in float32 and blocks nothing.
_DEGENERATE = 1e-12
# More than rays' own accuracy, less than a picture shows.
_THICKNESS = 1e-3


def prepared(mesh: Mesh) -> tuple[Mesh, tuple[str, ...]]:
    """Return the mesh without degenerate triangles and with outward normals, and the findings.

    An open mesh does not change, but is reported, because light may enter it from behind. Normals are flipped only if
    the mesh is closed and encloses a negative volume. Raises BadInput if no triangle remains.
    """
    notes = list(mesh.remarks)
    a, b, c = (mesh.positions[mesh.triangles[:, k]] for k in range(3))
    faces = np.cross(b - a, c - a)
    area = np.linalg.norm(faces, axis=1)
    kept = area > _DEGENERATE * area.max(initial=0.0)
    if not kept.any():
        raise BadInput("every triangle is degenerate", where=mesh.name, expected="some area")
    if not kept.all():
        notes.append(f"{mesh.name}: {int((~kept).sum())} degenerate triangles of {len(kept)} are left out")
    mesh = replace(mesh, triangles=mesh.triangles[kept])
    opened = open_edges(mesh)
    if opened:
        notes.append(f"{mesh.name}: open along {opened} edges; light may enter it from behind")
    # Triangles are wound to the side of the normals, so that the volume is of the normals' side.
    volume = float((a[kept] * faces[kept]).sum()) / 6
    if not opened and volume < 0:
        notes.append(f"{mesh.name}: its normals point inwards; they are turned")
        turned = None if mesh.tangents is None else -mesh.tangents
        mesh = replace(mesh, normals=-mesh.normals, triangles=mesh.triangles[:, ::-1].copy(), tangents=turned)
    return mesh, tuple(notes)


def two_sided(mesh: Mesh) -> Mesh:
    """Return the mesh with back faces: flipped copies of its triangles, `_THICKNESS` of its size behind them."""
    size = float(np.linalg.norm(np.ptp(mesh.positions, axis=0)))
    behind = mesh.positions - _THICKNESS * size * mesh.normals
    return replace(
        mesh,
        positions=np.concatenate((mesh.positions, behind)),
        normals=np.concatenate((mesh.normals, -mesh.normals)),
        triangles=np.concatenate((mesh.triangles, mesh.triangles[:, ::-1] + len(mesh.positions))),
        uv=None if mesh.uv is None else np.tile(mesh.uv, (2, 1)),
        # Mapped normals of the back are those of the front, turned round.
        tangents=None if mesh.tangents is None else np.concatenate((mesh.tangents, -mesh.tangents)),
    )


def open_edges(mesh: Mesh) -> int:
    """Count the edges of only one triangle; vertices at the same position count as one."""
    _, place = np.unique(mesh.positions, axis=0, return_inverse=True)
    corners = place.reshape(-1)[mesh.triangles]
    edges = np.sort(np.concatenate([corners[:, [k, (k + 1) % 3]] for k in range(3)]), axis=1)
    edges = edges[edges[:, 0] != edges[:, 1]]
    _, times = np.unique(edges, axis=0, return_counts=True)
    return int((times == 1).sum())
