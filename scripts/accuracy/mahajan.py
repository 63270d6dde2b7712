"""Repeat the experiments of Mahajan, Tseng and Ramamoorthi (2008) on the number of in-out terms, by figure.

    python scripts/accuracy/mahajan.py [--out FOLDER] [--data FOLDER] [--short]

SVD of Phong's lobe on the sphere and on the hemisphere against F_l of Ramamoorthi (2002, eq. 3.37), K for 99% of Σσ²
against the exponent, K of the Torrance-Sparrow lobe (eq. 14) and of measured materials against l*. Printed beside the
paper's claims; the pictures are its figures 2 to 7. Surrogates are networks fitted to MERL materials, not MERL.
"""

import math
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import torch
from torch import Tensor

from homofact.brdf.analytic import TorranceSparrow
from homofact.brdf.source import open_source
from homofact.brdf.symmetry import Symmetry
from homofact.evaluation.machine import machine
from homofact.rendering.environment import read_environment
from homofact.theory.half_curve import ORDER, HalfCurve, half_angle_curve
from homofact.theory.in_out import Decomposition, DirectionGrid, count_for_share, decompose
from homofact.theory.reflection import phong_filter
from homofact.theory.terms import half_angle_terms, mirror_terms, phong_terms, settled_decomposition

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from scripts.accuracy import mahajan_figures as draw
from scripts.shared.harness import cornell_files, data_folder, figure, markdown, parser_of

SHARE = 0.99
EXPONENTS = tuple(range(1, 101))
SIGMAS = (0.1, 0.125, 0.15, 0.175, 0.2, 0.225, 0.25, 0.3, 0.35, 0.4)
# How far from the normal directions go: the whole hemisphere, and two ways of leaving out grazing ones.
LIMITS = (90, 85, 75)
MATERIAL_LIMIT = 75
RGL = ("aurora_white", "vch_golden_yellow", "chm_light_blue", "irid_flake_paint1")
SURROGATES = (
    "alum-bronze", "blue-acrylic", "blue-rubber", "cherry-235", "gold-paint", "green-latex", "nickel", "pearl-paint",
    "pink-fabric", "red-plastic", "teflon", "yellow-matte-plastic",
)  # fmt: skip
EVEN = Symmetry(isotropic=True, reciprocal=True, mirrored=True, half_turn=True)


@dataclass(frozen=True)
class PhongLobe:
    """(s+1)/2π max(0, R·L)^s of the paper's eq. 5, defined on the whole sphere; one channel."""

    exponent: float
    channels: tuple[str, ...] = ("Y",)
    nbytes: int = 4
    fetches: int = 0

    def evaluate(self, wi: Tensor, wo: Tensor) -> Tensor:
        """Values (N, 1) in sr⁻¹ of any pair of directions."""
        cosine = 2 * wi[:, 2:] * wo[:, 2:] - (wi * wo).sum(1, keepdim=True)
        return (self.exponent + 1) / (2 * math.pi) * cosine.clamp(0, 1) ** self.exponent


@dataclass(frozen=True)
class Point:
    """One material's orders and terms."""

    name: str
    kind: str
    l_star: float
    terms: int
    settled: bool


def phong_svd(exponent: float, whole: bool) -> Decomposition:
    """Phong's decomposition on the sphere (`whole`) or the hemisphere, exact for s ≤ 100 to all digits that matter."""
    limit = math.pi if whole else math.pi / 2
    rings = (96 if whole else 56) if exponent >= 4 else (160 if whole else 80)
    return decompose(PhongLobe(exponent), DirectionGrid(rings, 128, limit), EVEN)


def lobe(sigma: float) -> TorranceSparrow:
    """Eq. 14 by itself."""
    return TorranceSparrow((0.0,), (1.0,), sigma, channels=("Y",))


def torrance_sparrow(sigma: float, degrees: float) -> Point:
    """K and l* of eq. 14 with directions up to `degrees` from the normal; the curve is exact up to there."""
    limit = math.radians(degrees)
    rings = 160 if sigma < 0.15 else 100
    found = decompose(lobe(sigma), DirectionGrid(rings, 3 * rings, limit), EVEN)
    return Point(
        f"σ = {sigma:g}", "model", half_angle_curve(lobe(sigma), limit).l_star(SHARE), found.count(SHARE), True
    )


def on_the_papers_grid(sigma: float, side: int = 40) -> int:
    """K of eq. 14 from the matrix over `side` even steps of cosθ and φ each, midpoints, as the paper made it.

    The matrix is block-circulant in azimuth, so that a Fourier transform of one block row has its singular values.
    """
    cosine = (torch.arange(side, dtype=torch.float64) + 0.5) / side
    sine, phi = (1 - cosine**2).sqrt(), torch.arange(side, dtype=torch.float64) * (2 * math.pi / side)
    wi = torch.stack((sine, torch.zeros_like(sine), cosine), 1)
    wo = torch.stack(
        (sine[:, None] * torch.cos(phi), sine[:, None] * torch.sin(phi), cosine[:, None].expand(-1, side)), 2
    ).reshape(-1, 3)
    pairs = wi.repeat_interleave(len(wo), 0), wo.repeat(side, 1)
    blocks = lobe(sigma).evaluate(*pairs).reshape(side, side, side)
    values = torch.linalg.svdvals(torch.fft.fft(blocks, dim=2).permute(2, 0, 1)).flatten()
    return count_for_share(values.sort(descending=True).values, SHARE)


def line(x: Sequence[float], y: Sequence[float]) -> tuple[float, float, float]:
    """(slope, intercept, R²) of the least squares line."""
    design = torch.tensor([[each, 1.0] for each in x], dtype=torch.float64)
    target = torch.tensor(list(y), dtype=torch.float64)
    slope, intercept = torch.linalg.lstsq(design, target[:, None]).solution[:, 0].tolist()
    rest = ((target - slope * design[:, 0] - intercept) ** 2).sum()
    return slope, intercept, float(1 - rest / ((target - target.mean()) ** 2).sum())


def sources(data: Path, short: bool) -> tuple[list[tuple[str, str, str]], list[str]]:
    """((source, name, kind) of every material that is there, a message for each that is not)."""
    files, missing = cornell_files(data)
    found = [] if short else [(str(file), file.stem, "Cornell") for file in files]
    for name in RGL[:1] if short else RGL:
        file = data / "rgl" / f"{name}_rgb.bsdf"
        if file.is_file():
            found.append((str(file), name, "RGL"))
        else:
            missing.append(f"skipped {name}: no {file}")
    weights = data / "nbrdf" / "merl_nbrdf_weights.npz"
    if weights.is_file():
        from homofact.brdf.formats.nbrdf import material_names

        known = set(material_names(weights))
        wanted = [name for name in SURROGATES if name in known][: 1 if short else None]
        found += [(f"{weights}#{name}", name, "surrogate") for name in wanted]
    else:
        missing.append(f"skipped the surrogates: no {weights}")
    return found, missing


def measured(source: str, name: str, kind: str) -> tuple[Point, HalfCurve]:
    """K and l* of a material, mean of its channels, and the half-angle curve that l* is from."""
    reflectance = open_source(source, count=100).reflectance
    limit = math.radians(MATERIAL_LIMIT)
    curve = half_angle_curve(reflectance, limit)
    found, settled = settled_decomposition(reflectance, SHARE, limit)
    return Point(name, kind, curve.l_star(SHARE), found.count(SHARE), settled), curve


def phong_part(short: bool, out: Path | None, exponents: Sequence[int]) -> list[tuple[str, str, str]]:
    """Rows (what, the paper's claim, found here) of figures 2 to 5."""
    spectra = {s: phong_svd(s, True) for s in (10, 30)}
    halves = {s: phong_svd(s, False) for s in (10, 30)}
    rows = []
    for s, found in spectra.items():
        degree = torch.arange(26)
        theory = phong_filter(25, s).repeat_interleave(2 * degree + 1)[:25]
        off = float((found.values()[:25] / theory - 1).abs().max())
        rows.append((f"s = {s}: leading 25 singular values against (3.37)", "excellent agreement", f"within {off:.1g}"))
    whole = [phong_svd(s, True).count(SHARE) for s in exponents]
    half = [phong_svd(s, False).count(SHARE) for s in exponents]
    limit = phong_terms(1, SHARE)
    for name, terms, claim, ideal in (("sphere", whole, "5", limit), ("hemisphere", half, "2.5", limit / 2)):
        slope, start, fit = line(exponents, terms)
        through = sum(s * k for s, k in zip(exponents, terms, strict=True)) / sum(s * s for s in exponents)
        words = f"{slope:.2f} (intercept {start:.1f}, R² {fit:.4f}; through 0 {through:.2f}; limit {ideal:.2f})"
        rows.append((f"slope of K against s, {name}, s to {exponents[-1]}", claim, words))
    for s, k in zip(exponents, half, strict=True):
        if s in (1, 20, 30):
            claim = {1: "2-4", 20: "about 50", 30: "75"}[s]
            rows.append((f"s = {s}: terms on the hemisphere", claim, str(k)))
    sixth = [s for s, k in zip(exponents, half, strict=True) if k <= 16]
    rows.append(("largest exponent with 16 terms", "about 6", str(max(sixth))))
    predicted = mirror_terms(phong_filter(60, 30), SHARE), mirror_terms(phong_filter(60, 30), SHARE, hemisphere=True)
    words = f"{predicted[0]} and {predicted[1]} (SVD {spectra[30].count(SHARE)} and {halves[30].count(SHARE)})"
    rows.append(("s = 30: K from F_l, each 2l+1 and l+1 times", "–", words))
    if out is not None:
        draw.spectrum(out / "figure_2.png", spectra, whole=True)
        draw.terms_against_exponent(out / "figure_3a.png", exponents, whole, half, limit)
        draw.functions(out / "figure_4.png", halves[30], 30)
        draw.spectrum(out / "figure_5.png", halves, whole=False)
        if not short:
            draw.spheres(out / "figure_3bc.png", PhongLobe(30), spectra[30], halves[30])
    return rows


def microfacet_part(sigmas: Sequence[float]) -> tuple[list[tuple[str, str, str]], dict[int, list[Point]]]:
    """(rows as of `phong_part`, points by limit) of the Torrance-Sparrow lobe."""
    points = {degrees: [torrance_sparrow(sigma, degrees) for sigma in sigmas] for degrees in LIMITS}
    rows = []
    for degrees, own in points.items():
        words = "whole hemisphere" if degrees == 90 else f"θ ≤ {degrees}°"
        for power, shift in (("(l*)²", 0), ("(l* + 1)²", 1)):
            slope, start, fit = line([(p.l_star + shift) ** 2 for p in own], [p.terms for p in own])
            found = f"{slope:.3f} (intercept {start:.1f}, R² {fit:.4f})"
            rows.append((f"Torrance-Sparrow, {words}: slope of K against {power}", "0.25", found))
        for sigma, claim in ((0.2, "about 60"), (0.4, "10-20")):
            point = own[list(sigmas).index(sigma)]
            found = f"{point.terms} (from l* = {point.l_star:.1f}: {half_angle_terms(point.l_star)})"
            rows.append((f"σ = {sigma}, {words}: K", claim, found))
    for sigma, claim in ((0.2, "about 60"), (0.4, "10-20")):
        rows.append((f"σ = {sigma}, even grid of 40⁴, whole hemisphere: K", claim, str(on_the_papers_grid(sigma))))
    return rows, points


def main(arguments: list[str] | None = None) -> int:
    """Print the tables and, with --out, draw the figures; returns the exit code."""
    parser = parser_of(__doc__, "data")
    parser.add_argument("--out", type=Path, help="a folder for the figures")
    chosen = parser.parse_args(arguments)
    began, data = time.perf_counter(), data_folder(chosen.data)
    if chosen.out is not None:
        chosen.out.mkdir(parents=True, exist_ok=True)
    print(machine() + ("; a smoke test, not results" if chosen.short else ""))
    exponents = (1, 5, 20, 30) if chosen.short else EXPONENTS
    sigmas = (0.2, 0.3, 0.4) if chosen.short else SIGMAS
    rows = phong_part(chosen.short, chosen.out, exponents)
    more, models = microfacet_part(sigmas)
    print(markdown(("what", "paper", "here"), rows + more) + "\n")
    found, missing = sources(data, chosen.short)
    for message in missing:
        print(message, file=sys.stderr)
    points, curves = [], []
    for source, name, kind in found:
        start = time.perf_counter()
        point, curve = measured(source, name, kind)
        points.append(point)
        curves.append((name, kind, curve))
        print(f"{name}: {time.perf_counter() - start:.0f} s", file=sys.stderr)
    if points:
        cells = [
            (
                point.name,
                point.kind,
                f"{'≥ ' if point.l_star >= ORDER else ''}{point.l_star:.1f}",
                half_angle_terms(point.l_star),
                f"{'' if point.settled else '~ '}{point.terms}",
                figure(point.terms / half_angle_terms(point.l_star)),
            )
            for point in points
        ]
        about = f"directions up to {MATERIAL_LIMIT}°, mean of the channels, {SHARE:.0%} of Σσ²"
        print(f"Materials, {about}; ~ not settled on the finest grid\n")
        print(markdown(("material", "kind", "l*", "(l* + 1)²/4", "K by SVD", "ratio"), cells, 2))
    if chosen.out is not None:
        models_drawn = [(sigma, half_angle_curve(lobe(sigma), math.radians(MATERIAL_LIMIT))) for sigma in (0.1, 0.2)]
        draw.half_angle_figure(chosen.out / "figure_7.png", models_drawn, curves, models, points)
        probe = data / "envmaps" / "stpeters_probe_latlong.hdr"
        if probe.is_file() and not chosen.short:
            draw.lit(chosen.out / "figure_6.png", PhongLobe(30), phong_svd(30, False), read_environment(probe))
        print(f"\nFigures: {', '.join(sorted(file.name for file in chosen.out.glob('figure_*.png')))}")
    print(f"{time.perf_counter() - began:.0f} s in all", file=sys.stderr)
    return 0


if __name__ == "__main__":
    sys.exit(main())
