"""A common basis of log textures: the principal components of the textures of many materials.

If the textures of several materials have the same projections and gauge (`gauge.in_gauge`), each material is a vector y
of T texels times C channels. Their mean and the first N principal directions represent all of them, as Nielsen, Jensen
and Ramamoorthi 2015 do for the values of MERL in a log mapping: y ≈ ȳ + U c, with N numbers c per material. The
coefficients that fit the samples best differ from those that fit the texels best. Since f̃ ≈ B(ȳ + Uc) is linear in c,
c is solved from the normal equations of the samples, UᵀBᵀWBU c = UᵀBᵀW(f̃ − Bȳ).
"""

from dataclasses import dataclass

import torch
from torch import Tensor

from homofact.errors import BadInput
from homofact.linear.normal import NormalEquations

_RIDGE = 1e-10  # of the mean diagonal: directions that no sample sees stay at 0


@dataclass(frozen=True)
class LogBasis:
    """The mean (T, C) and the principal directions (N, T, C) of log textures, sorted by falling variance."""

    mean: Tensor
    directions: Tensor

    @classmethod
    def of(cls, stack: Tensor, count: int) -> "LogBasis":
        """Return the basis of the textures (M, T, C) of M materials. Raises BadInput for a `count` above M − 1."""
        materials = len(stack)
        if not 1 <= count < materials:
            raise BadInput(where="basis", found=f"{count} for {materials} materials", expected=f"1 to {materials - 1}")
        mean = stack.mean(0)
        _, _, directions = torch.linalg.svd((stack - mean).flatten(1), full_matrices=False)
        return cls(mean, directions[:count].reshape(count, *mean.shape))

    @property
    def count(self) -> int:
        """The number N of directions."""
        return len(self.directions)

    def first(self, count: int) -> "LogBasis":
        """Return the basis of the first `count` directions."""
        return LogBasis(self.mean, self.directions[:count])

    def projected(self, texels: Tensor) -> Tensor:
        """Return the coefficients (N,) whose texels are nearest to the given ones (T, C)."""
        return self.directions.flatten(1) @ (texels - self.mean).flatten()

    def solved(self, equations: NormalEquations) -> Tensor:
        """Return the coefficients (N,) that fit the samples best, from their accumulated normal equations."""
        directions = self.directions
        seen = torch.einsum("tu,nuc->ntc", equations.matrix, directions)
        matrix = torch.einsum("mtc,ntc->mn", directions, seen)
        right = torch.einsum("ntc,tc->n", directions, equations.rhs - equations.matrix @ self.mean)
        matrix = matrix + _RIDGE * matrix.diagonal().mean() * torch.eye(self.count).to(matrix)
        return torch.linalg.solve(matrix, right)

    def texels(self, coefficients: Tensor) -> Tensor:
        """Return the textures (T, C) of coefficients (N,)."""
        return self.mean + torch.einsum("n,ntc->tc", coefficients.to(self.mean), self.directions)


def of_channel(equations: NormalEquations, number: int) -> NormalEquations:
    """Return the equations of one channel alone."""
    own = slice(number, number + 1)
    return NormalEquations(equations.matrix, equations.rhs[:, own], equations.energy[own], equations.weight)
