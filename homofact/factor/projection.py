"""Projections: how a pair of directions finds its place in a texture.

A projection is a 2 × k matrix on one of the named coordinates, its rows scaled so that the image of the
coordinates' domain just fits the texture square [−1, 1]². With orthonormal rows (thesis 2.3.1, appendix
A: any linear projection is an orthonormal one up to a linear map of the texture) the tight bound of a
row (a, b, c, d) on two discs is |(a, b)| + |(c, d)|; the thesis uses the 4-cube, |a| + |b| + |c| + |d|,
as one does for a box of angles. A one-dimensional texture has a second row of zeros.

The conjugate π* of a projection is P S with S the swap of its coordinates: π*(ωi, ωo) = π(ωo, ωi).
A reciprocal projection that is not its own conjugate looks its texture up twice (thesis 3.2.3).
"""

from dataclasses import dataclass
from typing import Any

import torch
from torch import Tensor

from homofact.errors import BadInput
from homofact.geometry.coordinates import CoordinateSystem, coordinate_system
from homofact.geometry.rotation import Pair, rotation3

BOUNDS = ("disc", "cube")


def row_bounds(matrix: Tensor, domain: str, bound: str) -> Tensor:
    """Largest |row · x| (2,) over the domain, for the tight ("disc") or the thesis's ("cube") bound."""
    if domain == "discs" and bound == "disc":
        return matrix[:, :2].norm(dim=1) + matrix[:, 2:].norm(dim=1)
    return matrix.abs().sum(1)


@dataclass(frozen=True)
class Warp:
    """A stretch of the half vector's angle, which gives a narrow specular peak its texels.

    ρ ↦ asinh(ρ/width)/asinh(1/width) on ρ in [0, 1]: linear up to `width`, logarithmic beyond. ρ is the
    parabolic radius of h in half-diff and θh/(π/2) in isotropic half-diff.
    """

    width: float

    def on(self, system: CoordinateSystem, coordinates: Tensor) -> Tensor:
        """The coordinates (N, k) with their half-vector part stretched. Raises BadInput where they have none."""
        return system.stretch(coordinates, self.width)


@dataclass(frozen=True)
class Projection:
    """A 2 × k matrix (float64, rows already scaled) on named coordinates.

    `rotation` is the quaternion pair (k = 4) or quaternion (k = 3) the matrix came from, for the record;
    `name` is the fixed name ("h", "theta_h-theta_d") or "searched".
    """

    coordinates: str
    matrix: Tensor
    reciprocal: bool
    name: str = "searched"
    rotation: Pair | Tensor | None = None
    warp: Warp | None = None

    def __post_init__(self) -> None:
        """Refuse a matrix that does not fit the coordinates or is not finite."""
        expected = (2, self.system.dimension)
        if tuple(self.matrix.shape) != expected:
            raise BadInput(f"projection: matrix has shape {tuple(self.matrix.shape)}, expected {expected}")
        if not bool(torch.isfinite(self.matrix).all()):
            raise BadInput("projection: matrix has entries that are not finite, expected finite numbers")

    @property
    def system(self) -> CoordinateSystem:
        """The coordinates that the matrix acts on."""
        return coordinate_system(self.coordinates)

    @classmethod
    def from_rows(
        cls, coordinates: str, rows: Tensor, reciprocal: bool, bound: str = "disc", **more: object
    ) -> "Projection":
        """The projection with `rows` (2, k) scaled to fit the texture square; a zero row stays zero."""
        if bound not in BOUNDS:
            raise BadInput(f"bound: found {bound!r}, expected one of {', '.join(BOUNDS)}")
        largest = row_bounds(rows, coordinate_system(coordinates).domain, bound)
        scale = torch.where(largest > 0, 1 / largest.clamp_min(1e-300), torch.zeros_like(largest))
        return cls(coordinates, rows * scale[:, None], reciprocal, **more)  # type: ignore[arg-type]

    @classmethod
    def from_rotation(
        cls, coordinates: str, rotation: Pair | Tensor, reciprocal: bool, bound: str = "disc", warp: Warp | None = None
    ) -> "Projection":
        """The first two rows of a rotation: a quaternion pair on R⁴ or one quaternion (4,) on R³.

        Basis vectors e1, e2 turned by R give the rows (R e1)ᵀ, (R e2)ᵀ, as in the thesis (2.3.1).
        """
        matrix = rotation.matrix() if isinstance(rotation, Pair) else rotation3(rotation)
        return cls.from_rows(coordinates, matrix.T[:2].contiguous(), reciprocal, bound, rotation=rotation, warp=warp)

    def place(self, wi: Tensor, wo: Tensor) -> tuple[Tensor, ...]:
        """Texture coordinates in [−1, 1]², one (N, 2) tensor for each lookup (two where the conjugate counts)."""
        return self.place_coordinates(self.prepare(wi, wo))

    def prepare(self, wi: Tensor, wo: Tensor) -> Tensor:
        """The coordinates (N, k) that the matrix acts on, warped where this projection warps."""
        return self.system.evaluate(wi, wo, None if self.warp is None else self.warp.width)

    def place_coordinates(self, x: Tensor) -> tuple[Tensor, ...]:
        """As `place`, from coordinates (N, k) that `prepare` made."""
        return tuple(x @ matrix.to(x).T for matrix in self.matrices())

    def matrices(self) -> tuple[Tensor, ...]:
        """The matrix of every lookup: P alone, or P and its conjugate P S.

        A fixed projection that is its own conjugate is looked up once. A searched one moves, and counts twice
        even where it happens to be.
        """
        swap = torch.tensor(self.system.swap, dtype=self.matrix.dtype)
        swapped = self.matrix @ swap
        fixed = self.rotation is None or torch.equal(swap, torch.eye(len(swap), dtype=swap.dtype))
        if not self.reciprocal or (fixed and torch.equal(swapped, self.matrix)):
            return (self.matrix,)
        return (self.matrix, swapped)

    @property
    def lookups(self) -> int:
        """Texture fetches of one evaluation."""
        return len(self.matrices())


def describe_projection(projection: Projection) -> dict[str, Any]:
    """The JSON-able description of a projection, as a manifest explains it."""
    matrices = projection.matrices()
    return {
        "name": projection.name,
        "coordinates": projection.coordinates,
        "axes": list(projection.system.axes),
        "matrix": projection.matrix.tolist(),
        "scale": projection.matrix.norm(dim=1).tolist(),
        "reciprocal": projection.reciprocal,
        "conjugate_matrix": matrices[1].tolist() if len(matrices) == 2 else None,
        "lookups": projection.lookups,
        "warp": None if projection.warp is None else {"width": projection.warp.width},
        "rotation": _rotation(projection.rotation),
    }


def _rotation(rotation: Pair | Tensor | None) -> dict[str, Any] | None:
    if isinstance(rotation, Pair):
        return {"kind": "pair", "left": rotation.left.tolist(), "right": rotation.right.tolist()}
    if isinstance(rotation, torch.Tensor):
        return {"kind": "single", "quaternion": rotation.tolist()}
    return None


# Fixed projections: parameterization and the axes that become the texture's columns and rows.
_FIXED = {
    "wi": ("in-out", ("u_i", "v_i")),
    "wo": ("in-out", ("u_o", "v_o")),
    "h": ("half-diff", ("u_h", "v_h")),
    "d": ("half-diff", ("u_d", "v_d")),
    "theta_h-theta_d": ("isotropic-half-diff", ("theta_h", "theta_d")),
    "theta_d-phi_d": ("isotropic-half-diff", ("theta_d", "phi_d")),
    "theta_h-phi_d": ("isotropic-half-diff", ("theta_h", "phi_d")),
    "theta_i-theta_o": ("isotropic-in-out", ("theta_i", "theta_o")),
    "theta_i-delta_phi": ("isotropic-in-out", ("theta_i", "delta_phi")),
    "theta_h": ("isotropic-half-diff", ("theta_h",)),
    "theta_d": ("isotropic-half-diff", ("theta_d",)),
    "theta_i": ("isotropic-in-out", ("theta_i",)),
}
FIXED_PROJECTIONS = tuple(_FIXED)


def fixed_projection(name: str, reciprocal: bool, warp: Warp | None = None) -> Projection:
    """The projection of that name: two coordinates taken as they are, or one for a 1D texture.

    Raises BadInput that lists the names.
    """
    if name not in _FIXED:
        raise BadInput(f"projection: found {name!r}, expected one of {', '.join(_FIXED)}")
    coordinates, axes = _FIXED[name]
    system = coordinate_system(coordinates)
    rows = torch.zeros(2, system.dimension, dtype=torch.float64)
    for row, axis in enumerate(axes):
        rows[row, system.axes.index(axis)] = 1
    return Projection(coordinates, rows, reciprocal, name=name, warp=warp)
