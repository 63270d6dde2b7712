"""Textures that cancel each other: a stronger ridge holds texels that few samples determine."""

import numpy as np
import pytest
import torch

from homofact.brdf.analytic.ggx import GgxBrdf, GgxLobe
from homofact.brdf.quality import extrapolation
from homofact.brdf.samples import Samples
from homofact.brdf.sampling import sample_model
from homofact.evaluation.metrics import measure
from homofact.factor.factorization import Factorization
from homofact.geometry.directions import from_spherical
from homofact.methods import search_fit
from homofact.methods.common import quantized
from homofact.methods.search import Search

PAINT = GgxBrdf((0.02, 0.09, 0.3), (GgxLobe((1.0,) * 3, 0.06, 0.045),))
METHOD = Search(textures=3, size=32, epsilon=0.01, effort="quick")


def scan(seed: int) -> Samples:
    """A coarse scan of 900 pairs, with 1% of noise."""
    generator = np.random.default_rng(seed)
    angles = np.array([(i, o, p) for i in range(0, 71, 10) for o in range(0, 81, 10) for p in range(0, 181, 15)], float)
    angles[:, :2] += generator.uniform(0, 8, (len(angles), 2))
    theta_i, theta_o, phi = torch.from_numpy(np.radians(angles)).T
    wi, wo = from_spherical(theta_i, 0 * theta_i), from_spherical(theta_o, phi)
    noise = torch.from_numpy(np.exp(0.01 * generator.standard_normal((len(angles), 3))))
    return Samples(wi, wo, PAINT.evaluate(wi, wo) * noise)


@pytest.fixture(scope="module")
def train() -> Samples:
    return scan(0)


def fitted(train: Samples) -> Factorization:
    """Without the model that determines texels beyond the samples, and so keeps them small by itself."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(extrapolation, "_surface_of", lambda samples: None)
        found = METHOD.fit(train).factorization
    assert isinstance(found, Factorization)
    return found


@pytest.fixture(scope="module")
def held(train: Samples) -> Factorization:
    return fitted(train)


@pytest.fixture(scope="module")
def free(train: Samples) -> Factorization:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(search_fit, "_cancel", lambda terms, samples: False)
        return fitted(train)


def span(fit: Factorization) -> float:
    return max(float(np.ptp(texture.texels[texture.mask], axis=0).max()) for texture in fit.textures)


def test_texels_keep_to_the_samples_and_the_error_is_as_small(
    train: Samples, held: Factorization, free: Factorization
) -> None:
    logs = free.transform.forward(train.values)
    least = search_fit._CANCELLING * float((logs.amax(0) - logs.amin(0)).max())
    assert span(free) > 2 * least
    assert span(held) < least
    others = scan(1)
    errors = [measure(each, others, each.transform).log_mse for each in (held, free)]
    assert errors[0] < 1.1 * errors[1]


def test_eight_bits_hold_them(train: Samples, held: Factorization, free: Factorization) -> None:
    errors = [
        measure(quantized(each, train, METHOD, "png8"), train, each.transform).log_mse
        / measure(each, train, each.transform).log_mse
        for each in (held, free)
    ]
    assert errors[0] < 1.5
    assert errors[0] < 1 + (errors[1] - 1) / 2


@pytest.mark.parametrize("loss", [0.9, 1.25])
def test_it_is_not_taken_where_the_samples_determine_large_texels(
    loss: float, train: Samples, free: Factorization, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(search_fit, "_MOST_LOSS", loss)
    assert (span(fitted(train)) == span(free)) is (loss < 1)


def test_samples_that_are_drawn_from_a_model_are_fitted_as_they_were(monkeypatch: pytest.MonkeyPatch) -> None:
    samples, method = sample_model(PAINT, 3000), Search(textures=2, size=8, epsilon=0.01, effort="quick")

    def texels() -> list[np.ndarray]:
        return [texture.texels for texture in method.fit(samples).factorization.textures]

    found = texels()
    monkeypatch.setattr(search_fit, "_CANCELLING", 0.0)
    assert all(np.array_equal(one, other) for one, other in zip(found, texels(), strict=True))
