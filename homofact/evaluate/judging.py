"""A fit judged by any of the metrics, on the samples held out of it and on a lit sphere.

    judge(homofact.load("out/paint"), metrics=("log_mse", "male", "flip"))

A `Judge` measures several fits of one source, whose own picture is drawn once.
"""

import math
import os
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

from homofact.brdf.channels import display_of
from homofact.brdf.source import Source
from homofact.errors import BadInput

if TYPE_CHECKING:
    from homofact.evaluate.split import Split
    from homofact.factor.fitted import Fitted
    from homofact.render.sphere import SphereImage

PIXELS = 192


def chosen_metrics(names: Sequence[str]) -> tuple[str, ...]:
    """The metrics that `names` stand for, in the order of the tables: "six", "all" or names themselves.

    Raises BadInput that lists the names for an unknown one, MissingDependency for a metric without its library.
    """
    from homofact.evaluate.brdf_metrics import METRICS, SIX
    from homofact.evaluate.image_metrics import IMAGE_METRICS, check_libraries

    known = (*METRICS, *IMAGE_METRICS)
    unknown = [name for name in names if name not in (*known, "six", "all")]
    if unknown or not names:
        found = repr(unknown[0]) if unknown else "none"
        raise BadInput(f"metrics: found {found}, expected six, all, or some of {', '.join(known)}")
    wanted = {*names, *(SIX if "six" in names else ()), *(known if "all" in names else ())}
    chosen = tuple(name for name in known if name in wanted)
    check_libraries(chosen)
    return chosen


def judge(
    fitted: "Fitted",
    source: Source | str | None = None,
    metrics: Sequence[str] = ("all",),
    near: Sequence[str | os.PathLike[str]] = (),
) -> dict[str, float | None]:
    """Every metric's number of a fit, on the samples that were held out of it (all of its source's where none were).

    The source is the fit's own unless another is given. Raises as `chosen_metrics` and `evaluate.reopening.reopen`.
    """
    from homofact.evaluate.reopening import reopen

    names = chosen_metrics(metrics)
    found = reopen(fitted, source, near)
    return Judge(found.source, names).measure(fitted, found.split)


@dataclass(frozen=True)
class Judge:
    """Measures fits of one source by the metrics `names` (`chosen_metrics`)."""

    source: Source
    names: tuple[str, ...]

    def measure(self, fit: "Fitted", split: "Split") -> dict[str, float | None]:
        """Every metric's number of a fit on the test samples of `split`.

        None where a metric is not defined. An infinite PSNR stays infinite.
        """
        from homofact.evaluate.brdf_metrics import METRICS, Judged
        from homofact.evaluate.image_metrics import IMAGE_METRICS

        judged = Judged(fit, split.test_samples(self.source), fit.transform, self.source.reflectance)
        values = {name: METRICS[name](judged) for name in self.names if name in METRICS}
        if self.pictured:
            from homofact.render.tonemap import displayed

            mine, theirs = (displayed(each, self._exposure) for each in (self._draw(fit), self._sphere))
            mask = self._sphere.coverage > 0
            values |= {name: IMAGE_METRICS[name](theirs, mine, mask) for name in self.names if name in IMAGE_METRICS}
        return {name: None if math.isnan(value) else value for name, value in values.items()}

    @property
    def pictured(self) -> bool:
        """Whether some metric is of a picture."""
        from homofact.evaluate.image_metrics import IMAGE_METRICS

        return any(name in IMAGE_METRICS for name in self.names)

    def conditions(self) -> list[str]:
        """Under which conditions the numbers hold, in sentences."""
        from homofact.evaluate.brdf_metrics import stated_density
        from homofact.evaluate.image_metrics import PIXELS_PER_DEGREE, WHITE_LUMINANCE

        lines = []
        if "cosine_rms" in self.names:
            lines.append(f"cosine_rms: {stated_density(self.source.samples)}.")
        if self.pictured:
            from homofact.render.light import DEFAULT_LIGHT
            from homofact.render.tonemap import tonemap

            clipped = tonemap(self._sphere, self._exposure).clipped
            lines.append(
                f"Spheres of {PIXELS} pixels, {DEFAULT_LIGHT.describe()}. Exposure {self._exposure:.4g} for all,"
                f" sRGB, white point D65; clipped to the gamut in {clipped:.1%} of the source's pixels."
                f" White is {WHITE_LUMINANCE:g} cd/m² for delta_e_itp, {PIXELS_PER_DEGREE:g} pixels a degree for flip."
            )
        return lines

    def _draw(self, reflectance: Any) -> "SphereImage":
        from homofact.render.sphere import render_sphere

        return render_sphere(reflectance, size=PIXELS, to_rgb=display_of(self.source.samples.channels))

    @cached_property
    def _sphere(self) -> "SphereImage":
        return self._draw(self.source.reflectance)

    @cached_property
    def _exposure(self) -> float:
        from homofact.render.tonemap import choose_exposure

        return choose_exposure(self._sphere)
