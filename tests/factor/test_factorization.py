"""Saving, loading and evaluating a factorization."""

import json

import numpy as np
import pytest
import torch

from homofact.brdf.log_transform import LogTransform
from homofact.errors import BadInput
from homofact.factor.factorization import Factorization, Term
from homofact.factor.projection import Projection, Warp, fixed_projection
from homofact.geometry.directions import draw_in_discs
from homofact.geometry.rotation import Rotation


@pytest.fixture
def factorization() -> Factorization:
    generator = torch.Generator().manual_seed(0)

    def term(projection: Projection, rows: int) -> Term:
        texture = torch.randn(rows, 6, 2, dtype=torch.float64, generator=generator)
        return Term(projection, texture, torch.rand(rows, 6, generator=generator) > 0.2)

    single = Rotation.of_numbers(torch.ones(4, dtype=torch.float64))
    terms = (
        term(Projection.from_rotation("in-out", Rotation.random(generator), True), 6),
        term(Projection.from_rotation("half-diff", Rotation.random(generator), True, warp=Warp(0.1)), 6),
        term(Projection.from_rotation("isotropic-half-diff", single, True), 6),
        term(fixed_projection("theta_i", True), 1),
    )
    transform = LogTransform(1e-3, torch.tensor([0.3, 0.7], dtype=torch.float64))
    return Factorization(terms, transform, ("R", "G"), {"seed": 7})


def test_a_loaded_factorization_is_bit_identical(factorization: Factorization, tmp_path) -> None:
    path = tmp_path / "f.npz"
    factorization.save(path)
    loaded = Factorization.load(path)
    wi, wo = draw_in_discs(500, torch.Generator().manual_seed(1))
    assert torch.equal(loaded.evaluate(wi, wo), factorization.evaluate(wi, wo))
    assert loaded.provenance == factorization.provenance
    assert loaded.channels == factorization.channels
    for one, other in zip(loaded.terms, factorization.terms, strict=True):
        assert np.array_equal(one.texture, other.texture)
        assert np.array_equal(one.mask, other.mask)
        assert np.array_equal(one.projection.matrix, other.projection.matrix)
        assert one.projection.warp == other.projection.warp
    first, third = loaded.terms[0].projection.rotation, loaded.terms[2].projection.rotation
    assert first is not None
    assert third is not None
    assert (first.dimension, third.dimension) == (4, 3)
    assert torch.equal(third.quaternions, torch.full((1, 4), 0.5, dtype=torch.float64))
    assert [p.name for p in tmp_path.iterdir()] == ["f.npz"]


def test_it_costs_its_texels_and_a_fetch_a_lookup(factorization: Factorization) -> None:
    assert factorization.nbytes == 4 * 2 * (36 * 3 + 6)
    assert factorization.fetches == 2 + 2 + 1 + 2


def test_the_product_of_exponentials_is_the_value(factorization: Factorization) -> None:
    """A constant texture a looked up twice and b once give A (e^(2a+b) − ε)."""
    a = Term(fixed_projection("wi", True), torch.full((4, 4, 1), 0.3, dtype=torch.float64), torch.ones(4, 4).bool())
    b = Term(fixed_projection("h", True), torch.full((4, 4, 1), -0.5, dtype=torch.float64), torch.ones(4, 4).bool())
    transform = LogTransform(0.01, torch.tensor([2.0], dtype=torch.float64))
    found = Factorization((a, b), transform, ("Y",)).evaluate(*draw_in_discs(5, torch.Generator().manual_seed(0)))
    assert torch.allclose(found, torch.full((5, 1), 2 * (np.exp(0.1) - 0.01), dtype=torch.float64))


def test_bad_files_are_named(factorization: Factorization, tmp_path) -> None:
    path = tmp_path / "f.npz"
    with pytest.raises(BadInput, match=r"f\.npz: no such file"):
        Factorization.load(path)
    path.write_bytes(b"not a zip")
    with pytest.raises(BadInput, match=r"f\.npz: not a saved factorization"):
        Factorization.load(path)
    factorization.save(path)
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) // 2])
    with pytest.raises(BadInput, match=r"f\.npz: not a saved factorization"):
        Factorization.load(path)
    path.write_bytes(whole)
    with np.load(path) as archive:
        arrays = {name: archive[name] for name in archive.files}
    for change, message in (
        ({"format_version": 99}, r"format version 99, expected at most 1 \(update homofact\)"),
        ({"epsilon": None}, "epsilon: found null, expected a finite number above 0"),
        ({"epsilon": -1}, "epsilon: found -1, expected a finite number above 0"),
        ({"terms": []}, "terms: .*expected 1 to 1000 objects"),
        ({"provenance": None}, "provenance: found null, expected an object"),
        ({"format": "others"}, 'format: found "others", expected one of homofact factorization'),
        ({"format_version": -5}, "format_version: found -5, expected a whole number from 1"),
        ({"channels": ["R"]}, r"mean is float64 of shape \(2,\), expected floats of shape \(1\)"),
    ):
        header = json.loads(str(arrays["header"])) | change
        np.savez(path, **{**arrays, "header": np.array(json.dumps(header))})
        with pytest.raises(BadInput, match=message):
            Factorization.load(path)
    np.savez(path, **{name: array for name, array in arrays.items() if name != "texture_1"})
    with pytest.raises(BadInput, match="texture_1"):
        Factorization.load(path)
    np.savez(path, **{**arrays, "texture_0": np.full((6, 6, 2), np.nan)})
    with pytest.raises(BadInput, match="texture_0 holds nan, expected numbers"):
        Factorization.load(path)


def test_an_unwritable_place_leaves_nothing(factorization: Factorization, tmp_path) -> None:
    with pytest.raises(BadInput, match="cannot be written"):
        factorization.save(tmp_path / "missing" / "f.npz")
    assert list(tmp_path.iterdir()) == []


def test_textures_that_ran_away_together_stay_finite_in_float32() -> None:
    """Each under the cap, their sum far above it."""
    whole = torch.ones(4, 4, dtype=torch.bool)
    terms = tuple(
        Term(fixed_projection(name, True), torch.full((4, 4, 1), 60.0, dtype=torch.float64), whole)
        for name in ("h", "theta_i-theta_o")
    )
    fit = Factorization(terms, LogTransform(0.01, torch.tensor([2.0], dtype=torch.float64)), ("Y",))
    wi, wo = draw_in_discs(5, torch.Generator().manual_seed(0))
    assert torch.allclose(fit.evaluate(wi, wo), torch.full((5, 1), 2 * np.exp(80.0), dtype=torch.float64))
    assert bool(torch.isfinite(fit.evaluate(wi.float(), wo.float())).all())
