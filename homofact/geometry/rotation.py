"""Unit quaternions (w, x, y, z), and rotations of R⁴ and R³ made of them (thesis 2.3).

Every rotation of R⁴ is v ↦ S v T for a pair of unit quaternions S and T, v read as a quaternion; (S, T) and
(−S, −T) are the same rotation. Composition (first b, then a) is (Sa Sb, Tb Ta), and the power x of a
pair raises both: Q^x = (cos xα, sin xα · n) for Q = (cos α, sin α · n). A pair of unit imaginary
quaternions, as the six basis rotations have, is therefore periodic in x with period 4: the thesis's
4π when t is an angle, x = 2t/π.

A rotation of R³ is v ↦ q v q⁻¹ for a single quaternion q: the pair (q, q⁻¹), which leaves the real axis alone.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from torch import Tensor

from homofact.errors import BadInput
from homofact.geometry.namespace import namespace


def multiply(a: Any, b: Any) -> Any:
    """Return the quaternion product ab, (..., 4), of tensors or of arrays."""
    aw, ax, ay, az = (a[..., k] for k in range(4))
    bw, bx, by, bz = (b[..., k] for k in range(4))
    return namespace(a).stack(
        (
            aw * bw - ax * bx - ay * by - az * bz,
            aw * bx + ax * bw + ay * bz - az * by,
            aw * by - ax * bz + ay * bw + az * bx,
            aw * bz + ax * by - ay * bx + az * bw,
        ),
        -1,
    )


def conjugate(q: Tensor) -> Tensor:
    """Return (w, −x, −y, −z): the inverse of a unit quaternion."""
    return q * torch.tensor([1, -1, -1, -1], dtype=q.dtype, device=q.device)


def power(q: Tensor, exponent: float | Tensor) -> Tensor:
    """q^exponent of unit quaternions (..., 4), by the angle α in [0, π] of q = (cos α, sin α n).

    The rotation axis of −1 is undefined; the function uses x, so that powers of −1 are continuous.
    """
    vector = q[..., 1:]
    sine = vector.norm(dim=-1, keepdim=True)
    alpha = torch.atan2(sine, q[..., :1])
    x_axis = torch.zeros_like(vector)
    x_axis[..., 0] = 1
    axis = torch.where(sine > 0, vector / sine.clamp_min(torch.finfo(q.dtype).tiny), x_axis)
    angle = alpha * exponent
    return torch.cat((torch.cos(angle), torch.sin(angle) * axis), -1)


@dataclass(frozen=True)
class Rotation:
    """A rotation of R⁴ (unit quaternions left and right, rows (2, 4)) or of R³ (one, rows (1, 4)), in float64."""

    quaternions: Tensor

    def __post_init__(self) -> None:
        """Refuse what is neither one quaternion nor a pair."""
        if tuple(self.quaternions.shape) not in ((1, 4), (2, 4)):
            found = tuple(self.quaternions.shape)
            raise BadInput(where="rotation", found=f"quaternions of shape {found}", expected="(1, 4) or (2, 4)")

    @classmethod
    def pair(cls, left: Tensor, right: Tensor) -> "Rotation":
        """Return the rotation v ↦ left · v · right of R⁴."""
        return cls(torch.stack((left, right)))

    @classmethod
    def single(cls, quaternion: Tensor) -> "Rotation":
        """Return the rotation v ↦ q v q⁻¹ of R³."""
        return cls(quaternion[None])

    @classmethod
    def of_numbers(cls, numbers: Tensor) -> "Rotation":
        """Return the rotation of 4 or 8 numbers (or of rows of 4), normalised to unit quaternions."""
        return cls(numbers.reshape(-1, 4)).normalized()

    @classmethod
    def random(cls, generator: torch.Generator, dimension: int = 4) -> "Rotation":
        """Return a random rotation, uniform on SO(4) or SO(3): every quaternion is uniform on the sphere."""
        count = 2 if dimension == 4 else 1
        return cls.of_numbers(torch.randn(count, 4, dtype=torch.float64, device="cpu", generator=generator))

    @classmethod
    def from_matrix(cls, matrix: Tensor) -> "Rotation":
        """Return the rotation of a 3 × 3 or 4 × 4 matrix: the inverse of `matrix`.

        The products lᵢ v rⱼ of basis quaternions make 16 matrices Mᵢⱼ that are orthogonal to one another, so
        ⟨R, Mᵢⱼ⟩/4 = leftᵢ rightⱼ, a matrix of rank one whose singular vectors are the pair (van Elfrinkhof 1897).
        """
        if matrix.shape[0] == 3:
            whole = torch.block_diag(torch.ones_like(matrix[:1, :1]), matrix)
            return cls(cls.from_matrix(whole).quaternions[:1])
        basis = torch.eye(4, dtype=matrix.dtype, device=matrix.device)
        shares = torch.stack(
            [torch.stack([(cls.pair(left, right).matrix() * matrix).sum() / 4 for right in basis]) for left in basis]
        )
        u, _, v = torch.linalg.svd(shares)
        left, right = u[:, 0], v[0]
        sign = torch.sign(left @ shares @ right)
        return cls.pair(left * sign, right)

    @property
    def dimension(self) -> int:
        """4 for a pair, 3 for a single quaternion."""
        return 4 if len(self.quaternions) == 2 else 3

    @property
    def numbers(self) -> Tensor:
        """All numbers (8,) or (4,), the left quaternion's first."""
        return self.quaternions.reshape(-1)

    def __matmul__(self, other: "Rotation") -> "Rotation":
        """Composition: (a @ b) turns by b first, then by a (thesis 2.3.1)."""
        products = [multiply(self.quaternions[0], other.quaternions[0])]
        if self.dimension == 4:
            products.append(multiply(other.quaternions[1], self.quaternions[1]))
        return Rotation(torch.stack(products))

    def __pow__(self, exponent: float) -> "Rotation":
        """Every quaternion raised: the rotation made `exponent` times."""
        return Rotation(power(self.quaternions, exponent))

    def inverse(self) -> "Rotation":
        """Return the rotation that undoes this one."""
        return Rotation(conjugate(self.quaternions))

    def normalized(self) -> "Rotation":
        """Return the rotation with unit quaternions again, which removes the rounding drift of long products."""
        return Rotation(self.quaternions / self.quaternions.norm(dim=1, keepdim=True))

    def matrix(self) -> Tensor:
        """Return the 4 × 4 matrix R with R v = left · v · right, or the 3 × 3 one with R v = q v q⁻¹."""
        q = self.quaternions
        left, right = (q[0], q[1]) if self.dimension == 4 else (q[0], conjugate(q[0]))
        if q.requires_grad or q.device.type != "cpu":
            basis = torch.eye(4, dtype=q.dtype, device=q.device)
            images = multiply(multiply(left, basis), right).T
        else:
            # A search makes thousands of them, and an operation on four numbers takes torch five times as long.
            first, last = left.numpy(), right.numpy()
            images = torch.from_numpy(multiply(multiply(first, np.eye(4, dtype=first.dtype)), last).T)
        return images if self.dimension == 4 else images[1:, 1:]


def basis_rotations(dimension: int = 4) -> tuple[Rotation, ...]:
    """Return the starting directions of a search.

    In R⁴ d1 … d6 of the thesis (3.1.1): i, j, k on the left, then on the right; in R³ i, j, k.
    """
    one = torch.eye(4, dtype=torch.float64, device="cpu")
    if dimension == 3:
        return tuple(Rotation.single(one[k]) for k in (1, 2, 3))
    return tuple(Rotation.pair(one[k], one[0]) for k in (1, 2, 3)) + tuple(
        Rotation.pair(one[0], one[k]) for k in (1, 2, 3)
    )
