"""Importance sampling of layers: every layer draws from its own mixture, in C, WGSL, HLSL and GLSL."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import shading_cases
import torch
from chi_square import p_value
from layered_cases import layered
from mixture_code import GLSL_HEAD, GLSL_MAIN, HLSL_MAIN, WGSL_MAIN, called, compiled_c, points
from slow_cases import slow_among
from torch import Tensor
from webgpu import Gpu, glslang

from homofact.containers.formats import FORMATS
from homofact.exporting.layered import codes, exported_layers, put_layers, with_sampling
from homofact.geometry.directions import draw_uniform
from homofact.shading.functions import functions_in_c, functions_text, sampling_functions, sampling_of_layers
from homofact.shading.languages import GLSL, HLSL, WGSL, Language
from homofact.shading.lobe_mixture import restored
from homofact.shading.noise import viewer_at

# One alone is brushed, all have the coordinates of a brushed one; tables, scales and shares of the cosine differ.
LAYERS = (
    shading_cases.mixture(4, 0.1, grained=True),
    shading_cases.mixture(5, 0.2, shading_cases.grain(2.0, 0.7)),
    shading_cases.mixture(6, 0.1, grained=True),
)
ANGLES = (0.0, 35.0, 80.0)
COUNT = 60_000
LAYERED = sampling_of_layers(LAYERS)


def layer_calls(text: str, layer: int) -> str:
    """An entry point's text with the layer as the functions' last argument."""
    return re.sub(r"(fit_sample|fit_density|homofact_sample|homofact_density)\(((?:[^()]|\([^()]*\))*)\)",
                  rf"\1(\2, {layer})", text)  # fmt: skip


@pytest.mark.parametrize("layer", slow_among(range(len(LAYERS)), 0, 2))
def test_c_draws_each_layer_from_its_own_density(layer: int, tmp_path: Path) -> None:
    text = "#include <math.h>\n" + functions_in_c(LAYERED)
    library = compiled_c(text, tmp_path, f"{layer}, ")
    mixture = LAYERS[layer]

    def density(wi: Tensor, wo: Tensor) -> Tensor:
        return called(library.many_density, wi, wo, 1)[:, 0]

    for angle in ANGLES:
        wo = viewer_at(angle)
        wi = called(library.many_sample, wo.expand(COUNT, 3), points(COUNT, 2), 3)
        assert p_value(wi, wo, density) > 1e-3, angle
        reference = mixture.draw(wo.expand(COUNT, 3), points(COUNT, 2))
        assert float((wi - reference).norm(dim=1).quantile(0.99)) < 1e-4
        # Another layer's mixture is no match.
        assert p_value(wi, wo, LAYERS[(layer + 1) % len(LAYERS)].density) < 1e-4
    wi, wo = draw_uniform(2000, torch.Generator().manual_seed(4))
    assert torch.allclose(density(wi, wo), mixture.density(wi, wo), rtol=1e-4)


@pytest.fixture(scope="module")
def gpu() -> Gpu:
    return Gpu()


def runnable(language: Language, layer: int, folder: Path) -> str | bytes:
    """WGSL or SPIR-V that writes (ωi, p) of a layer for each pair of (ωo, u)."""
    text = functions_text(LAYERED, language, "fit")
    if language is WGSL:
        return text + layer_calls(WGSL_MAIN, layer)
    if language is HLSL:
        return glslang(text + layer_calls(HLSL_MAIN, layer), folder, "comp", "-D", "-V", "-e", "main")
    return glslang(GLSL_HEAD + text + layer_calls(GLSL_MAIN, layer), folder, "comp", "-V")


@pytest.mark.parametrize("layer", range(len(LAYERS)))
@pytest.mark.parametrize("language", [WGSL, HLSL, GLSL], ids=lambda language: language.name)
def test_a_gpu_draws_each_layer_from_its_own_density(layer: int, language: Language, gpu: Gpu, tmp_path: Path) -> None:
    mixture, code = LAYERS[layer], runnable(language, layer, tmp_path)
    for angle in ANGLES if language is WGSL else ANGLES[1:2]:
        wo = viewer_at(angle)
        wide = torch.from_numpy(gpu.run(code, [], wo.expand(COUNT, 3), points(COUNT, 5), None)).double()
        wi, found = wide[:, :3], wide[:, 3]
        assert p_value(wi, wo, mixture.density) > 1e-3, angle
        expected = mixture.density(wi, wo.expand_as(wi))
        clear = wi[:, 2].abs() > 1e-6
        assert float(((found - expected).abs() / expected.clamp_min(1e-6))[clear].quantile(0.999)) < 2e-3


def test_layers_alike_draw_what_one_material_draws() -> None:
    """The statements are those of a single mixture, the constants read from a table."""
    single = sampling_functions(LAYERS[0])
    both = sampling_of_layers(LAYERS[:1])
    for one, layer in zip(single, both, strict=True):
        assert [each.name for each in one.statements] == [each.name for each in layer.statements]
        assert not one.tables
        assert {len(rows) for _, rows in layer.tables} == {1}
    assert "slope" in functions_text(LAYERED, GLSL)
    assert "slope" not in functions_text(sampling_of_layers([shading_cases.mixture(4, 0.1)]), GLSL)


@pytest.mark.slow
def test_an_export_of_layers_draws_from_each_and_says_how_noisily(tmp_path: Path) -> None:
    made = with_sampling(exported_layers(layered(), FORMATS["exr"]))
    assert len({str(each.describe()) for each in made.sampling}) == len(made.stored.layers) == len(made.sampling)
    manifest = put_layers(tmp_path, made, np.zeros((2, 2), np.uint8))
    assert manifest["code"]["sampling"] == ["homofact_sample", "homofact_density"]
    for entry, mixture in zip(manifest["layers"], made.sampling, strict=True):
        assert torch.equal(restored(entry["sampling"]).rows(), mixture.rows())
        for each in entry["sampling"]["measured"]:
            assert each["variance"] < 1.05 * each["cosine"]
    # The estimator of the C code, layer by layer, has the mean that Python has.
    source = codes(made)["brdf.c"]
    evaluated = (
        "\nvoid many_evaluate(int n, const float *wi, const float *wo, float *f)\n{\n    for (int k = 0; k < n; k++)\n"
        "        homofact_evaluate(wi + 3 * k, wo + 3 * k, LAYER, f + 3 * k);\n}\n"
    )
    wo = viewer_at(35.0)
    seen = wo.expand(COUNT, 3)
    for k, (layer, mixture) in enumerate(zip(made.stored.layers, made.sampling, strict=True)):
        (tmp_path / str(k)).mkdir()
        library = compiled_c(source + evaluated.replace("LAYER", str(k)), tmp_path / str(k), f"{k}, ")
        wi = called(library.many_sample, seen, points(COUNT, 3), 3)
        density = called(library.many_density, wi, seen, 1)
        value = called(library.many_evaluate, wi, seen, 3) * wi[:, 2:]
        weight = torch.where(density > 0, value / density, 0)
        drawn = mixture.draw(seen, points(COUNT, 8))
        own = mixture.density(drawn, seen)[:, None]
        reference = torch.where(own > 0, layer.evaluate(drawn, seen) * drawn[:, 2:] / own, 0)
        noise = (weight.std(0) ** 2 + reference.std(0) ** 2).sqrt() / COUNT**0.5
        assert ((weight.mean(0) - reference.mean(0)).abs() < 4.5 * noise).all(), k


def test_glsl_es_and_hlsl_compile_behind_an_evaluation(tmp_path: Path) -> None:
    texts = codes(replace(exported_layers(layered(), FORMATS["exr16"]), sampling=LAYERS))
    value = "homofact_evaluate(wi, wo, layer) * homofact_sample(wo, wi, layer) * homofact_density(wi, wo, layer)"
    main = "in vec3 wi;\nin vec3 wo;\nin vec2 uv;\nout vec4 f;\nvoid main() {\n    int layer = homofact_layer(uv);\n"
    main += f"    f = vec4({value}, 0.0);\n}}\n"
    head = "#version 300 es\nprecision highp float;\nprecision highp sampler2DArray;\n"
    glslang(head + texts["brdf.glsl"] + main, tmp_path, "frag")
    main = "float4 main(float3 wi : TEXCOORD0, float3 wo : TEXCOORD1, float2 uv : TEXCOORD2) : SV_Target\n{\n"
    main += f"    int layer = homofact_layer(uv);\n    return float4({value}, 0.0);\n}}\n"
    glslang(texts["brdf.hlsl"] + main, tmp_path, "frag", "-D", "-V", "-e", "main")
