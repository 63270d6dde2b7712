"""Texture arrays: saved and evaluated by label, printed, compiled and run, they give what Python gives."""

import ctypes
import re
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from layered_cases import COLUMNS, COUNT, ROWS, layered, places
from webgpu import SAMPLER, WGSL_MAIN, WIDENED, Gpu, Image, glslang

from homofact.containers.formats import FORMATS
from homofact.errors import BadInput
from homofact.exporting.layered import codes, exported_layers, put_layers
from homofact.factor.layered import Layered

COMPILER = shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")


@pytest.mark.parametrize(("channels", "form"), [(3, "exr"), (1, "exr"), (3, "png8")])
def test_c_gives_what_python_gives_at_every_label(channels: int, form: str, tmp_path: Path) -> None:
    if COMPILER is None:
        pytest.skip("no C compiler (cc, gcc or clang) on the PATH")
    fit = layered(channels)
    made = exported_layers(fit, FORMATS[form])
    wi, wo, uv, labels, expected_labels = places()
    source = codes(made)["brdf.c"] + (
        "\nvoid every(int n, const float *wi, const float *wo, const float *uv, const unsigned char *labels, float *f)"
        "\n{\n    for (int k = 0; k < n; k++)\n        homofact_evaluate(wi + 3 * k, wo + 3 * k,"
        f" homofact_layer(labels, {ROWS}, {COLUMNS}, uv + 2 * k), f + {channels} * k);\n}}\n"
    )
    (tmp_path / "brdf.c").write_text(source, encoding="utf-8")
    strict = ["-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic", "-O1", "-shared", "-fPIC"]
    library = tmp_path / "brdf.so"
    subprocess.run([COMPILER, *strict, "-o", library, tmp_path / "brdf.c", "-lm"], check=True)
    found = np.empty((len(wi), channels), np.float32)
    given = [np.ascontiguousarray(each.float().numpy()) for each in (wi, wo)]
    pointers = [each.ctypes.data_as(ctypes.c_void_p) for each in (*given, uv, labels, found)]
    ctypes.CDLL(str(library)).every(len(wi), *pointers)
    expected = made.stored.evaluate(wi, wo, expected_labels).numpy()
    assert (found[:50] == 0).all()
    error = np.abs(found - expected)[50:] / np.maximum(expected[50:], 1e-2)
    assert np.median(error) < 2e-6
    assert np.quantile(error, 0.999) < 1e-4
    # And the stored texels are those of the fit, as nearly as the format holds them.
    change = (made.stored.evaluate(wi, wo, expected_labels) - fit.evaluate(wi, wo, expected_labels)).abs().max()
    assert float(change) < {"exr": 1e-4, "png8": 0.5}[form]


@pytest.mark.parametrize("form", ["exr", "png16", "ktx2", "dds"])
def test_a_file_s_layers_are_those_that_are_evaluated(form: str, tmp_path: Path) -> None:
    made = exported_layers(layered(), FORMATS[form])
    put_layers(tmp_path, made, np.zeros((2, 2), np.uint8))
    for k, (name, texture) in enumerate(zip(made.names, made.textures, strict=True)):
        found = made.format.read(tmp_path / name, 3, layers=COUNT)
        assert (found == texture.sampled).all()
        values = replace(texture, stored=found).values
        for layer, part in zip(made.stored.layers, np.split(values, COUNT), strict=True):
            assert (layer.textures[k].texels == part).all()


def test_an_array_of_blocks_needs_layers_of_whole_blocks() -> None:
    with pytest.raises(BadInput, match="texture 0: 12 x 10 texels of 3 channels, expected sides that are multiples"):
        exported_layers(layered(), FORMATS["bc6h"])


def test_wgsl_on_a_gpu_gives_what_python_gives_at_every_label() -> None:
    gpu = Gpu()
    made = exported_layers(layered(), FORMATS["exr"])
    wi, wo, uv, labels, expected_labels = places()
    text = codes(made)["brdf.wgsl"].replace("homofact_", "fit_")
    text = re.sub(r"@binding\(\d+\) (?=var fit_sampler)", f"@binding({SAMPLER}) ", text)
    # A place in the fourth numbers of wi and wo, which the test's buffers leave free.
    main = WGSL_MAIN.replace(
        "lights[id.x].xyz, viewers[id.x].xyz",
        "lights[id.x].xyz, viewers[id.x].xyz, fit_layer(vec2<f32>(lights[id.x].w, viewers[id.x].w))",
    ).replace("WIDENED", f"vec4<f32>{WIDENED[3]}")
    text = re.sub(r"@binding\(\d+\) (?=var fit_labels)", "@binding(3) ", text)
    images = [replace(Image.of(texture.stored), layers=COUNT) for texture in made.textures]
    images.append(Image("r8uint", ROWS, COLUMNS, labels.tobytes()))
    across, up = torch.from_numpy(uv).double().split(1, 1)
    found = gpu.run(text + main, images, torch.cat((wi, across), 1), torch.cat((wo, up), 1), SAMPLER)[:, :3]
    expected = made.stored.evaluate(wi, wo, expected_labels).numpy()
    error = np.abs(found - expected)[50:] / np.maximum(expected[50:], 0.05 * expected.mean())
    assert (found[:50] == 0).all()
    assert error[[10, 11]].max() < 1e-4
    assert np.median(error) < 1e-5
    assert np.quantile(error, 0.999) < 1e-4


def test_glsl_and_hlsl_compile(tmp_path: Path) -> None:
    texts = codes(exported_layers(layered(), FORMATS["exr16"]))
    main = "in vec3 wi;\nin vec3 wo;\nin vec2 uv;\nout vec4 f;\nvoid main() {\n"
    main += "    f = vec4(homofact_evaluate(wi, wo, homofact_layer(uv)), 0.0);\n}\n"
    head = "#version 300 es\nprecision highp float;\nprecision highp sampler2DArray;\n"
    glslang(head + texts["brdf.glsl"] + main, tmp_path, "frag")
    main = "float4 main(float3 wi : TEXCOORD0, float3 wo : TEXCOORD1, float2 uv : TEXCOORD2) : SV_Target\n{\n"
    main += "    return float4(homofact_evaluate(wi, wo, homofact_layer(uv)), 0.0);\n}\n"
    glslang(texts["brdf.hlsl"] + main, tmp_path, "frag", "-D", "-V", "-e", "main")
    assert re.findall(r"register\(([ts]\d)\)", texts["brdf.hlsl"]) == ["t0", "t1", "t2", "s0", "t3"]


def test_layers_are_evaluated_by_label_and_read_back_to_the_bit(tmp_path: Path) -> None:
    fit = layered()
    wi, wo, _, _, labels = places()
    values = fit.evaluate(wi, wo, labels)
    for k, layer in enumerate(fit.layers):
        assert torch.equal(values[labels == k], layer.evaluate(wi, wo)[labels == k])
    fit.save(tmp_path / "svbrdf.npz")
    again = Layered.load(tmp_path / "svbrdf.npz")
    assert torch.equal(again.evaluate(wi, wo, labels), values)
    assert [layer.provenance for layer in again.layers] == [{"seed": k} for k in range(COUNT)]
    # Another material in one layer changes no other.
    other = replace(fit.layers[1], terms=fit.layers[2].terms)
    changed = Layered((fit.layers[0], other, fit.layers[2])).evaluate(wi, wo, labels)
    assert torch.equal(changed[labels != 1], values[labels != 1])
    assert not torch.equal(changed[labels == 1], values[labels == 1])


def test_what_are_no_layers_is_refused() -> None:
    fit = layered()
    wi, wo, _, _, labels = places()
    with pytest.raises(BadInput, match="labels: found 1 to 3, expected 0 to 2"):
        fit.evaluate(wi, wo, labels + 1)
    moved = replace(fit.layers[1].terms[2].projection, matrix=fit.layers[1].terms[2].projection.matrix * 0.5)
    terms = (*fit.layers[1].terms[:2], replace(fit.layers[1].terms[2], projection=moved))
    with pytest.raises(BadInput, match="layers: number 1 has other projections, sizes or channels"):
        Layered((fit.layers[0], replace(fit.layers[1], terms=terms)))
    with pytest.raises(BadInput, match="layers: found 0, expected 1 to 256"):
        Layered(())
