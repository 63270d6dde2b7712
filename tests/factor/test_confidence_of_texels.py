"""What a texel is worth: holes that may not invent it, and how far it would move."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from homofact.brdf.log_transform import LogTransform
from homofact.brdf.materials import material
from homofact.brdf.samples import Samples
from homofact.brdf.sampling import sample_model
from homofact.errors import BadInput
from homofact.factor.confidence import with_deviations
from homofact.factor.factorization import Factorization, Term, layout_of_terms
from homofact.factor.gauge import gauge_rows
from homofact.factor.projection import fixed_projection
from homofact.factor.textures import LogSamples, centred, domain_mask, inner_problem, solve_terms
from homofact.methods.cole import Cole
from homofact.methods.mccool import McCool
from homofact.methods.mccool_fit import fit_mccool

NAMES = ("theta_h-theta_d", "theta_i-theta_o")
PROJECTIONS = tuple(fixed_projection(name, True) for name in NAMES)
SHAPES = ((8, 8), (8, 8))
_UNIT = LogTransform(1e-2, torch.ones(3, dtype=torch.float64))


def planted(count: int = 4000) -> tuple[LogSamples, LogTransform]:
    """Log samples that two textures meet exactly, of a glossy material's likeness."""
    samples = sample_model(material("phong-10").model, count, "discs", 0)
    transform = LogTransform.of(samples, 1e-2)
    logs = LogSamples.of(samples, transform)
    terms = solve_terms(logs, PROJECTIONS, SHAPES, 1e-3, "cholesky").terms
    exact = Factorization(terms, transform, samples.channels)
    return replace(logs, logs=exact.evaluate_log(samples.wi, samples.wo)), transform


def with_noise(logs: LogSamples, level: float, seed: int) -> LogSamples:
    generator = torch.Generator().manual_seed(seed)
    return replace(
        logs, logs=logs.logs + level * torch.randn(logs.logs.shape, dtype=torch.float64, generator=generator)
    )


def test_texels_far_from_all_samples_are_left_out_and_take_the_nearest_value() -> None:
    logs, _ = planted()
    theta = torch.acos(logs.wi[:, 2].clamp(-1, 1)), torch.acos(logs.wo[:, 2].clamp(-1, 1))
    low = (theta[0] < 0.6) & (theta[1] < 0.6)
    solved = solve_terms(logs.select(low.nonzero()[:, 0]), PROJECTIONS, SHAPES, 1e-5, "cholesky")
    both = solved.terms[1]
    domain = domain_mask(both.projection, (8, 8))
    assert bool((both.mask <= domain).all())
    assert int(both.mask.sum()) < int(domain.sum())
    inside = both.texture[both.mask]
    # No ramp is carried on: outside there is nothing that is not inside.
    assert float(both.texture.max()) <= float(inside.max()) + 1e-12
    assert float(both.texture.min()) >= float(inside.min()) - 1e-12


def test_the_predicted_deviation_is_the_observed_spread() -> None:
    """Repeated noise on data that the textures can meet: within 20%, texture by texture and in the median texel."""
    logs, _ = planted()
    level, repeats = 0.05, 60
    solved = [
        solve_terms(with_noise(logs, level, seed), PROJECTIONS, SHAPES, 1e-3, "cholesky").terms
        for seed in range(repeats)
    ]
    predicted = with_deviations(with_noise(logs, level, 0), solved[0], 1e-3)
    for j, term in enumerate(predicted):
        assert term.deviation is not None
        observed = torch.stack([terms[j].texture for terms in solved]).std(0)[term.mask]
        expected = term.deviation[term.mask]
        assert float(observed.square().mean().sqrt() / expected.square().mean().sqrt()) == pytest.approx(1, abs=0.2)
        assert float((observed / expected).median()) == pytest.approx(1, abs=0.2)
        # It tells good texels from bad ones, too.
        assert float(torch.corrcoef(torch.stack((observed[:, 0], expected[:, 0])))[0, 1]) > 0.8
        assert not bool(term.deviation[~term.mask].any())


def test_the_deviation_is_that_of_texels_whose_constants_are_gathered_in_the_first() -> None:
    """σ √diag(C H⁻¹ G H⁻¹ Cᵀ) with C taken from `centred` itself, unit texel by unit texel: the gauge makes it 1."""
    projections = (fixed_projection("wi", True), fixed_projection("h", True))
    assert [projection.lookups for projection in projections] == [2, 1]
    samples = sample_model(material("phong-10").model, 1500, "discs", 0)
    logs = with_noise(LogSamples.of(samples, LogTransform.of(samples, 1e-2)), 0.1, 3)
    terms = solve_terms(logs, projections, ((4, 4), (5, 5)), 1e-2, "cholesky").terms
    masks = tuple(term.mask for term in terms)
    problem = inner_problem(logs, projections, ((4, 4), (5, 5)), 1e-2, masks)
    problem = replace(problem, gauge=gauge_rows(projections, masks))
    kept = problem.kept
    data = problem.data.matrix[kept][:, kept]
    inverse = torch.linalg.inv(problem.normal()[0])
    layout = layout_of_terms(terms)

    def gathered(column: torch.Tensor) -> torch.Tensor:
        textures = layout.split(problem.expand(column[:, None]))
        moved = centred(tuple(replace(term, texture=own) for term, own in zip(terms, textures, strict=True)))
        return layout.join([term.texture for term in moved])[kept, 0]

    turned = torch.stack([gathered(column) for column in inverse.T], 1)
    freedom = float(logs.weights.sum()) - float((inverse * data).sum())
    errors = logs.logs - Factorization(terms, _UNIT, samples.channels).evaluate_log(logs.wi, logs.wo)
    variance = (logs.weights[:, None] * errors**2).sum(0) / freedom
    expected = (turned @ data @ turned.T).diagonal()[:, None].sqrt() * variance.sqrt()
    found = layout.join([term.deviation for term in with_deviations(logs, terms, 1e-2) if term.deviation is not None])
    assert torch.allclose(found[kept], expected, rtol=1e-6)


def test_a_fit_leaves_deviations_that_are_saved_and_read_back(tmp_path) -> None:
    samples = sample_model(material("phong-10").model, 2000, "discs", 0)
    settings = McCool(size=8, confidence=True)
    fit = fit_mccool(samples, settings).factorization
    fit.save(tmp_path / "fit.npz")
    for one, two in zip(fit.terms, Factorization.load(tmp_path / "fit.npz").terms, strict=True):
        assert one.deviation is not None
        assert two.deviation is not None
        assert float(one.deviation.max()) > 0
        assert np.array_equal(one.deviation, two.deviation)
    assert all(
        term.deviation is None for term in fit_mccool(samples, replace(settings, confidence=False)).factorization.terms
    )


def test_terms_that_were_not_solved_together_have_no_confidence() -> None:
    with pytest.raises(BadInput, match=r"confidence: found joint_terms 1 for 3 textures with it, expected 0"):
        Cole(textures=3, joint_terms=1, confidence=True)
    samples: Samples = sample_model(material("phong-10").model, 500, "discs", 0)
    quick = Cole(textures=2, joint_terms=0, size=4, restarts=1, search_samples=200, confidence=True)
    assert all(term.deviation is not None for term in quick.fit(samples).factorization.terms)


def test_a_deviation_of_another_shape_is_refused(tmp_path) -> None:
    term = Term(PROJECTIONS[0], torch.zeros(4, 4, 1).double(), torch.ones(4, 4, dtype=torch.bool), torch.zeros(4, 4, 2))
    Factorization((term,), LogTransform(1e-2, torch.ones(1).double()), ("Y",)).save(tmp_path / "fit.npz")
    with pytest.raises(BadInput, match=r"deviation_0 is float32 of shape \(4, 4, 2\), expected .*\(4, 4, 1\)"):
        Factorization.load(tmp_path / "fit.npz")


def test_with_hardly_more_samples_than_texels_the_deviation_is_still_the_spread() -> None:
    """Residuals are far smaller than the noise then: the degrees of freedom make up for it."""
    logs, _ = planted(130)
    projections, shapes = PROJECTIONS[:1], SHAPES[:1]
    level, repeats = 0.1, 60
    texels, predicted, free = [], [], []
    for seed in range(repeats):
        noise = with_noise(replace(logs, logs=torch.zeros_like(logs.logs)), level, seed)
        solved = solve_terms(noise, projections, shapes, 1e-4, "cholesky").terms
        (term,) = with_deviations(noise, solved, 1e-4)
        assert term.deviation is not None
        texels.append(term.texture[term.mask])
        predicted.append(term.deviation[term.mask].square())
        free.append(float(Factorization(solved, _UNIT, ("R", "G", "B")).evaluate_log(noise.wi, noise.wo).std()))
    observed = torch.stack(texels).square().mean(0).sum()
    assert float(observed / torch.stack(predicted).mean(0).sum()) == pytest.approx(1, abs=0.1)
    # The fit follows a good part of the noise, or this says nothing.
    assert sum(free) / repeats > 0.5 * level


def test_a_sample_in_two_halves_changes_no_deviation() -> None:
    """Weights are shares of a measurement, as those of azimuth copies: the freedom counts them, not the rows."""
    logs, _ = planted(300)
    noise = with_noise(logs, 0.1, 0)
    index = torch.arange(300).repeat(2)
    halves = replace(noise.select(index), weights=noise.weights[index] / 2)
    found = []
    for samples in (noise, halves):
        solved = solve_terms(samples, PROJECTIONS, SHAPES, 1e-3, "cholesky").terms
        found.append(with_deviations(samples, solved, 1e-3))
    for one, other in zip(*found, strict=True):
        assert one.deviation is not None
        assert other.deviation is not None
        assert np.allclose(one.deviation, other.deviation, rtol=1e-6)


def test_smoothing_reaches_an_eighth_of_a_side_from_the_samples() -> None:
    """One sample, read by the four texels round it: two more on every side of a texture of sixteen."""
    logs, _ = planted(500)
    theta = torch.acos(logs.wi[:, 2]) + torch.acos(logs.wo[:, 2])
    middle = (torch.acos(logs.wi[:, 2]) - torch.acos(logs.wo[:, 2])).abs() + (theta - 1.5).abs()
    one = logs.select(middle.argmin()[None])
    projection = fixed_projection("theta_i-theta_o", False)
    (term,) = solve_terms(one, (projection,), ((16, 16),), 1e-3, "cholesky").terms
    assert int(term.mask.sum()) == (2 + 2 * 2) ** 2
