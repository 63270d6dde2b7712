"""The sample set: pairs of directions with the reflectance measured or computed there.

An isotropic measurement is taken at one azimuth, so a texture indexed by absolute directions is left
unconstrained nearly everywhere and the fit is meaningless on a rotated object. `azimuth_copies` turns
the whole configuration about the normal (and mirrors it, where the material is left-right symmetric);
`rotated_at_random` makes the test set on which every error is measured. Split before copying, or the
held-out samples are in the training set under another azimuth.
"""

from dataclasses import dataclass, field, replace
from typing import Any

import torch
from torch import Tensor

from homofact.errors import BadInput
from homofact.files.words import listed

MOST_COPIES = 1_500_000
# Squares and sums of weights between these stay numbers.
LEAST_WEIGHT, MOST_WEIGHT = 1e-40, 1e40


@dataclass(frozen=True)
class Samples:
    """N samples of a BRDF.

    Attributes
    ----------
    wi, wo : (N, 3) float64 unit vectors in the surface frame, away from the surface.
    values : (N, C) float64 in sr⁻¹, linear, without the cosine.
    weights : (N,) float64, 0 or from `LEAST_WEIGHT` to `MOST_WEIGHT` and more than one of several
        above 0; 1 where nothing else is known.
    channels : C names.
    isotropic : whether the material may be turned about its normal (and mirrored) freely.
    all_azimuths : whether the samples lie at all azimuths as they are, so that a fit needs no copies of them.
    clipped : (N, C) bool, where a value is only known not to be less (`brdf.clipping`); None where there is none.
    provenance : where the samples come from and what was done to them (JSON-able).
    """

    wi: Tensor
    wo: Tensor
    values: Tensor
    weights: Tensor
    channels: tuple[str, ...]
    isotropic: bool
    provenance: dict[str, Any] = field(default_factory=dict)
    all_azimuths: bool = False
    clipped: Tensor | None = None

    def __repr__(self) -> str:
        """In a line, without the values."""
        turned = "isotropic" if self.isotropic else "anisotropic"
        return f"<Samples: {len(self)} pairs of directions, {listed(self.channels)}, {turned}>"

    def __post_init__(self) -> None:
        """Refuse shapes that disagree, values that are not finite or negative, directions under the horizon."""
        count = self.wi.shape[0]
        expected = {
            "wi": (self.wi, (count, 3)),
            "wo": (self.wo, (count, 3)),
            "values": (self.values, (count, len(self.channels))),
            "weights": (self.weights, (count,)),
        }
        if self.clipped is not None:
            expected["clipped"] = (self.clipped, (count, len(self.channels)))
        for name, (tensor, shape) in expected.items():
            if tuple(tensor.shape) != shape:
                raise BadInput(f"samples: {name} has shape {tuple(tensor.shape)}, expected {shape}")
            if not bool(torch.isfinite(tensor).all()):
                row = int((~torch.isfinite(tensor.reshape(count, -1))).any(1).nonzero()[0])
                raise BadInput(f"samples: {name} at row {row} is not finite, expected finite numbers")
        if count == 0:
            raise BadInput("samples: no samples are left, expected at least one")
        for name, direction in (("wi", self.wi), ("wo", self.wo)):
            below = direction[:, 2] < 0
            if bool(below.any()):
                row = int(below.nonzero()[0])
                raise BadInput(
                    f"samples: {name} at row {row} has z = {float(direction[row, 2]):.4g}, under the horizon;"
                    " expected z >= 0"
                )
            length = direction.norm(dim=1)
            off = (length - 1).abs() > 1e-6
            if bool(off.any()):
                row = int(off.nonzero()[0])
                raise BadInput(
                    f"samples: {name} at row {row} has length {float(length[row]):.6g}, expected a unit vector"
                )
        given = self.weights[self.weights > 0]
        if len(given) == 0 or bool((given < LEAST_WEIGHT).any()) or bool((given > MOST_WEIGHT).any()):
            odd = given[(given < LEAST_WEIGHT) | (given > MOST_WEIGHT)]
            found = f"{float(odd[0]):g} among the weights" if len(odd) else "weights that are all 0"
            raise BadInput(f"samples: found {found}, expected some from {LEAST_WEIGHT:g} to {MOST_WEIGHT:g}, or 0")
        if count > 1 and len(given) == 1:
            raise BadInput("samples: found a single one with a weight above 0, expected at least 2")
        for name, tensor in (("values", self.values), ("weights", self.weights)):
            if bool((tensor < 0).any()):
                row = int((tensor.reshape(count, -1) < 0).any(1).nonzero()[0])
                raise BadInput(f"samples: {name} at row {row} is negative, expected >= 0")

    def __len__(self) -> int:
        """N, the number of samples."""
        return int(self.wi.shape[0])

    @classmethod
    def make(
        cls,
        wi: Tensor,
        wo: Tensor,
        values: Tensor,
        *,
        channels: tuple[str, ...],
        isotropic: bool,
        weights: Tensor | None = None,
        provenance: dict[str, Any] | None = None,
        all_azimuths: bool = False,
    ) -> "Samples":
        """Samples in float64 with unit weights unless given; same errors as the constructor."""
        wi, wo, values = (torch.as_tensor(x).to(torch.float64) for x in (wi, wo, values))
        if weights is None:
            weights = torch.ones(wi.shape[0], dtype=torch.float64, device=wi.device)
        weights = weights.to(torch.float64)
        return cls(wi, wo, values, weights, tuple(channels), isotropic, provenance or {}, all_azimuths)

    def select(self, index: Tensor) -> "Samples":
        """The samples at `index` (integer or boolean), in that order."""
        clipped = None if self.clipped is None else self.clipped[index]
        parts = {name: getattr(self, name)[index] for name in ("wi", "wo", "values", "weights")}
        return replace(self, **parts, clipped=clipped)

    def channel(self, name: str) -> "Samples":
        """One channel alone. Raises BadInput naming the channels there are."""
        if name not in self.channels:
            raise BadInput(f"channel: found {name!r}, expected one of {', '.join(self.channels)}")
        column = slice(self.channels.index(name), self.channels.index(name) + 1)
        clipped = None if self.clipped is None else self.clipped[:, column]
        return replace(self, values=self.values[:, column], channels=(name,), clipped=clipped)

    def split(self, fraction: float, seed: int) -> tuple["Samples", "Samples"]:
        """(training, held out): `fraction` of the samples, drawn by `seed`, are held out."""
        if not 0 < fraction < 1:
            raise BadInput(f"held-out fraction: found {fraction}, expected between 0 and 1")
        order = torch.randperm(len(self), generator=torch.Generator().manual_seed(seed))
        held = round(fraction * len(self))
        if held == 0 or held == len(self):
            raise BadInput(f"samples: {len(self)} are too few to hold out {fraction:.0%}, expected at least 5")
        return self.select(order[held:].sort().values), self.select(order[:held].sort().values)

    def subset(self, count: int, seed: int) -> "Samples":
        """At most `count` samples drawn without replacement by `seed`, in their old order."""
        if count >= len(self):
            return self
        order = torch.randperm(len(self), generator=torch.Generator().manual_seed(seed))
        return self.select(order[:count].sort().values)

    def turned(self, angles: Tensor, mirrored: Tensor | None = None) -> "Samples":
        """Each sample turned about the normal by its angle (N,) in radians, after y ↦ −y where `mirrored`."""
        sign = torch.ones_like(angles) if mirrored is None else 1.0 - 2.0 * mirrored.to(angles.dtype)
        cos, sin = torch.cos(angles), torch.sin(angles)

        def turn(w: Tensor) -> Tensor:
            x, y, z = w[:, 0], sign * w[:, 1], w[:, 2]
            return torch.stack((cos * x - sin * y, sin * x + cos * y, z), 1)

        return replace(self, wi=turn(self.wi), wo=turn(self.wo))

    def azimuth_copies(self, count: int, seed: int, mirrored: bool = True, most: int = MOST_COPIES) -> "Samples":
        """`count` copies of every sample, each at its own azimuth, and mirrored ones beside them.

        The azimuths are stratified: copy k of a sample is turned by (k + u)·2π/count with u uniform by
        `seed`. Weights are divided by the number of copies, so the sum of weights is unchanged. Where that
        would be more than `most` samples there are fewer copies, and at last one of each sample, at a random
        azimuth: a million samples (a full MERL table) cover all azimuths as they are. Raises
        BadInput for anisotropic samples, where a turned copy is a lie.
        """
        if not self.isotropic:
            raise BadInput("azimuth copies: the samples are anisotropic, expected an isotropic material")
        n, total = len(self), count * (2 if mirrored else 1)
        allowed = max(1, most // n)
        if allowed < 2 and mirrored:
            return self.rotated_at_random(seed)
        if allowed < total:
            count = allowed // (2 if mirrored else 1)
            total = count * (2 if mirrored else 1)
        generator = torch.Generator().manual_seed(seed)
        stratum = torch.arange(count, dtype=torch.float64).repeat(total // count).repeat_interleave(n)
        jitter = torch.rand(n * total, dtype=torch.float64, generator=generator)
        angles = ((stratum + jitter) * (2 * torch.pi / count)).to(self.wi.device)
        flip = (torch.arange(total) >= count).repeat_interleave(n).to(self.wi.device)
        tiled = self.select(torch.arange(n, device=self.wi.device).repeat(total))
        return replace(tiled.turned(angles, flip), weights=tiled.weights / total, all_azimuths=True)

    def rotated_at_random(self, seed: int) -> "Samples":
        """Every sample at a random azimuth, mirrored or not by chance; anisotropic samples unchanged."""
        if not self.isotropic:
            return self
        generator = torch.Generator().manual_seed(seed)
        angles = torch.rand(len(self), dtype=torch.float64, generator=generator) * (2 * torch.pi)
        flip = torch.rand(len(self), dtype=torch.float64, generator=generator) < 0.5
        return replace(self.turned(angles.to(self.wi.device), flip.to(self.wi.device)), all_azimuths=True)
