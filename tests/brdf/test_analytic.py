"""The analytic models: the laws of a BRDF, then values worked by hand."""

import math

import pytest
import torch
from refusals import refused
from torch import Tensor

from homofact.brdf.analytic import (
    AnalyticModel,
    AshikhminShirley,
    BlinnPhong,
    CookTorrance,
    Lafortune,
    Lambert,
    Lobe,
    Phong,
    TorranceSparrow,
    Ward,
)
from homofact.brdf.analytic.cook_torrance import dielectric
from homofact.brdf.materials import MATERIALS, material
from homofact.geometry.directions import draw_uniform, from_half_difference, from_spherical

GREY = (0.2, 0.3, 0.4)
MODELS: dict[str, AnalyticModel] = {name: item.model for name, item in MATERIALS.items()} | {
    "lambert": Lambert(GREY),
    "ward-isotropic": Ward(GREY, GREY, 0.1, 0.1),
    "ashikhmin-shirley-isotropic": AshikhminShirley(GREY, GREY, 30, 30),
}
ALL = pytest.mark.parametrize("model", MODELS.values(), ids=list(MODELS))
NORMAL = torch.tensor([[0.0, 0.0, 1.0]], dtype=torch.float64)


def pairs(seed: int = 0, count: int = 4000) -> tuple[Tensor, Tensor]:
    return draw_uniform(count, torch.Generator().manual_seed(seed))


def direction(theta: float, phi: float) -> Tensor:
    angles = torch.tensor([[theta, phi]], dtype=torch.float64)
    return from_spherical(angles[:, 0], angles[:, 1])


def turned(w: Tensor, angle: float, mirrored: bool) -> Tensor:
    x, y = w[:, 0], -w[:, 1] if mirrored else w[:, 1]
    cos, sin = math.cos(angle), math.sin(angle)
    return torch.stack((cos * x - sin * y, sin * x + cos * y, w[:, 2]), 1)


def albedo(model: AnalyticModel, wi: Tensor, side: int = 300) -> Tensor:
    """∫ f cosθo dωo (C,) by the midpoint rule in θ and φ."""
    cell = (torch.arange(side, dtype=torch.float64) + 0.5) / side
    theta, phi = torch.meshgrid(cell * (math.pi / 2), cell * (2 * math.pi), indexing="ij")
    theta, phi = theta.reshape(-1), phi.reshape(-1)
    weights = torch.sin(theta) * torch.cos(theta) * (math.pi**2 / side**2)
    wo = from_spherical(theta, phi)
    return (model.evaluate(wi.expand_as(wo), wo) * weights[:, None]).sum(0)


@ALL
def test_an_isotropic_model_has_no_left_and_right(model: AnalyticModel) -> None:
    wi, wo = pairs()
    values = model.evaluate(wi, wo)
    moved = model.evaluate(turned(wi, 0.9, True), turned(wo, 0.9, True))
    assert torch.allclose(moved, values, rtol=1e-8, atol=1e-12) == model.isotropic


def test_no_model_reads_a_table() -> None:
    assert {model.fetches for model in MODELS.values()} == {0}


def test_which_materials_are_isotropic() -> None:
    anisotropic = {name for name, model in MODELS.items() if not model.isotropic}
    assert anisotropic == {"ward-brushed", "ashikhmin-shirley-wang"}


@ALL
@pytest.mark.parametrize("degrees", [0, 30, 60, 80, 88])
def test_no_more_light_leaves_than_came(model: AnalyticModel, degrees: float) -> None:
    for phi in (0.0, math.pi / 2):
        reflected = albedo(model, direction(math.radians(degrees), phi))
        assert float(reflected.max()) <= 1
        assert float(reflected.min()) > 0.05


@pytest.mark.parametrize(
    ("model", "expected", "tolerance"),
    [
        (Lambert(GREY), GREY, 1e-4),
        (Phong((0.1, 0.1, 0.1), GREY, 30), (0.3, 0.4, 0.5), 1e-4),
        (BlinnPhong((0.1, 0.1, 0.1), GREY, 50), (0.3, 0.4, 0.5), 1e-4),
        # The Gaussians are normalised for narrow lobes only.
        (TorranceSparrow((0.1, 0.1, 0.1), GREY, 0.03), (0.3, 0.4, 0.5), 2e-3),
        (Ward((0.1, 0.1, 0.1), GREY, 0.03, 0.05), (0.3, 0.4, 0.5), 2e-3),
    ],
    ids=["lambert", "phong", "blinn-phong", "torrance-sparrow", "ward"],
)
def test_albedo_at_normal_incidence_is_the_weights(
    model: AnalyticModel, expected: tuple[float, ...], tolerance: float
) -> None:
    found = albedo(model, NORMAL, side=600)
    assert found.tolist() == pytest.approx(expected, abs=tolerance)


def test_cook_torrance_distribution_is_normalised() -> None:
    # A narrow lobe at normal incidence, where G = 1: the albedo is ks F0.
    model = CookTorrance((0.0, 0.0, 0.0), (1.0, 0.5, 0.1), roughness=0.03, reflectance=0.2)
    assert albedo(model, NORMAL, side=600).tolist() == pytest.approx((0.2, 0.1, 0.02), rel=5e-3)


@pytest.mark.parametrize(
    "model",
    [BlinnPhong(GREY, GREY, 50), TorranceSparrow(GREY, GREY, 0.2)],
    ids=["blinn-phong", "torrance-sparrow"],
)
def test_half_angle_models_read_the_half_angle_alone(model: AnalyticModel) -> None:
    h = direction(0.3, 0.7).expand(50, 3)
    theta = torch.linspace(0, 0.9, 50, dtype=torch.float64)
    values = model.evaluate(*from_half_difference(h, from_spherical(theta, theta * 9)))
    assert torch.allclose(values, values[:1].expand_as(values), rtol=1e-10)
    other = model.evaluate(direction(0.4, 0.7), direction(0.4, 0.7))
    assert not torch.allclose(other, values[:1], rtol=1e-2)


def test_lambert_by_hand() -> None:
    assert Lambert((0.5, 0.25, 0.0)).evaluate(*pairs())[7].tolist() == pytest.approx([0.5 / math.pi, 0.25 / math.pi, 0])


def test_phong_by_hand() -> None:
    model = Phong((0.0, 0.0, 0.0), (0.6, 0.6, 0.6), 10)
    mirror = model.evaluate(direction(0.8, 0.2), direction(0.8, 0.2 + math.pi))
    assert float(mirror[0, 0]) == pytest.approx(0.6 * 12 / (2 * math.pi))
    off = model.evaluate(direction(0.8, 0), direction(0.8 - 0.3, math.pi))
    assert float(off[0, 0]) == pytest.approx(0.6 * 12 / (2 * math.pi) * math.cos(0.3) ** 10)
    # More than a right angle from the mirror direction: nothing.
    assert float(model.evaluate(direction(1.2, 0), direction(1.2, 0))[0, 0]) == 0


def test_blinn_phong_by_hand() -> None:
    model = BlinnPhong((0.0, 0.0, 0.0), (1.0, 1.0, 1.0), 2)
    # (n+2)(n+4)/(8π(2^(−n/2) + n)) = 24/(8π·2.5) at n = 2.
    found = model.evaluate(direction(0.4, 1.0), direction(0.4, 1.0))
    assert float(found[0, 0]) == pytest.approx(24 / (20 * math.pi) * math.cos(0.4) ** 2)


def test_torrance_sparrow_is_mahajans_equation_14() -> None:
    model = TorranceSparrow((0.0, 0.0, 0.0), (1.0, 1.0, 1.0), 0.2)
    assert float(model.evaluate(NORMAL, NORMAL)[0, 0]) == pytest.approx(1 / (4 * math.pi * 0.04))
    found = model.evaluate(direction(0.2, 0), direction(0.2, 0))
    assert float(found[0, 0]) == pytest.approx(math.exp(-1) / (4 * math.pi * 0.04))


def test_cook_torrance_by_hand() -> None:
    model = CookTorrance((0.3, 0.2, 0.1), (0.8, 0.8, 0.8), roughness=0.15, reflectance=0.1)
    # ωi = ωo = n: D = 1/(4m²), G = 1, F = F0.
    peak = 0.8 * 0.1 / (math.pi * 4 * 0.15**2)
    assert model.evaluate(NORMAL, NORMAL)[0].tolist() == pytest.approx([peak + x / math.pi for x in (0.3, 0.2, 0.1)])
    # Back along ωi at θ = 0.2: h = ωi, F = F0, G = min(1, 2cos²θ) = 1, D with β = 0.2.
    cos, tan = math.cos(0.2), math.tan(0.2)
    expected = 0.8 * 0.1 * math.exp(-((tan / 0.15) ** 2)) / (4 * 0.15**2 * cos**4) / (math.pi * cos**2)
    found = model.evaluate(direction(0.2, 0), direction(0.2, 0))
    assert float(found[0, 0]) == pytest.approx(expected + 0.3 / math.pi)
    # At θi = 85°, θo = 60° in the plane G = 2 (n·h)(n·ωi)/(h·ωi) < 1.
    i, o = math.radians(85), math.radians(60)
    beta, half = (i - o) / 2, (i + o) / 2
    groove = 2 * math.cos(beta) * math.cos(i) / math.cos(half)
    assert groove < 1
    d = math.exp(-((math.tan(beta) / 0.15) ** 2)) / (4 * 0.15**2 * math.cos(beta) ** 4)
    f = float(dielectric(torch.tensor(math.cos(half), dtype=torch.float64), model.index))
    expected = 0.8 * f * d * groove / (math.pi * math.cos(i) * math.cos(o))
    found = model.evaluate(direction(i, 0), direction(o, math.pi))
    assert float(found[0, 0]) == pytest.approx(expected + 0.3 / math.pi)


def test_fresnel_of_glass() -> None:
    cosine = torch.tensor([1.0, math.cos(math.pi / 4), math.cos(math.atan(1.5)), 0.0], dtype=torch.float64)
    # Index 1.5: .04 straight on; at 45° s .09201, p .00847; at Brewster's angle half of s; 1 at grazing.
    brewster = 0.5 * ((1.5**2 - 1) / (1.5**2 + 1)) ** 2
    expected = [0.04, (0.0920134 + 0.0084665) / 2, brewster, 1.0]
    assert dielectric(cosine, 1.5).tolist() == pytest.approx(expected, abs=1e-6)
    model = CookTorrance(GREY, GREY, 0.1, reflectance=0.04)
    assert model.index == pytest.approx(1.5)


def test_ward_by_hand() -> None:
    model = Ward((0.0, 0.0, 0.0), (0.19, 0.19, 0.19), 0.088, 0.13)
    peak = 0.19 / (4 * math.pi * 0.088 * 0.13)
    assert float(model.evaluate(NORMAL, NORMAL)[0, 0]) == pytest.approx(peak)
    for phi, alpha in ((0.0, 0.088), (math.pi / 2, 0.13)):
        w = direction(0.15, phi)
        expected = peak * math.exp(-((math.tan(0.15) / alpha) ** 2)) / math.cos(0.15)
        assert float(model.evaluate(w, w)[0, 0]) == pytest.approx(expected)


def test_ashikhmin_shirley_by_hand() -> None:
    model = material("ashikhmin-shirley-wang").model
    scale = math.sqrt(11 * 101) / (8 * math.pi)
    matte = 28 * 0.5 / (23 * math.pi) * 0.25
    peak = scale * 0.75 + matte * (1 - 0.5**5) ** 2
    assert float(model.evaluate(NORMAL, NORMAL)[0, 0]) == pytest.approx(peak)
    for phi, n in ((0.0, 10), (math.pi / 2, 100)):
        w = direction(0.3, phi)
        cos = math.cos(0.3)
        expected = scale * cos**n / cos * 0.75 + matte * (1 - (1 - cos / 2) ** 5) ** 2
        assert float(model.evaluate(w, w)[0, 0]) == pytest.approx(expected)
    # Schlick off the peak: h = n, k·h = cos 60°.
    expected = scale / (0.5 * 0.5) * (0.75 + 0.25 * 0.5**5) + matte * (1 - 0.75**5) ** 2
    found = model.evaluate(direction(math.pi / 3, 0), direction(math.pi / 3, math.pi))
    assert float(found[0, 0]) == pytest.approx(expected)


def test_lafortune_blue_paint_by_hand() -> None:
    model = material("lafortune-blue-paint").model
    # Red at ωi = ωo = n, where only Cz counts.
    red = 0.3094 / math.pi + 0.803624**21.820103 + 0.023123**2.774499 + 0.706734**66.899060
    assert float(model.evaluate(NORMAL, NORMAL)[0, 0]) == pytest.approx(red, rel=1e-12)
    # .0984851 + .0084773 + .0000289 + 8·10⁻¹¹, with logarithms to six digits.
    assert red == pytest.approx(0.1069913, abs=1e-6)
    # Blue, ωi = (.6, 0, .8), ωo = (−.8, 0, .6): xx + yy = −.48, zz = .48.
    wi = torch.tensor([[0.6, 0.0, 0.8]], dtype=torch.float64)
    wo = torch.tensor([[-0.8, 0.0, 0.6]], dtype=torch.float64)
    # The first lobe's base, −.48·.670982 + .48·.586674, is negative: no contribution.
    second = (0.48 * 0.477976 + 0.48 * 0.227295) ** 3.677653
    third = (0.48 * 1.026588 + 0.48 * 0.687715) ** 57.489181
    blue = 0.70837 / math.pi + second + third
    assert float(model.evaluate(wi, wo)[0, 2]) == pytest.approx(blue, rel=1e-12)
    # Blue, back along ωi: xx = .36, zz = .64; the first lobe is the retroreflection, the second's base < 0.
    first = (0.36 * 0.670982 + 0.64 * 0.586674) ** 7.472717
    third = (0.64 * 0.687715 - 0.36 * 1.026588) ** 57.489181
    assert float(model.evaluate(wi, wi)[0, 2]) == pytest.approx(0.70837 / math.pi + first + third, rel=1e-12)


def test_bytes_count_the_coefficients() -> None:
    assert Lambert(GREY).nbytes == 12
    assert Ward(GREY, GREY, 0.1, 0.2).nbytes == 4 * 8
    assert material("lafortune-skin").model.nbytes == 4 * (3 + 27)


def test_any_number_of_channels() -> None:
    model = Lambert((0.5,), channels=("Y",))
    assert model.evaluate(NORMAL, NORMAL).shape == (1, 1)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Lambert((0.5, 0.5)), "Lambert: diffuse has 2 numbers, expected one for each of R, G, B"),
        (lambda: Lambert((0.5, -0.1, 0.5)), "diffuse is .*, expected finite numbers >= 0"),
        (lambda: Lambert((0.5, math.nan, 0.5)), "diffuse is .*, expected finite numbers >= 0"),
        (lambda: Phong(GREY, GREY, -1), "Phong: exponent is -1, expected a finite number >= 0"),
        (lambda: BlinnPhong(GREY, GREY, math.inf), "BlinnPhong: exponent is inf"),
        (lambda: CookTorrance(GREY, GREY, 0, 0.1), "roughness is 0, expected a finite number > 0"),
        (lambda: CookTorrance(GREY, GREY, 0.1, 1.0), "reflectance is 1.0, expected between 0 and 1"),
        (lambda: TorranceSparrow(GREY, GREY, 0.0), "sigma is 0.0, expected a finite number > 0"),
        (lambda: Ward(GREY, GREY, 0.1, -0.1), "alpha_y is -0.1"),
        (lambda: AshikhminShirley(GREY, (1.2, 0, 0), 1, 1), "specular is .*, expected numbers in"),
        (lambda: AshikhminShirley(GREY, GREY, -1, 1), "nu is -1"),
        (lambda: Lafortune(GREY, (Lobe((1, 1), GREY, GREY),)), "cxy of lobe 0 has 2 numbers"),
        (lambda: Lafortune(GREY, (Lobe(GREY, GREY, (1, 0, 1)),)), "n of lobe 0 is .*, n above 0"),
    ],
)
def test_impossible_parameters_are_refused(make, message: str) -> None:
    with refused(message):
        make()
