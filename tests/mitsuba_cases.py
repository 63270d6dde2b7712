"""What the tests of the Mitsuba material share: saved fits, and calls of a `mitsuba.BSDF` with tensors."""

import importlib
import importlib.util
import math
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from torch import Tensor

import homofact
from homofact.brdf.log_transform import LogTransform
from homofact.brdf.reflectance import Reflectance
from homofact.brdf.source import open_source
from homofact.factor.factorization import Factorization, Term
from homofact.factor.projection import Projection, Warp, fixed_projection
from homofact.geometry.directions import draw_uniform, from_spherical
from homofact.rendering import mitsuba_bsdf

RGB = ("R", "G", "B")
COORDINATES = {
    "in-out": 4,
    "half-diff": 4,
    "isotropic-half-diff": 3,
    "isotropic-in-out": 3,
    "isotropic-angles": 3,
    "isotropic-half-tilt": 3,
}


def variant(name: str, register: bool = True) -> Any:
    """Mitsuba with that variant set, the material registered too; skips where Mitsuba or LLVM is missing."""
    if importlib.util.find_spec("mitsuba") is None:
        pytest.skip("Mitsuba is missing: pip install homofact[mitsuba]")
    mi = importlib.import_module("mitsuba")
    dr = importlib.import_module("drjit")
    if name.startswith("llvm") and not dr.has_backend(dr.JitBackend.LLVM):
        pytest.skip("LLVM is missing: install Debian's libllvm19, or set DRJIT_LIBLLVM_PATH")
    mi.set_variant(name)
    if register:
        mitsuba_bsdf.register()
    return mi


def factorization(*terms: tuple[Projection, Tensor], mean: tuple[float, ...] = (0.1, 0.2, 0.3)) -> Factorization:
    made = tuple(Term(each, texture, torch.ones(texture.shape[:2], dtype=torch.bool)) for each, texture in terms)
    channels = RGB if len(mean) == 3 else tuple(map(str, range(len(mean))))
    return Factorization(made, LogTransform(1e-5, torch.tensor(mean, dtype=torch.float64)), channels)


def random_texture(rows: int, columns: int, seed: int = 0, channels: int = 3) -> Tensor:
    return torch.randn(rows, columns, channels, dtype=torch.float64, generator=torch.Generator().manual_seed(seed))


def searched(coordinates: str, warp: Warp | None = None, reciprocal: bool = True, seed: int = 0) -> Projection:
    """A projection with rows in general position."""
    rows = torch.randn(2, COORDINATES[coordinates], dtype=torch.float64, generator=torch.Generator().manual_seed(seed))
    return Projection.from_rows(coordinates, rows, reciprocal, warp=warp)


def sharp() -> Factorization:
    """A lobe of 1.7° in half over a dim base, reddish."""
    warp = Warp(0.02)
    # The radius at each column: asinh(ρ/w)/asinh(1/w) = column/(columns − 1).
    rho = 0.02 * torch.sinh(torch.linspace(0, 1, 64, dtype=torch.float64) * math.asinh(1 / 0.02))
    theta = rho * (math.pi / 2)
    lobe = torch.log(0.05 + 50 * torch.exp(-((theta / 0.03) ** 2)))[None, :, None].expand(4, -1, 3)
    return factorization((fixed_projection("theta_h-theta_d", True, warp), lobe), mean=(1.0, 0.8, 0.6))


def saved_fits(folder: Path) -> dict[str, Path]:
    """`fits_by_name` saved in a folder."""
    for name, each in fits_by_name().items():
        each.save(folder / f"{name}.npz")
    return {name: folder / f"{name}.npz" for name in fits_by_name()}


@cache
def fits_by_name() -> dict[str, Any]:
    """Two searched textures, a lobe, an anisotropic one, a lobe as narrow as any: fitted once a process."""
    # Cole's search has no budget of seconds: the same textures on a busy machine.
    paint = homofact.fit(
        open_source("material:lafortune-blue-paint", count=5000, scheme="discs"),
        homofact.Cole(textures=2, size=12, restarts=1, search_size=4, search_samples=300),
    )
    phong = homofact.fit(homofact.read("material:phong-30", count=5000), homofact.McCool(projections=("h", "theta_d")))
    ward = homofact.read("material:ward-brushed", count=20_000)
    brushed = homofact.fit(ward, homofact.McCool(projections=("h", "wi"), size=24))
    return {"paint": paint, "phong": phong, "ward": brushed, "sharp": sharp()}


def saved(fit: Factorization, folder: Path) -> str:
    fit.save(folder / "fit.npz")
    return str(folder / "fit.npz")


def vectors(mi: Any, w: Tensor) -> Any:
    return mi.Vector3f(w.T.numpy().astype(np.float32))


def seen_from(mi: Any, wo: Tensor) -> Any:
    si = importlib.import_module("drjit").zeros(mi.SurfaceInteraction3f, len(wo))
    si.wi = vectors(mi, wo)
    return si


def pairs(count: int, seed: int = 1) -> tuple[Tensor, Tensor]:
    """Directions that float32 holds exactly."""
    wi, wo = draw_uniform(count, torch.Generator().manual_seed(seed))
    return wi.float().double(), wo.float().double()


def evaluated(mi: Any, bsdf: Any, wi: Tensor, wo: Tensor, context: Any = None) -> Tensor:
    """F cosθi (N, C) of Mitsuba's material."""
    values = bsdf.eval(context or mi.BSDFContext(), seen_from(mi, wo), vectors(mi, wi))
    return torch.from_numpy(np.array(values)).double().reshape(-1, len(wi)).T


def at(degrees: float, azimuth: float = 0.7) -> Tensor:
    theta, phi = torch.tensor([math.radians(degrees), azimuth], dtype=torch.float64)
    return from_spherical(theta, phi)


def drawn(mi: Any, bsdf: Any, wo: Tensor, count: int, seed: int = 5) -> tuple[Any, Any, Any]:
    """(interaction, samples, weights) of `count` draws."""
    si = seen_from(mi, wo.expand(count, 3))
    points = torch.rand(3, count, generator=torch.Generator().manual_seed(seed)).numpy()
    return si, *bsdf.sample(mi.BSDFContext(), si, mi.Float(points[0]), mi.Point2f(points[1:]))


def apart(found: Tensor, expected: Tensor) -> Tensor:
    """Relative differences where something is expected, sorted."""
    return ((found - expected).abs() / expected)[expected > 0].sort().values


def albedo(fit: Reflectance, wo: Tensor, rows: int = 300, columns: int = 480) -> Tensor:
    """∫ f cosθi dωi (C,) by the midpoint rule."""
    theta = (torch.arange(rows, dtype=torch.float64) + 0.5) * (math.pi / 2 / rows)
    phi = (torch.arange(columns, dtype=torch.float64) + 0.5) * (2 * math.pi / columns)
    grid = torch.meshgrid(theta, phi, indexing="ij")
    weights = (torch.sin(grid[0]) * (math.pi / 2 / rows * 2 * math.pi / columns)).reshape(-1)
    wi = from_spherical(*grid).reshape(-1, 3)
    return ((fit.evaluate(wi, wo.expand_as(wi)) * wi[:, 2:]) * weights[:, None]).sum(0)
