"""Unit quaternions (w, x, y, z), and pairs of them as rotations of R⁴ (thesis 2.3).

Every rotation of R⁴ is v ↦ S v T for unit quaternions S and T, v read as a quaternion; (S, T) and
(−S, −T) are the same rotation. Composition (first b, then a) is (Sa Sb, Tb Ta), and the power x of a
pair raises both: Q^x = (cos xα, sin xα · n) for Q = (cos α, sin α · n). A pair of unit imaginary
quaternions, as the six basis rotations have, is therefore periodic in x with period 4: the thesis's
4π when t is an angle, x = 2t/π.
"""

from dataclasses import dataclass

import torch
from torch import Tensor

IDENTITY = (1.0, 0.0, 0.0, 0.0)


def multiply(a: Tensor, b: Tensor) -> Tensor:
    """The quaternion product ab, (..., 4)."""
    aw, ax, ay, az = a.unbind(-1)
    bw, bx, by, bz = b.unbind(-1)
    return torch.stack(
        (
            aw * bw - ax * bx - ay * by - az * bz,
            aw * bx + ax * bw + ay * bz - az * by,
            aw * by - ax * bz + ay * bw + az * bx,
            aw * bz + ax * by - ay * bx + az * bw,
        ),
        -1,
    )


def conjugate(q: Tensor) -> Tensor:
    """(w, −x, −y, −z): the inverse of a unit quaternion."""
    return q * torch.tensor([1, -1, -1, -1], dtype=q.dtype, device=q.device)


def power(q: Tensor, exponent: float | Tensor) -> Tensor:
    """q^exponent of unit quaternions (..., 4), by the angle α in [0, π] of q = (cos α, sin α n).

    −1 has no axis of its own; x is taken, so that powers of it stay continuous.
    """
    vector = q[..., 1:]
    sine = vector.norm(dim=-1, keepdim=True)
    alpha = torch.atan2(sine, q[..., :1])
    x_axis = torch.zeros_like(vector)
    x_axis[..., 0] = 1
    axis = torch.where(sine > 0, vector / sine.clamp_min(torch.finfo(q.dtype).tiny), x_axis)
    angle = alpha * exponent
    return torch.cat((torch.cos(angle), torch.sin(angle) * axis), -1)


def rotation3(q: Tensor) -> Tensor:
    """The 3 × 3 rotation v ↦ q v q⁻¹ of a unit quaternion (4,); rows are the images of the axes' duals."""
    basis = torch.eye(3, dtype=q.dtype, device=q.device)
    vectors = torch.cat((torch.zeros(3, 1, dtype=q.dtype, device=q.device), basis), 1)
    images = multiply(multiply(q.expand(3, 4), vectors), conjugate(q).expand(3, 4))
    return images[:, 1:].T


@dataclass(frozen=True)
class Pair:
    """A rotation of R⁴, v ↦ left · v · right, as two unit quaternions (4,) in float64."""

    left: Tensor
    right: Tensor

    @classmethod
    def identity(cls) -> "Pair":
        """The rotation that moves nothing."""
        one = torch.tensor(IDENTITY, dtype=torch.float64)
        return cls(one, one.clone())

    @classmethod
    def random(cls, generator: torch.Generator) -> "Pair":
        """Uniform on SO(4): both quaternions uniform on the sphere."""
        left, right = torch.randn(2, 4, dtype=torch.float64, generator=generator)
        return cls(left / left.norm(), right / right.norm())

    def __matmul__(self, other: "Pair") -> "Pair":
        """Composition: (a @ b) turns by b first, then by a (thesis 2.3.1)."""
        return Pair(multiply(self.left, other.left), multiply(other.right, self.right))

    def __pow__(self, exponent: float) -> "Pair":
        """Both quaternions raised: the rotation made `exponent` times."""
        return Pair(power(self.left, exponent), power(self.right, exponent))

    def inverse(self) -> "Pair":
        """The rotation that undoes this one."""
        return Pair(conjugate(self.left), conjugate(self.right))

    def normalized(self) -> "Pair":
        """Both quaternions back at length 1, against the drift of long products."""
        return Pair(self.left / self.left.norm(), self.right / self.right.norm())

    def apply(self, v: Tensor) -> Tensor:
        """The images (..., 4) of vectors (..., 4)."""
        return multiply(multiply(self.left.expand_as(v), v), self.right.expand_as(v))

    def matrix(self) -> Tensor:
        """The 4 × 4 matrix R with R v = left · v · right."""
        return self.apply(torch.eye(4, dtype=self.left.dtype, device=self.left.device)).T


def basis_rotations() -> tuple[Pair, ...]:
    """The six starting directions d1 … d6 of the thesis (3.1.1): i, j, k on the left, then on the right."""
    one = torch.eye(4, dtype=torch.float64)
    return tuple(Pair(one[k], one[0]) for k in (1, 2, 3)) + tuple(Pair(one[0], one[k]) for k in (1, 2, 3))


def from_matrix(matrix: Tensor) -> Pair | Tensor:
    """The quaternion (4,) of a 3 × 3 rotation, or the pair of a 4 × 4 one; the inverse of `rotation3` and `matrix`.

    The products lᵢ v rⱼ of basis quaternions make 16 matrices Mᵢⱼ that are orthogonal to one another, so
    ⟨R, Mᵢⱼ⟩/4 = leftᵢ rightⱼ, a matrix of rank one whose singular vectors are the pair (van Elfrinkhof 1897).
    A 3D rotation is the 4D one that leaves the real axis alone, with right = left⁻¹.
    """
    if matrix.shape[0] == 3:
        whole = torch.block_diag(torch.ones(1, 1, dtype=matrix.dtype), matrix)
        pair = from_matrix(whole)
        assert isinstance(pair, Pair)
        return pair.left
    basis = torch.eye(4, dtype=matrix.dtype)
    shares = torch.stack(
        [torch.stack([(Pair(left, right).matrix() * matrix).sum() / 4 for right in basis]) for left in basis]
    )
    u, _, v = torch.linalg.svd(shares)
    left, right = u[:, 0], v[0]
    sign = torch.sign(left @ shares @ right)
    return Pair(left * sign, right)
