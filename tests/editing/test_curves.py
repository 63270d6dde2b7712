"""Curves, their bands, and the laws of the five models: unedited they are the material itself."""

import math
from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache

import pytest
import torch

from homofact.brdf.analytic import (
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
from homofact.brdf.materials import material
from homofact.editing import factored, models
from homofact.editing.angles import ANGLES, RIGHT_ANGLE, angle, chord_at
from homofact.editing.curves import (
    Bands,
    Formula,
    Knots,
    band_centres,
    band_deviation,
    band_edges,
    band_of,
    banded,
    flat,
)
from homofact.editing.material import Editable, EditableTerm, Slot
from homofact.editing.starts import beckmann, cosine_power, fresnel
from homofact.errors import BadInput
from homofact.geometry.directions import draw_in_discs, half_difference, to_spherical

RGB = (0.2, 0.1, 0.05)
PAINT = CookTorrance(RGB, (0.5, 0.6, 0.7), 0.15, 0.05)
BRUSHED = AshikhminShirley(RGB, (0.3, 0.4, 0.5), 300, 20)
GLOSSY, ALUMINIUM = Phong(RGB, (0.3, 0.4, 0.5), 30), Ward(RGB, (0.3, 0.4, 0.5), 0.1, 0.2)
BLINN, ANGULAR = BlinnPhong(RGB, RGB, 50), TorranceSparrow(RGB, RGB, 0.2)
CLAY = material("lafortune-clay").model
WI, WO = draw_in_discs(4000, torch.Generator().manual_seed(3))
# A search of some seconds: once a material.
half_and_diffuse = lru_cache(factored.half_and_diffuse)


def relative(found: torch.Tensor, expected: torch.Tensor) -> float:
    return float(((found - expected).abs() / expected.abs().clamp_min(1e-12)).max())


def test_angles_are_those_of_the_half_and_difference_vectors() -> None:
    h, d = half_difference(WI, WO)
    theta, phi = to_spherical(h)
    assert torch.allclose(angle("theta_h", WI, WO), theta, atol=1e-9)
    assert torch.allclose(angle("theta_d", WI, WO), to_spherical(d)[0], atol=1e-7)
    assert torch.allclose(angle("theta_o", WI, WO), to_spherical(WO)[0], atol=1e-12)
    # Eq. 15 and 16 as they are printed.
    alpha = torch.acos(torch.cos(theta) ** (torch.cos(phi) ** 2))
    beta = torch.acos(torch.cos(theta) ** (torch.sin(phi) ** 2))
    assert torch.allclose(angle("gamma_alpha", WI, WO), alpha, atol=1e-7)
    assert torch.allclose(angle("gamma_beta", WI, WO), beta, atol=1e-7)
    mirrored = (2 * WI[:, 2] * WO[:, 2] - (WI * WO).sum(1)).clamp(0, 1)
    assert torch.allclose(torch.cos(angle("theta_r", WI, WO)), mirrored, atol=1e-12)
    for name, component in (("theta_x", 0), ("theta_y", 1)):
        assert torch.allclose(torch.tan(angle(name, WI, WO)), (h[:, component] / h[:, 2]).abs(), rtol=1e-9)


@pytest.mark.parametrize("name", ANGLES)
def test_compiled_angles_are_the_same(name: str) -> None:
    for row in range(5):
        found = [chord_at(ANGLES.index(name), *wi, *WO[row].tolist()) for wi in WI[:100].tolist()]
        expected = 2 * torch.sin(angle(name, WI[:100], WO[row].expand(100, 3)) / 2)
        # What lies beyond π/2, as θr may, belongs to the last band.
        assert torch.allclose(torch.tensor(found, dtype=torch.float64).clamp_max(math.sqrt(2)), expected, atol=1e-7)


def test_angles_stay_within_their_range_at_the_ends() -> None:
    normal = torch.tensor([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [1.0, 0.0, 0.0]], dtype=torch.float64)
    other = torch.tensor([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [-1.0, 0.0, 0.0]], dtype=torch.float64)
    for name in ANGLES:
        found = angle(name, normal, other)
        assert bool(torch.isfinite(found).all())
        assert bool(((found >= 0) & (found <= RIGHT_ANGLE + 1e-12)).all())


@pytest.mark.parametrize(
    ("make", "model"),
    [
        (models.cook_torrance, PAINT),
        (models.ashikhmin_shirley, BRUSHED),
        (models.light_view, Lambert(RGB)),
        (models.phong, GLOSSY),
        (models.blinn_phong, BLINN),
        (models.torrance_sparrow, ANGULAR),
        (models.ward, ALUMINIUM),
        (models.ward, replace(ALUMINIUM, alpha_y=0.1)),
        (models.lafortune, CLAY),
        (factored.homomorphic, PAINT),
        (half_and_diffuse, PAINT),
        (models.from_reflectance, PAINT),
    ],
    ids=["CT", "AS", "LV", "Phong", "Blinn-Phong", "TS", "Ward", "isotropic Ward", "Lafortune", "HF", "HD", "any"],
)
def test_curves_as_they_start_give_the_material(make: Callable[..., Editable], model) -> None:
    made = make(model)
    found = made.edited({}).evaluate(WI, WO)
    assert relative(found, model.evaluate(WI, WO)) < 1e-10
    for term in made.terms:
        assert bool((term.evaluate(WI, WO) >= 0).all())


def test_sliders_are_the_parameters_of_the_model() -> None:
    paint, place = models.cook_torrance(PAINT), ("specular", "distribution")
    sliders = paint.slot(place).sliders
    assert sliders is not None
    found = paint.edited({place: sliders.curve(sigma=0.4)}).evaluate(WI, WO)
    assert relative(found, replace(PAINT, roughness=0.4).evaluate(WI, WO)) < 1e-10
    place = ("specular", "fresnel")
    sliders, other = paint.slot(place).sliders, replace(PAINT, reflectance=0.3)
    assert sliders is not None
    found = paint.edited({place: sliders.curve(n=other.index)}).evaluate(WI, WO)
    assert relative(found, other.evaluate(WI, WO)) < 1e-10
    brushed, model = models.ashikhmin_shirley(BRUSHED), replace(BRUSHED, nu=50, nv=500)
    curves = {}
    for name, slider, value in (("alpha", "nu", 50.0), ("beta", "nv", 500.0)):
        sliders = brushed.slot(("specular", name)).sliders
        assert sliders is not None
        curves["specular", name] = sliders.curve(**{slider: value})
    assert relative(brushed.edited(curves).evaluate(WI, WO), model.evaluate(WI, WO)) < 1e-10
    with pytest.raises(BadInput, match="slider: found 'width', expected one of nu"):
        brushed.slot(("specular", "alpha")).sliders.curve(width=1.0)  # type: ignore[union-attr]


@pytest.mark.parametrize(
    ("made", "changed", "sliders"),
    [
        (models.phong(GLOSSY), replace(GLOSSY, exponent=7.5), {"lobe": {"exponent": 7.5}}),
        (models.blinn_phong(BLINN), replace(BLINN, exponent=9), {"lobe": {"exponent": 9}}),
        (models.torrance_sparrow(ANGULAR), replace(ANGULAR, sigma=0.4), {"lobe": {"sigma": 0.4}}),
        (
            models.ward(ALUMINIUM),
            replace(ALUMINIUM, alpha_x=0.3, alpha_y=0.05),
            {"along": {"alpha_x": 0.3}, "across": {"alpha_y": 0.05}},
        ),
        (
            models.ward(replace(ALUMINIUM, alpha_y=0.1)),
            replace(ALUMINIUM, alpha_x=0.3, alpha_y=0.3),
            {"lobe": {"alpha": 0.3}},
        ),
    ],
    ids=["Phong", "Blinn-Phong", "TS", "Ward", "isotropic Ward"],
)
def test_sliders_are_the_parameters_of_lobes(made: Editable, changed, sliders: dict[str, dict[str, float]]) -> None:
    curves = {}
    for name, values in sliders.items():
        own = made.slot((models.SPECULAR, name)).sliders
        assert own is not None
        curves[models.SPECULAR, name] = own.curve(**values)
    assert relative(made.edited(curves).evaluate(WI, WO), changed.evaluate(WI, WO)) < 1e-10


def test_sharpening_adds_to_the_exponent_of_a_mirror_lobe() -> None:
    def lobe(n: float) -> Lafortune:
        # C^n stays while n rises: (1.2)^20.
        size = 1.2 ** (20 / n)
        return Lafortune(RGB, (Lobe((-size,) * 3, (size,) * 3, (n,) * 3),))

    made, place = models.lafortune(lobe(20)), ("lobe 1", "narrowing")
    sliders = made.slot(place).sliders
    assert sliders is not None
    assert made.slot(place).angle == "theta_r"
    found = made.edited({place: sliders.curve(sharpening=15.0)}).evaluate(WI, WO)
    assert relative(found, lobe(35).evaluate(WI, WO)) < 1e-9
    retro = models.lafortune(Lafortune(RGB, (Lobe((0.6,) * 3, (0.6,) * 3, (9.0,) * 3),)))
    assert retro.slot(place).angle == "theta_d"


def test_fresnel_of_metals_and_glass() -> None:
    gamma = torch.linspace(0, RIGHT_ANGLE, 50, dtype=torch.float64)
    assert torch.allclose(fresnel((1.5,), (0.0,)).at(gamma)[:, 0], dielectric(torch.cos(gamma), 1.5), atol=1e-12)
    # ((n − 1)² + k²)/((n + 1)² + k²) at normal incidence; 1 at grazing.
    gold = fresnel((0.47,), (2.83,)).at(gamma)[:, 0]
    assert float(gold[0]) == pytest.approx((0.53**2 + 2.83**2) / (1.47**2 + 2.83**2), rel=1e-12)
    assert float(gold[-1]) == pytest.approx(1, abs=1e-9)
    for bad in (((0.0,), (0.0,)), ((1.5,), (-1.0,)), ((1.5, 1.5), (0.0,))):
        with pytest.raises(BadInput, match=r"^[nk]: found"):
            fresnel(*bad)
    with pytest.raises(BadInput, match="sigma: found nan"):
        beckmann(math.nan, 3)


def test_a_band_is_the_mean_over_it_and_not_the_value_at_its_centre() -> None:
    curve = Formula(lambda gamma: (gamma**3)[:, None], 1)
    found, width = banded(curve, 32).values[:, 0], RIGHT_ANGLE / 32
    edges = torch.arange(33, dtype=torch.float64) * width
    assert torch.allclose(found, (edges[1:] ** 4 - edges[:-1] ** 4) / (4 * width), rtol=1e-12)
    # Finer bands have the same area.
    for count in (64, 256):
        assert float(banded(curve, count).values.mean()) == pytest.approx(float(found.mean()), rel=1e-9)


@pytest.mark.parametrize("count", [256, 64])
def test_bands_err_by_what_is_stated(count: int) -> None:
    paint, place = models.cook_torrance(PAINT, bands=(count, 64)), ("specular", "distribution")
    slot = paint.slot(place)
    found = paint.edited({place: banded(slot.start, count)}).evaluate(WI, WO)
    difference = (found - PAINT.evaluate(WI, WO)).abs()
    term = paint.term("specular")
    unit = term.evaluate(WI, WO, {"distribution": flat(3)})
    allowed = unit * Bands(band_deviation(slot.start, count)).at(angle("theta_h", WI, WO))
    assert bool((difference <= allowed * 1.0001 + 1e-12).all())
    # And it is no empty statement: the bound is near what is found somewhere.
    assert float((difference / allowed.clamp_min(1e-300))[allowed > 1e-6].max()) > 0.5


def test_finer_bands_err_less() -> None:
    curve = cosine_power(300, 1)
    errors = [float(band_deviation(curve, count).max()) for count in (32, 64, 128, 256)]
    assert errors == sorted(errors, reverse=True)
    assert errors[0] / errors[3] > 6


def test_the_specular_term_of_hd_takes_the_highlight() -> None:
    made = half_and_diffuse(PAINT)
    at = torch.tensor([[math.sin(0.6), 0.0, math.cos(0.6)]], dtype=torch.float64)
    mirror = at * torch.tensor([-1.0, 1.0, 1.0], dtype=torch.float64)
    diffuse, specular = (term.evaluate(at, mirror) for term in made.terms)
    assert bool((specular > 3 * diffuse).all())
    off = torch.tensor([[0.0, math.sin(0.9), math.cos(0.9)]], dtype=torch.float64)
    diffuse, specular = (term.evaluate(off, mirror) for term in made.terms)
    assert bool((diffuse > 3 * specular).all())


def test_hf_finds_its_own_curves_again() -> None:
    """Of a material that is such a product, up to the curves' common scale, and the quotient is then 1."""
    q = Formula(lambda gamma: torch.exp(-((gamma / 0.4) ** 2))[:, None] + 0.02, 1)
    p = Formula(lambda gamma: (0.3 + torch.cos(gamma))[:, None], 1)

    class Product:
        channels, nbytes, fetches = ("Y",), 0, 0

        def evaluate(self, wi: torch.Tensor, wo: torch.Tensor) -> torch.Tensor:
            ends = p.at(angle("theta_i", wi, wo)) * p.at(angle("theta_o", wi, wo))
            return q.at(angle("theta_h", wi, wo)) * ends

    made = factored.homomorphic(Product())
    found = made.terms[0].quotient(WI, WO)
    inside = (angle("theta_i", WI, WO) < 1.4) & (angle("theta_o", WI, WO) < 1.4) & (angle("theta_h", WI, WO) < 1.2)
    assert float((found[inside] - 1).abs().max()) < 0.03
    # An edit of P changes f at both ends.
    raised = Knots(made.slot(("whole", "directions")).start.values + math.log(2), logs=True)  # type: ignore[union-attr]
    doubled = made.edited({("whole", "directions"): raised}).evaluate(WI, WO)
    assert relative(doubled, 4 * Product().evaluate(WI, WO)) < 1e-9


def test_zeros_of_a_material_stay_and_are_named() -> None:
    class Cut:
        channels, nbytes, fetches = ("Y",), 0, 0

        def evaluate(self, wi: torch.Tensor, wo: torch.Tensor) -> torch.Tensor:
            return (wi[:, 2:] - 0.5).clamp_min(0)

    made = factored.half_and_diffuse(Cut())
    assert "zero at" in made.notes[0]
    found = made.edited({("diffuse", "incident"): flat(1, 5.0)}).evaluate(WI, WO)
    assert bool((found[WI[:, 2] <= 0.5] == 0).all())
    assert bool(torch.isfinite(found).all())

    class Black(Cut):
        def evaluate(self, wi: torch.Tensor, wo: torch.Tensor) -> torch.Tensor:
            return torch.zeros_like(wi[:, :1])

    for make in (factored.half_and_diffuse, factored.homomorphic):
        with pytest.raises(BadInput, match="channel Y is zero everywhere"):
            make(Black())


@pytest.mark.parametrize(
    ("values", "words"),
    [
        (torch.full((256, 3), -1.0), "value 0 of channel 0 is -1.0, expected finite numbers >= 0"),
        (torch.full((256, 3), math.nan), "value 0 of channel 0 is nan"),
        (torch.ones(100, 3), r"shape \(100, 3\), expected \(256 or 128 or 64 or 32, C\)"),
        (torch.ones(0, 3), "shape"),
        (torch.ones(256), "shape"),
    ],
)
def test_bands_that_are_no_curve_are_refused(values: torch.Tensor, words: str) -> None:
    with pytest.raises(BadInput, match=words):
        Bands(values.double())


def test_curves_that_do_not_fit_the_material_are_refused() -> None:
    made = models.cook_torrance(PAINT)
    ones = Bands(torch.ones(128, 3, dtype=torch.float64))
    for place, curve, words in (
        (("specular", "gloss"), ones, "specular: has no curve 'gloss', expected one of distribution, fresnel"),
        (("clear coat", "fresnel"), ones, "Cook-Torrance: has no term 'clear coat', expected one of diffuse, specular"),
        (
            ("specular", "fresnel"),
            ones,
            "specular: fresnel: found a curve of 128 bands of 3 channels, expected 64 of 3",
        ),
        (("specular", "fresnel"), Bands(torch.zeros(64, 3)), "a curve that is 0 everywhere"),
    ):
        with pytest.raises(BadInput, match=words):
            made.checked(place, curve)
    with pytest.raises(BadInput, match="angle: found 'phi', expected one of theta_h"):
        Slot("x", "phi", flat(3))
    with pytest.raises(BadInput, match="found 0 curves over angles with the light, expected 1 or 2"):
        EditableTerm("x", lambda wi, wo: wi, (Slot("x", "theta_o", flat(3)),))
    with pytest.raises(BadInput, match="bands: found 100, expected one of 256"):
        Slot("x", "theta_h", flat(3), 100)


@pytest.mark.parametrize("finer", [False, True])
def test_bands_cover_the_quarter_circle_in_their_order(finer: bool) -> None:
    edges = band_edges(64, finer)
    assert float(edges[0]) == 0
    assert float(edges[-1]) == pytest.approx(RIGHT_ANGLE)
    assert bool((edges.diff() > 0).all())
    assert band_of(band_centres(64, finer), 64, finer).tolist() == list(range(64))
    assert band_of(edges[1:-1] + 1e-9, 64, finer).tolist() == list(range(1, 64))
    assert band_of(torch.tensor([-1.0, 4.0], dtype=torch.float64), 64, finer).tolist() == [0, 63]


def test_finer_bands_hold_a_sharp_highlight() -> None:
    """D at sigma .05 to within 3% of its peak by 256 bands finer near 0; equal ones are off by more than ten times."""
    sharp = beckmann(0.05, 1)
    peak = float(sharp.at(torch.zeros(1, dtype=torch.float64)))
    finer, equal = (float(band_deviation(sharp, 256, kind).max()) / peak for kind in (True, False))
    assert finer < 0.02
    assert equal > 2.5 * finer


@pytest.mark.parametrize("finer", [False, True])
def test_bands_of_another_kind_keep_the_integral(finer: bool) -> None:
    generator = torch.Generator().manual_seed(1)
    before = Bands(torch.rand(128, 2, dtype=torch.float64, generator=generator), not finer)
    after = banded(before, 64, finer)

    def integral(bands: Bands) -> torch.Tensor:
        return (bands.values * band_edges(bands.count, bands.finer).diff()[:, None]).sum(0)

    assert torch.allclose(integral(after), integral(before), rtol=1e-12)
    # Each band is the mean of what lies in it, here by many points.
    edges = band_edges(64, finer)
    inside = edges[20] + (edges[21] - edges[20]) * (torch.arange(4000, dtype=torch.float64) + 0.5) / 4000
    assert torch.allclose(after.values[20], before.at(inside).mean(0), rtol=1e-3)
