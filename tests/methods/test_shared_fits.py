"""Several materials under shared projections: what sharing must not change, and what it means."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from homofact.brdf.materials import material
from homofact.brdf.samples import Samples
from homofact.brdf.sampling import sample_model
from homofact.errors import BadInput
from homofact.factor.factorization import Factorization
from homofact.factor.objective import JointObjective, Objective
from homofact.factor.textures import solve_terms
from homofact.methods.fitting import MethodFit
from homofact.methods.search import Search
from homofact.methods.search_data import SearchData
from homofact.methods.search_fit import fit_shared

SETTINGS = Search(effort=8.0, size=6, search_size=5, search_samples=400, epsilon=1e-3, objective="log")
# Nothing is left to choose: no rotation, no warp, no λ.
CHOSEN = replace(SETTINGS, projections=("theta_i-theta_o", "theta_i-theta_d"), smoothing=1e-3)


def drawn(name: str, count: int = 500) -> Samples:
    return sample_model(material(name).model, count, "discs", 0)


CLAY, PAINT = drawn("lafortune-clay"), drawn("lafortune-blue-paint", 600)


def product(fit: MethodFit) -> Factorization:
    assert isinstance(fit.factorization, Factorization)
    return fit.factorization


def same(one: MethodFit, other: MethodFit) -> bool:
    pairs = list(zip(product(one).terms, product(other).terms, strict=True))
    textures = all(np.array_equal(a.texture, b.texture) and np.array_equal(a.mask, b.mask) for a, b in pairs)
    return textures and all(np.array_equal(a.projection.matrix, b.projection.matrix) for a, b in pairs)


@pytest.fixture(scope="module")
def shared() -> tuple[MethodFit, ...]:
    return fit_shared((CLAY, PAINT), SETTINGS)


def test_every_material_has_the_same_projections_and_sizes(shared: tuple[MethodFit, ...]) -> None:
    clay, paint = (product(fit).terms for fit in shared)
    assert all(np.array_equal(a.projection.matrix, b.projection.matrix) for a, b in zip(clay, paint, strict=True))
    assert [term.size for term in clay] == [term.size for term in paint]
    assert not np.array_equal(clay[0].texture, paint[0].texture)


def test_a_materials_textures_are_the_solve_of_its_own_samples(shared: tuple[MethodFit, ...]) -> None:
    for fit, samples in zip(shared, (CLAY, PAINT), strict=True):
        found = product(fit)
        data = SearchData.of(samples, found.transform, SETTINGS, knows_azimuth=False)
        projections = tuple(term.projection for term in found.terms)
        shapes = tuple(term.size for term in found.terms)
        alone = solve_terms(data.judged, projections, shapes, tuple(found.provenance["smoothing"]), "cholesky").terms
        assert all(np.array_equal(mine.texture, own.texture) for mine, own in zip(found.terms, alone, strict=True))


def test_each_material_has_the_smoothing_that_suits_it() -> None:
    """Noise asks for more of it."""
    noise = torch.randn(CLAY.values.shape, dtype=torch.float64, generator=torch.Generator().manual_seed(2))
    noisy = replace(CLAY, values=CLAY.values * torch.exp(0.5 * noise))
    settings = replace(CHOSEN, smoothing=None, effort=60.0)
    found = [fit.factorization.provenance["smoothing"] for fit in fit_shared((CLAY, noisy), settings)]
    assert min(found[1]) >= max(found[0])
    assert found[1] != found[0]
    back = [fit.factorization.provenance["smoothing"] for fit in fit_shared((noisy, CLAY), settings)]
    assert back == found[::-1]


def test_two_copies_of_a_material_are_fitted_as_the_one() -> None:
    """Means of equals, and twice the effort for twice the work."""
    settings = replace(SETTINGS, projections=("isotropic-angles",), textures=1, restarts=1)
    (one,) = fit_shared((CLAY,), settings)
    assert same(one, settings.fit(CLAY))
    for fit in fit_shared((CLAY, CLAY), settings):
        assert same(fit, one)
        assert fit.factorization.provenance["smoothing"] == one.factorization.provenance["smoothing"]
        effort, alone = (each.factorization.provenance["effort"] for each in (fit, one))
        assert effort == {name: 2 * spent for name, spent in alone.items()}


def test_with_nothing_to_search_shared_fits_are_the_separate_ones() -> None:
    for fit, samples in zip(fit_shared((CLAY, PAINT), CHOSEN), (CLAY, PAINT), strict=True):
        assert same(fit, CHOSEN.fit(samples))


def test_their_order_does_not_matter(shared: tuple[MethodFit, ...]) -> None:
    settings = replace(SETTINGS, smoothing=1e-3, projections=("isotropic-angles",), textures=1, restarts=1)
    there, back = fit_shared((CLAY, PAINT), settings), fit_shared((PAINT, CLAY), settings)
    assert same(there[0], back[1])
    assert same(there[1], back[0])


def test_the_joint_objective_is_the_mean(shared: tuple[MethodFit, ...]) -> None:
    each = []
    for fit, samples in zip(shared, (CLAY, PAINT), strict=True):
        found = product(fit)
        data = SearchData.of(samples, found.transform, SETTINGS, knows_azimuth=False)
        projections = tuple(replace(term.projection) for term in found.terms)
        each.append(Objective(data.judged, projections, tuple(term.size for term in found.terms), 1e-3))
    joint = JointObjective(tuple(each))
    at = joint.start()
    alone = [objective.evaluate(at) for objective in each]
    together = joint.evaluate(at)
    assert together.value == pytest.approx((alone[0].value + alone[1].value) / 2, rel=1e-12)
    assert joint.error(at) == pytest.approx(together.value, rel=1e-9)
    torch.testing.assert_close(together.gradient, (alone[0].gradient + alone[1].gradient) / 2)


def test_other_channels_and_too_few_samples_are_refused() -> None:
    with pytest.raises(BadInput, match=r"material 1: found the channels R, expected R, G, B as material 0 has"):
        fit_shared((CLAY, PAINT.channel("R")), SETTINGS)
    with pytest.raises(BadInput, match="found 5, expected at least 8"):
        fit_shared((CLAY, PAINT.select(torch.arange(5))), SETTINGS)
