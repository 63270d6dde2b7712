"""The candidate projections of a texture in a searched factorization, by name.

A kind is a fixed projection ("theta_h-theta_d", "h" …) or the name of coordinates without a periodic axis, on which the
projection is then searched. A searched projection mixes the axes, so it would jump where a periodic axis wraps around.
For an isotropic material, the candidates are only coordinates that do not depend on the azimuth and are continuous on
the sphere; 4D coordinates would waste texels on learning that rotation changes nothing. An anisotropic material may use
both: one texture for its lobe, another for its isotropic part.
"""

import torch

from homofact.errors import BadInput
from homofact.factor.fixed_projections import FIXED_PROJECTIONS, KINDS
from homofact.factor.projection import WARPED_AXES, Projection, Warp, fixed_projection
from homofact.geometry.coordinates import coordinate_system
from homofact.geometry.names import COORDINATE_NAMES
from homofact.geometry.rotation import Rotation
from homofact.linear.arrays import as_array

ISOTROPIC_CANDIDATES = (
    "theta_h-theta_d",
    "theta_i-theta_o",
    "theta_d-tilt",
    "theta_h-tilt",
    "theta_i-theta_d",
    "theta_i",
    "theta_d",
    "isotropic-half-tilt",
    "isotropic-angles",
)
ANISOTROPIC_CANDIDATES = (
    "h",
    "theta_h-phi_h",
    "theta_h-theta_d",
    "theta_i-theta_o",
    "theta_i-theta_d",
    "wi",
    "d",
    "half-diff",
    "isotropic-angles",
    "in-out",
    "isotropic-half-tilt",
)
WARP_WIDTHS = (0.3, 0.1, 0.03, 0.01, 0.003)


def coordinates_of(kind: str) -> str:
    """Return the coordinates that a kind's projection acts on. Raises BadInput that lists the kinds."""
    if kind not in KINDS:
        raise BadInput(where="projections", found=repr(kind), expected=f"one of {', '.join(KINDS)}")
    return kind if kind in COORDINATE_NAMES else fixed_projection(kind, True).coordinates


def is_searched(kind: str) -> bool:
    """Return whether the projection of this kind has parameters to search."""
    return kind in COORDINATE_NAMES


def is_isotropic(kind: str) -> bool:
    """Return whether the kind's coordinates do not depend on the azimuth."""
    return coordinate_system(coordinates_of(kind)).isotropic


def takes_warp(kind: str) -> bool:
    """Return whether the kind uses an axis of the half vector, which a warp can stretch."""
    axes = coordinate_system(coordinates_of(kind)).axes
    if not is_searched(kind):
        read = (fixed_projection(kind, True).matrix != 0).any(0).tolist()
        axes = tuple(axis for axis, own in zip(axes, read, strict=True) if own)
    return bool(set(WARPED_AXES) & set(axes))


def make(kind: str, reciprocal: bool, warp: Warp | None, generator: torch.Generator, bound: str) -> Projection:
    """Return a projection of this kind: the fixed one, or one at a rotation drawn uniformly."""
    used = warp if takes_warp(kind) else None
    if not is_searched(kind):
        return fixed_projection(kind, reciprocal, used)
    rotation = Rotation.random(generator, coordinate_system(kind).dimension)
    return Projection.from_rotation(kind, rotation, reciprocal, bound, used)


def relatives(kind: str) -> tuple[str, ...]:
    """Return the fixed two-axis projections on a searched kind's coordinates, at which its rotation may start."""
    return tuple(
        name
        for name in FIXED_PROJECTIONS
        if coordinates_of(name) == kind and bool((fixed_projection(name, True).matrix != 0).any(1).all())
    )


def loosened(projection: Projection) -> Projection | None:
    """Return a fixed projection as a searched one at the same place, or None if no rotation represents it.

    Its two axes become the first rows of a rotation, which is a signed permutation, converted to quaternions.
    """
    rows = projection.matrix
    searchable = projection.coordinates in COORDINATE_NAMES
    if not searchable or projection.quaternions is not None or not (rows != 0).any(1).all():
        return None
    dimension = projection.system.dimension
    # Complete the rows to a rotation: the remaining axes in order, the last one signed for determinant 1.
    used = [int(abs(row).argmax()) for row in rows]
    order = used + [axis for axis in range(dimension) if axis not in used]
    matrix = torch.eye(dimension, dtype=torch.float64, device="cpu")[order]
    matrix[-1] *= torch.linalg.det(matrix)
    rotation = Rotation.from_matrix(matrix.T)
    made = as_array(rotation.quaternions)
    return Projection(projection.coordinates, rows, projection.reciprocal, quaternions=made, warp=projection.warp)
