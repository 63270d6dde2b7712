"""A reflectance that interpolates scattered samples, so that a measurement can be rendered and compared like a model.

Radial basis functions (thin plates, r² log r with a linear part) interpolate log(f/A + ε), A the mean of the
samples per channel, over the places of `brdf.places`. Up to `GLOBAL_LIMIT` samples make one smooth surface, more are
interpolated from the nearest `neighbours`. The result stays within the range of the samples' logs.

For isotropic samples, a GGX model with two lobes is fitted first. The interpolated quantity is then log(f/A + ε) minus
the same logarithm of the model. So a highlight between two measured rings has the shape of the model, corrected by the
difference at the rings; without the model, interpolation would flatten it. The model need not be accurate: its
difference from the samples only has to be smoother than the samples. The interpolated difference stays within its range
at the samples, so outside the measured angles the result follows the model. A highlight grows towards grazing angles,
up to `_MOST_BRIGHTER` times the brightest sample.

The misplaced light of isotropic samples is 1.2% (geometric mean of seven materials on three layouts); with φd at its
full weight everywhere, where a sample at the mirror direction is far from its neighbours, it is 3.3%.
With six materials on five layouts of samples taken as anisotropic, the misplaced light is 2.9% (geometric mean); over
the coordinates of both directions, which lose highlights between lights, it is 12%
(`scripts/accuracy/interpolated_samples.py`).
"""

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, ClassVar

import numpy as np
import torch
from torch import Tensor

from homofact.brdf.analytic.ggx import GgxBrdf
from homofact.brdf.analytic.ggx_fit import fit_ggx
from homofact.brdf.in_kind import answering_in_kind
from homofact.brdf.kept import Kept
from homofact.brdf.log_transform import LogTransform
from homofact.brdf.places import READ_AZIMUTH, half_places
from homofact.brdf.reflectance import Reflectance, innermost
from homofact.brdf.samples import Samples
from homofact.errors import BadInput

if TYPE_CHECKING:
    from scipy.interpolate import RBFInterpolator

GLOBAL_LIMIT = 2000
# Of the model whose difference from isotropic samples is interpolated: the fewest samples that it is fitted to, and the
# most channels with colours of their own in it; of more it is the mean.
LEAST_SAMPLES, _MOST_COLOURS = 100, 4
_MOST_BRIGHTER = 100.0
# Its F0 at least, that of water: of samples that stop short of grazing angles, less could mean any growth there.
_LEAST_REFLECTANCE = 0.02


@dataclass(frozen=True)
class Scattered:
    """A `Reflectance` interpolated from `samples`.

    `smoothing` ≥ 0 is scipy's λ: 0 interpolates every sample exactly, and fails if two samples coincide. `epsilon` > 0
    is the ε of the logarithm, `neighbours` the number read where there are too many samples for one surface. `lobes` ≥
    0 is the number of GGX lobes for isotropic samples; 0 means no model. Raises BadInput for numbers out of range and
    for too few samples.
    """

    samples: Samples
    smoothing: float = 1e-3
    epsilon: float = 1e-2
    neighbours: int = 32
    lobes: int = 2

    of_samples: ClassVar[bool] = True

    def __post_init__(self) -> None:
        """Refuse numbers out of range."""
        if not self.smoothing >= 0:
            raise BadInput(where="smoothing", found=self.smoothing, expected="0 or more")
        if not self.epsilon > 0:
            raise BadInput(where="epsilon", found=self.epsilon, expected="above 0")
        if not self.lobes >= 0:
            raise BadInput(where="lobes", found=self.lobes, expected="0 or more")
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
        modelled = self._logs_of_model(wi[above], wo[above])
        apart = self._apart
        found = self._interpolate(place).clip(apart.min(0), apart.max(0)) + modelled
        if self._model is not None:
            found = found.clip(None, self._logs.max(0) + math.log(_MOST_BRIGHTER))
        values[above] = self._transform.inverse(torch.from_numpy(found)).to(values)
        return values

    @property
    def follows_model(self) -> bool:
        """Whether values follow a fitted model outside the measured angles."""
        return self._model is not None

    def modelled(self, wi: Tensor, wo: Tensor) -> Tensor:
        """Return the model's own values (N, C) in sr⁻¹; 0 without one."""
        return self._transform.inverse(torch.from_numpy(self._logs_of_model(wi, wo))).to(wi)

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
    def _apart(self) -> np.ndarray:
        """The logs of the samples less those of the model: what is interpolated."""
        return self._logs - self._logs_of_model(self.samples.wi, self.samples.wo)

    @cached_property
    def _model(self) -> GgxBrdf | None:
        """The model in units of A, of one channel if there are too many; None without lobes, and of few samples."""
        if not self.lobes or not self.samples.isotropic or len(self.samples) < LEAST_SAMPLES:
            return None
        values = self.samples.values.cpu().double() / torch.as_tensor(self._transform.mean)
        names = self.channels
        if len(names) > _MOST_COLOURS:
            values, names = values.mean(1, keepdim=True), ("Y",)
        wi, wo = self.samples.wi.cpu().double(), self.samples.wo.cpu().double()
        return fit_ggx(Samples(wi, wo, values, channels=names, isotropic=True), self.lobes, 0, _LEAST_REFLECTANCE)[0]

    def _logs_of_model(self, wi: Tensor, wo: Tensor) -> np.ndarray:
        """log(f/A + ε) of the model (N, C); 0 without one."""
        if self._model is None:
            return np.zeros((len(wi), len(self.channels)))
        values = self._model.evaluate(wi.cpu().double(), wo.cpu().double())
        return self._transform.forward(values * torch.as_tensor(self._transform.mean)).numpy()

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
            self._apart,
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


# Of a copy that shares their values, since what is kept may not keep the samples alive.
_KEPT = Kept(lambda samples: Scattered(replace(samples)))


def surface_of(samples: Samples) -> Scattered:
    """Return the interpolation of samples, cached with the samples. Raises BadInput for too few samples."""
    return _KEPT.of(samples)


def made_of_samples(reflectance: Reflectance) -> bool:
    """Return whether a reflectance interpolates scattered samples, also as a luminance or a single channel.

    Its values between and beyond the samples are then homofact's interpolation, not data of the source.
    """
    return getattr(innermost(reflectance), "of_samples", False)


def models_the_rest(reflectance: Reflectance) -> bool:
    """Return whether a reflectance interpolates scattered samples and follows a model beyond them."""
    inner = innermost(reflectance)
    return isinstance(inner, Scattered) and inner.follows_model


def interpolated_samples(reflectance: Reflectance) -> Samples | None:
    """Return the samples that a reflectance interpolates, also as a luminance or a single channel; else None."""
    inner = innermost(reflectance)
    return inner.samples if isinstance(inner, Scattered) else None
