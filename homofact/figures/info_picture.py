"""Draw an overview of a BRDF: the θh–θd slice, polar lobes and a lit sphere, side by side.

The slice shows the luminance of f in sr⁻¹ on a log₁₀ scale over θh and θd. It lies at φd = 90°, where ωi − ωo is
perpendicular to the plane of n and h, because both directions stay above the horizon there. Dots mark the (θh, θd) of a
measurement's samples at any φd. The lobes show ∛f by viewing angle in the plane of incidence, with the mirror direction
on the right; the cube root makes highlight and base visible in one plot. The sphere is drawn as in the comparison
pictures.
"""

import math
import os
from collections.abc import Callable
from pathlib import Path

import numpy as np
import torch
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from matplotlib.projections.polar import PolarAxes
from torch import Tensor

from homofact.brdf.reflectance import Reflectance
from homofact.brdf.samples import Samples
from homofact.brdf.spectral import LUMINANCE
from homofact.figures.lit_picture import PictureReport, caption
from homofact.figures.words import in_figure
from homofact.files.atomic import replace_file
from homofact.geometry.coordinates import rusinkiewicz_angles
from homofact.geometry.directions import from_half_difference, from_spherical
from homofact.rendering.light import DEFAULT_LIGHT
from homofact.rendering.sphere import render_sphere
from homofact.rendering.tonemap import DEFAULT_CURVE, automatic_exposure, tonemap

LOBE_DEGREES = (15.0, 45.0, 75.0)
_SIDE, _PIXELS, _MOST_DOTS = 90, 256, 4000
# Okabe and Ito's, told apart under all common colour deficiencies.
_COLOURS = ("#0072b2", "#d55e00", "#009e73")
# Beyond so many powers of ten under the largest value the slice would show nothing but noise.
_DECADES = 5.0


def slice_values(reflectance: Reflectance, to_rgb: Callable[[Tensor], Tensor] | None = None) -> Tensor:
    """Return the luminance (90, 90) of f in sr⁻¹: rows are θd, columns θh, at the middle of each degree."""
    middle = (torch.arange(_SIDE, dtype=torch.float64) + 0.5) * (math.pi / 2 / _SIDE)
    theta_d, theta_h = (x.reshape(-1) for x in torch.meshgrid(middle, middle, indexing="ij"))
    h = from_spherical(theta_h, 0 * theta_h)
    d = from_spherical(theta_d, 0 * theta_d + math.pi / 2)
    wi, wo = from_half_difference(h, d)
    return _luminance(reflectance, wi, wo, to_rgb).reshape(_SIDE, _SIDE)


def lobe_values(
    reflectance: Reflectance, degrees: float, to_rgb: Callable[[Tensor], Tensor] | None = None
) -> tuple[Tensor, Tensor]:
    """Return (θo in radians from −90° to 90°, luminance of f in sr⁻¹) for light at −`degrees` in the same plane."""
    theta = torch.linspace(-89.5, 89.5, 359, dtype=torch.float64) * (math.pi / 180)
    light = torch.full_like(theta, -math.radians(degrees))
    wi, wo = from_spherical(light, 0 * light), from_spherical(theta, 0 * theta)
    return theta, _luminance(reflectance, wi, wo, to_rgb)


def info_picture(
    path: str | os.PathLike[str],
    name: str,
    reflectance: Reflectance,
    *,
    measured: Samples | None = None,
    to_rgb: Callable[[Tensor], Tensor] | None = None,
) -> PictureReport:
    """Draw a PNG of `reflectance` with the title `name`, and dots at the samples of `measured`.

    `to_rgb` converts spectra to RGB as in `render_sphere`. Raises BadInput for input that `render_sphere` rejects and
    for a path that cannot be written.
    """
    image = render_sphere(reflectance, size=_PIXELS, to_rgb=to_rgb)
    exposure = automatic_exposure(image)
    shown = tonemap(image, exposure, curve=DEFAULT_CURVE)
    report = PictureReport(exposure, shown.clipped, DEFAULT_CURVE)
    figure = Figure(figsize=(13, 4.9), dpi=100, facecolor="white", layout="constrained")
    FigureCanvasAgg(figure)
    figure.suptitle(in_figure(name), weight="bold")
    left, right = figure.add_subplot(1, 3, 1), figure.add_subplot(1, 3, 3)
    middle = figure.add_subplot(1, 3, 2, projection="polar")
    assert isinstance(middle, PolarAxes)
    _draw_slice(figure, left, slice_values(reflectance, to_rgb).numpy(), measured)
    _draw_lobes(middle, reflectance, to_rgb)
    right.imshow(shown.pixels.numpy(), interpolation="none")
    right.set_title("lit sphere", fontsize=10)
    right.set_axis_off()
    text = caption(DEFAULT_LIGHT, report)
    if measured is not None:
        text += " Between and beyond the samples (dots) the measurement is interpolated."
    figure.supxlabel(in_figure("\n".join(_halves(text))), fontsize=9)

    def save(place: Path) -> None:
        figure.savefig(place, format="png", metadata={"Description": text})

    replace_file(path, save)
    return report


def _draw_slice(figure: Figure, axes: Axes, values: np.ndarray, measured: Samples | None) -> None:
    """Draw the slice with its colour bar and dots at the samples."""
    known = values[values > 0]
    top = float(known.max()) if known.size else 1.0
    bottom = max(float(known.min()), top * 10**-_DECADES) if known.size else 0.1
    if not bottom < top * 0.99:
        bottom = top / 10
    picture = axes.imshow(
        np.maximum(values, bottom),
        origin="lower",
        extent=(0, 90, 0, 90),
        norm=LogNorm(bottom, top),
        cmap="viridis",
        interpolation="none",
    )
    figure.colorbar(picture, ax=axes, shrink=0.8, label="luminance of f [sr⁻¹]")
    if measured is not None:
        some = measured.subset(_MOST_DOTS, 0)
        theta_h, theta_d, _ = (angle * (180 / math.pi) for angle in rusinkiewicz_angles(some.wi, some.wo))
        axes.plot(theta_h.numpy(), theta_d.numpy(), ".", color="white", markersize=2, alpha=0.5)
    thirds = (0, 30, 60, 90)
    axes.set(xlim=(0, 90), ylim=(0, 90), xlabel="θh [°]", ylabel="θd [°]", xticks=thirds, yticks=thirds)
    axes.set_title("slice at φd = 90°", fontsize=10)


def _draw_lobes(axes: PolarAxes, reflectance: Reflectance, to_rgb: Callable[[Tensor], Tensor] | None) -> None:
    """Draw the cube root of f in the plane of incidence: a curve and a dashed ray for each light."""
    longest = 0.0
    lobes = [(degrees, *lobe_values(reflectance, degrees, to_rgb)) for degrees in LOBE_DEGREES]
    for (degrees, theta, values), colour in zip(lobes, _COLOURS, strict=True):
        radius = values.clamp_min(0) ** (1 / 3)
        longest = max(longest, float(radius.max()))
        axes.plot(theta.numpy(), radius.numpy(), color=colour, label=f"θi = {degrees:g}°")
    longest = longest if longest > 0 else 1.0
    for degrees, colour in zip(LOBE_DEGREES, _COLOURS, strict=True):
        axes.plot([-math.radians(degrees)] * 2, [0, longest * 1.05], color=colour, linestyle="--", linewidth=1)
    axes.set(theta_offset=math.pi / 2, theta_direction=-1, thetamin=-90, thetamax=90, rmin=0, rmax=longest * 1.05)
    axes.set_thetagrids((-90, -60, -30, 0, 30, 60, 90))
    # Few and round: the numbers stand side by side under half of the base line.
    axes.set_rgrids(_round_steps(longest), angle=-90)
    axes.tick_params(labelsize=8)
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, 0.1), ncol=3, fontsize=8)
    axes.set_title("lobes: ∛f in the plane of incidence (dashed: light)", fontsize=10)


def _round_steps(most: float) -> list[float]:
    """Return two to four multiples of a step of 1, 2 or 5 times a power of ten, from the step up to `most`."""
    power = 10.0 ** math.floor(math.log10(most))
    step = next(size for size in (power / 2, power, 2 * power) if most / size < 5)
    return [step * k for k in range(1, math.floor(most / step * (1 + 1e-9)) + 1)]


def _luminance(reflectance: Reflectance, wi: Tensor, wo: Tensor, to_rgb: Callable[[Tensor], Tensor] | None) -> Tensor:
    values = reflectance.evaluate(wi, wo).to(torch.float64)
    if to_rgb is not None:
        values = to_rgb(values)
    return values[:, 0] if values.shape[1] == 1 else values @ torch.tensor(LUMINANCE, dtype=torch.float64)


def _halves(text: str) -> list[str]:
    """The text on two lines, broken at the space nearest to its middle."""
    middle = len(text) // 2
    cut = min((i for i, c in enumerate(text) if c == " "), key=lambda i: abs(i - middle), default=len(text))
    return [text[:cut], text[cut + 1 :]]
