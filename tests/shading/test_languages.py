"""Generated shaders: GLSL, HLSL and WGSL pass compilers that are not ours, run on a GPU and give what Python gives.

WGSL is compiled by naga and HLSL and GLSL by glslang; SPIR-V and WGSL run through WebGPU (`webgpu`), on Mesa's software
Vulkan driver where there is no other. C, which needs no GPU, is in test_shading.py, GLSL in a browser's WebGL2 with
the viewer.
"""

import re
import struct
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image as Picture
from shading_cases import BELOW, CASES, NAMES, pairs, program, random_term
from webgpu import GLSL_BUFFERS, SAMPLER, WGSL_MAIN, WIDENED, Gpu, Image, glsl_main, glslang, hlsl_main

from homofact.containers.formats import FORMATS
from homofact.shading.encoding import encode_texture
from homofact.shading.languages import GLSL, HLSL, WGSL, Language, number, shader
from homofact.shading.program import program_of

HLSL_MAIN = hlsl_main("TYPE value = fit_evaluate(lights[id.x].xyz, viewers[id.x].xyz);", "values[id.x] = WIDENED;")
GLSL_HEAD = f"""#version 450
#define textureLod(image, uv, level) textureLod(sampler2D(image, fit_sampler), uv, level)
layout(set = 0, binding = 16) uniform sampler fit_sampler;
{GLSL_BUFFERS}"""
GLSL_MAIN = glsl_main("TYPE value = fit_evaluate(lights[k].xyz, viewers[k].xyz);", "values[k] = WIDENED;")


@pytest.fixture(scope="module")
def gpu() -> Gpu:
    return Gpu()


def runnable(text: str, language: Language, channels: int, folder: Path) -> str | bytes:
    """The shader `text` (prefix fit) with an entry point that evaluates every pair, as WGSL or SPIR-V."""
    kind = language.types[channels - 1]
    widened = f"{language.types[3]}{WIDENED[channels]}"

    def entry(main: str) -> str:
        return main.replace("TYPE", kind).replace("WIDENED", widened)

    if language is WGSL:
        return re.sub(r"@binding\(\d+\) (?=var fit_sampler)", f"@binding({SAMPLER}) ", text) + entry(WGSL_MAIN)
    if language is HLSL:
        shift = ("--shift-sampler-binding", str(SAMPLER))
        return glslang(text + entry(HLSL_MAIN), folder, "comp", "-D", "-V", "-e", "main", *shift)
    # Vulkan has textures and samplers apart, where ES has one uniform.
    apart = re.sub(
        r"uniform highp sampler2D fit_texture_(\d+)",
        r"layout(set = 0, binding = \1) uniform texture2D fit_texture_\1",
        text,
    )
    return glslang(GLSL_HEAD + apart + entry(GLSL_MAIN), folder, "comp", "-V")


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("language", [WGSL, HLSL, GLSL], ids=lambda language: language.name)
def test_a_gpu_gives_what_python_gives(name: str, language: Language, gpu: Gpu, tmp_path: Path) -> None:
    fitted, printed, textures = program(name)
    channels = len(fitted.channels)
    wi, wo = pairs()
    code = runnable(shader(printed, language, "fit"), language, channels, tmp_path)
    found = gpu.run(code, [Image.of(texture.stored) for texture in textures], wi, wo, SAMPLER)[:, :channels]
    expected = fitted.evaluate(wi, wo).numpy()
    assert (found[:BELOW] == 0).all()
    error = np.abs(found - expected)[BELOW:] / np.maximum(expected[BELOW:], 0.05 * expected.mean())
    assert np.median(error) < 1e-5
    assert np.quantile(error, 0.999) < 1e-4


def test_constants_read_back_whatever_numpy_prints() -> None:
    """colour-science, which reading a measurement imports, sets numpy to print fewer digits."""
    generator = np.random.default_rng(0)
    values = generator.normal(0, 1, 2000) * 10.0 ** generator.uniform(-30, 30, 2000)
    singles = [np.float32(value) for value in (0, -0.0, 1, -2, 1e-4, 1e16, 0.1, 1e-20, *values)]
    plain = [number(float(value)) for value in singles]
    assert [np.float32(text) for text in plain] == singles
    assert plain[:8] == ["0.0", "-0.0", "1.0", "-2.0", "0.0001", "1e+16", "0.1", "1e-20"]
    # An integer's text would be an int in GLSL.
    assert all("." in text or "e" in text for text in plain)
    with np.printoptions(legacy="1.13", precision=3):
        assert [number(float(value)) for value in singles] == plain


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("stage", ["vert", "frag"])
def test_glsl_es_compiles_in_both_stages(name: str, stage: str, tmp_path: Path) -> None:
    """As WebGL2 takes it; a second material under another name beside it."""
    fitted, printed, _ = program(name)
    text = shader(printed, GLSL, "fit") + shader(program("five of all kinds")[1], GLSL, "other")
    value = f"vec4{WIDENED[len(fitted.channels)]}".replace("value", "fit_evaluate(wi, wo)")
    evaluated = f"{value} + vec4(other_evaluate(wi, wo), 0.0)"
    head = "#version 300 es\nprecision highp float;\n"
    if stage == "vert":
        main = (
            f"in vec3 wi;\nin vec3 wo;\nout vec4 f;\nvoid main() {{\n    f = {evaluated};\n    gl_Position = f;\n}}\n"
        )
    else:
        main = f"in vec3 wi;\nin vec3 wo;\nout vec4 f;\nvoid main() {{\n    f = {evaluated};\n}}\n"
    glslang(head + text + main, tmp_path, stage)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("stage", ["vert", "frag"])
def test_hlsl_compiles_in_both_stages(name: str, stage: str, tmp_path: Path) -> None:
    fitted, printed, textures = program(name)
    text = shader(printed, HLSL, "fit")
    # Which registers textures and samplers may have, glslang does not ask.
    assert re.findall(r"fit_texture_(\d+) : register\(t(\d+)\)", text) == [(f"{k}",) * 2 for k in range(len(textures))]
    assert "SamplerState fit_trilinear_clamp_sampler : register(s0)" in text
    value = f"float4{WIDENED[len(fitted.channels)]}".replace("value", "fit_evaluate(wi, wo)")
    semantic = "SV_Position" if stage == "vert" else "SV_Target"
    main = f"float4 main(float3 wi : TEXCOORD0, float3 wo : TEXCOORD1) : {semantic}\n{{\n    return {value};\n}}\n"
    glslang(text + main, tmp_path, stage, "-D", "-V", "-e", "main")


@pytest.mark.parametrize("language", [GLSL, HLSL])
def test_the_compiler_sees_what_is_wrong(language: Language, tmp_path: Path) -> None:
    text = shader(program("five of all kinds")[1], language, "fit")
    options = ("-D", "-V", "-e", "main") if language is HLSL else ()
    main = {
        GLSL.name: "out vec4 f;\nvoid main() {\n    f = vec4(fit_evaluate(vec3(0.0), vec3(0.0)), 1.0);\n}\n",
        HLSL.name: "float4 main() : SV_Target\n{\n    return float4(fit_evaluate(0.0, 0.0), 1.0);\n}\n",
    }[language.name]
    head = "#version 300 es\nprecision highp float;\n" if language is GLSL else ""
    glslang(head + text + main, tmp_path, "frag", *options)
    for right, wrong in (("uv_0 =", "uv_1 ="), ("max(", "maximum("), (".rgb;", ".rg;")):
        assert right in text
        with pytest.raises(AssertionError, match="ERROR"):
            glslang(head + text.replace(right, wrong, 1) + main, tmp_path, "frag", *options)


def test_naga_sees_what_is_wrong(gpu: Gpu) -> None:
    text = shader(program("five of all kinds")[1], WGSL, "fit")
    gpu.compiled(text)
    for right, wrong in (("let uv_0:", "let uv_1:"), ("vec3<f32>(0.0)", "0.0"), (".rgb;", ".rg;")):
        assert right in text
        with pytest.raises(gpu.wgpu.GPUValidationError):
            gpu.compiled(text.replace(right, wrong, 1))


def of_file(path: Path) -> Image:
    """What a loader uploads of a file, by the numbers of its header."""
    data = path.read_bytes()
    if path.suffix == ".png":
        with Picture.open(path) as picture:
            return Image.of(np.asarray(picture))
    if path.suffix == ".ktx2":
        (kind, _, columns, rows), (start, length) = (
            struct.unpack_from("<4I", data, 12),
            struct.unpack_from("<2Q", data, 80),
        )
    else:
        (rows, columns), (kind,) = struct.unpack_from("<2I", data, 12), struct.unpack_from("<I", data, 128)
        start, length = 148, len(data) - 148
    return Image(
        {97: "rgba16float", 10: "rgba16float", 96: "bc6h-rgb-float"}[kind], rows, columns, data[start:][:length]
    )


@pytest.mark.parametrize("name", ["ktx2", "dds", "bc6h", "png8"])
def test_files_on_a_gpu_give_what_their_decoded_texels_give(name: str, gpu: Gpu, tmp_path: Path) -> None:
    form = FORMATS[name]
    projections = [CASES[case].terms[0].projection for case in ("warped half-diff", "fixed theta_h-theta_d")]
    terms = [random_term(projection, k, 3, (8, 12)) for k, projection in enumerate(projections)]
    fitted = replace(CASES["fixed h"], terms=tuple(terms))
    textures = [encode_texture(texture, form.storage) for texture in fitted.textures]
    paths = [tmp_path / f"{k}{form.suffix}" for k in range(2)]
    for path, texture in zip(paths, textures, strict=True):
        form.write(path, texture.stored)
    wi, wo = pairs()
    code = runnable(shader(program_of(fitted, textures), WGSL, "fit"), WGSL, 3, tmp_path)
    found = gpu.run(code, [of_file(path) for path in paths], wi, wo, SAMPLER)[BELOW:, :3]
    stored = fitted.with_textures([texture.decoded() for texture in textures])
    expected, whole = (each.evaluate(wi, wo).numpy()[BELOW:] for each in (stored, fitted))
    error = np.abs(np.log(found / expected))
    if name == "png8":
        # Mesa interpolates 8 bits in 8 bits: a step or so of each texture.
        step = sum(float(texture.scale.max()) / 255 for texture in textures)
        assert np.median(error) < step / 2
        assert error.max() < 1.5 * step
    else:
        assert np.median(error) < 1e-5
        assert error.max() < 1e-4
    # What is stored differs from the fit by more than the GPU does.
    assert np.median(np.abs(np.log(expected / whole))) > (1e-3 if name in ("bc6h", "png8") else 5e-5)
