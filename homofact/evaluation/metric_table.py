"""Every metric of a fit, in one table: its name, formula, unit, words, and which values are good.

Comparisons, charts, sweeps and their tables, pictures and reports use the names, units and labels of this table. To add
a metric, write its formula and one entry (docs/contributing/metric.md). A metric is computed from one of three inputs:

* "pairs": the fit and its held-out samples (`brdf_metrics.EvaluatedPairs`);
* "light": integrals over both hemispheres and pictures under fixed lights, compared with a source that can be evaluated
  everywhere (`appearance.Appearance`);
* "picture": two pictures of a sphere and a mask (`image_metrics`).
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from operator import attrgetter
from typing import Literal

from homofact.evaluation import brdf_metrics, image_metrics
from homofact.evaluation.metrics import SixErrors

Good = Literal["low", "high", "one"]


@dataclass(frozen=True)
class Metric:
    """One figure of a fit.

    Attributes
    ----------
    name : the name in `metrics`, in JSON and in CSV.
    computed_from : "pairs", "light" or "picture" (see the module docstring); the type of the argument of `formula`.
    formula : returns the value of the metric, or NaN if it is undefined.
    label : the text in tables and pictures, without the unit.
    unit : the unit, "" for none; f is in sr⁻¹.
    domain : "log" if logarithms are compared, "linear" if values are compared, "" otherwise.
    good : the direction of improvement: "low", "high", or "one" for a ratio that should be 1.
    library : the optional Python module that the metric needs; "" for none.
    """

    name: str
    computed_from: Literal["pairs", "light", "picture"]
    formula: Callable[..., float]
    label: str
    unit: str = ""
    domain: Literal["log", "linear", ""] = "linear"
    good: Good = "low"
    library: str = ""

    @property
    def words(self) -> str:
        """The label with the input and the unit: "MAE, held out, sr⁻¹"."""
        held_out = ", held out" if self.computed_from == "pairs" else ""
        return f"{self.label}{held_out}{', ' if self.unit else ''}{self.unit}"

    def badness(self, value: float) -> float:
        """Return a number that is larger for worse values; for a ratio r, max(r, 1/r)."""
        if self.good == "one":
            return max(value, 1 / value) if value > 0 else float("inf")
        return value if self.good == "low" else -value


def _bands() -> list[Metric]:
    """`male` of bands of θi, and of θh."""
    bands = (
        *(("theta_i", "θi", low, high) for low, high in brdf_metrics.THETA_BANDS),
        *(("theta_h", "θh", low, high) for low, high in brdf_metrics.LOBE_BANDS),
    )
    return [
        Metric(
            f"male_{angle}_{low}_{high}",
            "pairs",
            brdf_metrics.band_error(low, high, angle),
            f"MALE, {sign} {low}–{high}°",
            domain="log",
        )
        for angle, sign, low, high in bands
    ]


_COSINES = "f cosθi cosθo"
_FLOOR = "least relative RMS of any reciprocal fit, of"
_LIGHT = "of the light, fit over source"
_TABLE = (
    Metric("log_mse", "pairs", attrgetter("six.log_mse"), "log MSE", domain="log"),
    Metric("log_mae", "pairs", attrgetter("six.log_mae"), "log MAE", domain="log"),
    Metric("log_max", "pairs", attrgetter("six.log_max"), "log maximum", domain="log"),
    Metric("mse", "pairs", attrgetter("six.mse"), "MSE", "sr⁻²"),
    Metric("mae", "pairs", attrgetter("six.mae"), "MAE", "sr⁻¹"),
    Metric("max", "pairs", attrgetter("six.max"), "maximum", "sr⁻¹"),
    Metric("male", "pairs", brdf_metrics.male, "MALE", domain="log"),
    Metric("cosine_rms", "pairs", brdf_metrics.cosine_rms, "cosine-weighted RMS", "sr⁻¹"),
    Metric("cube_root_rms", "pairs", brdf_metrics.cube_root_rms, "cube-root RMS", "sr⁻¹ᐟ³"),
    Metric("low_rms", "pairs", brdf_metrics.low_rms, "RMS of Löw et al.", domain="log"),
    Metric("log_rms_80", "pairs", brdf_metrics.log_rms_80, "log RMS up to 80°", domain="log"),
    Metric("reciprocity", "pairs", brdf_metrics.reciprocity, "reciprocity, 95th percentile"),
    Metric("albedo", "pairs", brdf_metrics.largest_albedo, "albedo, largest"),
    Metric("energy_above_one", "pairs", brdf_metrics.energy_above_one, "albedo above 1"),
    Metric("albedo_error", "pairs", brdf_metrics.albedo_error, "albedo, largest difference"),
    *_bands(),
    Metric("albedo_worst", "light", attrgetter("energy.albedo_worst"), "albedo, worst, fit over source", good="one"),
    Metric("energy_overall", "light", attrgetter("energy.energy_overall"), "energy, fit over source", good="one"),
    Metric("rms_cosine", "light", attrgetter("energy.rms_cosine"), f"relative RMS of {_COSINES}"),
    Metric("floor_cosine", "light", attrgetter("energy.floor_cosine"), f"{_FLOOR} {_COSINES}"),
    Metric("rms_measured", "light", attrgetter("rms_measured"), f"relative RMS of {_COSINES}, tilt left in"),
    Metric("floor_measured", "light", attrgetter("floor_measured"), f"{_FLOOR} {_COSINES}, tilt left in"),
    Metric("rms", "light", attrgetter("energy.rms"), "relative RMS of f without cosines"),
    Metric("floor", "light", attrgetter("energy.floor"), f"{_FLOOR} f without cosines"),
    Metric("highlight", "light", attrgetter("energy.highlight"), f"highlight, brightest 1% {_LIGHT}", good="one"),
    Metric("bright_half", "light", attrgetter("energy.bright_half"), f"brighter half {_LIGHT}", good="one"),
    Metric("psnr_light", "light", attrgetter("psnr_light"), "PSNR under a lamp", "dB", good="high"),
    Metric("psnr_sky", "light", attrgetter("psnr_sky"), "PSNR under a sky", "dB", good="high"),
    Metric("opinion", "light", attrgetter("score"), "expected grade by people, 1 to 5", domain="", good="high"),
    Metric("psnr", "picture", image_metrics.psnr, "PSNR", "dB", "", "high"),
    Metric("ssim", "picture", image_metrics.ssim, "SSIM", "", "", "high", "skimage.metrics"),
    Metric("ciede2000", "picture", image_metrics.ciede2000, "CIEDE2000", domain=""),
    Metric("delta_e_itp", "picture", image_metrics.delta_e_itp, "ΔE_ITP", domain=""),
    Metric("flip", "picture", image_metrics.flip, "FLIP", domain="", library="flip_evaluator"),
)  # fmt: skip
METRICS: Mapping[str, Metric] = {metric.name: metric for metric in _TABLE}
SIX: tuple[str, ...] = tuple(SixErrors.__dataclass_fields__)
LIGHT: tuple[str, ...] = tuple(name for name, metric in METRICS.items() if metric.computed_from == "light")
# The figures of a fit that a sweep's tables and its report show.
REPORTED: tuple[Metric, ...] = tuple(
    METRICS[name]
    for name in (
        "log_mse", "mae", "albedo_worst", "energy_overall", "highlight", "rms_cosine", "psnr_light", "psnr_sky",
    )
)  # fmt: skip
