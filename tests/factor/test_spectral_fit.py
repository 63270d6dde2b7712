"""Fits of many bands by few basis vectors: ranks, values, bytes, files, and what is refused."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from refusals import refused

from homofact.brdf.cielab import ciede2000
from homofact.brdf.colour_difference import ILLUMINANTS, lab_of, lab_slopes
from homofact.brdf.log_transform import LogTransform
from homofact.brdf.pair_density import over_discs
from homofact.brdf.samples import Samples
from homofact.brdf.wavelengths import spectral_names
from homofact.factor.factorization import Factorization, Term
from homofact.factor.projection import fixed_projection
from homofact.factor.spectral_choice import choose_basis, whole_basis
from homofact.factor.spectral_fit import SpectralFit
from homofact.geometry.directions import draw_in_discs
from homofact.methods.saved import open_saved

BANDS = tuple(float(w) for w in range(400, 701, 10))
TRANSFORM = LogTransform(1e-3, np.linspace(0.05, 0.2, len(BANDS)))


def humps(count: int) -> np.ndarray:
    """Vectors (count, 31) over the bands, none a sum of the others."""
    centres = np.linspace(430, 670, count)[:, None]
    return np.exp(-(((np.array(BANDS) - centres) / 60) ** 2))


def product(rank: int, channels: tuple[str, ...] = spectral_names(BANDS)) -> Factorization:
    """A fit of 31 bands whose logarithms vary in `rank` vectors, but for filler that nothing reads."""
    drawn = np.random.default_rng(rank)
    terms = []
    for name, shape in (("theta_h-theta_d", (7, 6)), ("theta_i", (1, 9))):
        texture = drawn.normal(size=(*shape, rank)) @ humps(rank) * 0.4
        terms.append(Term(fixed_projection(name, True), texture, drawn.uniform(size=shape) > 0.1))
    return Factorization(tuple(terms), TRANSFORM, channels, {"seed": 3})


def samples(fit: Factorization, count: int = 400) -> Samples:
    wi, wo = draw_in_discs(count, torch.Generator().manual_seed(5))
    return Samples(wi, wo, fit.evaluate(wi, wo), torch.ones(count, dtype=torch.float64), fit.channels)


def compressed(rank: int, tolerance: float) -> tuple[Factorization, SpectralFit]:
    fit = product(rank)
    return fit, SpectralFit.of(fit, samples(fit), tolerance)


@pytest.mark.parametrize("rank", [1, 2, 3, 5])
def test_spectra_of_a_rank_take_as_many_vectors(rank: int) -> None:
    fit, made = compressed(rank, 1e-6)
    assert made.basis.rank == rank
    wi, wo = draw_in_discs(500, torch.Generator().manual_seed(1))
    assert torch.allclose(made.evaluate(wi, wo), fit.evaluate(wi, wo), rtol=1e-10)


def test_all_vectors_give_the_fit_of_all_bands() -> None:
    fit, made = compressed(31, 1e-14)
    assert made.basis.rank == 31
    wi, wo = draw_in_discs(500, torch.Generator().manual_seed(1))
    assert torch.allclose(made.evaluate(wi, wo), fit.evaluate(wi, wo), rtol=1e-10)
    for own, other in zip(made.expanded.terms, fit.terms, strict=True):
        assert own.texture == pytest.approx(other.texture, abs=1e-10)


def test_the_product_of_all_bands_is_the_same_fit() -> None:
    """Also where the texture that takes the constants is looked up twice."""
    fit = product(3)
    turned = replace(fit, terms=fit.terms[::-1])
    assert turned.terms[0].projection.lookups == 2
    made = SpectralFit.of(turned, samples(turned), 5)
    assert made.basis.rank < 3
    wi, wo = draw_in_discs(200, torch.Generator().manual_seed(1))
    assert torch.allclose(made.expanded.evaluate(wi, wo), made.evaluate(wi, wo), rtol=1e-10)


def test_the_rank_is_the_smallest_that_meets_the_tolerance() -> None:
    fit = product(8)
    logs, weights = _logs(fit)
    ranks = []
    for tolerance in (3.0, 1.0, 0.3, 0.1, 0.03):
        chosen = choose_basis(logs, weights, TRANSFORM, BANDS, tolerance)
        ranks.append(chosen.basis.rank)
        assert max(chosen.differences.values()) <= tolerance
        # The differences are those of the colours themselves.
        for illuminant, found in chosen.differences.items():
            assert found == pytest.approx(_difference(logs, weights, chosen.basis, illuminant), abs=1e-9)
        if chosen.basis.rank > 1:
            share = weights / weights.sum()
            one_less = whole_basis(logs, weights, TRANSFORM, BANDS).first(chosen.basis.rank - 1, share @ logs)
            assert max(_difference(logs, weights, one_less, each) for each in ILLUMINANTS) > tolerance
    assert ranks == sorted(ranks)
    assert ranks[0] < ranks[-1] <= 8


def test_no_other_vectors_leave_less_of_the_colours_squares() -> None:
    """Eckart and Young: of all subspaces of a rank, M's principal one leaves the least."""
    fit = product(8)
    logs, weights = _logs(fit)
    share = weights / weights.sum()
    values = TRANSFORM.mean * (np.exp(logs) - TRANSFORM.epsilon).clip(0)
    off = logs - share @ logs

    def squares(hat: np.ndarray) -> float:
        error = off @ (np.eye(31) - hat)
        total = 0.0
        for illuminant in ILLUMINANTS:
            slopes = lab_slopes(values, BANDS, illuminant) * (values + TRANSFORM.epsilon * TRANSFORM.mean)[:, None]
            metric = np.einsum("n,nai,naj->ij", share, slopes, slopes)
            total += float(np.einsum("n,ni,ij,nj->", share, error, metric, error))
        return total

    basis = whole_basis(logs, weights, TRANSFORM, BANDS).first(3, share @ logs)
    least = squares(basis.dual @ basis.vectors)
    plain = np.linalg.svd(off * np.sqrt(share)[:, None], full_matrices=False)[2][:3]
    drawn = np.linalg.qr(np.random.default_rng(0).normal(size=(31, 3)))[0].T
    for other in (plain, drawn, humps(8)[:3]):
        # The best coordinates for these vectors are unknown; those of least squares will do.
        hat = np.linalg.pinv(other) @ other
        assert least < 0.9 * squares(hat)


def _logs(fit: Factorization) -> tuple[np.ndarray, np.ndarray]:
    drawn = samples(fit)
    return fit.evaluate_log(drawn.wi, drawn.wo).numpy(), over_discs(drawn).double().numpy()


def _difference(logs: np.ndarray, weights: np.ndarray, basis, illuminant: str) -> float:
    first, second = (
        lab_of(TRANSFORM.mean * (np.exp(own) - TRANSFORM.epsilon).clip(0), BANDS, illuminant)
        for own in (logs, logs @ basis.dual @ basis.vectors + basis.offset)
    )
    return float(np.average(ciede2000(first, second), weights=weights))


def test_it_costs_its_textures_and_its_table() -> None:
    fit, made = compressed(3, 1e-6)
    texels = 7 * 6 + 9
    assert fit.nbytes == 4 * 31 * texels
    assert made.nbytes == 4 * (3 * texels + 3 * 31 + 31)
    assert made.fetches == fit.fetches
    assert [texture.texels.shape for texture in made.textures] == [(7, 6, 3), (1, 9, 3)]
    assert made.textures[0].components == ("vector 0", "vector 1", "vector 2")
    assert made.provenance["spectral"]["rank"] == 3
    assert made.provenance["seed"] == 3


def test_a_loaded_fit_is_bit_identical(tmp_path: Path) -> None:
    _, made = compressed(4, 1e-6)
    made.save(tmp_path / "fit.npz")
    loaded = open_saved(tmp_path / "fit.npz")
    assert isinstance(loaded, SpectralFit)
    wi, wo = draw_in_discs(500, torch.Generator().manual_seed(1))
    assert torch.equal(loaded.evaluate(wi, wo), made.evaluate(wi, wo))
    assert loaded.provenance == made.provenance
    assert loaded.channels == made.channels
    assert np.array_equal(loaded.basis.dual, made.basis.dual)
    assert loaded.nbytes == made.nbytes


def test_below_the_horizon_it_is_black_and_never_negative() -> None:
    _, made = compressed(3, 0.5)
    wi, wo = draw_in_discs(200, torch.Generator().manual_seed(1))
    assert float(made.evaluate(wi, wo).min()) >= 0
    assert float(made.evaluate(-wi, wo).abs().max()) == 0
    assert float(made.evaluate(wi, -wo).abs().max()) == 0


def test_other_texels_change_the_values_in_the_bands_of_their_vector() -> None:
    _, made = compressed(2, 1e-6)
    texels = [texture.texels.copy() for texture in made.textures]
    texels[0][..., 1] += 0.25
    changed = made.with_textures(texels, facts={"edited": True})
    wi, wo = draw_in_discs(50, torch.Generator().manual_seed(1))
    lookups = made.terms[0].projection.lookups
    expected = torch.from_numpy(0.25 * lookups * made.basis.vectors[1]).expand(50, -1)
    assert torch.allclose(changed.evaluate_log(wi, wo) - made.evaluate_log(wi, wo), expected)
    assert changed.provenance["edited"]


@pytest.mark.parametrize(
    ("channels", "where", "found"),
    [
        (("R", "G", "B"), "channels", "R, G, B"),
        (("550nm",), "wavelengths", "550 nm alone"),
        (("500nm", "510nm"), "wavelengths", "500-510 nm"),
        (("400nm", "500nm", "600nm", "700nm"), "channels", "4 bands"),
        (("900nm", "1700nm"), "wavelengths", "900-1700 nm"),
        (("700nm", "400nm"), "wavelengths", "400 nm follows 700 nm"),
        (("400nm", "nannm", "700nm"), "wavelengths", "nan nm follows 400 nm"),
    ],
)
def test_channels_that_are_no_visible_spectrum_are_refused(channels: tuple[str, ...], where: str, found: str) -> None:
    whole = product(2)
    terms = tuple(replace(term, texture=term.texture[..., : len(channels)]) for term in whole.terms)
    fit = Factorization(terms, TRANSFORM.of_channels(slice(0, len(channels))), channels)
    with refused(where=where, found=found):
        SpectralFit.of(fit, samples(fit), 0.5)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("vectors", np.zeros((4, 30))),
        ("vectors", np.full((4, 31), np.nan)),
        ("offset", np.zeros(30)),
        ("dual", np.zeros((31, 3))),
        ("texture_0", np.zeros((7, 6, 31))),
    ],
)
def test_a_damaged_file_is_refused(tmp_path: Path, name: str, value: np.ndarray) -> None:
    path = _written(tmp_path, lambda arrays, _: arrays.update({name: value}))
    with refused(match="fit.npz"):
        SpectralFit.load(path)


@pytest.mark.parametrize(("entry", "value"), [("rank", 0), ("rank", "4"), ("channels", ["R", "G", "B"])])
def test_a_header_that_cannot_be_meant_is_refused(tmp_path: Path, entry: str, value: object) -> None:
    path = _written(tmp_path, lambda _, header: header.update({entry: value}))
    with refused(match="fit.npz"):
        SpectralFit.load(path)


def _written(folder: Path, change) -> Path:
    """A saved fit with its arrays and header changed."""
    _, made = compressed(4, 1e-6)
    path = folder / "fit.npz"
    made.save(path)
    with np.load(path) as stored:
        arrays = dict(stored)
    header = json.loads(str(arrays["header"]))
    change(arrays, header)
    arrays["header"] = np.array(json.dumps(header))
    np.savez(path, **arrays)
    return path
