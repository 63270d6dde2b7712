"""Fits of spoiled samples: bad without an option and good with it, and clean ones as they were."""

from dataclasses import replace
from functools import lru_cache
from typing import Any

import pytest
import torch

from homofact.brdf.analytic import BlinnPhong
from homofact.brdf.log_transform import LogTransform
from homofact.brdf.quality.clipping import marked
from homofact.brdf.quality.noise_floor import noise_floor
from homofact.brdf.samples import Samples
from homofact.brdf.sampling import sample_model
from homofact.factor.energy import Flux, keep_light
from homofact.factor.factorization import Factorization
from homofact.factor.projection import fixed_projection
from homofact.factor.textures import LogSamples, solve_terms
from homofact.methods.mccool import McCool
from homofact.methods.search import Search

BROAD = BlinnPhong((0.35, 0.15), (0.4, 0.4), exponent=6, channels=("R", "G"))
GLOSSY = BlinnPhong((0.1, 0.1), (0.4, 0.4), exponent=200, channels=("R", "G"))
SMALL: dict[str, Any] = {"size": 8, "epsilon": 1e-2}
SEARCH: dict[str, Any] = SMALL | {"effort": 5.0, "search_size": 5, "search_samples": 250, "restarts": 1}


@lru_cache(maxsize=4)
def drawn(model: BlinnPhong, scheme: str = "discs", seed: int = 0, count: int = 1500) -> Samples:
    return sample_model(model, count, scheme, seed)


def spoiled(samples: Samples, share: float = 0.02, factor: float = 300.0) -> Samples:
    hit = torch.rand(len(samples), generator=torch.Generator().manual_seed(9)) < share
    return replace(samples, values=samples.values * torch.where(hit, factor, 1.0)[:, None])


def light(fit: Any, clean: Samples) -> float:
    """Light of the fit over the clean samples', all channels together."""
    flux = (clean.wi[:, 2] * clean.wo[:, 2])[:, None]
    return float((flux * fit.evaluate(clean.wi, clean.wo)).sum() / (flux * clean.values).sum())


@pytest.mark.parametrize("objective", ["both", "log"])
def test_two_per_cent_of_outliers_spoil_a_search_and_not_a_robust_one(objective: str) -> None:
    test = drawn(BROAD, seed=1)
    bad, good = (
        Search(**SEARCH, objective=objective, robust=robust).fit(spoiled(drawn(BROAD))) for robust in (False, True)
    )
    # Logarithms are bent less than the energy is.
    assert abs(light(bad, test) - 1) > (0.05 if objective == "log" else 0.15)
    assert light(good, test) == pytest.approx(1, abs=0.03)
    assert good.report.details["outliers"] == pytest.approx(0.02, abs=0.01)
    assert bad.report.details["outliers"] == 0


def test_a_robust_mccool_fit_is_that_of_the_clean_samples() -> None:
    test = drawn(BROAD, seed=1)
    bad, good = (McCool(**SMALL, robust=robust).fit(spoiled(drawn(BROAD))) for robust in (False, True))
    clean = McCool(**SMALL).fit(drawn(BROAD))
    assert abs(light(bad, test) - 1) > 0.05
    assert light(good, test) == pytest.approx(light(clean, test), abs=0.01)


@pytest.mark.slow
def test_the_highlight_of_a_glossy_material_is_kept_beside_outliers() -> None:
    """The brightest tenth of the light, of a lobe of 5°: within a few per cent of what it is without outliers."""
    samples, test = drawn(GLOSSY, "lobe"), drawn(GLOSSY, "discs", 1, 20_000)
    bright = test.select((test.values.mean(1) > 0.3 * float(test.values.mean(1).max())).nonzero()[:, 0])
    fits = [
        replace(Search(**SEARCH), size=16, robust=robust).fit(each)
        for robust, each in ((False, samples), (True, samples), (True, spoiled(samples)))
    ]
    plain, robust, mended = (light(fit, bright) for fit in fits)
    assert robust == pytest.approx(plain, abs=0.02)
    assert mended == pytest.approx(plain, abs=0.04)


@pytest.mark.slow
def test_clean_samples_give_the_same_fit_to_the_bit() -> None:
    plain, robust = (Search(**SEARCH, robust=robust).fit(drawn(BROAD)) for robust in (False, True))
    test = drawn(BROAD, seed=1)
    assert torch.equal(plain.evaluate(test.wi, test.wo), robust.evaluate(test.wi, test.wo))


def cut(share: float) -> Samples:
    samples = drawn(BROAD)
    return replace(samples, values=torch.minimum(samples.values, samples.values.quantile(1 - share, dim=0)))


@pytest.mark.parametrize("method", [McCool(**SMALL), Search(**SEARCH)], ids=["mccool", "search"])
def test_a_clipped_highlight_is_carried_on(method: Any) -> None:
    test = drawn(BROAD, seed=1)
    bright = test.select((test.values[:, 0] > test.values[:, 0].quantile(0.9)).nonzero()[:, 0])
    plain = light(method.fit(cut(0.15)), bright)
    one_sided = light(method.fit(marked(cut(0.15), "found")), bright)
    assert plain < 0.82
    assert 0.85 < one_sided < 1.15


def test_a_clipped_value_pulls_up_and_never_down() -> None:
    """Two texels a channel: of R all samples of one are clipped, the fit is above; of G below, and is pulled up."""
    samples = drawn(BROAD)
    transform = LogTransform(1e-2, torch.ones(2, dtype=torch.float64))
    logs = LogSamples.of(samples, transform)
    projection = fixed_projection("theta_h-theta_d", True)
    over = torch.rand(len(samples), generator=torch.Generator().manual_seed(2)) < 0.3
    # A third of the samples is said to be at least 1 lower, and at least as much as it is.
    lower = logs.logs - over[:, None].double()

    def solved(values: torch.Tensor, clipped: torch.Tensor | None) -> torch.Tensor:
        terms = solve_terms(
            replace(logs, logs=values, clipped=clipped), (projection,), ((8, 8),), 1e-6, "cholesky"
        ).terms
        return Factorization(terms, transform, samples.channels).evaluate_log(samples.wi, samples.wo)

    both = over[:, None].expand(-1, 2)
    clean = solved(logs.logs, None)
    assert float((solved(lower, both) - clean).abs().mean()) < 0.02
    assert float((solved(lower, None) - clean).mean()) < -0.2
    # Only channel G is marked: R is as without marks.
    half = torch.stack((torch.zeros_like(over), over), 1)
    assert torch.allclose(solved(lower, half)[:, 0], solved(lower, None)[:, 0])
    assert float((solved(lower, half)[:, 1] - clean[:, 1]).abs().mean()) < 0.02
    # A bound above the fit does pull.
    higher = logs.logs + over[:, None].double()
    assert torch.allclose(solved(higher, both).mean(), solved(higher, None).mean(), atol=0.1)


def test_the_light_s_own_descent_leaves_values_over_their_bound_alone() -> None:
    samples = cut(0.15)
    transform = LogTransform.of(samples, 1e-2)
    logs = LogSamples.of(marked(samples, "found"), transform)
    flux = Flux.of(samples, transform, "both")
    projections = (fixed_projection("theta_h-theta_d", True),)
    terms = solve_terms(logs, projections, ((8, 8),), 1e-4, "cholesky").terms
    peak = [
        float(Factorization(keep_light(each, terms, 1e-4, flux)[0], transform, samples.channels)
              .evaluate(samples.wi, samples.wo).max())
        for each in (logs, replace(logs, clipped=None))
    ]  # fmt: skip
    level = float(samples.values.max())
    assert peak[0] > 1.2 * level
    assert peak[1] < 1.15 * level


@pytest.mark.slow
def test_epsilon_is_the_noise_floor_where_that_is_asked_for() -> None:
    samples = drawn(BROAD)
    draw = torch.randn(samples.values.shape, generator=torch.Generator().manual_seed(3), dtype=torch.float64)
    noisy = replace(samples, values=(samples.values + 0.5 * samples.values.mean(0) * draw).clamp_min(0))
    test = drawn(BROAD, seed=1)
    transform = LogTransform.of(test, 1e-2)
    errors = []
    for epsilon in (1e-2, "floor"):
        fit = replace(Search(**SEARCH), epsilon=epsilon).fit(noisy)
        found = transform.forward(fit.evaluate(test.wi, test.wo)) - transform.forward(test.values)
        errors.append(float(found.square().mean()))
    assert fit.factorization.transform.epsilon == pytest.approx(noise_floor(noisy))
    assert errors[1] < 0.7 * errors[0]
