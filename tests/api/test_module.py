"""A fit as a module of PyTorch: values, derivatives, training, and the way back to a fit."""

from copy import deepcopy
from pathlib import Path

import pytest
import torch
from shading_cases import CASES, SEPARABLE

import homofact
from homofact.api.module import ProjectionModule
from homofact.errors import BadInput
from homofact.factor.fitted import Fitted
from homofact.geometry.directions import draw_uniform

FITS: dict[str, Fitted] = {**CASES, **SEPARABLE}


def pairs(count: int, seed: int = 0) -> tuple[torch.Tensor, torch.Tensor]:
    return draw_uniform(count, torch.Generator().manual_seed(seed))


@pytest.mark.parametrize("name", FITS)
def test_a_module_gives_the_values_of_its_fit_and_goes_back_to_it(name: str, tmp_path: Path) -> None:
    fit = homofact.Fit(FITS[name])
    module = fit.module()
    wi, wo = pairs(200)
    wi[:5, 2] *= -1
    expected = fit.evaluate(wi, wo)
    found = module(wi, wo)
    assert torch.allclose(found, expected, rtol=1e-9, atol=1e-12)
    assert not bool(found[:5].any())
    assert module(wi[:6].reshape(2, 3, 3), wo[0]).shape == (2, 3, len(fit.channels))
    back = module.to_fit()
    assert (back.channels, back.nbytes, back.fetches) == (fit.channels, fit.nbytes, fit.fetches)
    assert back.provenance["trained"] is True
    assert torch.equal(back.evaluate(wi, wo), expected)
    back.save(tmp_path / "trained.npz")
    assert torch.equal(homofact.load(tmp_path / "trained.npz").evaluate(wi, wo), expected)


@pytest.mark.parametrize(
    "name",
    [
        "searched in-out", "searched, warped isotropic half-tilt", "warped half-diff", "fixed wi",
        "round, warped, beside all angles", "five of all kinds", "in-out, polar, two", "half-diff, parabolic, two",
    ],
)  # fmt: skip
def test_derivatives_by_directions_and_parameters_are_right(name: str) -> None:
    module = homofact.Fit(next(fit for key, fit in FITS.items() if key == name)).module()
    wi, wo = (w.requires_grad_() for w in pairs(6, seed=4))
    parameters = dict(module.named_parameters())

    def values(wi: torch.Tensor, wo: torch.Tensor, *given: torch.Tensor) -> torch.Tensor:
        return torch.func.functional_call(module, dict(zip(parameters, given, strict=True)), (wi, wo))

    assert torch.autograd.gradcheck(values, (wi, wo, *parameters.values()), fast_mode=True, atol=1e-6)


def test_parameters_are_texels_and_projections_and_those_can_be_held_still() -> None:
    module = homofact.Fit(CASES["round, warped, beside all angles"]).module()
    names = set(dict(module.named_parameters()))
    assert names == {
        "textures.0", "textures.1", "textures.2", "projections.1.quaternions", "projections.2.quaternions",
    }  # fmt: skip
    mccool = homofact.Fit(CASES["McCool, one channel"]).module()
    assert {"projections.0.matrix", "projections.1.matrix"} < set(dict(mccool.named_parameters()))
    projections = mccool.get_submodule("projections").requires_grad_(False)
    mccool(*pairs(20)).sum().backward()
    assert mccool.textures[0].grad is not None
    assert all(parameter.grad is None for parameter in projections.parameters())
    assert "9 × 12" in repr(mccool)
    assert "wi, in-out, reciprocal" in repr(mccool)


def test_a_module_moves_between_types_and_round_its_state_dict() -> None:
    fit = homofact.Fit(CASES["five of all kinds"])
    module = fit.module(dtype=torch.float32)
    wi, wo = pairs(50)
    assert module(wi.float(), wo.float()).dtype == torch.float32
    assert torch.allclose(module(wi, wo).double(), fit.evaluate(wi, wo), rtol=1e-3)
    other = fit.module()
    with torch.no_grad():
        for parameter in other.parameters():
            parameter.mul_(1.01)
    again = fit.module()
    again.load_state_dict(other.state_dict())
    assert torch.equal(again(wi, wo), other(wi, wo))
    assert torch.equal(deepcopy(other)(wi, wo), other(wi, wo))
    with pytest.raises(BadInput, match=r"dtype: found torch\.int64"):
        fit.module(dtype=torch.int64)
    with pytest.raises(BadInput, match="wi: found a tensor on meta, expected cpu"):
        module(wi.to("meta"), wo.to("meta"))


def test_at_the_normal_the_derivative_is_a_number() -> None:
    module = homofact.Fit(CASES["five of all kinds"]).module()
    up = torch.tensor([[0.0, 0.0, 1.0]], dtype=torch.float64, requires_grad=True)
    module(up, up).sum().backward()
    assert up.grad is not None
    assert bool(torch.isfinite(up.grad).all())
    assert all(bool(torch.isfinite(p.grad).all()) for p in module.parameters() if p.grad is not None)


@pytest.mark.parametrize("name", ["searched half-diff", "McCool, one channel", "in-out, polar, shared"])
def test_training_finds_what_was_changed_and_the_fit_says_so(name: str, tmp_path: Path) -> None:
    fit = homofact.Fit(FITS[name])
    wi, wo = pairs(3000)
    wanted = fit.evaluate(wi, wo)
    module = fit.module()
    generator = torch.Generator().manual_seed(1)
    with torch.no_grad():
        for parameter in module.parameters():
            parameter.add_(0.02 * torch.randn(parameter.shape, generator=generator, dtype=torch.float64))

    def loss() -> torch.Tensor:
        return (module(wi, wo) - wanted).square().mean()

    before = float(loss().detach())
    optimizer = torch.optim.Adam(module.parameters(), lr=3e-3)
    for _ in range(150):
        optimizer.zero_grad()
        off = loss()
        off.backward()
        optimizer.step()
    assert float(loss().detach()) < before / 20
    trained = module.to_fit()
    assert torch.allclose(trained.evaluate(wi, wo), module(wi, wo).detach(), rtol=1e-9, atol=1e-12)
    trained.save(tmp_path / "trained.npz")
    assert torch.equal(homofact.load(tmp_path / "trained.npz").evaluate(wi, wo), trained.evaluate(wi, wo))
    # A reciprocal fit is one still.
    assert torch.allclose(trained.evaluate(wi, wo), trained.evaluate(wo, wi), rtol=1e-9, atol=1e-12)


@pytest.mark.slow
def test_what_has_no_textures_has_no_module_and_a_round_axis_stays_round() -> None:
    with pytest.raises(BadInput, match="has no textures, expected a fit by"):
        homofact.fit("material:phong-10", homofact.Ggx()).module()
    module = homofact.Fit(CASES["fixed theta_h-phi_h"]).module()
    projection = module.get_submodule("projections.0")
    assert isinstance(projection, ProjectionModule)
    assert not list(projection.parameters())
    with torch.no_grad():
        module.textures[0][:, 0] += 1
    wi, wo = pairs(100)
    assert torch.allclose(module.to_fit().evaluate(wi, wo), module(wi, wo).detach(), rtol=1e-9)
