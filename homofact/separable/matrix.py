"""The BRDF matrix: f at every pair of texels of two direction maps.

With the parameterization in-out, rows are ωi and columns ωo on equal maps, so the matrix of a reciprocal BRDF is
symmetric. With half-diff, rows are h and columns d (in Kautz and McCool's frame). A pair whose ωi or ωo lies below the
horizon is not `valid`. Its entry is the value at directions raised to the horizon, which serves as a start for methods
that fit only valid entries. Only texels that a direction reads have a row.
"""

from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from homofact.brdf.reflectance import Reflectance
from homofact.errors import BadInput
from homofact.geometry.coordinates import coordinate_system
from homofact.geometry.directions import from_half_difference
from homofact.separable.decomposition_names import SIDES
from homofact.separable.maps import DirectionMap, raised

# A float64 matrix beyond this is refused: its decomposition would need several times as much.
MOST_BYTES = 2 << 30
_CHUNK = 200_000
# Coordinates in [0, 1] that differ by less are one; 21 bits hold their whole multiples.
_SAME = 1e-6


@dataclass(frozen=True)
class BrdfMatrix:
    """The `values` (n, n, C) in sr⁻¹ without the cosine, `valid` (n, n) bool, and `read` (size²,) bool with n Trues.

    `weights` (n,) are the projected solid angles of the texels, up to a factor."""

    values: Tensor
    valid: Tensor
    read: Tensor
    weights: Tensor
    size: int
    map: DirectionMap
    parameterization: str

    def texture(self, factor: Tensor) -> Tensor:
        """Return the (size, size) texture of one factor (n,); texels that no direction reads are 0."""
        whole = factor.new_zeros(self.size**2)
        whole[self.read] = factor
        return whole.reshape(self.size, self.size)


def brdf_matrix(
    reflectance: Reflectance,
    map: DirectionMap,
    size: int,
    parameterization: str = "in-out",
    *,
    isotropic: bool = False,
    reciprocal: bool = True,
) -> BrdfMatrix:
    """Evaluate `reflectance` at all pairs of texels of `size`² maps.

    `isotropic`: pairs that differ only by rotation about the normal, mirroring, or exchange of light and viewer are
    evaluated once (an isotropic interpolant is reciprocal). `reciprocal` makes an in-out matrix exactly symmetric, by
    the mean of both exchanges. Raises BadInput for an unknown parameterization, and for a size below 2 or with too
    large a matrix.
    """
    if parameterization not in SIDES:
        raise BadInput(where="parameterization", found=repr(parameterization), expected=" or ".join(SIDES))
    if size < 2:
        raise BadInput(where="size", found=size, expected="at least 2")
    channels = len(reflectance.channels)
    most = int((MOST_BYTES / (8 * channels)) ** 0.25)
    # At least half of the texels are read: what is far too large is refused before so many directions are made.
    if size > 2 * most:
        raise BadInput(where="size", found=size, expected=f"at most about {most}")
    read = map.read(size)
    directions = map.texel_directions(size)[read]
    n = len(directions)
    if n * n * channels * 8 > MOST_BYTES:
        raise BadInput(
            where="size", found=f"{size}, a matrix of {n} x {n} x {channels}", expected=f"at most about {most}"
        )
    values = torch.empty(n, n, channels, dtype=torch.float64)
    valid = torch.ones(n, n, dtype=torch.bool)
    symmetric = parameterization == "in-out" and reciprocal
    step = max(1, _CHUNK // n)
    if isotropic:
        _fill_alike(reflectance, directions, parameterization, values, valid)
    else:
        for begin in range(0, n, step):
            rows = slice(begin, min(begin + step, n))
            # Half of a symmetric matrix is the other half.
            first = begin if symmetric else 0
            wi, wo, above = _placed(*_all_pairs(directions[rows], directions[first:]), parameterization)
            part = reflectance.evaluate(wi, wo)
            if symmetric:
                part = (part + reflectance.evaluate(wo, wi)) / 2
            values[rows, first:] = part.reshape(-1, n - first, channels)
            valid[rows, first:] = above.reshape(-1, n - first)
            if symmetric:
                values[first:, rows] = values[rows, first:].transpose(0, 1).clone()
    if symmetric:
        values = (values + values.transpose(0, 1)) / 2
    if not bool(torch.isfinite(values).all()):
        raise BadInput(where="matrix", found="values that are not finite at some texels", expected="finite reflectance")
    return BrdfMatrix(values, valid, read, map.texel_weights(size)[read], size, map, parameterization)


def _all_pairs(rows: Tensor, columns: Tensor) -> tuple[Tensor, Tensor]:
    return rows.repeat_interleave(len(columns), 0), columns.repeat(len(rows), 1)


def _placed(first: Tensor, second: Tensor, parameterization: str) -> tuple[Tensor, Tensor, Tensor]:
    """(wi, wo, above) of the pairs of a row's and a column's direction; raised where they are under the horizon."""
    if parameterization == "in-out":
        return first, second, torch.ones(len(first), dtype=torch.bool)
    wi, wo = from_half_difference(first, second)
    above = (wi[:, 2] >= 0) & (wo[:, 2] >= 0)
    return raised(wi), raised(wo), above


def _fill_alike(
    reflectance: Reflectance, directions: Tensor, parameterization: str, values: Tensor, valid: Tensor
) -> None:
    """One evaluation for all pairs of one (θh, θd, |φd|): a square grid has each up to sixteen times."""
    n = len(directions)
    system = coordinate_system("isotropic-half-diff")
    step = max(1, _CHUNK // n)
    keys = torch.empty(n * n, dtype=torch.int64)
    for begin in range(0, n, step):
        rows = directions[begin : begin + step]
        wi, wo, above = _placed(*_all_pairs(rows, directions), parameterization)
        valid[begin : begin + step] = above.reshape(-1, n)
        place = system.evaluate(wi, wo)
        # φd means nothing where ωi = ωo or h is the normal: there it is rounding alone.
        place[:, 2] = torch.where((place[:, :2] < _SAME - 1).any(1), -1.0, place[:, 2])
        whole = torch.round((place + 1) / (2 * _SAME)).to(torch.int64)
        keys[begin * n : begin * n + len(whole)] = (whole[:, 0] << 42) | (whole[:, 1] << 21) | whole[:, 2]
    _, chosen, back = np.unique(keys.numpy(), return_index=True, return_inverse=True)
    del keys
    found = torch.empty(len(chosen), values.shape[2], dtype=torch.float64)
    for begin in range(0, len(chosen), _CHUNK):
        part = torch.from_numpy(chosen[begin : begin + _CHUNK])
        wi, wo, _ = _placed(directions[part // n], directions[part % n], parameterization)
        found[begin : begin + len(part)] = reflectance.evaluate(wi, wo)
    values.reshape(-1, values.shape[2])[:] = found[torch.from_numpy(back)]
