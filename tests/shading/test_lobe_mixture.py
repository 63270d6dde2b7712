"""Importance sampling: what is drawn has its density, in Python, C, WGSL, HLSL and GLSL, and lowers the variance."""

import math
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import torch
from chi_square import p_value
from mixture_code import GLSL_HEAD, GLSL_MAIN, HLSL_MAIN, WGSL_MAIN, called, compiled_c, points
from shading_cases import MIXTURES, factorization, searched
from torch import Tensor
from webgpu import Gpu, glslang

from homofact.brdf.materials import material
from homofact.factor.factorization import Factorization
from homofact.factor.projection import Warp, fixed_projection
from homofact.geometry.directions import draw_uniform, from_spherical
from homofact.geometry.quadrature import hemisphere_nodes
from homofact.shading.c_code import c_source
from homofact.shading.encoding import as_floats
from homofact.shading.functions import functions_in_c, functions_text, sampling_functions
from homofact.shading.languages import GLSL, HLSL, WGSL, Language, shader
from homofact.shading.lobe_mixture import LEAST, NODES, LobeMixture
from homofact.shading.mixture_fit import fitted_mixture
from homofact.shading.noise import cosine_density, noise_at_angles, noise_of, viewer_at
from homofact.shading.program import program_of

ANGLES = (0.0, 35.0, 70.0, 86.0)
COUNT = 100_000


def one(alpha: tuple[float, float]) -> LobeMixture:
    """A lobe alone."""
    return LobeMixture((alpha,), ((1.0,) * NODES,))


def integral(mixture: LobeMixture, wo: Tensor) -> float:
    wi, angles = (each[0] for each in hemisphere_nodes(wo[None]))
    return float((mixture.density(wi, wo.expand_as(wi)) * angles).sum())


@pytest.mark.parametrize("alpha", [0.01, 0.2, 0.7, 1.0])
def test_seen_along_the_normal_a_lobe_loses_nothing_and_is_known(alpha: float) -> None:
    """There κ = (1 − α²)/(1 + α²), and pk = (1 + α²) D/4."""
    wo = viewer_at(0.0)
    assert integral(one((alpha, alpha)), wo) == pytest.approx(1, abs=1e-4)
    theta = torch.linspace(0, 0.7, 8, dtype=torch.float64)
    h = from_spherical(theta, torch.zeros_like(theta))
    wi = torch.stack((2 * h[:, 2] * h[:, 0], torch.zeros_like(theta), 2 * h[:, 2] ** 2 - 1), 1)
    distribution = alpha**2 / (math.pi * (h[:, 2] ** 2 * (alpha**2 - 1) + 1) ** 2)
    found = one((alpha, alpha)).density(wi, wo.expand_as(wi))
    assert found.tolist() == pytest.approx(((1 + alpha**2) * distribution / 4).tolist(), rel=1e-9)


def test_the_roughest_lobe_is_the_hemisphere() -> None:
    """α = 1 is the uniform distribution of half vectors by solid angle times cosine: κ = 0, D = 1/π."""
    wi, wo = draw_uniform(100, torch.Generator().manual_seed(0))
    t = wo.norm(dim=1)
    assert torch.allclose(one((1.0, 1.0)).density(wi, wo), 1 / (2 * math.pi * t), rtol=1e-12)
    assert integral(one((1.0, 1.0)), viewer_at(70.0)) == pytest.approx(1, abs=1e-4)


@pytest.mark.parametrize("name", MIXTURES)
def test_the_density_is_one_less_what_is_lost(name: str) -> None:
    for angle in ANGLES:
        wo = viewer_at(angle)
        wi = MIXTURES[name].draw(wo.expand(COUNT, 3), points(COUNT))
        lost = float((wi[:, 2] <= 0).double().mean())
        assert integral(MIXTURES[name], wo) == pytest.approx(1 - lost, abs=4 * math.sqrt(0.25 / COUNT))
        assert lost < 0.1


def test_weights_are_linear_between_their_nodes() -> None:
    """At a direction where the lobe is nothing beside the cosine, p is the cosine's share of it."""
    weights = (0.0, 0.1, 0.2, 0.8, 0.1, 0.3, 0.9, 0.5)
    mixture = LobeMixture(((2e-3, 2e-3),), (weights,))
    z = torch.linspace(1e-3, 1, 50, dtype=torch.float64)
    wo = from_spherical(torch.acos(z), torch.zeros_like(z))
    wi = from_spherical(torch.full_like(z, 0.4), torch.full_like(z, 2.0))
    share = mixture.density(wi, wo) / (wi[:, 2] / math.pi)
    expected = 1 - np.interp(z.numpy() * (NODES - 1), np.arange(NODES), weights)
    assert share.tolist() == pytest.approx(expected.tolist(), abs=1e-3)


@pytest.mark.parametrize("name", MIXTURES)
def test_what_is_drawn_has_the_density(name: str) -> None:
    mixture = MIXTURES[name]
    for angle in ANGLES:
        wo = viewer_at(angle)
        wi = mixture.draw(wo.expand(COUNT, 3), points(COUNT, 1))
        assert torch.allclose(wi.norm(dim=1), torch.ones(COUNT, dtype=torch.float64))
        assert p_value(wi, wo, mixture.density) > 1e-3, angle


def test_the_chi_square_test_sees_another_density() -> None:
    mixture, wo = MIXTURES["isotropic"], viewer_at(35.0)
    wi = mixture.draw(wo.expand(COUNT, 3), points(COUNT))
    others = (
        LobeMixture(((0.108, 0.108), (0.4, 0.4)), mixture.weights),
        LobeMixture(mixture.alphas, ((0.5,) * 4 + (0.33,) * 4, mixture.weights[1])),
        LobeMixture(((0.1, 0.1), (0.4, 0.6)), mixture.weights),
    )
    for other in others:
        assert p_value(wi, wo, other.density) < 1e-4
    assert p_value(mixture.draw(viewer_at(36.0).expand(COUNT, 3), points(COUNT)), wo, mixture.density) < 1e-4


@pytest.mark.parametrize("name", MIXTURES)
def test_c_draws_from_the_density_that_it_gives(name: str, tmp_path: Path) -> None:
    mixture = MIXTURES[name]
    library = compiled_c("#include <math.h>\n" + functions_in_c(sampling_functions(mixture)), tmp_path)

    def density(wi: Tensor, wo: Tensor) -> Tensor:
        return called(library.many_density, wi, wo, 1)[:, 0]

    for angle in ANGLES:
        wo = viewer_at(angle)
        wi = called(library.many_sample, wo.expand(COUNT, 3), points(COUNT, 2), 3)
        assert p_value(wi, wo, density) > 1e-3, angle
        above = wi[:, 2] > 0
        found = density(wi, wo.expand_as(wi))
        assert torch.isfinite(found).all()
        assert (found[above] > 0).all()
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


@pytest.mark.parametrize("name", MIXTURES)
@pytest.mark.parametrize("language", [WGSL, HLSL, GLSL], ids=lambda language: language.name)
def test_a_gpu_draws_from_the_density_that_it_gives(name: str, language: Language, gpu: Gpu, tmp_path: Path) -> None:
    mixture = MIXTURES[name]
    code = runnable(mixture, language, tmp_path)
    for angle in ANGLES if language is WGSL else ANGLES[1:2]:
        wo = viewer_at(angle)
        wide = torch.from_numpy(gpu.run(code, [], wo.expand(COUNT, 3), points(COUNT, 5), None)).double()
        wi, found = wide[:, :3], wide[:, 3]
        assert p_value(wi, wo, mixture.density) > 1e-3, angle
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
    [("phong-30", 0.3), ("blinn-phong-50", 0.1), ("ward-brushed", 0.06), ("cook-torrance-plastic", 0.2)],
)
def test_a_lobe_is_drawn_with_little_variance(name: str, most: float) -> None:
    model = material(name).model
    for noise in noise_at_angles(model, fitted_mixture(model)):
        assert noise.variance < most, noise.angle
        assert noise.variance < noise.cosine / 5, noise.angle
        assert noise.lost < 0.03


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


def test_a_planted_lobe_is_found_along_its_own_axes() -> None:
    """f cosθi = p of a mixture: grain and roughness are found, and no variance is left but that of lost directions."""
    truth = LobeMixture(((0.05, 0.2),), ((0.9,) * NODES,), 2.0)

    def value(wi: Tensor, wo: Tensor) -> Tensor:
        return (truth.density(wi, wo) / wi[:, 2].clamp_min(1e-9))[:, None]

    found = fitted_mixture(planted(value), 1)
    alphas = sorted(found.alphas[0])
    assert alphas == pytest.approx([0.05, 0.2], rel=0.02)
    wide = found.turn + (math.pi / 2 if found.alphas[0][1] > found.alphas[0][0] else 0)
    assert math.remainder(wide - (2.0 + math.pi / 2), math.pi) == pytest.approx(0, abs=0.02)
    for ours, best in zip(*(noise_at_angles(planted(value), each) for each in (found, truth)), strict=True):
        assert ours.variance == pytest.approx(best.variance, abs=1e-3)
        assert best.variance == pytest.approx(best.lost / (1 - best.lost), abs=1e-3)


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


def test_equal_bits() -> None:
    assert fitted_mixture(material("phong-30").model) == fitted_mixture(material("phong-30").model)
