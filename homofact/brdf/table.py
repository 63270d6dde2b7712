"""A BRDF tabulated over the angles of both directions, as in most databases, with multilinear interpolation."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import torch
from torch import Tensor

from homofact.brdf.in_kind import answering_in_kind
from homofact.errors import BadInput
from homofact.geometry.directions import to_spherical


@dataclass(frozen=True)
class TableAxis:
    """The increasing nodes (n,) of one angle in radians; values beyond the ends are constant, or wrap if `periodic`."""

    nodes: Tensor
    periodic: bool = False

    def __post_init__(self) -> None:
        """Refuse no nodes, and nodes that do not rise."""
        if self.nodes.ndim != 1 or not len(self.nodes) or bool((self.nodes.diff() <= 0).any()):
            raise BadInput("an axis has no nodes or they do not rise", where="table", expected="rising angles")

    def locate(self, x: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """Return (node below, node above, fraction in [0, 1]) of angles (N,)."""
        n, nodes = len(self.nodes), self.nodes
        if self.periodic:
            x = torch.remainder(x - nodes[0], 2 * math.pi) + nodes[0]
            nodes = torch.cat((nodes, nodes[:1] + 2 * math.pi))
        if len(nodes) == 1:
            zero = torch.zeros(x.shape, dtype=torch.long)
            return zero, zero, torch.zeros_like(x)
        low = (torch.searchsorted(nodes, x.contiguous(), right=True) - 1).clamp(0, len(nodes) - 2)
        fraction = ((x - nodes[low]) / (nodes[low + 1] - nodes[low])).clamp(0, 1)
        return low, (low + 1) % n if self.periodic else low + 1, fraction


@dataclass(frozen=True)
class AngleTable:
    """A `Reflectance` of `values` in sr⁻¹ without the cosine at the nodes of its axes.

    Isotropic: axes θi, θo, |Δφ| in [0, π] and values (θi, θo, Δφ, C). Anisotropic: axes θi, φi, θo, φo and
    values (θi, φi, θo, φo, C). Values are multilinear between nodes, and constant beyond the last node of an axis.
    Raises BadInput for shapes that disagree.
    """

    axes: tuple[TableAxis, ...]
    values: Tensor
    channels: tuple[str, ...]

    def __post_init__(self) -> None:
        """Refuse shapes that disagree."""
        expected = (*(len(axis.nodes) for axis in self.axes), len(self.channels))
        if len(self.axes) not in (3, 4) or tuple(self.values.shape) != expected:
            raise BadInput(
                f"values have shape {tuple(self.values.shape)}", where="table", expected=f"{expected} over 3 or 4 axes"
            )

    @property
    def isotropic(self) -> bool:
        """Whether there are three axes."""
        return len(self.axes) == 3

    @property
    def nbytes(self) -> int:
        """Bytes of the values as they are held."""
        return self.values.numel() * self.values.element_size()

    @property
    def fetches(self) -> int:
        """Nodes read for one value: 8 or 16."""
        return 1 << len(self.axes)

    @answering_in_kind
    def evaluate(self, wi: Tensor, wo: Tensor) -> Tensor:
        """Return BRDF values (N, C) in sr⁻¹, without the cosine; 0 where a direction is under the horizon."""
        above = ((wi[:, 2] >= 0) & (wo[:, 2] >= 0))[:, None]
        flat = self.values.reshape(-1, len(self.channels))
        places = [axis.locate(x) for axis, x in zip(self.axes, self._angles(wi.double(), wo.double()), strict=True)]
        total = torch.zeros(wi.shape[0], len(self.channels), dtype=torch.float64)
        for corner in range(1 << len(places)):
            index = torch.zeros(wi.shape[0], dtype=torch.long)
            share = torch.ones(wi.shape[0], dtype=torch.float64)
            for k, (low, high, fraction) in enumerate(places):
                up = corner >> k & 1
                index = index * self.values.shape[k] + (high if up else low)
                share = share * (fraction if up else 1 - fraction)
            total += flat[index].double() * share[:, None]
        return torch.where(above, total, 0.0).to(wi)

    def _angles(self, wi: Tensor, wo: Tensor) -> Sequence[Tensor]:
        theta_i, phi_i = to_spherical(wi)
        theta_o, phi_o = to_spherical(wo)
        if self.isotropic:
            turn = torch.remainder(phi_o - phi_i + math.pi, 2 * math.pi) - math.pi
            return theta_i, theta_o, turn.abs()
        return theta_i, phi_i, theta_o, phi_o


def ring_weights(theta: Tensor) -> Tensor:
    """Return solid angle/2π of the ring around each increasing node θ (n,) in radians, split halfway between nodes.

    The innermost ring extends to the normal. The outermost ring extends as far outwards as inwards, but at most to the
    horizon.
    """
    if len(theta) == 1:
        return torch.ones_like(theta)
    middle = (theta[1:] + theta[:-1]) / 2
    last = (2 * theta[-1] - middle[-1]).clamp_max(math.pi / 2)
    edges = torch.cat((torch.zeros(1, dtype=theta.dtype), middle, last[None]))
    return torch.cos(edges[:-1]) - torch.cos(edges[1:])
