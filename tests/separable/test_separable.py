"""Separable fits: maps round trip, the matrix, reciprocity, what one term can do, files, and the methods' settings."""

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from refusals import refused
from slow_cases import slow_among

import homofact
from homofact.brdf.analytic import AnalyticModel, Lambert
from homofact.brdf.channels import OneChannel
from homofact.brdf.materials import material
from homofact.brdf.reflectance import Reflectance
from homofact.brdf.sampling import sample_model
from homofact.containers.exr import read_exr
from homofact.errors import BadInput, Status
from homofact.exporting.result import open_result, write_result
from homofact.factor.factorization import Factorization
from homofact.geometry.directions import draw_uniform, from_half_difference
from homofact.linear.bilinear import stencil
from homofact.methods.mccool import McCool
from homofact.methods.nmf import Nmf
from homofact.methods.separable_fit import fit_nmf, fit_svd, separable_of
from homofact.methods.svd import Svd
from homofact.separable.decompositions import eigen, power, svd
from homofact.separable.maps import LEAST_COSINE, MAPS, DirectionMap, direction_map, texel_centres
from homofact.separable.matrix import brdf_matrix
from homofact.separable.resampling import LocalPlanes, resampled
from homofact.separable.separable import Separable

pytestmark = pytest.mark.usefixtures("unseen")

SKIN, WARD = material("lafortune-skin").model, material("ward-brushed").model
GREY = Lambert((0.3, 0.2, 0.1))


def pairs(count: int = 400, seed: int = 0) -> tuple[torch.Tensor, torch.Tensor]:
    return draw_uniform(count, torch.Generator().manual_seed(seed))


def method(kind: Any = Svd, **changes: Any) -> Any:
    return kind(**({"size": 8, "textures": 3, "epsilon": 1e-2} | changes))


def rms(reflectance: Reflectance, model: Reflectance) -> float:
    wi, wo = pairs(2000, 7)
    difference = reflectance.evaluate(wi, wo) - model.evaluate(wi, wo)
    return float(((difference * wi[:, 2:]) ** 2).mean().sqrt())


@pytest.mark.parametrize("name", MAPS)
def test_a_map_and_its_inverse_go_round(name: str) -> None:
    chosen = direction_map(name)
    w, _ = pairs(500)
    uv = chosen.to_square(w)
    assert float(uv.abs().max()) <= 1
    assert torch.allclose(chosen.from_square(uv), w, atol=1e-7)
    rim = torch.tensor([[1.0, 0, 0], [0, -1, 0], [-(0.5**0.5), 0.5**0.5, 0], [0, 0, 1]], dtype=torch.float64)
    assert torch.allclose(chosen.from_square(chosen.to_square(rim)), rim, atol=1e-12)


def test_the_maps_are_the_papers() -> None:
    w = torch.tensor([[0.6, 0.0, 0.8], [0.0, 0.8, 0.6]], dtype=torch.float64)
    assert direction_map("orthographic").to_square(w).flatten().tolist() == pytest.approx([0.6, 0, 0, 0.8])
    assert direction_map("parabolic").to_square(w)[0].tolist() == pytest.approx([0.6 / 1.8, 0])
    assert direction_map("polar").to_square(w)[1].tolist() == pytest.approx([0.5, 2 * math.sqrt(0.4) - 1])


@pytest.mark.parametrize("name", MAPS)
@pytest.mark.parametrize("size", [2, 5, 16])
def test_every_texel_that_a_direction_reads_is_marked_and_has_a_direction_above_the_horizon(
    name: str, size: int
) -> None:
    chosen = direction_map(name)
    w, _ = pairs(20_000)
    numbers, weights = stencil(chosen.to_square(w), (size, size))
    reached = torch.zeros(size**2, dtype=torch.bool)
    reached[numbers[weights > 0]] = True
    marked = chosen.read(size)
    assert bool((marked | ~reached).all())
    assert int(marked.sum()) - int(reached.sum()) <= 0.1 * size**2
    directions = chosen.texel_directions(size)
    assert float(directions[:, 2].min()) >= LEAST_COSINE - 1e-12
    assert torch.allclose(directions.norm(dim=1), torch.ones(size**2).double())


@pytest.mark.parametrize("name", MAPS)
def test_the_weights_are_projected_solid_angles(name: str) -> None:
    chosen = direction_map(name)
    size = 64
    w = chosen.texel_directions(size)
    inside = torch.ones(size**2).bool() if not chosen.disc else texel_centres(size).norm(dim=1) < 1
    weights = chosen.texel_weights(size)[inside]
    z = w[inside, 2]
    # ∫ cosθ · cosθ dω / ∫ cosθ dω = 2/3.
    assert float((weights * z).sum() / weights.sum()) == pytest.approx(2 / 3, rel=0.02)


@pytest.mark.parametrize("decomposition", ["eigen", "svd", "power", "normalized"])
@pytest.mark.parametrize("name", MAPS)
@pytest.mark.parametrize("weighted", [False, True])
def test_lambert_needs_one_term(name: str, decomposition: str, weighted: bool) -> None:
    found = separable_of(GREY, 1, 8, map=name, decomposition=decomposition, weighted=weighted)
    wi, wo = pairs()
    assert torch.allclose(found.evaluate(wi, wo), GREY.evaluate(wi, wo), rtol=1e-9)


@pytest.mark.parametrize("isotropic", [False, True])
def test_a_matrix_holds_the_model_at_texel_directions(isotropic: bool) -> None:
    for parameterization in ("in-out", "half-diff"):
        matrix = brdf_matrix(SKIN, direction_map("parabolic"), 8, parameterization, isotropic=isotropic)
        n = int(matrix.read.sum())
        w = direction_map("parabolic").texel_directions(8)[matrix.read]
        wi, wo = w.repeat_interleave(n, 0), w.repeat(n, 1)
        if parameterization == "in-out":
            assert torch.equal(matrix.values, matrix.values.transpose(0, 1))
            assert bool(matrix.valid.all())
        else:
            wi, wo = from_half_difference(wi, wo)
            assert 0.05 < float(matrix.valid.double().mean()) < 0.5
        # Those a little above the horizon are raised to it.
        high = (wi[:, 2] >= LEAST_COSINE) & (wo[:, 2] >= LEAST_COSINE)
        expected = SKIN.evaluate(wi, wo)[high]
        assert torch.allclose(matrix.values.reshape(-1, 3)[high], expected, rtol=1e-4)
        assert bool(matrix.valid.reshape(-1)[high].all())


def test_an_anisotropic_matrix_is_filled_in_parts_like_in_one(monkeypatch: pytest.MonkeyPatch) -> None:
    whole = brdf_matrix(WARD, direction_map("polar"), 7)
    monkeypatch.setattr("homofact.separable.matrix._CHUNK", 100)
    parts = brdf_matrix(WARD, direction_map("polar"), 7)
    assert torch.equal(whole.values, parts.values)
    free = brdf_matrix(WARD, direction_map("polar"), 7, reciprocal=False)
    assert torch.allclose(free.values, whole.values, rtol=1e-9)


def test_more_terms_and_texels_are_better() -> None:
    errors = [rms(separable_of(SKIN, terms, 16), SKIN) for terms in (1, 3, 8)]
    assert errors == sorted(errors, reverse=True)
    assert rms(separable_of(SKIN, 8, 8), SKIN) > 1.2 * errors[-1]


@pytest.mark.parametrize(
    "name", slow_among(["ashikhmin-shirley-wang", "lafortune-clay", "lafortune-skin"], "ashikhmin-shirley-wang")
)
def test_power_equals_eigen_on_wangs_materials(name: str) -> None:
    matrix = brdf_matrix(OneChannel(material(name).model, "R"), direction_map("orthographic"), 12).values[..., 0]
    best, found = eigen(matrix, 8), power(matrix, 8, torch.Generator().manual_seed(0))
    assert found.converged
    values = [((each.left**2).sum(0) * each.signs).sort().values for each in (best, found)]
    assert float((values[0] - values[1]).abs().max()) < 1e-6 * float(values[0].abs().max())
    # Equal pairs may be turned within themselves: what is compared is how near the products come.
    errors = [float((each.product() - matrix).norm()) for each in (best, found, svd(matrix, 8))]
    assert errors == pytest.approx([errors[0]] * 3, rel=1e-6)


@pytest.mark.parametrize("model", [SKIN, WARD])
def test_a_reciprocal_fit_is_reciprocal_to_the_last_bit(model: AnalyticModel) -> None:
    fit = fit_svd(sample_model(model, 3000), method())
    wi, wo = pairs()
    found = fit.factorization
    assert torch.equal(found.evaluate(wi, wo), found.evaluate(wo, wi))
    free = fit_svd(sample_model(model, 3000), method(reciprocal=False)).factorization
    assert free.nbytes == 2 * found.nbytes
    assert found.nbytes == 3 * 8 * 8 * 3 * 4
    assert found.fetches == free.fetches == 6


@pytest.mark.parametrize("parameterization", ["in-out", "half-diff"])
def test_fits_from_samples_come_near_the_fit_of_the_model(parameterization: str) -> None:
    samples = sample_model(SKIN, 6000)
    direct = separable_of(
        SKIN, 3, 8, map="parabolic", parameterization=parameterization, decomposition="svd", weighted=True
    )
    fit = fit_svd(samples, method(coordinates=parameterization))
    assert rms(fit.factorization, SKIN) < 1.25 * rms(direct, SKIN)
    assert fit.report.status is Status.DIRECT
    other = fit_nmf(samples, method(Nmf, coordinates=parameterization))
    assert rms(other.factorization, SKIN) < 1.6 * rms(direct, SKIN)


def test_an_isotropic_measurement_at_one_azimuth_is_fitted_at_all() -> None:
    samples = sample_model(SKIN, 1500)
    azimuth = -torch.atan2(samples.wi[:, 1], samples.wi[:, 0])
    plane = fit_svd(samples.turned(azimuth), method()).factorization
    assert rms(plane, SKIN) == pytest.approx(rms(fit_svd(samples, method()).factorization, SKIN), rel=0.02)


def test_what_is_below_zero_is_cut_and_counted() -> None:
    samples = sample_model(material("lafortune-clay").model, 3000)
    fit = fit_svd(samples, method(textures=5))
    found = fit.factorization
    assert isinstance(found, Separable)
    signed = found.evaluate_signed(samples.wi, samples.wo)
    share = float((signed < 0).double().mean())
    assert 0 < share < 0.5
    assert fit.report.details["clipped"] == share == found.clipped(samples.wi, samples.wo)
    assert f"{share:.2%} of the values" in fit.report.notes[0]
    assert float(found.evaluate(samples.wi, samples.wo).min()) == 0
    for fit in (
        fit_nmf(samples, method(Nmf)),
        fit_svd(samples, method(decomposition="normalized")),
    ):
        assert (fit.report.details["clipped"], fit.report.notes) == (0, ())
    assert len(fit.factorization.terms) == 1


def test_local_planes_pass_through_a_plane_and_invent_nothing() -> None:
    samples = sample_model(WARD, 20_000)
    wi, wo = samples.wi[:300], samples.wo[:300]
    without = samples.select(torch.arange(300, 20_000))
    found, expected = LocalPlanes(without).evaluate(wi, wo), samples.values[:300]
    # Half of the places within 5% of their value, though none of these samples was seen.
    assert float(((found - expected).abs() / expected).median()) < 0.05
    assert float(found.max()) <= float(without.values.max()) * (1 + 1e-9)
    even = replace(samples, values=torch.full_like(samples.values, 0.25))
    assert torch.allclose(LocalPlanes(even).evaluate(wi, wo), torch.tensor(0.25).double())
    assert torch.allclose(LocalPlanes(samples).evaluate(wi, wo), LocalPlanes(samples).evaluate(wo, wi), rtol=1e-6)


@pytest.mark.parametrize("kind", [Svd, Nmf])
def test_a_result_comes_back_bit_identical_with_its_pictures(kind: Any, tmp_path: Path) -> None:
    samples = sample_model(SKIN, 1000)
    chosen = kind(size=6, textures=2, coordinates="half-diff", epsilon=1e-2)
    found = homofact.fit(samples, chosen).factorization
    assert isinstance(found, Separable)
    write_result(tmp_path / "r", factorization=found, report={})
    wi, wo = pairs()
    for back in (open_result(tmp_path / "r"), homofact.load(str(tmp_path / "r" / "factorization.npz"))):
        assert torch.equal(back.evaluate(wi, wo), found.evaluate(wi, wo))
        assert back.provenance == json.loads(json.dumps(found.provenance))
    described = json.loads((tmp_path / "r" / "manifest.json").read_text())
    assert [described[key] for key in ("map", "parameterization", "bytes")] == ["parabolic", "half-diff", found.nbytes]
    assert [entry["signs"] for entry in described["terms"]] == [term.signs.tolist() for term in found.terms]
    for term, entry in zip(found.terms, described["terms"], strict=True):
        for side, texture in zip(("first", "second"), term.textures, strict=True):
            names = entry["files"][side]
            stored = read_exr(tmp_path / "r" / names["exr"])
            assert np.array_equal(stored["G"], texture[..., 1].astype(np.float32))
            assert (tmp_path / "r" / names["png"]).is_file()


@pytest.mark.slow
def test_damaged_and_foreign_files_are_named(tmp_path: Path) -> None:
    found = separable_of(SKIN, 2, 4)
    path = tmp_path / "x.npz"
    found.save(path)
    with np.load(path) as archive:
        data = dict(archive)
    header = json.loads(str(data["header"]))

    def spoiled(**changes: Any) -> None:
        np.savez(path, **(data | changes))

    def retitled(**changes: object) -> np.ndarray:
        return np.array(json.dumps(header | changes))

    for changes, expected in (
        ({"header": retitled(format_version=99)}, "format version 99"),
        ({"header": retitled(map="round")}, 'map: found "round"'),
        ({"header": retitled(terms=3)}, "holds no signs_2"),
        ({"header": retitled(terms=0)}, "terms: found 0"),
        ({"header": np.array("3")}, "header is a JSON int, expected an object"),
        ({"first_1": data["first_1"][:2]}, r"first_1 is float64 of shape \(2,"),
        ({"first_1": data["first_1"] * np.nan}, "first_1 holds nan, expected numbers"),
        ({"second_1": data["first_1"]}, "holds second_1 and no second_0"),
        ({"signs_0": data["signs_0"][:1]}, "signs_0 is float64 of shape"),
    ):
        spoiled(**changes)
        with pytest.raises(BadInput, match=expected):
            open_result(path)
    path.write_bytes(b"nothing")
    with pytest.raises(BadInput, match="not a saved factorization"):
        open_result(path)
    with pytest.raises(BadInput, match="no such file"):
        Separable.load(tmp_path / "none.npz")
    found.save(path)
    with pytest.raises(BadInput):
        Factorization.load(path)
    homofact.fit(sample_model(SKIN, 300), McCool(size=4)).save(path)
    with pytest.raises(BadInput, match='format: found "homofact factorization"'):
        Separable.load(path)


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({"decomposition": "eigen", "reciprocal": False}, "decomposition: found 'eigen', which needs the symmetry"),
        ({"decomposition": "power", "coordinates": "half-diff"}, "expected svd or normalized"),
        ({"coordinates": "h"}, "coordinates: found 'h', expected one of in-out, half-diff"),
        ({"kind": Nmf, "coordinates": "wi"}, "coordinates: found 'wi', expected one of in-out, half-diff"),
        ({"map": "round"}, "map: found 'round', expected one of parabolic"),
        ({"decomposition": "qr"}, "decomposition: found 'qr', expected one of eigen"),
        ({"decomposition": ""}, "decomposition: found '', expected one of eigen"),
    ],
)
def test_settings_that_cannot_be_meant_are_refused(changes: dict[str, object], expected: str) -> None:
    with pytest.raises(BadInput, match=expected):
        method(**changes)


def test_bad_arguments_are_refused() -> None:
    with pytest.raises(BadInput, match="map: found 'x'"):
        direction_map("x")
    with pytest.raises(BadInput, match="parameterization: found 'x'"):
        separable_of(GREY, 1, 4, parameterization="x")
    with pytest.raises(BadInput, match="size: found 1,"):
        separable_of(GREY, 1, 1)
    with pytest.raises(BadInput, match="size: found 150, a matrix of"):
        separable_of(GREY, 1, 150)
    with pytest.raises(BadInput, match="decomposition: found 'x'"):
        separable_of(GREY, 1, 4, decomposition="x")
    with pytest.raises(BadInput, match="samples: 5 are too few to resample"):
        resampled(sample_model(WARD, 5), True)


def test_a_size_that_is_far_too_large_is_refused_before_its_directions_are_made(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(DirectionMap, "read", lambda *_: pytest.fail("directions were made"))
    with refused(where="size", found="10000"):
        brdf_matrix(SKIN, direction_map("parabolic"), 10_000)
