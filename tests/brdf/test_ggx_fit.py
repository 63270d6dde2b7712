"""Fits of GGX models: slopes are those of the values, parameters of a model are found again."""

import numpy as np
import pytest
import torch

from homofact.brdf.analytic.ggx import GgxBrdf, GgxLobe
from homofact.brdf.analytic.ggx_fit import _Lobes, fit_ggx
from homofact.brdf.sampling import sample_model

TWO = GgxBrdf((0.1, 0.2, 0.1), (GgxLobe((0.3, 0.3, 0.3), 0.06, 0.1), GgxLobe((0.9, 0.5, 0.2), 0.4, 0.3)))


def parameters(model: GgxBrdf) -> np.ndarray:
    """The free numbers of a model, as the fit has them."""
    parts = [np.sqrt(model.diffuse)]
    for lobe in model.lobes:
        odds = lobe.reflectance / (1 - lobe.reflectance)
        parts += [np.sqrt(lobe.specular), [np.log(lobe.roughness)], [np.log(odds)]]
    return np.concatenate(parts)


def test_values_are_those_of_the_model() -> None:
    samples = sample_model(TWO, 500, "lobe", 0)
    found = _Lobes.at(samples, 2).values(parameters(TWO))
    assert np.allclose(found, TWO.evaluate(samples.wi, samples.wo).numpy(), rtol=1e-9)


def test_slopes_are_differences_of_the_values() -> None:
    lobes = _Lobes.at(sample_model(TWO, 200, "lobe", 0), 2)
    x = parameters(TWO) + 0.1
    steps = 1e-6 * np.eye(len(x))
    expected = np.stack([(lobes.values(x + step) - lobes.values(x - step)) / 2e-6 for step in steps], 2)
    assert np.allclose(lobes.slopes(x), expected, rtol=1e-5, atol=1e-6)


def test_extreme_parameters_stay_finite() -> None:
    lobes = _Lobes.at(sample_model(TWO, 200, "lobe", 0), 2)
    for shift in (-800.0, 800.0):
        x = parameters(TWO)
        x[[3 + 3, 3 + 4, 8 + 3, 8 + 4]] = shift
        with np.errstate(over="ignore"):
            assert np.isfinite(lobes.values(x)).all()
            assert np.isfinite(lobes.slopes(x)).all()


@pytest.mark.parametrize("channels", [("Y",), ("R", "G", "B")])
def test_a_lobe_is_found_again(channels: tuple[str, ...]) -> None:
    count = len(channels)
    model = GgxBrdf((0.2, 0.3, 0.1)[:count], (GgxLobe((0.8, 0.6, 0.9)[:count], 0.12, 0.07),), channels=channels)
    samples = sample_model(model, 800, "lobe", 3)
    found, report = fit_ggx(samples, 1, 0)
    assert found.lobes[0].roughness == pytest.approx(0.12, rel=1e-4)
    assert found.diffuse == pytest.approx(model.diffuse, rel=1e-3)
    assert torch.allclose(found.evaluate(samples.wi, samples.wo), samples.values, rtol=1e-3)
    assert report.residual < 1e-10
