"""Measure a fit by any of the metrics, on its held-out samples and on pictures of a lit sphere.

    judge(homofact.load("out/paint"), metrics=("log_mse", "male", "flip"))

A `FitEvaluator` measures several fits of one source, and renders the picture of the source only once.
"""

import math
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

from homofact.brdf.channels import display_of
from homofact.brdf.source import Source
from homofact.errors import BadInput
from homofact.files import extras

if TYPE_CHECKING:
    from torch import Tensor

    from homofact.evaluation.appearance import Appearance
    from homofact.evaluation.brdf_metrics import EvaluatedPairs
    from homofact.evaluation.split import Split
    from homofact.factor.fitted import Fitted
    from homofact.rendering.sphere import SphereImage

PIXELS = 192


# What people call a metric, as the pages do.
METRIC_ALIASES = {"cole": "log_mse", "cole_error": "log_mse"}


def chosen_metrics(names: Sequence[str]) -> tuple[str, ...]:
    """Return the metrics that `names` select, in their order and each once: "six", "all" or single names.

    Raises BadInput that lists the names for an unknown one, MissingDependency for a metric without its library.
    """
    from homofact.evaluation.metric_table import METRICS, SIX

    names = [METRIC_ALIASES.get(name, name) for name in names]
    unknown = [name for name in names if name not in (*METRICS, "six", "all")]
    if unknown or not names:
        found = repr(unknown[0]) if unknown else "none"
        raise BadInput(where="metrics", found=found, expected=f"six, all, or some of {', '.join(METRICS)}")
    several = {"six": SIX, "all": METRICS}
    chosen = tuple(dict.fromkeys(one for name in names for one in several.get(name, (name,))))
    for name in chosen:
        if METRICS[name].library:
            extras.library(METRICS[name].library, "metrics")
    return chosen


def judge(
    fitted: "Fitted",
    source: Source | str | None = None,
    metrics: Sequence[str] = ("all",),
    near: Sequence[str | os.PathLike[str]] = (),
) -> dict[str, float | None]:
    """Return the value of each metric of a fit on its held-out samples, or on all samples if none were held out.

    Without `source`, the source of the fit is opened again. Raises the errors of `chosen_metrics` and of
    `evaluation.reopening.reopen`.
    """
    from homofact.evaluation.reopening import reopen

    names = chosen_metrics(metrics)
    reopened = reopen(fitted, source, near)
    return FitEvaluator(reopened.source, names).measure(fitted, reopened.split)


@dataclass(frozen=True)
class FitEvaluator:
    """Measures fits of one source by the metrics `names` (`chosen_metrics`)."""

    source: Source
    names: tuple[str, ...]

    def measure(self, fit: "Fitted", split: "Split") -> dict[str, float | None]:
        """Return the value of each metric of a fit on the test samples of `split`.

        The value is None if a metric is not defined. An infinite PSNR stays infinite.
        """
        from homofact.evaluation.metric_table import METRICS

        compute: dict[str, Callable[[], tuple[Any, ...] | None]] = {
            "pairs": lambda: (self._pairs(fit, split),),
            "light": lambda: self._light(fit),
            "picture": lambda: self._pictures(fit),
        }
        kinds = dict.fromkeys(METRICS[name].computed_from for name in self.names)
        arguments = {kind: compute[kind]() for kind in kinds}
        values: dict[str, float | None] = {}
        for name in self.names:
            given = arguments[METRICS[name].computed_from]
            value = math.nan if given is None else METRICS[name].formula(*given)
            values[name] = None if math.isnan(value) else value
        return values

    def _pairs(self, fit: "Fitted", split: "Split") -> "EvaluatedPairs":
        from homofact.evaluation.brdf_metrics import EvaluatedPairs

        return EvaluatedPairs(fit, split.test_samples(self.source), fit.transform, self.source.reflectance)

    def _light(self, fit: "Fitted") -> "tuple[Appearance] | None":
        """Return None if the source consists only of samples."""
        from homofact.evaluation.appearance import appearance

        figures = appearance(fit, self.source)
        return None if figures is None else (figures,)

    def _pictures(self, fit: "Fitted") -> "tuple[Tensor, Tensor, Tensor]":
        """(the source's picture, the fit's, the sphere's pixels)."""
        from homofact.rendering.tonemap import displayed

        theirs, mine = (displayed(picture, self._exposure) for picture in (self._sphere, self._draw(fit)))
        return theirs, mine, self._sphere.coverage > 0

    @property
    def pictured(self) -> bool:
        """Whether at least one metric needs a picture."""
        from homofact.evaluation.metric_table import METRICS

        return any(METRICS[name].computed_from == "picture" for name in self.names)

    def conditions(self) -> list[str]:
        """Return sentences that state the conditions of the measurement, such as light, exposure and picture size."""
        from homofact.evaluation.brdf_metrics import stated_density
        from homofact.evaluation.image_metrics import PIXELS_PER_DEGREE, WHITE_LUMINANCE

        lines = []
        if "cosine_rms" in self.names:
            lines.append(f"cosine_rms: {stated_density(self.source.samples)}.")
        if self.pictured:
            from homofact.rendering.light import DEFAULT_LIGHT
            from homofact.rendering.tonemap import tonemap

            clipped = tonemap(self._sphere, self._exposure).clipped
            lines.append(
                f"Spheres of {PIXELS} pixels, {DEFAULT_LIGHT.describe()}. Exposure {self._exposure:.4g} for all,"
                f" sRGB, white point D65; clipped to the gamut in {clipped:.1%} of the source's pixels."
                f" White is {WHITE_LUMINANCE:g} cd/m² for delta_e_itp, {PIXELS_PER_DEGREE:g} pixels a degree for flip."
            )
        return lines

    def _draw(self, reflectance: Any) -> "SphereImage":
        from homofact.rendering.sphere import render_sphere

        return render_sphere(reflectance, size=PIXELS, to_rgb=display_of(self.source.samples.channels))

    @cached_property
    def _sphere(self) -> "SphereImage":
        return self._draw(self.source.reflectance)

    @cached_property
    def _exposure(self) -> float:
        from homofact.rendering.tonemap import choose_exposure

        return choose_exposure(self._sphere)
