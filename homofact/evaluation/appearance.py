"""Measure the visible errors of a fit: its reflected light, and pictures of a sphere beside those of the source.

`evaluation.energy` computes the energy. The pictures show a sphere. The picture of the fit has the same exposure as
that of the source, which is chosen from the source:

* under a small lamp: `PIXELS`² under the default directional light, as `compare.png` shows it;
* under the sky of `rendering.fixed_lights` (`evaluation.fixed_pictures`). The exposure maps the median brightness to
  middle grey, and the curve is filmic, since a glossy material reflects lamps many times as bright as white;
* under the light of a study in which people graded approximations (`evaluation.opinion`), at one exposure for all
  materials. This picture predicts the grade that people would give.

Another figure is the share of the variance of the logarithms that the fit explains. It is measured at `PAIRS` new pairs
of directions in the discs, which no fit has used. Measured only on the held-out samples, this share would have an
error of several per cent.

PSNR compares the encoded values of the pictures. There are no figures if the source only interpolates samples, since it
has no reference values between them.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from statistics import fmean
from typing import Any

import torch

from homofact.brdf.channels import display_of
from homofact.brdf.kept import Kept
from homofact.brdf.pair_density import RIM
from homofact.brdf.reflectance import Reflectance
from homofact.brdf.scattered import made_of_samples
from homofact.brdf.source import Source
from homofact.brdf.tilt import as_measured
from homofact.evaluation.energy import EnergyErrors, SourceLight
from homofact.evaluation.fixed_pictures import fixed_pictures, study_difference
from homofact.evaluation.image_metrics import psnr
from homofact.evaluation.metric_table import LIGHT, METRICS
from homofact.evaluation.metrics import explained_variance
from homofact.evaluation.opinion import Opinion, opinion_table
from homofact.geometry.directions import draw_in_discs
from homofact.rendering.light import DEFAULT_LIGHT
from homofact.rendering.sphere import SphereImage, render_sphere
from homofact.rendering.tonemap import choose_exposure, choose_middle, displayed

PIXELS = 128
PAIRS = 4000
_SEED = 20261122


Figures = Mapping[str, float | None]


def mean_figures(several: Sequence[Figures]) -> dict[str, float | None]:
    """Return the mean of each figure over several appearances; None if one of them lacks the figure."""
    means: dict[str, float | None] = {}
    for name in LIGHT:
        values = [float(value) for figures in several if (value := figures[name]) is not None]
        means[name] = fmean(values) if len(values) == len(several) else None
    return means


@dataclass(frozen=True)
class Appearance:
    """The visible errors of a fit: `energy`, and the PSNR in dB of a sphere under a lamp and under the sky.

    PSNR is infinite if the pictures are equal. `explained` is the share of the variance of the source's logarithms that
    the fit explains, for the worst channel. It is None if the reflectance has no log transform. `measured` compares the
    energy with the measurement before homofact corrected the specimen's tilt (`brdf.tilt`). It is None if no tilt was
    corrected. `off_light` and `off_sky` compare the radiance of the same pictures, before the tone curve: Σ|fit −
    source|/Σ source. `study` is the mean CIEDE2000 under the study's light.
    """

    energy: EnergyErrors
    psnr_light: float
    psnr_sky: float
    explained: float | None = None
    measured: EnergyErrors | None = None
    off_light: float = math.nan
    off_sky: float = math.nan
    study: float = math.nan

    @property
    def opinion(self) -> Opinion | None:
        """The predicted grade that people would give; None if the pictures were not compared."""
        return opinion_table().law.opinion(self.study) if math.isfinite(self.study) else None

    @property
    def score(self) -> float:
        """The expected grade of `opinion`, from 1 to 5; NaN where there is none."""
        return math.nan if self.opinion is None else self.opinion.score

    @property
    def rms_measured(self) -> float:
        """`EnergyErrors.rms_cosine` against the measurement before tilt correction; NaN if no tilt was corrected."""
        return math.nan if self.measured is None else self.measured.rms_cosine

    @property
    def floor_measured(self) -> float:
        """`EnergyErrors.floor_cosine` of the measurement before tilt correction; NaN if no tilt was corrected."""
        return math.nan if self.measured is None else self.measured.floor_cosine

    @property
    def figures(self) -> dict[str, float | None]:
        """The value of each metric of `metric_table.LIGHT`; None for values that are not finite."""
        values = {name: METRICS[name].formula(self) for name in LIGHT}
        return {name: value if math.isfinite(value) else None for name, value in values.items()}

    def record(self) -> dict[str, Any]:
        """Return a JSON-able dictionary, with None for values that are not finite."""
        off = {"off_light": self.off_light, "off_sky": self.off_sky}
        seen = {} if self.opinion is None else self.opinion.record()
        numbers = {name: x if math.isfinite(x) else None for name, x in off.items()}
        return self.energy.record() | self.figures | numbers | seen


def appearance(fit: Reflectance, source: Source) -> Appearance | None:
    """Return the figures of a fit against its source; None if the source consists only of samples.

    The evaluations of the source are cached for its next fit, as long as the source object exists. Raises BadInput if
    fit and source have different numbers of channels.
    """
    if made_of_samples(source.reflectance):
        return None
    return _KEPT.of(source).against(fit)


class _SourceAppearance:
    """All evaluations of one source."""

    def __init__(self, source: Source) -> None:
        self.to_rgb = display_of(source.reflectance.channels)
        self.light = SourceLight.of(source.reflectance, source.samples.isotropic)
        raw = as_measured(source.reflectance)
        self.measured = None if raw is None else SourceLight.of(raw, source.samples.isotropic)
        self.pictures = self.draw(source.reflectance)
        self.pairs = draw_in_discs(PAIRS, torch.Generator().manual_seed(_SEED), RIM)
        self.values = source.reflectance.evaluate(*self.pairs).to(torch.float64)

    def draw(self, reflectance: Reflectance) -> tuple[SphereImage, SphereImage, SphereImage]:
        """Return the sphere under the lamp, under the sky, and under the study's light."""
        lamp = render_sphere(reflectance, DEFAULT_LIGHT, PIXELS, to_rgb=self.to_rgb)
        under = fixed_pictures(reflectance, self.to_rgb)
        return lamp, under.sky, under.study

    def against(self, fit: Reflectance) -> Appearance:
        """Return the figures of a fit."""
        energy = self.light.errors(fit)
        (lamp, sky, study), (own_lamp, own_sky, own_study) = self.draw(fit), self.pictures
        by_lamp = _psnr(own_lamp, lamp, choose_exposure(own_lamp), "srgb")
        by_sky = _psnr(own_sky, sky, choose_middle(own_sky), "filmic")
        measured = None if self.measured is None else self.measured.errors(fit)
        off = [picture_off(*pair) for pair in ((own_lamp, lamp), (own_sky, sky))]
        seen = study_difference(own_study, study)
        return Appearance(energy, by_lamp, by_sky, self.explained(fit), measured, off[0], off[1], seen)

    def explained(self, fit: Reflectance) -> float | None:
        """Return what the fit explains of the logarithms of the source."""
        transform = getattr(fit, "transform", None)
        if transform is None:
            return None
        values = fit.evaluate(*self.pairs).to(torch.float64)
        expected, logs = (transform.forward(both) for both in (self.values, values))
        return explained_variance(expected, logs, torch.ones(PAIRS, dtype=torch.float64))


_KEPT = Kept(_SourceAppearance)


def picture_off(source: SphereImage, fit: SphereImage) -> float:
    """Return Σ|fit − source| over Σ|source| of the radiance of all pixels and channels; 0 where both are dark."""
    theirs, mine = (image.radiance.to(torch.float64) * image.coverage[..., None] for image in (source, fit))
    missed, there = float((mine - theirs).abs().sum()), float(theirs.abs().sum())
    return 0.0 if missed == 0 else missed / max(there, 1e-300)


def _psnr(source: SphereImage, fit: SphereImage, exposure: float, curve: str) -> float:
    theirs, mine = (displayed(image, exposure, curve=curve) for image in (source, fit))
    return psnr(theirs, mine, source.coverage > 0)
