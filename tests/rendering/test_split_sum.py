"""The split sum: exact where it must be, near the exact picture elsewhere, the same on a GPU and in C as in Python."""

import ctypes
import math
import shutil
import subprocess
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import torch
from skies import LAMBERT, Planted, chain, lamps, normals
from slow_cases import slow_among
from torch import Tensor
from webgpu import Gpu, Image, glslang, wgsl_main

from homofact.brdf.materials import material
from homofact.brdf.reflectance import Reflectance
from homofact.errors import BadInput
from homofact.exporting.prefiltered import compared, in_halves, picture
from homofact.geometry.directions import from_spherical
from homofact.geometry.quadrature import hemisphere_nodes
from homofact.rendering.filtered import render_filtered
from homofact.rendering.prefilter import Prefiltered, prefiltered
from homofact.rendering.sky_chain import SkyChain, own_kernels
from homofact.rendering.split_sum import COLUMNS, LOBES, Response, response_of
from homofact.shading.cube_code import c_light
from homofact.shading.languages import GLSL, HLSL, WGSL, shader

COMPILER = shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")
SIDE = 32


def blob(wi: Tensor, wo: Tensor) -> Tensor:
    """A narrow lobe round the mirror direction."""
    mirror = wo * wo.new_tensor((-1, -1, 1))
    return torch.exp(-((wi - mirror) ** 2).sum(1) / 2e-2) * 2


@cache
def response(name: str, lobes: int = LOBES) -> Response:
    return response_of(material(name).model, own_kernels(SIDE), lobes)


def sky(name: str = "lamps") -> SkyChain:
    return chain(name, SIDE)


def albedo(reflectance: Reflectance, cosine: Tensor) -> Tensor:
    wo = from_spherical(torch.acos(cosine), torch.zeros_like(cosine))
    wi, angles = hemisphere_nodes(wo)
    values = reflectance.evaluate(wi.reshape(-1, 3), wo[:, None].expand_as(wi).reshape(-1, 3))
    return (values.reshape(*angles.shape, -1) * (wi[..., 2] * angles)[..., None]).sum(1)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["lafortune-blue-paint", "phong-30"])
def test_the_table_keeps_the_albedo(name: str) -> None:
    found, model = response(name), material(name).model
    assert found.lobes.shape == (COLUMNS, LOBES, 3)
    assert found.shares.shape == (COLUMNS, LOBES + 1, 3)
    assert float(found.shares.min()) >= 0
    assert 0 <= float(found.lobes[..., 0].min()) <= float(found.lobes[..., 0].max()) <= len(sky().levels) - 1
    cosine = torch.arange(1, COLUMNS, dtype=torch.float64)[4::8] / (COLUMNS - 1)
    assert torch.allclose(found.shares.sum(1)[5::8], albedo(model, cosine), rtol=1.5e-2)


@pytest.mark.slow
@pytest.mark.parametrize("reflectance", [LAMBERT, material("cook-torrance-plastic").model], ids=["lambert", "plastic"])
def test_in_a_furnace_it_is_the_albedo(reflectance: Reflectance) -> None:
    data = prefiltered(response_of(reflectance, own_kernels(32)), chain("constant"))
    n, wo = normals(60)
    cosine = (n * wo).sum(1)
    seen = cosine > 0.15
    expected = 2 * albedo(reflectance, cosine[seen]).expand(-1, 3)
    assert torch.allclose(data.radiance(n, wo)[seen], expected, rtol=1e-2)


@pytest.mark.slow
def test_a_matte_surface_has_the_irradiance_and_no_lobe() -> None:
    """Of L = 1 + s·ω it is π (1 + ⅔ s·n)."""
    slope, found = (0.3, 0.4, -0.2), response_of(LAMBERT, own_kernels(SIDE))
    assert found.shares[:, -1].flatten().tolist() == pytest.approx([0.6] * COLUMNS, abs=5e-3)
    n, wo = normals()
    expected = (1 + 2 / 3 * n @ n.new_tensor(slope))[:, None] * n.new_tensor((1, 2, 3))
    assert torch.allclose(prefiltered(found, sky("gradient")).radiance(n, wo), 0.6 * expected, rtol=1e-2)


@pytest.mark.slow
def test_a_narrow_lobe_shows_the_light_itself() -> None:
    """Where the light changes little over the lobe: L at the mirror direction times the albedo, every way round."""
    slope = (0.3, 0.4, -0.2)
    data = prefiltered(response_of(Planted(blob), own_kernels(SIDE)), sky("gradient"))
    n, wo = normals()
    cosine = (n * wo).sum(1)
    clear = cosine > 0.5
    mirror = 2 * cosine[:, None] * n - wo
    share = albedo(Planted(blob), cosine[clear])
    expected = (1 + mirror @ n.new_tensor(slope))[clear, None] * n.new_tensor((1, 2, 3)) * share
    assert torch.allclose(data.radiance(n, wo)[clear], expected, rtol=2.5e-2)


@pytest.mark.slow
def test_a_black_material_reflects_nothing() -> None:
    found = response_of(Planted(lambda wi, wo: torch.zeros_like(wi[:, 0])), own_kernels(32))
    assert float(found.shares.abs().max()) == 0
    assert torch.isfinite(found.lobes).all()


@pytest.mark.parametrize(
    ("name", "most"), slow_among([("lafortune-blue-paint", 0.03), ("phong-30", 0.03)], "lafortune-blue-paint")
)
def test_the_sphere_is_near_the_exact_one(name: str, most: float) -> None:
    exact = render_filtered(material(name).model, lamps(), 48)
    data = prefiltered(response(name), sky())
    assert compared(picture(data, 48), exact) < most
    # It would be seen if the light were mirrored or turned.
    for wrong in ("lamps, turned", "lamps, upside down"):
        assert compared(picture(replace(data, sky=sky(wrong)), 48), exact) > 2 * most


@pytest.mark.slow
def test_what_looks_different_by_channel_and_angle_wants_two_lobes() -> None:
    """A wide coloured lobe and a narrow white one."""

    class Two(Planted):
        channels = ("R", "G", "B")

        def evaluate(self, wi: Tensor, wo: Tensor) -> Tensor:
            off = ((wi - wo * wo.new_tensor((-1, -1, 1))) ** 2).sum(1, keepdim=True)
            wide = torch.exp(-off / 0.3) * wi.new_tensor((0.5, 0.1, 0.05))
            return (wide + 2 * torch.exp(-off / 0.02)) * ((wi[:, 2:] > 0) & (wo[:, 2:] > 0))

    model = Two(blob)
    exact = render_filtered(model, lamps(), 48)
    one, two = (
        compared(picture(prefiltered(response_of(model, own_kernels(SIDE), k), sky()), 48), exact) for k in (1, 2)
    )
    assert two < 0.035
    assert two < 0.8 * one


def test_one_sky_serves_all_materials_and_a_table_fits_its_sky_alone() -> None:
    paint, phong = (prefiltered(response(name), sky()) for name in ("lafortune-blue-paint", "phong-30"))
    assert paint.sky is phong.sky
    with pytest.raises(AssertionError, match="another chain"):
        prefiltered(response("phong-30"), replace(sky(), kernels=own_kernels(64)))


def test_the_factor_of_a_bright_sky_is_multiplied_back() -> None:
    data = prefiltered(response("phong-30"), sky())
    scaled = SkyChain(
        tuple(level / 8 for level in sky().levels), sky().irradiance / 8, sky().harmonics, 8.0, "lamps", sky().kernels
    )
    n, wo = normals(50)
    assert torch.allclose(prefiltered(response("phong-30"), scaled).radiance(n, wo), data.radiance(n, wo))


def test_what_is_no_picture_is_refused() -> None:
    class Two(Planted):
        channels = ("a", "b")

        def evaluate(self, wi: Tensor, wo: Tensor) -> Tensor:
            return super().evaluate(wi, wo).expand(-1, 2)

    with pytest.raises(BadInput, match="found 2 channels"):
        response_of(Two(blob), own_kernels(SIDE))
    with pytest.raises(BadInput, match="not finite"):
        response_of(Planted(lambda wi, wo: torch.full_like(wi[:, 0], math.nan)), own_kernels(SIDE))
    with pytest.raises(BadInput, match="found 100 texels per side"):
        response_of(LAMBERT, own_kernels(100))


@pytest.mark.slow
def test_equal_bits() -> None:
    one, two = (response_of(Planted(blob), own_kernels(32), 1) for _ in range(2))
    assert all(torch.equal(a, b) for a, b in zip(one[:2], two[:2], strict=True))


MAIN = wgsl_main("values[id.x] = vec4<f32>(sky_reflected(lights[id.x].xyz, viewers[id.x].xyz), 0.0);")


@pytest.fixture(scope="module")
def data() -> Prefiltered:
    found = prefiltered(response("phong-30"), in_halves(sky()))
    return replace(found, material=found.material.rounded(np.float32))


def test_a_gpu_gives_what_python_gives(data: Prefiltered) -> None:
    """By its own cube maps: faces, edges, levels and the table are read as by `rendering.cube`."""
    n, wo = normals(4000)
    code = shader(data.program(("light",), 0), WGSL, "sky") + MAIN
    cubes = [level.numpy() for level in data.sky.levels], [data.sky.irradiance.numpy()]
    images = [Image.of(data.material.table.numpy().astype(np.float32)), *map(Image.cube, cubes)]
    found = Gpu().run(code, images, n, wo, 3)[:, :3]
    expected = data.radiance(n, wo).numpy()
    assert np.median(np.abs(found / expected - 1)) < 1e-3
    # A sampler has 256 steps between two texels, and between two levels.
    assert np.quantile(np.abs(found / expected - 1), 0.99) < 2e-2


def test_c_gives_what_python_gives(data: Prefiltered, tmp_path: Path) -> None:
    if COMPILER is None:
        pytest.skip("no C compiler (cc, gcc or clang) on the PATH")
    n, wo = normals(4000)
    code = c_light(data.program(("light",), 0), data.material.table.numpy().astype(np.float32), "sky")
    code += (
        "\nvoid many(int n, const float *s, const float *e, const float *a, const float *b, float *out)\n{\n"
        "    for (int k = 0; k < n; k++)\n        sky_reflected(s, e, a + 3 * k, b + 3 * k, out + 3 * k);\n}\n"
    )
    (tmp_path / "light.c").write_text(code, encoding="utf-8")
    strict = ["-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic", "-O1", "-shared", "-fPIC"]
    subprocess.run([COMPILER, *strict, "-o", tmp_path / "l.so", tmp_path / "light.c", "-lm"], check=True)
    texels = np.frombuffer(b"".join(Image.cube([level.numpy()]).data for level in data.sky.levels), np.float32)
    lit = np.frombuffer(Image.cube([data.sky.irradiance.numpy()]).data, np.float32)
    given = [np.ascontiguousarray(each.float().numpy()) for each in (n, wo)]
    found = np.empty((len(n), 3), np.float32)
    pointers = [each.ctypes.data_as(ctypes.c_void_p) for each in (texels.copy(), lit.copy(), *given, found)]
    ctypes.CDLL(str(tmp_path / "l.so")).many(len(n), *pointers)
    expected = data.radiance(*(torch.from_numpy(each).double() for each in given)).numpy()
    assert np.median(np.abs(found / expected - 1)) < 1e-6
    assert np.quantile(np.abs(found / expected - 1), 0.999) < 1e-4


def test_glsl_and_hlsl_compile(data: Prefiltered, tmp_path: Path) -> None:
    program = data.program(("light",), 3)
    value = "sky_reflected(n, wo)"
    main = f"in vec3 n;\nin vec3 wo;\nout vec4 f;\nvoid main() {{\n    f = vec4({value}, 1.0);\n}}\n"
    glslang("#version 300 es\nprecision highp float;\n" + shader(program, GLSL, "sky") + main, tmp_path, "frag")
    text = shader(program, HLSL, "sky")
    assert "TextureCube<float4> sky_texture_1 : register(t4);" in text
    assert "sky_trilinear_clamp_sampler : register(s1);" in text
    main = f"float4 main(float3 n : A, float3 wo : B) : SV_Target\n{{\n    return float4({value}, 1.0);\n}}\n"
    glslang(text + main, tmp_path, "frag", "-D", "-V", "-e", "main")
    assert "@binding(6) var sky_sampler: sampler;  // linear, also between levels" in shader(program, WGSL, "sky")
