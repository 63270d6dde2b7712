"""Importance sampling: what is drawn has its density, in Python, C, WGSL, HLSL and GLSL, and lowers the variance."""

import json
import math
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import torch
from chi_square import p_value
from mixture_code import GLSL_HEAD, GLSL_MAIN, HLSL_MAIN, WGSL_MAIN, called, compiled_c, points
from shading_cases import MIXTURES, factorization, grain, mixture, searched
from slow_cases import slow_among
from torch import Tensor
from webgpu import Gpu, glslang

from homofact.brdf.analytic.ward import Ward
from homofact.brdf.materials import material
from homofact.factor.factorization import Factorization
from homofact.factor.projection import Warp, fixed_projection
from homofact.geometry.directions import draw_uniform, from_spherical
from homofact.geometry.quadrature import hemisphere_nodes
from homofact.shading.c_code import c_source
from homofact.shading.encoding import as_floats
from homofact.shading.functions import functions_in_c, functions_text, sampling_functions
from homofact.shading.languages import GLSL, HLSL, WGSL, Language, shader
from homofact.shading.lobe_coordinates import PHIS, RADII, THETAS
from homofact.shading.lobe_mixture import LEAST, ROUND, LobeMixture, halves, restored
from homofact.shading.mixture_fit import fitted_mixture
from homofact.shading.noise import cosine_density, noise_at_angles, noise_of, viewer_at
from homofact.shading.program import program_of

ANGLES = (0.0, 35.0, 70.0, 86.0)
COUNT = 100_000


def compared(name: str) -> tuple[tuple[float, int], ...]:
    """Viewers' angles, and how finely the cells of the chi-square test are integrated there.

    Next to the horizon, where half of a brushed lobe ends in a step, they would have to be integrated finer still.
    """
    return tuple((angle, 12) for angle in ANGLES[:3]) + (() if "brushed" in name else ((ANGLES[3], 40),))


def even(scale: float, cosine: float) -> LobeMixture:
    """A table of ones."""
    ones = torch.ones(THETAS, PHIS, RADII, dtype=torch.float64)
    return LobeMixture(ones, ones[..., 0].clone(), halves(cosine * ones[:, 0, 0]), scale)


def integral(mixture: LobeMixture, wo: Tensor) -> float:
    """On the half vector's nodes, which have neither the table's edges nor its measure."""
    wi, angles = (each[0] for each in hemisphere_nodes(wo[None], 256, 192))
    return float((mixture.density(wi, wo.expand_as(wi)) * angles).sum())


def test_seen_along_the_normal_an_even_table_is_known() -> None:
    """There R = 1 and r² = 1 − z, dω = 2 r dr dφ, and v = log((1 + r/σ)/(1 − r/1.2))/L."""
    sigma, cosine = 0.25, 0.125
    z = torch.linspace(0.01, 0.999, 40, dtype=torch.float64)
    wi = from_spherical(torch.acos(z), torch.linspace(-3, 3, 40, dtype=torch.float64))
    whole, r = math.log((1 + 1 / sigma) * 6), torch.sqrt(1 - z)
    v = torch.log((1 + r / sigma) / (1 - r / 1.2)) / whole
    slope = (1 / (sigma + r) + 1 / (1.2 - r)) / whole
    g = (v * RADII).clamp_max(1) * (RADII / (RADII - 0.5))
    expected = cosine * z / math.pi + (1 - cosine) * g * slope / (2 * math.pi) / (2 * r)
    wo = viewer_at(0.0).expand_as(wi)
    assert torch.allclose(even(sigma, cosine).density(wi, wo), expected, rtol=1e-6)


@pytest.mark.parametrize("name", MIXTURES)
def test_the_density_is_one(name: str) -> None:
    for angle in ANGLES:
        assert integral(MIXTURES[name], viewer_at(angle)) == pytest.approx(1, abs=2e-3), angle


@pytest.mark.parametrize("name", MIXTURES)
def test_nothing_is_lost_under_the_horizon(name: str) -> None:
    for angle in ANGLES:
        wi = MIXTURES[name].draw(viewer_at(angle).expand(COUNT, 3), points(COUNT))
        assert bool((wi[:, 2] > 0).all())


def test_shares_are_linear_between_their_viewers() -> None:
    """With one table for all viewers but for the cosine's share, p is a mixture of both parts by that share."""
    base = MIXTURES["isotropic"]
    lobe, turns = (each[:1].expand_as(each).contiguous() for each in (base.lobe, base.turns))
    shares = halves(torch.tensor([0.5, 0.1, 0.25, 0.75, 0.1, 0.3, 0.9, 0.5], dtype=torch.float64))
    none, varied = (LobeMixture(lobe, turns, each, 0.1) for each in (torch.zeros_like(shares), shares))
    z = torch.linspace(1e-3, 1, 50, dtype=torch.float64)
    wo = from_spherical(torch.acos(z), torch.zeros_like(z))
    wi = from_spherical(torch.full_like(z, 0.4), torch.full_like(z, 2.0))
    a = torch.sqrt(1 - z).numpy()
    share = torch.from_numpy(np.interp((a + a**9) / 2 * (THETAS - 1), np.arange(THETAS), shares.numpy()))
    expected = share * wi[:, 2] / math.pi + (1 - share) * none.density(wi, wo)
    assert torch.allclose(varied.density(wi, wo), expected, rtol=1e-9)


def test_it_looks_the_same_from_every_azimuth_unless_brushed() -> None:
    wi, wo = draw_uniform(200, torch.Generator().manual_seed(0))
    cosine, sine = math.cos(1.1), math.sin(1.1)
    turn = torch.tensor([[cosine, sine, 0], [-sine, cosine, 0], [0, 0, 1]], dtype=torch.float64)
    plain, brushed = (MIXTURES[name] for name in ("isotropic", "brushed, turned"))
    assert torch.allclose(plain.density(wi, wo), plain.density(wi @ turn, wo @ turn), rtol=1e-6)
    assert not torch.allclose(brushed.density(wi, wo), brushed.density(wi @ turn, wo @ turn), rtol=1e-2)


@pytest.mark.parametrize("name", MIXTURES)
def test_the_description_is_the_mixture(name: str) -> None:
    again = restored(json.loads(json.dumps(MIXTURES[name].describe())))
    assert torch.equal(again.rows(), MIXTURES[name].rows())
    assert (again.scale, again.grain) == (MIXTURES[name].scale, MIXTURES[name].grain)
    assert again.nbytes <= 2048


@pytest.mark.parametrize("name", slow_among(MIXTURES, "isotropic", "narrow"))
def test_what_is_drawn_has_the_density(name: str) -> None:
    mixture = MIXTURES[name]
    for angle, finer in compared(name):
        wo = viewer_at(angle)
        wi = mixture.draw(wo.expand(COUNT, 3), points(COUNT, 1))
        assert torch.allclose(wi.norm(dim=1), torch.ones(COUNT, dtype=torch.float64))
        assert p_value(wi, wo, mixture.density, finer) > 1e-3, angle


def test_the_chi_square_test_sees_another_density() -> None:
    mixture, wo = MIXTURES["isotropic"], viewer_at(35.0)
    wi = mixture.draw(wo.expand(COUNT, 3), points(COUNT))
    lobe = mixture.lobe.clone()
    lobe[2:4] = lobe[2:4].flip(2)
    others = (
        replace(mixture, scale=0.11),
        replace(mixture, cosine=mixture.cosine + 0.03),
        replace(mixture, lobe=lobe),
        replace(mixture, turns=mixture.turns.flip(1)),
        replace(mixture, grained=True),
    )
    for other in others:
        assert p_value(wi, wo, other.density) < 1e-4
    assert p_value(mixture.draw(viewer_at(36.0).expand(COUNT, 3), points(COUNT)), wo, mixture.density) < 1e-4


@pytest.mark.parametrize("name", slow_among(MIXTURES, "isotropic", "narrow"))
def test_c_draws_from_the_density_that_it_gives(name: str, tmp_path: Path) -> None:
    mixture = MIXTURES[name]
    library = compiled_c("#include <math.h>\n" + functions_in_c(sampling_functions(mixture)), tmp_path)

    def density(wi: Tensor, wo: Tensor) -> Tensor:
        return called(library.many_density, wi, wo, 1)[:, 0]

    for angle, finer in compared(name):
        wo = viewer_at(angle)
        wi = called(library.many_sample, wo.expand(COUNT, 3), points(COUNT, 2), 3)
        assert p_value(wi, wo, density, finer) > 1e-3, angle
        above = wi[:, 2] > 0
        found = density(wi, wo.expand_as(wi))
        assert torch.isfinite(found).all()
        assert (found[above] > 0).all()
        assert float(above.double().mean()) > 1 - 1e-4
        assert (found[~above] == 0).all()
    wi, wo = draw_uniform(2000, torch.Generator().manual_seed(4))
    assert torch.allclose(density(wi, wo), mixture.density(wi, wo), rtol=1e-4)


@pytest.mark.parametrize("name", MIXTURES)
def test_edges_give_numbers(name: str, tmp_path: Path) -> None:
    """Viewers on and under the horizon and along the normal, the cube's corners, opposite directions."""
    mixture = MIXTURES[name]
    library = compiled_c("#include <math.h>\n" + functions_in_c(sampling_functions(mixture)), tmp_path)
    viewers = torch.tensor(
        [[0, 0, 1], [1, 0, 0], [0, -1, 0], [0.6, 0, -0.8], [0, 0, -1], [0.8, 0.6, 1e-6]], dtype=torch.float64
    )
    corner = torch.tensor([0, 0.5, 1 - 2**-24], dtype=torch.float64)
    u = torch.cartesian_prod(corner, corner, corner)
    wo = viewers.repeat_interleave(len(u), 0)
    u = u.repeat(len(viewers), 1)
    for wi in (called(library.many_sample, wo, u, 3), mixture.draw(wo, u)):
        assert torch.isfinite(wi).all()
        assert torch.allclose(wi[wo[:, 2] >= 0].norm(dim=1), torch.ones(1, dtype=torch.float64), atol=1e-4)
        for found in (called(library.many_density, wi, wo, 1)[:, 0], mixture.density(wi, wo)):
            assert torch.isfinite(found).all()
            both = (wi[:, 2] > 0) & (wo[:, 2] > 0)
            assert (found[both] > 0).all()
            assert (found[~both] == 0).all()
    for found in (called(library.many_density, -viewers, viewers, 1)[:, 0], mixture.density(-viewers, viewers)):
        assert (found == 0).all()


@cache
def fit() -> Factorization:
    """A rough random material with a lobe: the first lookup is over h."""
    return factorization(fixed_projection("h", True, Warp(0.2)), searched("isotropic-in-out", 4))


@pytest.mark.slow
def test_the_estimator_in_c_is_the_albedo(tmp_path: Path) -> None:
    fitted = fit()
    mixture = fitted_mixture(fitted)
    plain = [as_floats(texture.texels) for texture in fitted.textures]
    source = c_source(program_of(fitted, plain), [texture.stored for texture in plain])
    source += functions_in_c(sampling_functions(mixture))
    source += (
        "\nvoid many_evaluate(int n, const float *wi, const float *wo, float *f)\n{\n    for (int k = 0; k < n; k++)\n"
        "        homofact_evaluate(wi + 3 * k, wo + 3 * k, f + 3 * k);\n}\n"
    )
    library = compiled_c(source, tmp_path)
    for angle in ANGLES:
        wo = viewer_at(angle)
        seen = wo.expand(COUNT, 3)
        wi = called(library.many_sample, seen, points(COUNT, 3), 3)
        density = called(library.many_density, wi, seen, 1)
        value = called(library.many_evaluate, wi, seen, 3) * wi[:, 2:]
        weight = torch.where(density > 0, value / density, 0)
        nodes, angles = (each[0] for each in hemisphere_nodes(wo[None]))
        expected = (fitted.evaluate(nodes, wo.expand_as(nodes)) * nodes[:, 2:] * angles[:, None]).sum(0)
        noise = weight.std(0) / math.sqrt(COUNT)
        assert ((weight.mean(0) - expected).abs() < 4.5 * noise + 1e-4 * expected).all(), angle
        assert (weight <= math.pi / LEAST * called(library.many_evaluate, wi, seen, 3) * 1.001).all()


def runnable(mixture: LobeMixture, language: Language, folder: Path) -> str | bytes:
    """WGSL or SPIR-V that writes (ωi, p) for each pair of (ωo, u)."""
    text = functions_text(sampling_functions(mixture), language, "fit")
    if language is WGSL:
        return text + WGSL_MAIN
    if language is HLSL:
        return glslang(text + HLSL_MAIN, folder, "comp", "-D", "-V", "-e", "main")
    return glslang(GLSL_HEAD + text + GLSL_MAIN, folder, "comp", "-V")


@pytest.fixture(scope="module")
def gpu() -> Gpu:
    return Gpu()


@pytest.mark.parametrize("name", slow_among(MIXTURES, "isotropic", "narrow"))
@pytest.mark.parametrize("language", [WGSL, HLSL, GLSL], ids=lambda language: language.name)
def test_a_gpu_draws_from_the_density_that_it_gives(name: str, language: Language, gpu: Gpu, tmp_path: Path) -> None:
    mixture = MIXTURES[name]
    code = runnable(mixture, language, tmp_path)
    for angle, finer in compared(name) if language is WGSL else compared(name)[1:2]:
        wo = viewer_at(angle)
        wide = torch.from_numpy(gpu.run(code, [], wo.expand(COUNT, 3), points(COUNT, 5), None)).double()
        wi, found = wide[:, :3], wide[:, 3]
        assert p_value(wi, wo, mixture.density, finer) > 1e-3, angle
        expected = mixture.density(wi, wo.expand_as(wi))
        # A direction at the horizon may be on either side of it.
        clear = wi[:, 2].abs() > 1e-6
        assert torch.isfinite(found).all()
        assert ((found > 0) == (wi[:, 2] > 0))[clear].all()
        assert float(((found - expected).abs() / expected.clamp_min(1e-6))[clear].quantile(0.999)) < 2e-3
        reference = mixture.draw(wo.expand(COUNT, 3), points(COUNT, 5))
        assert float((wi - reference).norm(dim=1).quantile(0.99)) < 1e-4


@pytest.mark.parametrize("stage", ["vert", "frag"])
def test_glsl_es_and_hlsl_compile_behind_an_evaluation(stage: str, tmp_path: Path) -> None:
    fitted = fit()
    program = program_of(fitted, [as_floats(texture.texels) for texture in fitted.textures])
    functions = sampling_functions(MIXTURES["brushed, turned"])
    value = "fit_evaluate(wi, wo) * fit_sample(wo, wi) * fit_density(wi, wo)"
    text = shader(program, GLSL, "fit") + functions_text(functions, GLSL, "fit")
    head = "#version 300 es\nprecision highp float;\n"
    place = "gl_Position = f;" if stage == "vert" else ""
    main = f"in vec3 wi;\nin vec3 wo;\nout vec4 f;\nvoid main() {{\n    f = vec4({value}, 1.0);\n    {place}\n}}\n"
    glslang(head + text + main, tmp_path, stage)
    text = shader(program, HLSL, "fit") + functions_text(functions, HLSL, "fit")
    semantic = "SV_Position" if stage == "vert" else "SV_Target"
    main = f"float4 main(float3 wi : A, float3 wo : B) : {semantic}\n{{\n    return float4({value}, 1.0);\n}}\n"
    glslang(text + main, tmp_path, stage, "-D", "-V", "-e", "main")


@pytest.mark.parametrize(
    ("name", "most"),
    [("phong-30", 0.02), ("blinn-phong-50", 0.02), ("ward-brushed", 0.02), ("cook-torrance-plastic", 0.02)],
)
def test_a_lobe_is_drawn_with_little_variance(name: str, most: float) -> None:
    model = material(name).model
    for noise in noise_at_angles(model, fitted_mixture(model)):
        assert noise.variance < most, noise.angle
        assert noise.variance < noise.cosine / 5, noise.angle


def test_a_diffuse_material_is_drawn_by_the_cosine_or_as_well() -> None:
    def flat(wi: Tensor, wo: Tensor) -> Tensor:
        return ((wi[:, 2] > 0) & (wo[:, 2] > 0)).double()[:, None] / math.pi

    mixture = fitted_mixture(planted(flat))
    assert max(noise.variance for noise in noise_at_angles(planted(flat), mixture)) < 4e-3
    assert mixture.isotropic


def planted(function):
    """A reflectance of one channel."""

    class Planted:
        channels, nbytes, fetches = ("Y",), 0, 0

        def evaluate(self, wi: Tensor, wo: Tensor) -> Tensor:
            return function(wi, wo)

    return Planted()


@pytest.mark.slow
def test_a_planted_lobe_is_found() -> None:
    """f cosθi = p of a mixture: no variance is left."""
    truth = mixture(7, 0.1)

    def value(wi: Tensor, wo: Tensor) -> Tensor:
        return (truth.density(wi, wo) / wi[:, 2].clamp_min(1e-9))[:, None]

    for noise in noise_at_angles(planted(value), fitted_mixture(planted(value))):
        assert abs(noise.variance) < 0.01, noise.angle


@pytest.mark.slow
def test_the_grain_of_a_brushed_metal_is_found() -> None:
    model = Ward((0.01,) * 3, (0.19,) * 3, alpha_x=0.03, alpha_y=0.12)
    assert fitted_mixture(model).grain == pytest.approx(grain(0.25, 0.0), abs=0.03)
    assert fitted_mixture(material("phong-30").model).grain == ROUND


@pytest.mark.parametrize("value", [0.0, math.nan, -1.0])
def test_nothing_to_reflect_is_left_to_the_cosine(value: float) -> None:
    reflectance = planted(lambda wi, wo: torch.full((len(wi), 1), value, dtype=torch.float64))
    mixture = fitted_mixture(reflectance)
    wi, wo = draw_uniform(100, torch.Generator().manual_seed(2))
    assert torch.allclose(mixture.density(wi, wo), wi[:, 2] / math.pi)
    if value <= 0:
        assert noise_of(reflectance, mixture.density, viewer_at(30.0)) == (0.0, pytest.approx(1, abs=1e-4))


def test_the_noise_of_the_cosine_is_known() -> None:
    """f = cosθi: ∫ cos⁴/(cos/π) over (∫ cos²)² = (π²/2)/(2π/3)² = 9/8."""
    reflectance = planted(lambda wi, wo: wi[:, 2:])
    for angle in ANGLES:
        assert noise_of(reflectance, cosine_density, viewer_at(angle))[0] == pytest.approx(1 / 8, abs=1e-3)


@pytest.mark.slow
def test_equal_bits() -> None:
    one, other = (fitted_mixture(material("phong-30").model) for _ in range(2))
    assert one.describe() == other.describe()
