"""Models without textures: their formulas, what fits of them recover, how they are saved, where they are refused."""

import math
from dataclasses import replace
from pathlib import Path

import pytest
import torch
from slow_cases import slow_among

import homofact
from homofact.brdf.analytic.ggx import GgxBrdf, GgxLobe
from homofact.brdf.analytic.ggx_fit import fit_ggx
from homofact.brdf.analytic.spherical_gaussians import Gaussian, SphericalGaussians
from homofact.brdf.factored import BINS, FactoredBrdf
from homofact.brdf.quality.faults import albedo
from homofact.brdf.sampling import sample_model
from homofact.brdf.source import Source
from homofact.cli.main import main
from homofact.errors import BadInput
from homofact.evaluation.compare import fit_and_measure
from homofact.geometry.directions import draw_uniform, from_spherical
from homofact.methods.table import made
from homofact.parametric.factored_fit import fit_factored
from homofact.parametric.gaussian_fit import fit_gaussians
from homofact.parametric.network import train

GGX = GgxBrdf((0.3, 0.2, 0.1), (GgxLobe((0.5, 0.4, 0.6), 0.25, 0.08),))
TWO = GgxBrdf((0.1, 0.2, 0.1), (GgxLobe((0.3, 0.3, 0.3), 0.06, 0.1), GgxLobe((0.9, 0.5, 0.2), 0.4, 0.3)))
GAUSSIANS = SphericalGaussians((0.2, 0.3, 0.4), (Gaussian((1.0, 0.5, 0.2), 60.0), Gaussian((0.1, 0.2, 0.3), 4.0)), 0.05)


def table(seed: int = 0) -> FactoredBrdf:
    """Tables as a glossy paint might have."""
    k = torch.arange(BINS, dtype=torch.float64) + 0.5
    lobe = 3 * torch.exp(-((k / BINS) ** 4) / 0.02) + 0.02
    masking = (k / BINS * math.pi / 2).cos() ** 0.7
    fresnel = 0.1 + 0.9 * (1 - (k / BINS * math.pi / 2).cos()) ** 5
    columns = [
        torch.cat((torch.tensor([d, 1.0]), lobe * s, masking, fresnel)) for d, s in ((0.3, 1.0), (0.2, 0.7), (0.1, 0.4))
    ]
    return FactoredBrdf(torch.stack(columns, 1))


def pairs(count: int = 400) -> tuple[torch.Tensor, torch.Tensor]:
    wi, wo = draw_uniform(count, torch.Generator().manual_seed(1))
    return wi, wo


def test_ggx_at_normal_incidence_and_as_walter_prints_it() -> None:
    up = torch.tensor([[0.0, 0.0, 1.0]], dtype=torch.float64)
    # At the normal D = 1/(π α²), G = 1, F = F0: f = kd/π + ks F0/(4 π α²).
    expected = [(d + s * 0.08 / (4 * 0.25**2)) / math.pi for d, s in zip(GGX.diffuse, (0.5, 0.4, 0.6), strict=True)]
    assert GGX.evaluate(up, up)[0].tolist() == pytest.approx(expected, rel=1e-12)
    wi, wo = pairs()
    h = torch.nn.functional.normalize(wi + wo, dim=1)
    tangent = (1 - h[:, 2] ** 2) / h[:, 2] ** 2
    d = 0.25**2 / (math.pi * h[:, 2] ** 4 * (0.25**2 + tangent) ** 2)

    def smith(w: torch.Tensor) -> torch.Tensor:
        return ((1 + 0.25**2 * (1 - w[:, 2] ** 2) / w[:, 2] ** 2).sqrt() - 1) / 2

    g = 1 / (1 + smith(wi) + smith(wo))
    f = 0.08 + 0.92 * (1 - (wi * h).sum(1)) ** 5
    lobe = d * g * f / (4 * wi[:, 2] * wo[:, 2])
    found = GGX.evaluate(wi, wo) - torch.tensor(GGX.diffuse, dtype=torch.float64) / math.pi
    found = found / torch.tensor([0.5, 0.4, 0.6], dtype=torch.float64)
    assert torch.allclose(found, lobe[:, None].expand(-1, 3), rtol=1e-9)


def test_a_white_microfacet_reflects_no_more_than_it_gets() -> None:
    for alpha in (0.05, 0.3, 1.0):
        model = GgxBrdf((0.0, 0.0, 0.0), (GgxLobe((1.0, 1.0, 1.0), alpha, 1.0),))
        for degrees in (0.0, 45.0, 75.0):
            assert 0.3 < float(albedo(model, degrees)[0]) <= 1.01


@pytest.mark.parametrize("model", [GGX, TWO, GAUSSIANS, table()], ids=["one", "two", "gaussians", "tables"])
def test_light_and_viewer_may_be_swapped(model) -> None:
    wi, wo = pairs()
    assert torch.allclose(model.evaluate(wi, wo), model.evaluate(wo, wi), rtol=1e-9)
    below = wi * torch.tensor([1.0, 1.0, -1.0])
    assert float(model.evaluate(below, wo).abs().max()) == 0


@pytest.mark.slow
def test_ggx_fits_recover_what_was_planted() -> None:
    found, report = fit_ggx(sample_model(GGX, 3000, "lobe", 0), 1, 0)
    assert report.residual < 1e-12
    assert found.diffuse == pytest.approx(GGX.diffuse, rel=1e-3)
    lobe, planted = found.lobes[0], GGX.lobes[0]
    assert (lobe.roughness, lobe.reflectance) == pytest.approx((planted.roughness, planted.reflectance), rel=1e-3)
    assert lobe.specular == pytest.approx(planted.specular, rel=1e-3)
    found, _ = fit_ggx(sample_model(TWO, 3000, "lobe", 0), 2, 0)
    assert sorted(lobe.roughness for lobe in found.lobes) == pytest.approx([0.06, 0.4], rel=1e-2)


def test_gaussians_recover_what_was_planted() -> None:
    found, _ = fit_gaussians(sample_model(GAUSSIANS, 3000, "lobe", 0), 2, 0)
    assert sorted(each.sharpness for each in found.gaussians) == pytest.approx([4, 60], rel=1e-2)
    assert found.diffuse == pytest.approx(GAUSSIANS.diffuse, rel=1e-2)


def test_tables_are_looked_up_between_their_centres() -> None:
    model = table()
    theta = torch.tensor([10.5, 44.0, 89.9], dtype=torch.float64).deg2rad()
    wi = from_spherical(theta, torch.zeros(3, dtype=torch.float64))
    # In the mirror direction θh = 0 and θd = θi = θo.
    values = model.evaluate(wi, from_spherical(theta, torch.full((3,), math.pi, dtype=torch.float64)))
    t = model.table

    def between(first: int, degrees: float) -> torch.Tensor:
        place = min(max(degrees - 0.5, 0.0), BINS - 1)
        low = min(int(place), BINS - 2)
        return t[first + low] + (place - low) * (t[first + low + 1] - t[first + low])

    for k, degrees in enumerate((10.5, 44.0, 89.9)):
        g, f = between(92, degrees), between(182, degrees)
        cosine = math.cos(math.radians(degrees))
        expected = (t[0] + t[1] * t[2] * f * g * g / cosine**2) / math.pi
        assert torch.allclose(values[k], expected, rtol=1e-6)


@pytest.mark.slow
def test_tables_are_solved_from_samples() -> None:
    planted = table()
    found, _ = fit_factored(sample_model(planted, 6000, "lobe", 0), 0)
    wi, wo = pairs(2000)
    ratio = found.evaluate(wi, wo) / planted.evaluate(wi, wo)
    assert float((ratio - 1).abs().median()) < 0.01
    assert float((ratio - 1).abs().quantile(0.95)) < 0.05


@pytest.mark.slow
def test_a_network_learns_a_plastic() -> None:
    samples = sample_model(replace(GGX, lobes=(GgxLobe((0.5, 0.4, 0.6), 0.5, 0.3),)), 4000, "discs", 0)
    found = train(samples, 1500)
    values = found.evaluate(samples.wi, samples.wo)
    assert float(((values - samples.values).abs() * samples.wi[:, 2:]).mean()) < 0.004


def test_a_network_of_a_metal_does_not_go_out() -> None:
    metal = replace(GGX, diffuse=(0.02, 0.02, 0.02), lobes=(GgxLobe((0.8, 0.7, 0.6), 0.06, 0.0),))
    samples = sample_model(metal, 4000, "lobe", 0)
    values = train(samples, 800).evaluate(samples.wi, samples.wo)
    # Nothing of the metal is zero, and once a value is cut at zero nothing would raise it again.
    assert float((values == 0).double().mean()) < 0.05


@pytest.mark.parametrize(
    "label", slow_among(["ggx", "ggx:2", "gaussians:2", "npf", "nbrdf"], "ggx:2", "gaussians:2", "npf")
)
def test_fits_are_equal_bit_by_bit_and_read_back(label: str, tmp_path: Path) -> None:
    samples = sample_model(GGX, 600, "lobe", 0)
    method = made(label, {"steps": 30, "seed": 3} if label == "nbrdf" else {"seed": 3})
    first, again = method.fit(samples), method.fit(samples)
    first.save(tmp_path / "a.npz")
    back = homofact.load(str(tmp_path / "a.npz"))
    wi, wo = pairs(50)
    expected = first.evaluate(wi, wo)
    assert torch.equal(again.evaluate(wi, wo), expected)
    assert torch.equal(back.evaluate(wi, wo), expected)
    assert (back.channels, back.nbytes, back.describe()) == (
        first.channels,
        first.nbytes,
        first.factorization.describe(),
    )
    assert back.transform.epsilon == first.factorization.transform.epsilon


@pytest.mark.parametrize(
    ("label", "bytes_expected"), [("ggx", 32), ("ggx:2", 52), ("gaussians:3", 64), ("npf", 3264), ("nbrdf", 2700)]
)
def test_bytes_are_those_of_the_numbers(label: str, bytes_expected: int) -> None:
    method = made(label, {"steps": 1} if label == "nbrdf" else {})
    assert method.fit(sample_model(GGX, 300, "lobe", 0)).nbytes == bytes_expected


@pytest.mark.parametrize("label", ["ggx:0", "ggx:9", "ggx:", "ggx:wi", "npf:2", "search:2", "nbrdf:wi+h"])
def test_labels_that_mean_nothing_are_refused(label: str) -> None:
    with pytest.raises(BadInput, match="lobes"):
        made(label, {})


@pytest.mark.parametrize(
    ("label", "coordinates"), [("svd", "in-out"), ("svd:half-diff", "half-diff"), ("nmf:in-out", "in-out")]
)
def test_a_label_names_coordinates(label: str, coordinates: str) -> None:
    method = made(label, {"size": 4})
    assert (method.name, vars(method)["coordinates"]) == (label.partition(":")[0], coordinates)


@pytest.mark.parametrize("label", ["svd:", "svd:half", "ggx:half-diff", "mccool:in-out,"])
def test_coordinates_that_are_none_are_refused(label: str) -> None:
    with pytest.raises(BadInput):
        made(label, {})


def test_a_network_has_three_channels() -> None:
    grey = sample_model(GgxBrdf((0.3,), (GgxLobe((0.5,), 0.2, 0.1),), channels=("Y",)), 300, "lobe", 0)
    with pytest.raises(BadInput, match="nbrdf: found 1 channels, expected the 3"):
        homofact.Nbrdf(steps=1).fit(grey)
    assert homofact.Ggx().fit(grey).channels == ("Y",)


def test_bounds_are_refused_since_a_model_takes_values_alone() -> None:
    samples = sample_model(GGX, 300, "lobe", 0)
    bounded = replace(samples, clipped=samples.values > 0.5)
    for label in ("ggx", "npf", "nbrdf"):
        with pytest.raises(BadInput, match=rf"clipped: {label} takes no values as bounds"):
            made(label, {}).fit(bounded)


def test_what_wants_textures_refuses_a_model(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    place = tmp_path / "a.npz"
    homofact.Gaussians().fit(sample_model(GGX, 300, "lobe", 0)).save(place)
    for command in (
        ["export", str(place), "--out", str(tmp_path / "b")],
        ["view", str(place), "--out", str(tmp_path / "c.html")],
    ):
        assert main(command) == 2
        said = capsys.readouterr().err
        assert said.count("\n") == 1
        assert "has no textures, expected a fit by search" in said
    assert main(["factorize", "material:phong-10", "--method", "gaussians", "--out", str(tmp_path / "d")]) == 2
    assert "method: found 'gaussians', expected one of search" in capsys.readouterr().err
    assert [each.name for each in tmp_path.iterdir()] == ["a.npz"]


@pytest.mark.parametrize(
    "wrong",
    [
        lambda: GgxBrdf((0.1, 0.1), ()),
        lambda: GgxBrdf((0.1, 0.1, 0.1), (GgxLobe((1.0,), 0.1, 0.1),)),
        lambda: GgxBrdf((0.1, 0.1, 0.1), (GgxLobe((1.0, 1.0, 1.0), 0.0, 0.1),)),
        lambda: GgxBrdf((0.1, 0.1, 0.1), (GgxLobe((1.0, 1.0, 1.0), 0.1, 1.5),)),
        lambda: SphericalGaussians((0.1, 0.1, 0.1), (Gaussian((1.0, 1.0, 1.0), -1.0),), 0.1),
        lambda: SphericalGaussians((0.1, 0.1, 0.1), (Gaussian((1.0, 1.0), 1.0),), 0.1),
        lambda: SphericalGaussians((0.1, 0.1, 0.1), (), math.nan),
        lambda: FactoredBrdf(torch.zeros(10, 3)),
        lambda: FactoredBrdf(torch.full((272, 3), math.nan)),
    ],
)
def test_parameters_that_cannot_be_are_refused(wrong) -> None:
    with pytest.raises(BadInput, match="expected"):
        wrong()


@pytest.mark.parametrize("label", ["ggx", "mccool"])
def test_only_options_that_a_method_has_are_recommended(label: str) -> None:
    """Of a narrow lobe that neither can hold: McCool's projections have a size but no number of textures."""
    narrow = GgxBrdf((0.3, 0.2, 0.1), (GgxLobe((1.0, 1.0, 1.0), 0.02, 0.9), GgxLobe((1.0, 0.5, 0.2), 0.3, 0.5)))
    source = Source("narrow", "material", sample_model(narrow, 1500, "lobe", 0), narrow, 1e-3, 0.0)
    row = fit_and_measure(source, made(label, {"size": 8} if label == "mccool" else {}))
    recommended = {each.advice.setting for each in row.verdict.findings if each.advice}
    assert row.verdict.findings
    assert recommended <= ({"size"} if label == "mccool" else set())
