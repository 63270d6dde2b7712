"""Laws that hold for any data: random BRDF-like samples through a whole fit.

100 examples here; `HYPOTHESIS_PROFILE=nightly` makes it 2000 (`make nightly`).
"""

import math

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from homofact.brdf.samples import Samples
from homofact.errors import BadInput, SolverFailure
from homofact.factor.factorization import Factorization
from homofact.geometry.directions import draw_cosine_weighted
from homofact.methods.fitting import MethodFit
from homofact.methods.mccool import McCool
from homofact.methods.mccool_fit import fit_mccool

KINDS = ("wi", "h", "theta_h-theta_d", "theta_d-phi_d", "theta_i-theta_o", "theta_i-delta_phi", "theta_h")


@st.composite
def brdf_samples(draw: st.DrawFn) -> Samples:
    """A lobe and a diffuse part of any scale, with noise, zeros, outliers and repeated samples now and then."""
    count = draw(st.integers(12, 250))
    seed = draw(st.integers(0, 2**32 - 1))
    generator = torch.Generator().manual_seed(seed)
    wi, wo = draw_cosine_weighted(count, generator)
    if draw(st.booleans()):
        again = torch.randint(0, count, (count,), generator=generator)
        wi, wo = wi[again], wo[again]
    half = torch.nn.functional.normalize(wi + wo, dim=1)[:, 2:]
    exponent = 10 ** draw(st.floats(0, 4))
    scale = 10 ** draw(st.floats(-8, 8))
    values = draw(st.floats(0, 1)) + draw(st.floats(0, 1e4)) * half**exponent + 1e-6
    values = values * torch.tensor([[1.0, 10 ** draw(st.floats(-4, 4))]], dtype=torch.float64) * scale
    noise = draw(st.floats(0, 1))
    values = values * torch.exp(noise * torch.randn(values.shape, dtype=torch.float64, generator=generator))
    if draw(st.booleans()):
        values = torch.where(torch.rand(count, 1, generator=generator) < 0.2, 0.0, values)
    if draw(st.booleans()):
        values[int(torch.randint(0, count, (1,), generator=generator))] *= 1e5
    isotropic = draw(st.booleans())
    return Samples(wi, wo, values, channels=("a", "b"), isotropic=isotropic, all_azimuths=True)


@st.composite
def settings(draw: st.DrawFn) -> McCool:
    """Fixed projections, which may coincide, textures of any small size, λ from none to far too much."""
    return McCool(
        projections=tuple(draw(st.lists(st.sampled_from(KINDS), min_size=1, max_size=4))),
        size=draw(st.integers(2, 9)),
        smoothing=draw(st.one_of(st.just(0.0), st.floats(1e-8, 1e8))),
        epsilon=10 ** draw(st.floats(-8, -1)),
        reciprocal=draw(st.booleans()),
        robust=draw(st.booleans()),
    )


def fitted(samples: Samples, chosen: McCool) -> MethodFit | None:
    """The fit, or None where it is refused by name, in one line."""
    try:
        return fit_mccool(samples, chosen)
    except (BadInput, SolverFailure) as refusal:
        said = str(refusal)
    assert said
    assert "\n" not in said
    return None


@given(brdf_samples(), settings())
def test_a_fit_is_finite_non_negative_and_reciprocal_or_refused_by_name(samples: Samples, chosen: McCool) -> None:
    fit = fitted(samples, chosen)
    if fit is None:
        return
    result = fit.factorization
    wi, wo = draw_cosine_weighted(200, torch.Generator().manual_seed(1))
    values = result.evaluate(wi, wo)
    assert bool(torch.isfinite(values).all())
    assert bool((values >= 0).all())
    if chosen.reciprocal:
        swapped = result.evaluate(wo, wi)
        assert torch.allclose(values, swapped, rtol=1e-6, atol=1e-9 * float(values.max()) + 1e-300)
    assert fit.report.details["condition"] >= 1
    assert 0 <= fit.report.details["determined"] <= 1
    assert 0 <= fit.report.details["outliers"] < 1
    assert all(bool(term.mask.any()) for term in result.terms)


@pytest.mark.slow
@given(brdf_samples(), settings(), st.floats(-6, 6))
def test_a_factor_on_the_data_is_a_factor_on_the_fit(samples: Samples, chosen: McCool, decades: float) -> None:
    """A is the data's mean, so the log samples are the same, and with them the textures."""
    one = fitted(samples, chosen)
    other = fitted(
        Samples(
            samples.wi,
            samples.wo,
            samples.values * 10**decades,
            channels=samples.channels,
            isotropic=samples.isotropic,
            all_azimuths=True,
        ),
        chosen,
    )
    assert (one is None) == (other is None)
    if one is None or other is None:
        return
    logs = []
    for fit in (one, other):
        assert isinstance(fit.factorization, Factorization)
        logs.append(fit.factorization.evaluate_log(samples.wi, samples.wo))
    # Rounding of the data grows by the condition number, at most to where a system counts as singular.
    condition = min(one.report.details["condition"], 1e12)
    tolerance = 1e-12 * condition + 1e-6
    assert float((logs[0] - logs[1]).abs().max()) <= tolerance * (1 + float(logs[0].abs().max())) or math.isinf(
        one.report.details["condition"]
    )


@pytest.mark.slow
@given(brdf_samples(), settings())
def test_the_order_of_the_samples_does_not_matter(samples: Samples, chosen: McCool) -> None:
    turned = samples.select(torch.arange(len(samples) - 1, -1, -1))
    one, other = fitted(samples, chosen), fitted(turned, chosen)
    assert (one is None) == (other is None)
    if one is None or other is None:
        return
    logs = []
    for fit in (one, other):
        assert isinstance(fit.factorization, Factorization)
        logs.append(fit.factorization.evaluate_log(samples.wi, samples.wo))
    # In logarithms, in which it is solved: a value far under εA is what is left of two that nearly cancel, and has as
    # many digits fewer as it is smaller.
    condition = one.report.details["condition"]
    if condition < 1e9:
        tolerance = 1e-14 * condition + 1e-6
        assert float((logs[0] - logs[1]).abs().max()) <= tolerance * (1 + float(logs[0].abs().max()))
