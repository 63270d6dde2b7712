"""Projections: functions from a pair of directions to texture coordinates.

A projection is a 2 × k matrix on one of the named coordinates, its rows scaled so that the image of the
coordinates' domain just fits the texture square [−1, 1]². With orthonormal rows (thesis 2.3.1, appendix
A: any linear projection is an orthonormal one up to a linear map of the texture) the tight bound of a
row (a, b, c, d) on two discs is |(a, b)| + |(c, d)|; the thesis uses the 4-cube, |a| + |b| + |c| + |d|,
as one does for a box of angles. A one-dimensional texture has a second row of zeros.

The conjugate π* of a projection is P S with S the matrix that swaps ωi and ωo in its coordinates: π*(ωi, ωo) = π(ωo,
ωi). A reciprocal projection that is not its own conjugate looks its texture up twice (thesis 3.2.3).

If a row is ±1 at a periodic coordinate and zero elsewhere, its texture axis is periodic (`linear.layout`). Any other
row with a nonzero entry at a periodic coordinate would be discontinuous there, and homofact rejects it.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from homofact.errors import BadInput
from homofact.factor.fixed_projections import BOUNDS, FIXED_AXES
from homofact.factor.rows import axes_of_rows, check_rows, lookup_matrices
from homofact.geometry.coordinates import CoordinateSystem, coordinate_system
from homofact.linear.arrays import Held, as_arrays
from homofact.linear.names import Axes, Axis, Shape

if TYPE_CHECKING:
    from torch import Tensor

    from homofact.geometry.rotation import Rotation
    from homofact.linear.layout import TexelLayout

# What a warp stretches, in whatever system.
WARPED_AXES = ("u_h", "v_h", "theta_h")


def row_bounds(matrix: "Tensor", domain: str, bound: str) -> "Tensor":
    """Return the largest |row · x| (2,) over the domain: the tight bound ("disc") or that of the thesis ("cube")."""
    if domain == "discs" and bound == "disc":
        return matrix[:, :2].norm(dim=1) + matrix[:, 2:].norm(dim=1)
    return matrix.abs().sum(1)


def bound_slopes(rows: np.ndarray, slope: np.ndarray, domain: str, bound: str) -> np.ndarray:
    """Return the derivative by the unscaled rows (2, k), given the derivative s by rows/b: s/b − (s · row) ∇b/b²."""
    if domain == "discs" and bound == "disc":
        lengths = np.sqrt((rows.reshape(2, 2, 2) ** 2).sum(2))
        size = lengths.sum(1, keepdims=True)
        by_row = (rows.reshape(2, 2, 2) / np.maximum(lengths, 1e-300)[:, :, None]).reshape(2, 4)
    else:
        size, by_row = np.abs(rows).sum(1, keepdims=True), np.sign(rows)
    return slope / size - (slope * rows).sum(1, keepdims=True) * by_row / size**2


def swap_of(system: CoordinateSystem) -> "Tensor":
    """Return the swap matrix S (k, k) of the module docstring, float64."""
    import torch

    return torch.tensor(system.swap, dtype=torch.float64, device="cpu")


@dataclass(frozen=True)
class Warp:
    """A stretching of the half vector's angle, so that a narrow specular peak covers many texels.

    ρ ↦ asinh(ρ/width)/asinh(1/width) on ρ in [0, 1]: linear up to `width`, logarithmic beyond. ρ is the
    parabolic radius of h in half-diff and θh/(π/2) where θh is an axis.
    """

    width: float

    def on(self, system: CoordinateSystem, coordinates: "Tensor") -> "Tensor":
        """Return the coordinates (N, k) with the half-vector part stretched. Raises BadInput if there is none."""
        return system.stretch(coordinates, self.width)


@dataclass(frozen=True)
class Projection:
    """A 2 × k matrix (float64, rows already scaled) on named coordinates.

    For a searched projection, `quaternions` (2 or 1, 4) are those of the rotation of R⁴ (k = 4) or R³ (k = 3) that
    gives the matrix. `name` is the name of a fixed projection ("h", "theta_h-theta_d") or "searched". The matrix and
    the quaternions are NumPy arrays; tensors are converted.
    """

    coordinates: str
    matrix: Held
    reciprocal: bool
    name: str = "searched"
    quaternions: Held | None = None
    warp: Warp | None = None

    def __post_init__(self) -> None:
        """Refuse a matrix that does not fit the coordinates or is not finite."""
        as_arrays(self, "matrix", "quaternions")
        check_rows(self.matrix, self.system)

    @property
    def rotation(self) -> "Rotation | None":
        """The rotation that gives the matrix; None for a fixed projection."""
        if self.quaternions is None:
            return None
        import torch

        from homofact.geometry.rotation import Rotation

        return Rotation(torch.from_numpy(self.quaternions))

    @property
    def one_way(self) -> bool:
        """Whether the texture coordinates change if ωi and ωo are swapped."""
        swapped = self.matrix @ np.array(self.system.swap, dtype=self.matrix.dtype)
        return not self.reciprocal and not np.array_equal(swapped, self.matrix)

    @property
    def axes(self) -> Axes:
        """The kinds of the texture's axes (rows, columns): `linear.layout`."""
        return axes_of_rows(self.matrix, self.system)

    @property
    def system(self) -> CoordinateSystem:
        """The coordinates that the matrix acts on."""
        return coordinate_system(self.coordinates)

    @classmethod
    def from_rows(
        cls, coordinates: str, rows: "Tensor", reciprocal: bool, bound: str = "disc", **more: object
    ) -> "Projection":
        """Return the projection with `rows` (2, k) scaled to fit the texture square; a zero row stays zero."""
        if bound not in BOUNDS:
            raise BadInput(where="bound", found=repr(bound), expected=f"one of {', '.join(BOUNDS)}")
        import torch

        largest = row_bounds(rows, coordinate_system(coordinates).domain, bound)
        scale = torch.where(largest > 0, 1 / largest.clamp_min(1e-300), torch.zeros_like(largest))
        return cls(coordinates, rows * scale[:, None], reciprocal, **more)  # type: ignore[arg-type]

    @classmethod
    def from_rotation(
        cls, coordinates: str, rotation: "Rotation", reciprocal: bool, bound: str = "disc", warp: Warp | None = None
    ) -> "Projection":
        """Return the first two rows of a rotation of R⁴ or R³.

        Basis vectors e1, e2 turned by R give the rows (R e1)ᵀ, (R e2)ᵀ, as in the thesis (2.3.1).
        """
        rows = rotation.matrix().T[:2].contiguous()
        return cls.from_rows(coordinates, rows, reciprocal, bound, quaternions=rotation.quaternions, warp=warp)

    def place(self, wi: "Tensor", wo: "Tensor") -> "tuple[Tensor, ...]":
        """Return texture coordinates in [−1, 1]², one (N, 2) tensor per lookup (two lookups with a conjugate)."""
        return self.place_coordinates(self.prepare(wi, wo))

    def prepare(self, wi: "Tensor", wo: "Tensor") -> "Tensor":
        """Return the coordinates (N, k) that the matrix acts on, warped where this projection warps."""
        return self.system.evaluate(wi, wo, None if self.warp is None else self.warp.width)

    def place_coordinates(self, x: "Tensor") -> "tuple[Tensor, ...]":
        """As `place`, from coordinates (N, k) that `prepare` made."""
        return tuple(x @ matrix.to(x).T for matrix in self.matrices())

    @property
    def lookup_matrices(self) -> tuple[np.ndarray, ...]:
        """The matrix of every lookup: P alone, or P and its conjugate P S (`rows.lookup_matrices`)."""
        return lookup_matrices(self.matrix, self.system, self.reciprocal, self.quaternions is not None)

    def matrices(self) -> "tuple[Tensor, ...]":
        """Return `lookup_matrices` as tensors."""
        import torch

        return tuple(torch.from_numpy(matrix) for matrix in self.lookup_matrices)

    @property
    def lookups(self) -> int:
        """Texture fetches of one evaluation."""
        return len(self.lookup_matrices)


def describe_projection(projection: Projection) -> dict[str, Any]:
    """Return the JSON-able description of a projection for a manifest."""
    matrices = projection.lookup_matrices
    return {
        "name": projection.name,
        "coordinates": projection.coordinates,
        "axes": list(projection.system.axes),
        "matrix": projection.matrix.tolist(),
        "scale": np.linalg.norm(projection.matrix, axis=1).tolist(),
        "reciprocal": projection.reciprocal,
        "conjugate_matrix": matrices[1].tolist() if len(matrices) == 2 else None,
        "lookups": projection.lookups,
        "warp": None if projection.warp is None else {"width": projection.warp.width},
        "rotation": _rotation(projection.quaternions),
        "periodic": [axis is Axis.PERIODIC for axis in reversed(projection.axes)],
    }


def _rotation(quaternions: np.ndarray | None) -> dict[str, Any] | None:
    if quaternions is None:
        return None
    rows = quaternions.tolist()
    if len(rows) == 2:
        return {"kind": "pair", "left": rows[0], "right": rows[1]}
    return {"kind": "single", "quaternion": rows[0]}


def fixed_projection(name: str, reciprocal: bool, warp: Warp | None = None) -> Projection:
    """Return the fixed projection `name`: two coordinates as texture axes, or one coordinate for a 1D texture.

    Raises BadInput that lists the names.
    """
    if name not in FIXED_AXES:
        raise BadInput(where="projection", found=repr(name), expected=f"one of {', '.join(FIXED_AXES)}")
    coordinates, axes = FIXED_AXES[name]
    system = coordinate_system(coordinates)
    rows = np.zeros((2, system.dimension))
    for row, axis in enumerate(axes):
        rows[row, system.axes.index(axis)] = 1
    return Projection(coordinates, rows, reciprocal, name=name, warp=warp)


def layout_of(projections: tuple[Projection, ...], shapes: tuple[Shape, ...]) -> "TexelLayout":
    """Return the texel layout of textures with these shapes (rows, columns), one per projection."""
    from homofact.linear.layout import TexelLayout

    return TexelLayout(tuple(shapes), tuple(projection.axes for projection in projections))
