"""Generated HLSL passes Microsoft's DXC, warnings being errors, and its SPIR-V gives on a GPU what Python gives.

DXIL is checked by the compiler's own validator; without Direct3D nothing here runs it.
"""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from dxc import dxc
from layered_cases import COUNT, layered, places
from shading_cases import BELOW, CASES, MIXTURES, NAMES, factorization, pairs, program, random_term, searched
from skies import normals
from webgpu import SAMPLER, WIDENED, Gpu, Image, hlsl_main

from homofact.containers.formats import FORMATS
from homofact.exporting.exported import exported, write_exported
from homofact.exporting.layered import codes, exported_layers
from homofact.exporting.prefiltered import PrefilteredExport
from homofact.factor.projection import Warp, fixed_projection
from homofact.rendering.chain_kernels import ChainKernels
from homofact.rendering.cube import directions_of
from homofact.rendering.prefilter import LevelTable, Prefiltered
from homofact.rendering.sky_chain import SkyChain
from homofact.shading.functions import functions_text, sampling_functions
from homofact.shading.languages import HLSL, shader
from homofact.shading.mixture_fit import fitted_mixture

# Profiles of Direct3D 12 with the language's versions; the first is the oldest that DXC has.
TARGETS = (("ps_6_0", "2018"), ("vs_6_6", "2021"))


@pytest.fixture(scope="module")
def gpu() -> Gpu:
    return Gpu()


def staged(text: str, value: str, parameters: str, profile: str) -> str:
    """A shader of that stage whose output is the value."""
    semantic = "SV_Position" if profile.startswith("vs") else "SV_Target"
    return f"{text}\nfloat4 main({parameters}) : {semantic}\n{{\n    return {value};\n}}\n"


def spirv(text: str, sampler: int = SAMPLER) -> bytes:
    """SPIR-V of a compute shader whose sampler s0 is bound there."""
    return dxc(text, "cs_6_0", "-spirv", "-fvk-s-shift", str(sampler), "0")


def relative(found: np.ndarray, expected: np.ndarray) -> np.ndarray:
    return np.abs(found - expected)[BELOW:] / np.maximum(expected[BELOW:], 0.05 * expected.mean())


@pytest.mark.parametrize("name", NAMES)
def test_every_program_compiles_to_dxil(name: str) -> None:
    fitted, printed, _ = program(name)
    text = shader(printed, HLSL, "fit") + shader(replace(program("fixed h")[1], first=9), HLSL, "other")
    value = f"float4{WIDENED[len(fitted.channels)]}".replace("value", "fit_evaluate(wi, wo)")
    value += " + float4(other_evaluate(wi, wo), 0.0)"
    for profile, version in TARGETS:
        code = staged(text, value, "float3 wi : TEXCOORD0, float3 wo : TEXCOORD1", profile)
        assert dxc(code, profile, "-HV", version).startswith(b"DXBC")


@pytest.mark.parametrize("name", NAMES)
def test_a_gpu_gives_what_python_gives(name: str, gpu: Gpu) -> None:
    fitted, printed, textures = program(name)
    channels = len(fitted.channels)
    main = hlsl_main(
        f"{HLSL.types[channels - 1]} value = fit_evaluate(lights[id.x].xyz, viewers[id.x].xyz);",
        f"values[id.x] = float4{WIDENED[channels]};",
    )
    wi, wo = pairs()
    images = [Image.of(texture.stored) for texture in textures]
    found = gpu.run(spirv(shader(printed, HLSL, "fit") + main), images, wi, wo, SAMPLER)[:, :channels]
    expected = fitted.evaluate(wi, wo).numpy()
    assert (found[:BELOW] == 0).all()
    assert np.median(relative(found, expected)) < 1e-5
    assert np.quantile(relative(found, expected), 0.999) < 1e-4


@pytest.mark.parametrize("channels", [1, 2, 4])
def test_other_numbers_of_channels_compile(channels: int) -> None:
    fit = factorization(fixed_projection("h", True, Warp(0.1)), searched("isotropic-in-out", 4), channels=channels)
    printed = exported(fit, FORMATS["exr"]).program
    wide = ("fit_evaluate(wi, wo)", *["0.0"] * (4 - channels))
    code = staged(shader(printed, HLSL, "fit"), f"float4({', '.join(wide)})", "float3 wi : A, float3 wo : B", "ps_6_0")
    assert dxc(code, "ps_6_0")


def test_layers_by_label(gpu: Gpu) -> None:
    made = exported_layers(layered(), FORMATS["exr"])
    wi, wo, uv, labels, expected_labels = places()
    text = codes(made)["brdf.hlsl"]
    value = "float4(homofact_evaluate(wi, wo, homofact_layer(uv)), 0.0)"
    for profile, version in TARGETS:
        dxc(staged(text, value, "float3 wi : A, float3 wo : B, float2 uv : C", profile), profile, "-HV", version)
    main = hlsl_main(
        "int layer = homofact_layer(float2(lights[id.x].w, viewers[id.x].w));",
        "values[id.x] = float4(homofact_evaluate(lights[id.x].xyz, viewers[id.x].xyz, layer), 0.0);",
    )
    images = [replace(Image.of(texture.stored), layers=COUNT) for texture in made.textures]
    images.append(Image("r8uint", labels.shape[0], labels.shape[1], labels.tobytes()))
    across, up = torch.from_numpy(uv).double().split(1, 1)
    lights, viewers = torch.cat((wi, across), 1), torch.cat((wo, up), 1)
    found = gpu.run(spirv(text + main), images, lights, viewers, SAMPLER)[:, :3]
    expected = made.stored.evaluate(wi, wo, expected_labels).numpy()
    assert (found[:BELOW] == 0).all()
    assert relative(found, expected)[[60 - BELOW, 61 - BELOW]].max() < 1e-4
    assert np.median(relative(found, expected)) < 1e-5
    assert np.quantile(relative(found, expected), 0.999) < 1e-4


@pytest.mark.parametrize("name", MIXTURES)
def test_sampling_and_density(name: str, gpu: Gpu) -> None:
    mixture = MIXTURES[name]
    text = functions_text(sampling_functions(mixture), HLSL, "fit")
    for profile, version in TARGETS:
        value = "float4(fit_sample(wo, u), fit_density(u, wo))"
        dxc(staged(text, value, "float3 wo : A, float3 u : B", profile), profile, "-HV", version)
    wo, _ = pairs()
    wo = wo[BELOW:]
    u = torch.rand(len(wo), 3, generator=torch.Generator().manual_seed(5)).double()
    main = hlsl_main(
        "float3 wi = fit_sample(lights[id.x].xyz, viewers[id.x].xyz);",
        "values[id.x] = float4(wi, fit_density(wi, lights[id.x].xyz));",
    )
    wide = torch.from_numpy(gpu.run(spirv(text + main), [], wo, u, None)).double()
    wi, density = wide[:, :3], wide[:, 3]
    assert float((wi - mixture.draw(wo, u)).norm(dim=1).quantile(0.99)) < 1e-4
    expected = mixture.density(wi, wo)
    clear = wi[:, 2].abs() > 1e-6
    assert float(((density - expected).abs() / expected.clamp_min(1e-6))[clear].quantile(0.99)) < 2e-3


@pytest.fixture(scope="module")
def light() -> Prefiltered:
    """A material's table of random numbers beside cube maps of random, smooth light."""
    generator = torch.Generator().manual_seed(0)

    def smooth(side: int) -> torch.Tensor:
        slope = torch.rand(3, 3, generator=generator).double() - 0.5
        return 1 + 0.5 * directions_of(side) @ slope

    sky = SkyChain(
        tuple(smooth(side) for side in (16, 8)), smooth(8), torch.zeros(9, 3), 1.0, "random", ChainKernels((0.5, 1.0))
    )
    return Prefiltered(LevelTable(torch.rand(4, 17, 4, generator=generator).double()), sky)


def test_prefiltered_light(light: Prefiltered, gpu: Gpu) -> None:
    text = shader(light.program(("light",), 0), HLSL, "sky")
    main = hlsl_main("values[id.x] = float4(sky_reflected(lights[id.x].xyz, viewers[id.x].xyz), 0.0);")
    n, wo = normals(2000)
    cubes = [level.numpy() for level in light.sky.levels], [light.sky.irradiance.numpy()]
    images = [Image.of(light.material.table.numpy().astype(np.float32)), *map(Image.cube, cubes)]
    found = gpu.run(spirv(text + main), images, n, wo, SAMPLER)[:, :3]
    apart = np.abs(found / light.radiance(n, wo).numpy() - 1)
    assert np.median(apart) < 1e-3
    # A sampler has 256 steps between two texels, and between two levels.
    assert np.quantile(apart, 0.99) < 2e-2


@pytest.mark.parametrize("form", ["exr", "png8", "png16", "ktx2", "bc6h"])
def test_all_of_an_export_stands_in_one_shader(form: str, light: Prefiltered, tmp_path: Path) -> None:
    """DXC refuses two resources in one register."""
    terms = [random_term(each, 3, 3, (8, 12)) for each in (fixed_projection("h", True), searched("half-diff", 2))]
    made = exported(replace(CASES["fixed h"], terms=tuple(terms)), FORMATS[form])
    PrefilteredExport(light, FORMATS["exr16"], False, 0.1).put(tmp_path, len(made.textures) + 1)
    text = shader(made.program, HLSL) + functions_text(sampling_functions(MIXTURES["isotropic"]), HLSL)
    text += (tmp_path / "prefiltered.hlsl").read_text()
    value = (
        "float4(homofact_evaluate(wi, wo) * homofact_sample(wo, wi) * homofact_density(wi, wo)"
        " + homofact_light_reflected(wi, wo), 1.0)"
    )
    for profile, version in TARGETS:
        dxc(staged(text, value, "float3 wi : A, float3 wo : B", profile), profile, "-HV", version)
    doubled = re.sub(r"register\(t3\)", "register(t0)", text)
    assert doubled != text
    with pytest.raises(AssertionError, match="overlap"):
        dxc(staged(doubled, value, "float3 wi : A, float3 wo : B", "ps_6_0"), "ps_6_0")


@pytest.mark.slow
def test_the_files_of_an_export(tmp_path: Path) -> None:
    made = exported(CASES["fixed h"], FORMATS["exr"])
    made = replace(made, sampling=fitted_mixture(made.stored))
    write_exported(tmp_path / "out", made, {})
    value = "float4(homofact_evaluate(wi, wo) * homofact_sample(wo, wi) * homofact_density(wi, wo), 1.0)"
    text = (tmp_path / "out" / "brdf.hlsl").read_text()
    for profile, version in TARGETS:
        code = staged(text, value, "float3 wi : A, float3 wo : B", profile)
        assert dxc(code, profile, "-HV", version).startswith(b"DXBC")


@pytest.mark.parametrize(
    ("right", "wrong", "told"),
    [
        (".rgb;", ";", "implicit truncation"),
        ("uv_0 =", "uv_1 =", "undeclared identifier 'uv_0'"),
        ("    return ", "    float3 other;\n    return other + ", "uninitialized"),
        (" : register(t0)", " : register(b0)", "invalid register"),
    ],
)
def test_the_compiler_sees_what_is_wrong(right: str, wrong: str, told: str) -> None:
    text = shader(program("five of all kinds")[1], HLSL, "fit")
    assert right in text
    main = "float4(fit_evaluate(wi, wo), 1.0)"
    with pytest.raises(AssertionError, match=told):
        dxc(staged(text.replace(right, wrong, 1), main, "float3 wi : A, float3 wo : B", "ps_6_0"), "ps_6_0")
