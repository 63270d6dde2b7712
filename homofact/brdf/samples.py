"""The sample set: pairs of directions with the reflectance measured or computed there.

An isotropic measurement has light from one azimuth. So it leaves a texture indexed by absolute directions unconstrained
nearly everywhere, and the fit would be meaningless on a rotated object. `azimuth_copies` rotates both directions about
the normal (and also mirrors them). `rotated_at_random` makes the test set on which every error is measured. Split the
samples before you copy them; otherwise the training set contains the held-out samples at other azimuths.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import torch
from numpy.typing import ArrayLike
from torch import Tensor

from homofact.errors import BadInput
from homofact.files.arrays import MOST_VALUE
from homofact.files.words import listed

MOST_COPIES = 1_500_000
_ONE_AZIMUTH = 1e-4  # radians: directions written with five digits stray as far
# What columns of values are called where nobody says so.
_CHANNELS = {3: ("R", "G", "B"), 1: ("Y",)}
# Squares and sums of weights between these stay numbers.
LEAST_WEIGHT, MOST_WEIGHT = 1e-40, 1e40


@dataclass(frozen=True, init=False, repr=False)
class Samples:
    """N samples of a BRDF.

    Create them from NumPy arrays, torch tensors on one device, or nested lists; they are stored as float64 tensors.

    Parameters
    ----------
    wi, wo : (N, 3) unit vectors to the light and to the viewer in the surface frame, away from the surface.
    values : (N, C), or (N,) of one channel, in sr⁻¹, linear, without the cosine.
    weights : (N,), 0 or from `LEAST_WEIGHT` to `MOST_WEIGHT` and more than one of several above 0; by default 1.
    channels : C names; by default "R", "G", "B" for three columns of values and "Y" for one.
    isotropic : whether the material may be turned about its normal (and mirrored) freely; by default whether all
        light comes from one azimuth, as the light of a measurement of an isotropic material does.
    provenance : where the samples come from and what was done to them (JSON-able).
    all_azimuths : whether the samples lie at all azimuths as they are, so that a fit needs no copies of them.
    clipped : (N, C) bool, where a value is only known not to be less (`brdf.quality.clipping`); None where there is
        none.

    Raises
    ------
    BadInput : for other shapes, what is no finite number, directions that are no unit vectors or lie below the
        horizon, negative values and weights, and tensors on several devices.

    Examples
    --------
    >>> from homofact import Samples
    >>> Samples([[0, 0, 1]], [[0.6, 0, 0.8]], [[0.1, 0.2, 0.3]])
    <Samples: 1 pairs of directions, R, G, B, isotropic>
    """

    wi: Tensor
    wo: Tensor
    values: Tensor
    weights: Tensor
    channels: tuple[str, ...]
    isotropic: bool
    provenance: dict[str, Any]
    all_azimuths: bool
    clipped: Tensor | None

    def __init__(
        self,
        wi: ArrayLike | Tensor,
        wo: ArrayLike | Tensor,
        values: ArrayLike | Tensor,
        weights: ArrayLike | Tensor | None = None,
        channels: Sequence[str] | None = None,
        isotropic: bool | None = None,
        *,
        provenance: dict[str, Any] | None = None,
        all_azimuths: bool = False,
        clipped: ArrayLike | Tensor | None = None,
    ) -> None:
        given = {"wi": wi, "wo": wo, "values": values}
        tensors: dict[str, Any] = {name: _as_tensor(name, value) for name, value in given.items()}
        first = tensors["wi"]
        if first.ndim != 2 or first.shape[1] != 3:
            hint = "transpose it" if first.ndim == 2 and first.shape[0] == 3 else ""
            raise BadInput(f"wi has shape {tuple(first.shape)}", where="samples", expected="(N, 3)", hint=hint)
        if tensors["values"].ndim == 1 and (channels is None or len(channels) == 1):
            tensors["values"] = tensors["values"][:, None]
        count = first.shape[0]
        if weights is None:
            tensors["weights"] = torch.ones(count, dtype=torch.float64, device=first.device)
        else:
            tensors["weights"] = _as_tensor("weights", weights)
        tensors["clipped"] = None if clipped is None else torch.as_tensor(clipped)
        if channels is None:
            channels = _default_channels(tensors["values"])
        elif isinstance(channels, str):
            raise BadInput(where="samples: channels", found=f"the text {channels!r}", expected="a list of names")
        for name, tensor in tensors.items():
            if tensor is not None and tensor.device != first.device:
                raise BadInput(
                    f"{name} is on {tensor.device}", where="samples", expected=f"{first.device}, where wi is"
                )
        self._set(**tensors, channels=tuple(channels))
        self._set(provenance={} if provenance is None else provenance, all_azimuths=all_azimuths)
        self._check()
        self._set(isotropic=lit_from_one_azimuth(first) if isotropic is None else bool(isotropic))

    def _set(self, **attributes: Any) -> None:
        for name, value in attributes.items():
            object.__setattr__(self, name, value)

    def __repr__(self) -> str:
        """In a line, without the values."""
        turned = "isotropic" if self.isotropic else "anisotropic"
        return f"<Samples: {len(self)} pairs of directions, {listed(self.channels)}, {turned}>"

    def _check(self) -> None:
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
                raise BadInput(f"{name} has shape {tuple(tensor.shape)}", where="samples", expected=shape)
            if not bool(torch.isfinite(tensor).all()):
                row = int((~torch.isfinite(tensor.reshape(count, -1))).any(1).nonzero()[0])
                raise BadInput(f"{name} at row {row} is not finite", where="samples", expected="finite numbers")
        if count and not float(self.values.max()) <= MOST_VALUE:
            row = int((self.values > MOST_VALUE).any(1).nonzero()[0])
            found = f"values at row {row} are up to {float(self.values.max()):.3g}"
            raise BadInput(found, where="samples", expected=f"at most {MOST_VALUE:g}")
        if count == 0:
            raise BadInput("no samples are left", where="samples", expected="at least one")
        for name, direction in (("wi", self.wi), ("wo", self.wo)):
            below = direction[:, 2] < 0
            if bool(below.any()):
                row = int(below.nonzero()[0])
                raise BadInput(
                    f"{name} at row {row} has z = {float(direction[row, 2]):.4g}, under the horizon",
                    where="samples",
                    expected="z >= 0",
                )
            length = direction.norm(dim=1)
            off = (length - 1).abs() > 1e-6
            if bool(off.any()):
                row = int(off.nonzero()[0])
                raise BadInput(
                    f"{name} at row {row} has length {float(length[row]):.6g}",
                    where="samples",
                    expected="a unit vector",
                )
        given = self.weights[self.weights > 0]
        if len(given) == 0 or bool((given < LEAST_WEIGHT).any()) or bool((given > MOST_WEIGHT).any()):
            odd = given[(given < LEAST_WEIGHT) | (given > MOST_WEIGHT)]
            found = f"{float(odd[0]):g} among the weights" if len(odd) else "weights that are all 0"
            raise BadInput(
                where="samples", found=found, expected=f"some from {LEAST_WEIGHT:g} to {MOST_WEIGHT:g}, or 0"
            )
        if count > 1 and len(given) == 1:
            raise BadInput(where="samples", found="a single one with a weight above 0", expected="at least 2")
        for name, tensor in (("values", self.values), ("weights", self.weights)):
            if bool((tensor < 0).any()):
                row = int((tensor.reshape(count, -1) < 0).any(1).nonzero()[0])
                raise BadInput(f"{name} at row {row} is negative", where="samples", expected=">= 0")

    def __len__(self) -> int:
        """N, the number of samples."""
        return int(self.wi.shape[0])

    @property
    def largest_angle(self) -> float:
        """The largest θ in degrees, of light or view."""
        return max(float(torch.rad2deg(torch.acos(w[:, 2].clamp(-1, 1)).max())) for w in (self.wi, self.wo))

    def select(self, index: Tensor) -> "Samples":
        """Return the samples at `index` (integer or boolean), in that order."""
        clipped = None if self.clipped is None else self.clipped[index]
        parts = {name: getattr(self, name)[index] for name in ("wi", "wo", "values", "weights")}
        return replace(self, **parts, clipped=clipped)

    def to(self, device: Any) -> "Samples":
        """Return the samples with all tensors on a device, such as "cuda".

        If they are already there, return the same object.
        """
        if self.wi.device == torch.device(device):
            return self
        names = ("wi", "wo", "values", "weights", "clipped")
        parts = {name: getattr(self, name) for name in names}
        return replace(self, **{name: part.to(device) for name, part in parts.items() if part is not None})

    def channel(self, name: str) -> "Samples":
        """Return one channel alone. Raises BadInput naming the channels there are."""
        if name not in self.channels:
            raise BadInput(where="channel", found=repr(name), expected=f"one of {', '.join(self.channels)}")
        column = slice(self.channels.index(name), self.channels.index(name) + 1)
        clipped = None if self.clipped is None else self.clipped[:, column]
        return replace(self, values=self.values[:, column], channels=(name,), clipped=clipped)

    def split(self, fraction: float, seed: int) -> tuple["Samples", "Samples"]:
        """Return (training, held out): `fraction` of the samples, drawn by `seed`, are held out."""
        if not 0 < fraction < 1:
            raise BadInput(where="held-out fraction", found=fraction, expected="between 0 and 1")
        order = torch.randperm(len(self), generator=torch.Generator().manual_seed(seed))
        held = round(fraction * len(self))
        if held == 0 or held == len(self):
            raise BadInput(
                f"{len(self)} are too few to hold out {fraction:.0%}", where="samples", expected="at least 5"
            )
        return self.select(order[held:].sort().values), self.select(order[:held].sort().values)

    def subset(self, count: int, seed: int) -> "Samples":
        """Return at most `count` samples, drawn without replacement by `seed`, in their original order."""
        if count >= len(self):
            return self
        order = torch.randperm(len(self), generator=torch.Generator().manual_seed(seed))
        return self.select(order[:count].sort().values)

    def turned(self, angles: Tensor, mirrored: Tensor | None = None) -> "Samples":
        """Return each sample turned about the normal by its angle (N,) in radians, after y ↦ −y where `mirrored`."""
        sign = torch.ones_like(angles) if mirrored is None else 1.0 - 2.0 * mirrored.to(angles.dtype)
        cos, sin = torch.cos(angles), torch.sin(angles)

        def turn(w: Tensor) -> Tensor:
            x, y, z = w[:, 0], sign * w[:, 1], w[:, 2]
            return torch.stack((cos * x - sin * y, sin * x + cos * y, z), 1)

        return replace(self, wi=turn(self.wi), wo=turn(self.wo))

    def azimuth_copies(self, count: int, seed: int, mirrored: bool = True, most: int = MOST_COPIES) -> "Samples":
        """Return `count` copies of every sample, each at its own azimuth, and mirrored copies.

        The azimuths are stratified: copy k of a sample is turned by (k + u)·2π/count with u uniform by
        `seed`. Weights are divided by the number of copies, so the sum of weights is unchanged. If this would give more
        than `most` samples, there are fewer copies, at least one of each sample, at a random azimuth. One is enough for
        a million samples (a full MERL table), which then cover all azimuths. Raises BadInput for anisotropic samples,
        for which rotated copies would be wrong.
        """
        if not self.isotropic:
            raise BadInput("the samples are anisotropic", where="azimuth copies", expected="an isotropic material")
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
        """Return every sample at a random azimuth, mirrored or not by chance; anisotropic samples unchanged."""
        if not self.isotropic:
            return self
        generator = torch.Generator().manual_seed(seed)
        angles = torch.rand(len(self), dtype=torch.float64, generator=generator) * (2 * torch.pi)
        flip = torch.rand(len(self), dtype=torch.float64, generator=generator) < 0.5
        return replace(self.turned(angles.to(self.wi.device), flip.to(self.wi.device)), all_azimuths=True)


def lit_from_one_azimuth(wi: Tensor) -> bool:
    """Return whether all light directions (N, 3) have one azimuth, which marks an isotropic file without a flag.

    Light along the normal matches every azimuth.
    """
    across = wi[:, :2]
    length = across.norm(dim=1)
    # The one that is farthest from the normal knows its azimuth best.
    ahead = across[length.argmax()] / length.max().clamp_min(1e-300)
    return bool(((across - length[:, None] * ahead).norm(dim=1) <= _ONE_AZIMUTH * length + 1e-12).all())


def _as_tensor(name: str, given: Any) -> Tensor:
    """A tensor of float64 on its own device, where it is one, or else a copy of arrays or lists."""
    if isinstance(given, Tensor):
        if given.is_complex() or given.dtype is torch.bool:
            raise BadInput(f"{name} is of {given.dtype}", where="samples", expected="real numbers")
        return given.to(torch.float64)
    try:
        array = np.array(given)
    except (TypeError, ValueError) as error:
        raise BadInput(f"{name} is no table of numbers ({error})", where="samples", expected="an array") from error
    if array.dtype.kind not in "fiu":
        raise BadInput(f"{name} is {_kind_of(given, array)}", where="samples", expected="an array of real numbers")
    return torch.from_numpy(array.astype(np.float64))


def _kind_of(given: Any, array: np.ndarray) -> str:
    return f"an array of {array.dtype}" if isinstance(given, np.ndarray | list | tuple) else type(given).__name__


def _default_channels(values: Tensor) -> tuple[str, ...]:
    width = values.shape[1] if values.ndim == 2 else 0
    if width not in _CHANNELS:
        raise BadInput(
            f"values has shape {tuple(values.shape)}",
            where="samples",
            expected="(N, 3), (N, 1) or (N,), or channels with it",
        )
    return _CHANNELS[width]
