"""The material in Mitsuba against `Factorization.evaluate`, what it says of itself, and renderings.

Install the extra `mitsuba` to run these, and Debian's libllvm19 for the variants that compile.
"""

import importlib
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from mitsuba_cases import (
    COORDINATES,
    albedo,
    apart,
    at,
    drawn,
    evaluated,
    factorization,
    pairs,
    random_texture,
    saved,
    saved_fits,
    searched,
    seen_from,
    variant,
    vectors,
)
from shading_cases import SEPARABLE
from slow_cases import slow_among

import homofact
from homofact.factor.factorization import Factorization
from homofact.factor.projection import Warp, fixed_projection
from homofact.methods.table import METHODS
from homofact.rendering import mitsuba_bsdf
from homofact.shading.mixture_fit import fitted_mixture

pytestmark = pytest.mark.usefixtures("unseen")


@pytest.fixture
def mi() -> Any:
    return variant("llvm_ad_rgb")


@pytest.fixture(scope="module")
def fits(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    return saved_fits(tmp_path_factory.mktemp("fits"))


CASES = [(name, None) for name in COORDINATES] + [("half-diff", 0.03), ("isotropic-half-diff", 0.03)]


@pytest.mark.usefixtures("rough_sampling")
@pytest.mark.parametrize("reciprocal", [True, False])
@pytest.mark.parametrize(("coordinates", "width"), CASES)
def test_it_evaluates_as_the_factorization(
    mi: Any, tmp_path: Path, coordinates: str, width: float | None, reciprocal: bool
) -> None:
    """Two textures of unlike sizes, one of them in other coordinates; the light is Mitsuba's wo."""
    warp = None if width is None else Warp(width)
    fit = factorization(
        (searched(coordinates, warp, reciprocal), random_texture(17, 23)),
        (searched("in-out", None, reciprocal, 4), random_texture(9, 5, 4)),
    )
    wi, wo = pairs(20_000)
    expected = fit.evaluate(wi, wo) * wi[:, 2:]
    relative = apart(evaluated(mi, mitsuba_bsdf.load_bsdf(saved(fit, tmp_path)), wi, wo), expected)
    assert len(relative) == 60_000
    assert float(relative.median()) < 1e-5
    assert float(relative[int(0.999 * len(relative))]) < 1e-3


@pytest.mark.parametrize("name", slow_among(["paint", "phong", "ward", "sharp"], "phong", "ward"))
def test_fits_evaluate_as_in_python(mi: Any, fits: dict[str, Path], name: str) -> None:
    wi, wo = pairs(20_000)
    expected = Factorization.load(fits[name]).evaluate(wi, wo) * wi[:, 2:]
    relative = apart(evaluated(mi, mitsuba_bsdf.load_bsdf(fits[name]), wi, wo), expected)
    assert float(relative.median()) < 1e-5
    assert float(relative[int(0.99 * len(relative))]) < 1e-3


@pytest.mark.usefixtures("rough_sampling")
@pytest.mark.parametrize("name", SEPARABLE)
def test_sums_of_products_evaluate_as_in_python(mi: Any, tmp_path: Path, name: str) -> None:
    fit = SEPARABLE[name]
    fit.save(tmp_path / "fit.npz")
    bsdf = mitsuba_bsdf.load_bsdf(tmp_path / "fit.npz")
    wi, wo = pairs(5000)
    expected = fit.evaluate(wi, wo) * wi[:, 2:]
    error = ((evaluated(mi, bsdf, wi, wo) - expected).abs() / expected.mean()).flatten()
    assert float(error.median()) < 2e-6
    # The polar map is torn at one meridian.
    assert float(error.quantile(0.999)) < 1e-3
    assert mi.has_flag(bsdf.flags(), mi.BSDFFlags.Anisotropic)


@pytest.mark.slow
@pytest.mark.parametrize("method", ["svd", "nmf"])
def test_fitted_sums_of_products_are_drawn_and_weighted_alike(mi: Any, tmp_path: Path, method: str) -> None:
    """What `sample` weighs adds up to the albedo; textures are parameters."""
    settings: Any = METHODS[method]
    fit = homofact.fit(homofact.read("material:phong-10", count=2000), settings(size=12, textures=3)).factorization
    fit.save(tmp_path / "fit.npz")
    bsdf = mitsuba_bsdf.load_bsdf(tmp_path / "fit.npz")
    weight = np.array(drawn(mi, bsdf, at(30), 200_000)[2])
    assert weight.mean(1).tolist() == pytest.approx(albedo(fit, at(30)).tolist(), rel=0.02)
    keys = [key for key in mi.traverse(bsdf).keys() if key.startswith("texture_")]  # noqa: SIM118
    assert keys == [f"texture_{k}" for k in range(len(fit.textures))]


@pytest.mark.slow
@pytest.mark.parametrize("name", ["paint", "ward"])
def test_the_scalar_variant_evaluates_the_same(fits: dict[str, Path], name: str) -> None:
    mi = variant("scalar_rgb")
    bsdf = mi.load_dict({"type": "homofact", "filename": str(fits[name])})
    wi, wo = pairs(40)
    # The normal, where lengths are 0, among them.
    wi[0] = wo[0] = wo[1] = torch.tensor([0, 0, 1], dtype=torch.float64)
    fit = Factorization.load(fits[name])
    density = fitted_mixture(fit).density(wi, wo)
    si = mi.SurfaceInteraction3f()
    for k, expected in enumerate(fit.evaluate(wi, wo) * wi[:, 2:]):
        si.wi = mi.Vector3f(*wo[k].tolist())
        value, pdf = bsdf.eval_pdf(mi.BSDFContext(), si, mi.Vector3f(*wi[k].tolist()))
        assert list(value) == pytest.approx(expected.tolist(), rel=1e-3)
        assert float(pdf) == pytest.approx(float(density[k]), rel=1e-3)


@pytest.mark.slow
def test_one_channel_is_grey(mi: Any, tmp_path: Path) -> None:
    fit = factorization((searched("half-diff"), random_texture(6, 7, channels=1)), mean=(0.4,))
    wi, wo = pairs(500)
    found = evaluated(mi, mitsuba_bsdf.load_bsdf(saved(fit, tmp_path)), wi, wo)
    expected = fit.evaluate(wi, wo) * wi[:, 2:]
    assert found.shape == (500, 3)
    assert torch.allclose(found, expected.expand(-1, 3), rtol=1e-3)


@pytest.mark.slow
def test_a_row_of_texels_is_a_texture(mi: Any, tmp_path: Path) -> None:
    fit = factorization((fixed_projection("theta_h", True), random_texture(1, 9)))
    wi, wo = pairs(500)
    found = evaluated(mi, mitsuba_bsdf.load_bsdf(saved(fit, tmp_path)), wi, wo)
    assert torch.allclose(found, fit.evaluate(wi, wo) * wi[:, 2:], rtol=1e-3)


def test_mono_is_luminance(fits: dict[str, Path]) -> None:
    mi = variant("llvm_ad_mono")
    wi, wo = pairs(500)
    found = evaluated(mi, mitsuba_bsdf.load_bsdf(fits["paint"]), wi, wo)
    rgb = Factorization.load(fits["paint"]).evaluate(wi, wo) * wi[:, 2:]
    expected = rgb @ torch.tensor([[0.212671], [0.71516], [0.072169]], dtype=torch.float64)
    assert torch.allclose(found, expected, rtol=1e-3)


@pytest.mark.slow
def test_importance_is_transported_the_other_way(mi: Any, tmp_path: Path) -> None:
    fit = factorization((searched("in-out", reciprocal=False), random_texture(8, 8)))
    wi, wo = pairs(500)
    context = mi.BSDFContext(mi.TransportMode.Importance)
    found = evaluated(mi, mitsuba_bsdf.load_bsdf(saved(fit, tmp_path)), wi, wo, context)
    assert torch.allclose(found, fit.evaluate(wo, wi) * wi[:, 2:], rtol=1e-3)
    assert not torch.allclose(fit.evaluate(wo, wi), fit.evaluate(wi, wo), rtol=0.1)


def test_runaway_texels_stay_finite_and_small_ones_are_cut_at_zero(mi: Any, tmp_path: Path) -> None:
    texture = torch.full((2, 2, 3), 200.0, dtype=torch.float64)
    texture[..., 1] = -30
    fit = factorization((fixed_projection("theta_h-theta_d", True), texture))
    wi, wo = at(30)[None], at(20)[None]
    found = evaluated(mi, mitsuba_bsdf.load_bsdf(saved(fit, tmp_path)), wi, wo)[0]
    assert found.tolist() == pytest.approx((fit.evaluate(wi, wo) * wi[:, 2:])[0].tolist(), rel=1e-3)
    assert float(found[1]) == 0
    assert math.isfinite(float(found[0]))


def test_nothing_under_the_horizon_or_where_inactive(mi: Any, fits: dict[str, Path]) -> None:
    bsdf = mitsuba_bsdf.load_bsdf(fits["ward"])
    up, down = at(30), torch.tensor([0.0, 0.0, -1.0], dtype=torch.float64)
    wi, wo = torch.stack((up, down, down)), torch.stack((down, up, down))
    assert float(evaluated(mi, bsdf, wi, wo).abs().max()) == 0
    assert np.array(bsdf.pdf(mi.BSDFContext(), seen_from(mi, wo), vectors(mi, wi))).tolist() == [0, 0, 0]
    above = seen_from(mi, up[None]), vectors(mi, up[None])
    assert np.array(bsdf.eval(mi.BSDFContext(), *above, mi.Mask(False))).max() == 0
    assert np.array(bsdf.eval(mi.BSDFContext(), *above)).min() > 0
    _, found, weight = drawn(mi, bsdf, down, 100)
    assert np.array(weight).max() == np.array(found.pdf).max() == 0


def sphere(mi: Any, bsdf: Any, size: int, light: dict[str, Any]) -> Any:
    """A unit sphere seen in parallel."""
    camera = {
        "type": "orthographic",
        "to_world": mi.ScalarTransform4f().look_at([0, 0, 4], [0, 0, 0], [0, 1, 0]),
        "film": {"type": "hdrfilm", "width": size, "height": size, "rfilter": {"type": "box"}},
    }
    scene = {"type": "scene", "integrator": {"type": "path", "max_depth": 2}, "sensor": camera, "light": light}
    return mi.load_dict(scene | {"ball": {"type": "sphere", "bsdf": bsdf}})


@pytest.mark.slow
def test_a_furnace_shows_the_albedo(mi: Any, fits: dict[str, Path]) -> None:
    """A sphere within radiance 1, seen in parallel: each pixel is the albedo at its angle."""
    size = 16
    furnace = {"type": "constant", "radiance": {"type": "rgb", "value": 1.0}}
    whole = sphere(mi, mitsuba_bsdf.load_bsdf(fits["paint"]), size, furnace)
    image = np.array(mi.render(whole, spp=2048, seed=3))
    fit = Factorization.load(fits["paint"])
    for column in (8, 10, 12):
        x, y = (column + 0.5) * 2 / size - 1, 1 / size
        degrees = math.degrees(math.asin(math.hypot(x, y)))
        assert image[8, column].tolist() == pytest.approx(albedo(fit, at(degrees)).tolist(), rel=0.03)


@pytest.mark.parametrize("name", slow_among(["scalar_rgb", "llvm_ad_rgb", "llvm_ad_mono"], "scalar_rgb"))
def test_it_renders_by_its_name(fits: dict[str, Path], name: str) -> None:
    mi = variant(name)
    mi.set_log_level(mi.LogLevel.Error)
    light = {"type": "point", "position": [2, 3, 4], "intensity": 30.0}
    whole = sphere(mi, {"type": "homofact", "filename": str(fits["ward"])}, 8, light)
    image = np.array(mi.render(whole, spp=4))
    assert np.isfinite(image).all()
    assert image.max() > 0.1
    assert image.min() >= 0


def test_texels_are_parameters_with_gradients(mi: Any, fits: dict[str, Path]) -> None:
    dr = importlib.import_module("drjit")
    bsdf = mitsuba_bsdf.load_bsdf(fits["paint"])
    parameters = mi.traverse(bsdf)
    keys = [key for key in parameters.keys() if key.startswith("texture_")]  # noqa: SIM118
    assert keys == ["texture_0", "texture_1"]
    wi, wo = pairs(2000)
    arguments = mi.BSDFContext(), seen_from(mi, wo), vectors(mi, wi)

    def total() -> Any:
        return dr.sum(mi.luminance(bsdf.eval(*arguments)))

    before = parameters["texture_0"].numpy().copy()
    dr.enable_grad(parameters["texture_0"])
    parameters.update()
    dr.backward(total())
    gradient = dr.grad(parameters["texture_0"]).numpy()
    place = np.unravel_index(np.abs(gradient).argmax(), gradient.shape)
    found = []
    for step in (0.02, -0.02):
        moved = before.copy()
        moved[place] += step
        parameters["texture_0"] = mi.TensorXf(moved)
        parameters.update()
        found.append(float(np.ravel(total())[0]))
    assert gradient[place] == pytest.approx((found[0] - found[1]) / 0.04, rel=1e-2)


def test_it_has_a_front_and_twosided_gives_it_a_back(mi: Any, fits: dict[str, Path]) -> None:
    bsdf = mitsuba_bsdf.load_bsdf(fits["ward"])
    assert mi.has_flag(bsdf.flags(), mi.BSDFFlags.FrontSide)
    assert not mi.has_flag(bsdf.flags(), mi.BSDFFlags.BackSide)
    assert mi.has_flag(bsdf.flags(), mi.BSDFFlags.Smooth)
    assert not mi.has_flag(bsdf.flags(), mi.BSDFFlags.Delta)
    assert not mi.has_flag(bsdf.flags(), mi.BSDFFlags.Transmission)
    both = mi.load_dict({"type": "twosided", "nested": bsdf})
    assert mi.has_flag(both.flags(), mi.BSDFFlags.BackSide)
    wi, wo = pairs(500)
    front = evaluated(mi, bsdf, wi, wo)
    mirrored = torch.tensor([1.0, 1.0, -1.0], dtype=torch.float64)
    assert torch.equal(evaluated(mi, both, wi, wo), front)
    assert torch.equal(evaluated(mi, both, wi * mirrored, wo * mirrored), front)
    assert float(evaluated(mi, both, wi * mirrored, wo).abs().max()) == 0


def test_a_lobe_that_is_switched_off_gives_nothing(mi: Any, fits: dict[str, Path]) -> None:
    bsdf = mitsuba_bsdf.load_bsdf(fits["paint"])
    wi, wo = pairs(50)
    for context in (
        mi.BSDFContext(mi.TransportMode.Radiance, +mi.BSDFFlags.DiffuseReflection),
        mi.BSDFContext(mi.TransportMode.Radiance, +mi.BSDFFlags.All, 1),
    ):
        assert float(evaluated(mi, bsdf, wi, wo, context).abs().max()) == 0
        assert float(np.array(bsdf.pdf(context, seen_from(mi, wo), vectors(mi, wi))).max()) == 0


def test_it_says_what_it_is(mi: Any, fits: dict[str, Path]) -> None:
    text = str(mitsuba_bsdf.load_bsdf(fits["sharp"]))
    assert text == f"homofact[filename = {fits['sharp']}, textures = 4 x 64, fetches = 1]"
    anisotropic = {
        name: mi.has_flag(mitsuba_bsdf.load_bsdf(fits[name]).flags(), mi.BSDFFlags.Anisotropic)
        for name in ("sharp", "ward")
    }
    assert anisotropic == {"sharp": False, "ward": True}


def test_a_folder_is_a_result(mi: Any, fits: dict[str, Path], tmp_path: Path) -> None:
    (tmp_path / "factorization.npz").write_bytes(fits["sharp"].read_bytes())
    assert "4 x 64" in str(mi.load_dict({"type": "homofact", "filename": str(tmp_path)}))
