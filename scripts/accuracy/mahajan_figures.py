"""Draw the pictures of `mahajan.py`, one per figure of Mahajan, Tseng and Ramamoorthi (2008)."""

import math
from collections.abc import Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import torch
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from torch import Tensor

from homofact.brdf.reflectance import Reflectance
from homofact.figures.label_places import place_labels
from homofact.figures.log_axis import log_x, log_y
from homofact.files.atomic import replace_file
from homofact.rendering.light import DirectionalLight, EnvironmentMap
from homofact.rendering.sphere import SphereImage, render_sphere
from homofact.rendering.tonemap import choose_exposure, displayed
from homofact.theory.half_curve import HalfCurve
from homofact.theory.in_out import Decomposition
from homofact.theory.reflection import phong_filter

LIGHT, DARK, WARM, GREEN = "#7f9fbf", "#1f4e79", "#b5541c", "#4d7f3a"
KINDS = {"Cornell": WARM, "RGL": GREEN, "surrogate": LIGHT}
PIXELS = 140


def _clean(axes: Axes) -> None:
    axes.spines[["top", "right"]].set_visible(False)


def _functions(found: Decomposition, count: int, view: tuple[float, float], pixels: int) -> list[tuple[int, Tensor]]:
    """(m, picture) of the first `count` singular functions g(ωi); pairs as cosine (m ≥ 0) and sine (−m).

    `view` (sine, cosine) tilts the sphere towards the viewer; NaN outside of the disc and of the domain.
    """
    ticks = torch.linspace(-1, 1, pixels, dtype=torch.float64)
    x, y = torch.meshgrid(ticks, -ticks, indexing="xy")
    depth = 1 - x**2 - y**2
    near = depth.clamp_min(0).sqrt()
    sine, cosine = view
    direction = torch.stack((x, y * cosine - near * sine, y * sine + near * cosine), -1)
    theta = torch.atan2(torch.hypot(direction[..., 0], direction[..., 1]), direction[..., 2])
    phi = torch.atan2(direction[..., 1], direction[..., 0])
    outside = (depth < 0) | (theta > found.grid.limit)
    pictures = []
    for place in range(len(found.sigma[0])):
        m, radial = int(found.order[0, place]), found.left[0, place]
        # The sign of a singular function is anybody's; the largest value is drawn positive.
        radial = radial * torch.sign(radial[radial.abs().argmax()])
        profile = np.interp(theta.numpy(), found.grid.theta.numpy(), radial.numpy())
        waves = [(m, torch.cos(m * phi))] + ([(-m, torch.sin(m * phi))] if m else [])
        for name, wave in waves:
            values = torch.from_numpy(profile) * wave
            pictures.append((name, torch.where(outside, math.nan, values / values[~outside].abs().max())))
        if len(pictures) >= count:
            break
    return pictures[:count]


def _show(axes: Axes, picture: Any, title: str = "") -> None:
    axes.imshow(np.asarray(picture), cmap="RdBu_r", vmin=-1, vmax=1, interpolation="bilinear")
    axes.set_title(title, fontsize=8, pad=2)
    axes.axis("off")


def _values_against_order(axes: Axes, spectra: Mapping[int, Decomposition], whole: bool) -> None:
    """Every singular value at the order it belongs to, F_l as a line."""
    last = 20
    degree = torch.arange(last + 1)
    times = 2 * degree + 1 if whole else degree + 1
    place = degree.repeat_interleave(times)
    for (s, found), colour in zip(spectra.items(), (DARK, WARM), strict=True):
        axes.plot(degree, phong_filter(last, s), color=colour, lw=1.4, label=f"$F_l$, s = {s} (3.37)")
        axes.plot(
            place, found.values()[: len(place)], "o", color=colour, ms=4, mfc="none", mew=0.9, label=f"SVD, s = {s}"
        )
    axes.set_xlabel("order l" if whole else "order l, l + 1 values at each")
    axes.set_ylabel("singular value")
    axes.set_xticks(range(0, last + 1, 4))
    axes.legend(frameon=False, fontsize=9)
    _clean(axes)


def spectrum(path: Path, spectra: Mapping[int, Decomposition], whole: bool) -> None:
    """Figure 2 (the sphere, with its first functions) or 5 (hemispheres): singular values against F_l."""
    if not whole:
        chart = Figure(figsize=(5.6, 4.2), layout="constrained")
        _values_against_order(chart.subplots(), spectra, whole)
        chart.suptitle("Figure 5: Phong on hemispheres\nfollows the sphere's $F_l$, l + 1 values an order", fontsize=11)
        replace_file(path, lambda made: chart.savefig(made, dpi=110))
        return
    chart = Figure(figsize=(12, 4.6), layout="constrained")
    halves: Any = chart.subfigures(1, 2, width_ratios=(1.15, 1))
    pictured, charted = halves
    grid = pictured.subplots(4, 7)
    for axis in grid.ravel():
        axis.axis("off")
    s = max(spectra)
    pictures = _functions(spectra[s], 16, (0.75, math.sqrt(1 - 0.75**2)), 90)
    for degree in range(4):
        own = sorted(pictures[degree**2 : (degree + 1) ** 2], key=lambda each: each[0])
        for column, (m, picture) in enumerate(own, start=3 - degree):
            _show(grid[degree, column], picture, f"l = {degree}, m = {m}")
    pictured.suptitle(f"Singular functions g(ωi), s = {s}: spherical harmonics (red +, blue −)", fontsize=10)
    _values_against_order(charted.subplots(), spectra, whole)
    charted.suptitle("Singular values, 2l + 1 at each order", fontsize=10)
    chart.suptitle("Figure 2: Phong on the sphere", fontsize=12)
    replace_file(path, lambda made: chart.savefig(made, dpi=110))


def terms_against_exponent(
    path: Path, exponents: Sequence[int], whole: Sequence[int], half: Sequence[int], limit: float
) -> None:
    """Figure 3A: K for 99% of Σσ² against the exponent, the paper's lines and the limit of the formula."""
    chart = Figure(figsize=(6.4, 4.6), layout="constrained")
    axes = chart.subplots()
    ends = torch.tensor([0, max(exponents)], dtype=torch.float64)
    for terms, share, colour, name in ((whole, 1.0, DARK, "sphere"), (half, 0.5, WARM, "hemisphere")):
        axes.plot(exponents, terms, "o", ms=3, color=colour, label=f"SVD, {name}")
        axes.plot(ends, 5 * share * ends, "--", color=colour, lw=1, label=f"the paper's {5 * share:g} s")
        axes.plot(
            ends, limit * share * ends, "-", color=colour, lw=1, label=f"limit ln(100) s{'' if share == 1 else '/2'}"
        )
    axes.set(xlim=(0, max(exponents) * 1.02), ylim=(0, None), xlabel="Phong exponent s", ylabel="terms K")
    axes.legend(frameon=False, fontsize=9)
    axes.set_title("Figure 3A: terms for 99% of Σσ²", fontsize=11)
    _clean(axes)
    replace_file(path, lambda made: chart.savefig(made, dpi=110))


def functions(path: Path, found: Decomposition, exponent: int) -> None:
    """Figure 4: the first singular functions on the hemisphere, seen along the normal."""
    chart = Figure(figsize=(8.4, 5.4), layout="constrained")
    grid = chart.subplots(3, 5).ravel()
    values = found.values()
    for k, (axis, (m, picture)) in enumerate(zip(grid, _functions(found, 15, (0.0, 1.0), 110), strict=True)):
        _show(axis, picture, f"k = {k + 1}, m = {m}, σ = {float(values[k]):.3f}")
    chart.suptitle(
        f"Figure 4: singular functions g(ωi) on the hemisphere, Phong s = {exponent} (red +, blue −)", fontsize=11
    )
    replace_file(path, lambda made: chart.savefig(made, dpi=110))


def _row(axes: Sequence[Axes], images: Sequence[tuple[str, SphereImage]], exposure: float) -> None:
    for axis, (name, image) in zip(axes, images, strict=True):
        axis.imshow(displayed(image, exposure, background=1.0).numpy(), interpolation="bilinear")
        axis.set_title(name, fontsize=9)
        axis.axis("off")


def spheres(path: Path, lobe: Reflectance, whole: Decomposition, half: Decomposition) -> None:
    """Figure 3B and C: lit spheres of Phong s = 30 with fewer terms, made on the sphere and on hemispheres."""
    light = DirectionalLight((0.4, 0.5, 1.0))
    truth = render_sphere(lobe, light, PIXELS)
    chart = Figure(figsize=(10, 4.6), layout="constrained")
    grid = chart.subplots(2, 5)
    exposure = choose_exposure(truth)
    for row, (found, counts, name) in enumerate(
        ((whole, (4, 16, 50, 150), "sphere"), (half, (4, 16, 25, 75), "hemisphere"))
    ):
        images = [(f"{name}, K = {k}", render_sphere(found.truncated(k), light, PIXELS)) for k in counts]
        _row(list(grid[row]), [*images, ("all terms", truth)], exposure)
    chart.suptitle("Figure 3B, C: Phong s = 30, 5 s = 150 terms on the sphere, 2.5 s = 75 on hemispheres", fontsize=11)
    replace_file(path, lambda made: chart.savefig(made, dpi=110))


def lit(path: Path, lobe: Reflectance, half: Decomposition, light: EnvironmentMap) -> None:
    """Figure 6: Phong s = 30 under a light probe with 4, 12 and 75 terms and with all."""
    counts = (4, 12, 75)
    images = [(f"K = {k}", render_sphere(half.truncated(k), light, 96, samples=300)) for k in counts]
    truth = render_sphere(lobe, light, 96, samples=300)
    chart = Figure(figsize=(9.4, 2.9), layout="constrained")
    _row(list(chart.subplots(1, 4)), [*images, ("all terms", truth)], choose_exposure(truth))
    chart.suptitle(
        "Figure 6: Phong s = 30 in St. Peter's (a sphere without shadows; the paper's scene is its own)", fontsize=10
    )
    replace_file(path, lambda made: chart.savefig(made, dpi=120))


def half_angle_figure(
    path: Path,
    models: Sequence[tuple[float, HalfCurve]],
    curves: Sequence[tuple[str, str, HalfCurve]],
    lines: Mapping[int, Sequence[Any]],
    points: Sequence[Any],
) -> None:
    """Figure 7: half-angle curves, and K against (l* + 1)² of the model at each limit and of the materials."""
    chart = Figure(figsize=(13, 5.6), layout="constrained")
    left, right = chart.subplots(1, 2, width_ratios=(1, 1.25))
    for _, kind, curve in curves:
        left.plot(torch.rad2deg(curve.theta_h), curve.values / curve.values[0], color=KINDS[kind], lw=0.9, alpha=0.8)
    for (sigma, curve), style in zip(models, ("-", "--"), strict=True):
        label = f"Torrance-Sparrow, σ = {sigma:g}"
        left.plot(torch.rad2deg(curve.theta_h), curve.values / curve.values[0], "k", ls=style, lw=1.6, label=label)
    for kind in dict.fromkeys(kind for _, kind, _ in curves):
        left.plot([], [], color=KINDS[kind], label=kind)
    left.set(xlim=(0, 60), xlabel="θh in degrees", ylabel="mean over θd, φd and channels, relative to θh = 0")
    log_y(left, 1e-4, 40)  # room for the legend
    left.legend(frameon=False, fontsize=9, loc="upper right")
    left.set_title("Figure 7A, B: half-angle curves", fontsize=11)
    _clean(left)
    for (degrees, own), style in zip(lines.items(), ("k-", "k--", "k:"), strict=True):
        name = "whole hemisphere" if degrees == 90 else f"θ ≤ {degrees}°"
        right.plot(
            [(p.l_star + 1) ** 2 for p in own], [p.terms for p in own], style, lw=1.2, label=f"Torrance-Sparrow, {name}"
        )
    orders = [(p.l_star + 1) ** 2 for own in (*lines.values(), points) for p in own]
    counts = [p.terms for own in (*lines.values(), points) for p in own]
    low, high = max(1.0, min(orders) / 1.5), max(orders) * 1.6
    right.plot([low, high], [low / 4, high / 4], color="0.6", lw=1, label="K = (l* + 1)²/4")
    log_x(right, low, high)
    log_y(right, 0.7, max(*counts, high / 4) * 1.5)
    for settled, marker, words in ((True, "o", ""), (False, "^", ", K not settled")):
        for kind, colour in KINDS.items():
            own = [p for p in points if p.settled is settled and p.kind == kind]
            if own:
                at = [(p.l_star + 1) ** 2 for p in own], [p.terms for p in own]
                right.plot(*at, marker, color=colour, ms=6, mec="white", mew=0.5, label=f"{kind}{words}")
    right.set(xlabel="(l* + 1)²", ylabel="terms K for 99% of Σσ²")
    right.legend(frameon=False, fontsize=8, loc="upper left")
    right.set_title("Figure 7C: terms against the order of the half-angle curve", fontsize=11)
    _clean(right)
    if points:
        _label(chart, right, points)
    replace_file(path, lambda made: chart.savefig(made, dpi=110))


def _label(chart: Figure, axes: Axes, points: Sequence[Any]) -> None:
    """Names beside the materials' points, on nothing else."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    FigureCanvasAgg(chart).draw()
    scale = 72 / chart.dpi
    where = axes.transData.transform([((p.l_star + 1) ** 2, p.terms) for p in points]) * scale
    box = axes.get_window_extent()
    # Axes are logarithmic: between two vertices a line is straight on the page.
    pages = [axes.transData.transform(np.asarray(each.get_xydata())) * scale for each in axes.lines[:4]]
    steps = np.linspace(0, 1, 30)[:, None]
    lines = [tuple(at) for page in pages for a, b in pairwise(page) for at in a + steps * (b - a)]
    names = [p.name.replace("_", " ") for p in points]
    sizes = [(3.7 * len(name) + 2, 9.0) for name in names]
    bounds = (box.x0 * scale, box.y0 * scale, box.x1 * scale, box.y1 * scale)
    legend = axes.get_legend()
    assert legend is not None
    # The legend's box is no place for a name either.
    covered = legend.get_window_extent()
    others = [
        (x * scale, y * scale)
        for x in np.arange(covered.x0, covered.x1, 10)
        for y in np.arange(covered.y0, covered.y1, 10)
    ]
    places = place_labels([tuple(at) for at in where], sizes, bounds, others=others, lines=lines)
    for name, place, at in zip(names, places, where, strict=True):
        x, y = place.box[0] + 1, (place.box[1] + place.box[3]) / 2
        if place.leader:
            nearest = np.clip(at, place.box[:2], place.box[2:])
            ends = axes.transData.inverted().transform(np.array([at, nearest]) / scale)
            axes.plot(ends[:, 0], ends[:, 1], color="0.6", lw=0.5)
        shown = axes.transData.inverted().transform(np.array([x, y]) / scale)
        axes.annotate(
            name, (float(shown[0]), float(shown[1])), fontsize=7, va="center", ha="left", annotation_clip=False
        )
