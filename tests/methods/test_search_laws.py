"""What a searched fit must reach, by planted products: laws of its behaviour, whatever goes on inside it."""

from typing import Any

import pytest
import torch
from torch import Tensor

from homofact.brdf.samples import Samples
from homofact.factor.projection import Projection, fixed_projection
from homofact.factor.textures import LogSamples, residual, solve_terms
from homofact.geometry.directions import draw_in_discs, from_spherical
from homofact.geometry.rotation import Rotation
from homofact.methods.fitting import MethodFit
from homofact.methods.kinds import loosened
from homofact.methods.search import Search

SMOOTHING = 1e-5


def fit(samples: Samples, **settings: Any) -> MethodFit:
    """The one place that knows how a searched fit is called."""
    return Search(epsilon=1e-5, **settings).fit(samples)


def found(result: MethodFit, name: str) -> Any:
    """What the fit says of itself: "smoothing" of every texture, "validation_error", "kinds"."""
    return result.factorization.provenance[name]


def rotated_off(name: str, seed: int, step: float) -> Projection:
    """A fixed projection turned a little, so that no fixed one is it any more."""
    loose = loosened(fixed_projection(name, True))
    assert loose is not None
    assert loose.rotation is not None
    step_taken = step * torch.randn(4, dtype=torch.float64, generator=torch.Generator().manual_seed(seed))
    moved = loose.rotation.quaternions.flatten() + step_taken
    return Projection.from_rotation(loose.coordinates, Rotation.of_numbers(moved / moved.norm()), True)


def samples_of(logs: Tensor, wi: Tensor, wo: Tensor) -> Samples:
    return Samples(wi, wo, torch.exp(logs)[:, None], channels=("Y",), isotropic=True)


def pairs(count: int) -> tuple[Tensor, Tensor]:
    return draw_in_discs(count, torch.Generator().manual_seed(0), 0.98)


def test_projections_off_the_fixed_ones_are_found() -> None:
    """A product of two textures, each turned off a fixed kind: both must leave their fixed places."""
    wi, wo = pairs(2000)
    first, second = rotated_off("theta_h-theta_d", 1, 0.4), rotated_off("theta_i-theta_o", 2, 0.4)
    logs = sum(1.5 * torch.cos(2.5 * uv[:, 0] + 0.5) * torch.sin(2 * uv[:, 1] + 0.3) for uv in first.place(wi, wo))
    logs = logs + sum(torch.sin(2.5 * uv[:, 0] + 1) * torch.cos(2 * uv[:, 1]) for uv in second.place(wi, wo))
    assert isinstance(logs, Tensor)
    samples = samples_of(logs, wi, wo)
    common = {"textures": 2, "size": 12, "search_size": 8, "search_samples": 1000, "restarts": 2, "smoothing": 1e-4}
    fixed = fit(samples, projections=("theta_h-theta_d", "theta_i-theta_o"), **common)
    free = fit(samples, **common)
    assert free.report.residual < 0.3 * fixed.report.residual


def test_refinement_at_full_size_lowers_the_training_error() -> None:
    """Against the projections that small textures and few samples find, solved for at full size."""
    wi, wo = pairs(2500)
    planted = rotated_off("theta_h-theta_d", 1, 0.2)
    logs = sum(1.5 * torch.cos(5 * uv[:, 0] + 0.5) * torch.sin(4 * uv[:, 1] + 0.3) for uv in planted.place(wi, wo))
    assert isinstance(logs, Tensor)
    samples = samples_of(logs, wi, wo)
    common = {"textures": 1, "projections": ("isotropic-half-tilt",), "restarts": 3, "smoothing": SMOOTHING}
    fine = fit(samples, size=16, search_size=5, search_samples=300, **common)
    coarse = fit(samples, size=5, search_size=5, search_samples=300, **common)
    observed = LogSamples.of(samples, coarse.factorization.transform)
    projections = tuple(term.projection for term in coarse.factorization.terms)
    solved = solve_terms(observed, projections, ((16, 16),), SMOOTHING, "cholesky")
    unrefined = float(residual(observed, solved.terms).square().mean())
    assert fine.report.residual < 0.5 * unrefined


def goniometer() -> Samples:
    """Rings of θi and θo, and a fault of its own on every ring of θi."""
    theta_i, theta_o = torch.arange(1, 8).double() * 0.17, torch.arange(0, 9).double() * 0.16
    axes = torch.meshgrid(theta_i, theta_o, torch.linspace(0, 3, 11).double(), indexing="ij")
    a, b, turn = (axis.reshape(-1) for axis in axes)
    faults = 0.5 * torch.randn(9, dtype=torch.float64, generator=torch.Generator().manual_seed(0))
    wi, wo = from_spherical(a, torch.zeros_like(a)), from_spherical(b, turn)
    return samples_of(torch.cos(a) + torch.cos(b) + faults[(a / 0.17).round().long()], wi, wo)


def test_how_gridded_data_are_judged_is_the_users_choice() -> None:
    """Left-out samples are known from their ring's others; a left-out ring is known from no one."""
    rings, scattered = (
        fit(goniometer(), textures=1, size=8, projections=("theta_i-theta_o",), validation=name)
        for name in ("rings", "random")
    )
    assert found(rings, "validation_error") > 1.3 * found(scattered, "validation_error")
    assert found(rings, "smoothing")[0] >= 100 * found(scattered, "smoothing")[0]


def test_samples_on_no_rings_are_judged_alike() -> None:
    wi, wo = pairs(600)
    samples = samples_of(torch.cos(3 * wi[:, 0]) * wo[:, 2], wi, wo)
    one, other = (
        fit(samples, textures=1, size=6, projections=("theta_i-theta_o",), validation=name)
        for name in ("rings", "random")
    )
    assert found(one, "validation_error") == pytest.approx(found(other, "validation_error"), rel=1e-12)


def test_every_texture_has_the_smoothing_that_its_data_ask_for() -> None:
    """One texture waves from texel to texel, the other is a ramp, which smoothing costs nothing."""
    generator = torch.Generator().manual_seed(0)
    wi, wo = draw_in_discs(2500, generator, 0.98)
    waves, ramp = (fixed_projection(name, True).place(wi, wo)[0] for name in ("theta_h-theta_d", "theta_i-theta_o"))
    noise = 0.5 * torch.randn(2500, dtype=torch.float64, generator=generator)
    logs = torch.sin(9 * waves).sum(1) + 0.3 * ramp.sum(1) + noise
    result = fit(samples_of(logs, wi, wo), textures=2, size=10, projections=("theta_h-theta_d", "theta_i-theta_o"))
    rough, smooth = found(result, "smoothing")
    assert smooth >= 10 * rough
