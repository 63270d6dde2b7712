"""A reflectance made of scattered samples, so that a measurement can be drawn and compared like a model.

Radial basis functions (thin plates, r² log r with a linear part) interpolate log(f/A + ε), A the mean of the
samples per channel, over the places of `brdf.places`. Up to `GLOBAL_LIMIT` samples make one smooth surface, more are
interpolated from the nearest `neighbours`. The result stays within the range of the samples' logs, so that nothing is
invented outside the measured angles.

The misplaced light of isotropic samples is 1.2% (geometric mean of seven materials on three layouts); with φd at its
full weight everywhere, where a sample at the mirror direction is far from its neighbours, it is 3.3%.
With six materials on five layouts of samples taken as anisotropic, the misplaced light is 2.9% (geometric mean); over
the coordinates of both directions, which lose highlights between lights, it is 12%
(`scripts/accuracy/interpolated_samples.py`).
"""

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, ClassVar

import numpy as np
import torch
from torch import Tensor

from homofact.brdf.in_kind import answering_in_kind
from homofact.brdf.log_transform import LogTransform
from homofact.brdf.places import READ_AZIMUTH, half_places
from homofact.brdf.reflectance import Reflectance, innermost
from homofact.brdf.samples import Samples
from homofact.errors import BadInput

if TYPE_CHECKING:
    from scipy.interpolate import RBFInterpolator

GLOBAL_LIMIT = 2000


@dataclass(frozen=True)
class Scattered:
    """A `Reflectance` interpolated from `samples`.

    `smoothing` ≥ 0 is scipy's λ: 0 goes through every sample, and fails where two samples fall together.
    `epsilon` > 0 is the ε of the logarithm, `neighbours` the number read where there are too many samples
    for one surface. Raises BadInput for numbers out of range and for too few samples.
    """

    samples: Samples
    smoothing: float = 1e-3
    epsilon: float = 1e-2
    neighbours: int = 32

    of_samples: ClassVar[bool] = True

    def __post_init__(self) -> None:
        """Refuse numbers out of range."""
        if not self.smoothing >= 0:
            raise BadInput(where="smoothing", found=self.smoothing, expected="0 or more")
        if not self.epsilon > 0:
            raise BadInput(where="epsilon", found=self.epsilon, expected="above 0")
        least = self._dimension + 2
        if min(self.neighbours, len(self.samples)) < least:
            raise BadInput(
                f"{len(self.samples)} samples, {self.neighbours} neighbours",
                where="interpolation",
                expected=f"at least {least}",
            )

    @property
    def channels(self) -> tuple[str, ...]:
        """Those of the samples."""
        return self.samples.channels

    @property
    def isotropic(self) -> bool:
        """That of the samples."""
        return self.samples.isotropic

    @property
    def nbytes(self) -> int:
        """Bytes of coordinates and logs of all samples in float64, the table that an evaluation reads."""
        return len(self.samples) * (self._dimension + len(self.channels)) * 8

    @property
    def fetches(self) -> int:
        """Samples read for one value: all of them, or the neighbours."""
        return len(self.samples) if self._whole else self.neighbours

    @answering_in_kind
    def evaluate(self, wi: Tensor, wo: Tensor) -> Tensor:
        """Return BRDF values (N, C) in sr⁻¹, ≥ 0, without the cosine; 0 where a direction is under the horizon."""
        above = (wi[:, 2] >= 0) & (wo[:, 2] >= 0)
        values = torch.zeros(wi.shape[0], len(self.channels), dtype=wi.dtype, device=wi.device)
        if not bool(above.any()):
            return values
        place = self._place(wi[above].double(), wo[above].double())
        low, high = self._logs.min(0), self._logs.max(0)
        logs = torch.from_numpy(self._interpolate(place).clip(low, high))
        values[above] = self._transform.inverse(logs).to(values)
        return values

    @property
    def _dimension(self) -> int:
        return 3 if self.samples.isotropic else 5

    @property
    def _whole(self) -> bool:
        return len(self.samples) <= GLOBAL_LIMIT

    def _place(self, wi: Tensor, wo: Tensor) -> np.ndarray:
        return half_places(wi, wo, self.samples.isotropic, READ_AZIMUTH).cpu().numpy()

    @cached_property
    def _transform(self) -> LogTransform:
        return LogTransform.of_values(self.samples.values.cpu(), self.epsilon)

    @cached_property
    def _logs(self) -> np.ndarray:
        return self._transform.forward(self.samples.values.cpu()).numpy()

    @cached_property
    def _thin_plate(self) -> "RBFInterpolator":
        return self._interpolator("thin_plate_spline", 1)

    @cached_property
    def _linear(self) -> "RBFInterpolator":
        return self._interpolator("linear", 0)

    def _interpolator(self, kernel: str, degree: int) -> "RBFInterpolator":
        from scipy.interpolate import RBFInterpolator  # with all of scipy.optimize: a tenth of a second to load

        return RBFInterpolator(
            self._place(self.samples.wi, self.samples.wo),
            self._logs,
            neighbors=None if self._whole else min(self.neighbours, len(self.samples)),
            smoothing=self.smoothing,
            kernel=kernel,
            degree=degree,
        )

    def _interpolate(self, place: np.ndarray) -> np.ndarray:
        try:
            return self._thin_plate(place)
        except np.linalg.LinAlgError:
            # Samples (or the neighbours of a point) in one plane have no linear part of their own.
            return self._linear(place)


def made_of_samples(reflectance: Reflectance) -> bool:
    """Return whether it interpolates scattered samples, looking through luminance and single channels.

    What it says between and beyond them is then a guess of ours, not of the source.
    """
    return getattr(innermost(reflectance), "of_samples", False)


def interpolated_samples(reflectance: Reflectance) -> Samples | None:
    """The samples that it interpolates, looking through luminance and single channels; None where it does not."""
    inner = innermost(reflectance)
    return inner.samples if isinstance(inner, Scattered) else None
