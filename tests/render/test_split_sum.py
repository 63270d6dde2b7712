"""The split sum: exact where it must be, near the exact picture elsewhere, the same on a GPU as in Python."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from torch import Tensor
from webgpu import Gpu, Image, glslang, wgsl_main

from homofact.brdf.materials import material
from homofact.brdf.reflectance import Reflectance
from homofact.errors import BadInput
from homofact.export.prefiltered import compared, picture
from homofact.geometry.directions import from_spherical, normalize
from homofact.geometry.quadrature import hemisphere_nodes
from homofact.render.filtered import render_filtered
from homofact.render.light import EnvironmentMap
from homofact.render.prefilter import MOST_SIDE, Prefiltered, needed_side, prefiltered, program_of_light
from homofact.render.split_sum import COLUMNS, RINGS, response_of
from homofact.shading.languages import GLSL, HLSL, WGSL, shader


class Planted:
    """A reflectance of one channel, from a function."""

    channels, nbytes, fetches = ("Y",), 0, 0

    def __init__(self, function) -> None:
        self.function = function

    def evaluate(self, wi: Tensor, wo: Tensor) -> Tensor:
        return self.function(wi, wo)[:, None] * ((wi[:, 2:] > 0) & (wo[:, 2:] > 0))


LAMBERT = Planted(lambda wi, wo: torch.full_like(wi[:, 0], 0.6 / math.pi))


def blob(wi: Tensor, wo: Tensor) -> Tensor:
    """A narrow lobe round the mirror direction."""
    mirror = wo * wo.new_tensor((-1, -1, 1))
    return torch.exp(-((wi - mirror) ** 2).sum(1) / 2e-3) * 20


def gradient(slope: tuple[float, float, float] = (0.3, 0.4, -0.2), rows: int = 64) -> EnvironmentMap:
    """L = 1 + slope · ω, thrice, brighter by channel."""
    theta = (torch.arange(rows, dtype=torch.float64) + 0.5) * (math.pi / rows)
    around = ((torch.arange(2 * rows, dtype=torch.float64) + 0.5) / (2 * rows) - 0.5) * (2 * math.pi)
    t, a = torch.meshgrid(theta, around, indexing="ij")
    w = torch.stack((t.sin() * a.sin(), t.cos(), -t.sin() * a.cos()), -1)
    level = 1 + w @ w.new_tensor(slope)
    return EnvironmentMap(torch.stack((level, 2 * level, 3 * level), 2), name="gradient.hdr")


def lamps() -> EnvironmentMap:
    """A dim sky with a soft lamp, and another."""
    sky = gradient((0.1, 0.3, 0.0))
    level = sky.radiance.clone()
    level[14:22, 80:100] += 25
    level[30:40, 20:30] += 8
    return EnvironmentMap(level, name="lamps.hdr")


def albedo(reflectance: Reflectance, cosine: Tensor) -> Tensor:
    wo = from_spherical(torch.acos(cosine), torch.zeros_like(cosine))
    wi, angles = hemisphere_nodes(wo)
    values = reflectance.evaluate(wi.reshape(-1, 3), wo[:, None].expand_as(wi).reshape(-1, 3))
    return (values.reshape(*angles.shape, -1) * (wi[..., 2] * angles)[..., None]).sum(1)


def normals(count: int = 400) -> tuple[Tensor, Tensor]:
    """(n, ωo) of unit directions all over the sphere, the viewer above each."""
    generator = torch.Generator().manual_seed(1)
    n, wo = (normalize(torch.randn(count, 3, dtype=torch.float64, generator=generator)) for _ in range(2))
    return n, torch.where((n * wo).sum(1, keepdim=True) > 0, wo, -wo)


@pytest.mark.parametrize("name", ["lafortune-blue-paint", "phong-30", "ward-brushed"])
def test_the_table_keeps_the_albedo(name: str) -> None:
    model = material(name).model
    response = response_of(model)
    assert response.scale.shape == response.diffuse.shape == (COLUMNS, 3)
    assert response.lobes.sum(1).tolist() == pytest.approx([1] * len(response.lobes))
    assert float(response.lobes.min()) >= 0
    if name == "ward-brushed":
        return
    cosine = torch.arange(1, COLUMNS, dtype=torch.float64)[4::8] / (COLUMNS - 1)
    whole = (response.scale + response.diffuse)[5::8]
    assert torch.allclose(whole, albedo(model, cosine), rtol=1.5e-2)


@pytest.mark.parametrize("reflectance", [LAMBERT, material("cook-torrance-plastic").model], ids=["lambert", "plastic"])
def test_in_a_furnace_it_is_the_albedo(reflectance: Reflectance) -> None:
    data = prefiltered(response_of(reflectance), EnvironmentMap.constant(2.0))
    n, wo = normals(60)
    cosine = (n * wo).sum(1)
    seen = cosine > 0.15
    expected = 2 * albedo(reflectance, cosine[seen]).expand(-1, 3)
    assert torch.allclose(data.radiance(n, wo)[seen], expected, rtol=1e-2)


def test_nothing_of_a_matte_surface_is_in_its_lobe() -> None:
    response = response_of(LAMBERT)
    assert float(response.scale.max()) < 2e-4
    assert response.diffuse.flatten().tolist() == pytest.approx([0.6] * COLUMNS, rel=1e-3)


def test_a_matte_surface_has_the_irradiance() -> None:
    """Of L = 1 + s·ω it is π (1 + ⅔ s·n), by the squares and by the coefficients alike."""
    slope = (0.3, 0.4, -0.2)
    data = prefiltered(response_of(LAMBERT), gradient(slope))
    n, wo = normals()
    expected = (1 + 2 / 3 * n @ n.new_tensor(slope))[:, None] * n.new_tensor((1, 2, 3))
    assert torch.allclose(data.radiance(n, wo), 0.6 * expected, rtol=1e-2)
    x, y, z = n.unbind(1)
    basis = torch.stack((torch.ones_like(x), x, y, z, x * y, y * z, z * x, 3 * z * z - 1, x * x - y * y), 1)
    assert torch.allclose(basis @ data.harmonics, expected, rtol=3e-3)
    # A band of the second order: L = 1 + 3z² − 1, E/π = 1 + (3z² − 1)/4.
    sky = gradient((0.0, 0.0, 1.0), 256)
    bent = EnvironmentMap((3 * (sky.radiance[..., :1] - 1) ** 2).clamp_min(0), name="band")
    found = prefiltered(response_of(LAMBERT), bent)
    assert torch.allclose((basis @ found.harmonics)[:, 0], 1 + (3 * z * z - 1) / 4, atol=5e-3)


def test_a_narrow_lobe_shows_the_light_itself() -> None:
    """Where the light changes little over the lobe: L at the mirror direction times the albedo, every way round."""
    slope = (0.3, 0.4, -0.2)
    data = prefiltered(response_of(Planted(blob)), gradient(slope))
    assert data.side == needed_side(response_of(Planted(blob))) >= 64
    n, wo = normals()
    cosine = (n * wo).sum(1)
    clear = cosine > 0.3
    mirror = 2 * cosine[:, None] * n - wo
    share = albedo(Planted(blob), cosine[clear])
    expected = (1 + mirror @ n.new_tensor(slope))[clear, None] * n.new_tensor((1, 2, 3)) * share
    assert torch.allclose(data.radiance(n, wo)[clear], expected, rtol=2e-2)


def test_squares_have_no_seams() -> None:
    """Normals beside the edges and the diagonals of the octahedron give what those on the other side do."""
    data = prefiltered(response_of(material("phong-30").model), lamps())
    n, _ = normals(300)
    n = torch.cat([normalize(torch.where(torch.arange(3) == k, 0.0, n)) for k in range(3)])
    shift = torch.full_like(n, 1e-7)
    one, two = (data.radiance(normalize(n + each), normalize(n + each)) for each in (shift, -shift))
    assert torch.allclose(one, two, rtol=1e-4)


@pytest.mark.parametrize(("name", "most"), [("lafortune-blue-paint", 0.03), ("phong-30", 0.06)])
def test_the_sphere_is_near_the_exact_one(name: str, most: float) -> None:
    model = material(name).model
    exact = render_filtered(model, lamps(), 48)
    several, one = (picture(prefiltered(response_of(model, levels=k), lamps()), 48) for k in (8, 1))
    assert compared(several, exact) < most
    assert compared(several, exact) < compared(one, exact)
    # It would be seen if the light were mirrored or turned.
    for wrong in (lamps().turned(0.5), EnvironmentMap(lamps().radiance.flip(1))):
        assert compared(picture(prefiltered(response_of(model), wrong), 48), exact) > 2 * most


def test_bright_light_is_scaled_into_half_floats() -> None:
    sun = lamps()
    radiance = sun.radiance.clone()
    radiance[10, 20] = 1e7
    bright = EnvironmentMap(radiance, name="sun")
    response = response_of(Planted(blob))
    data = prefiltered(response, bright)
    assert data.factor > 1
    assert 2**14 < float(data.map.max()) <= 2**15
    assert prefiltered(response, sun).factor == 1
    n, wo = normals(50)
    plain = replace(data, map=data.map * data.factor, factor=1.0)
    assert torch.allclose(data.radiance(n, wo), plain.radiance(n, wo))


def test_sides_are_powers_of_two_within_limits() -> None:
    rough, sharp = response_of(LAMBERT), response_of(Planted(blob))
    assert needed_side(sharp) & (needed_side(sharp) - 1) == 0
    narrowest = sharp._replace(lobes=torch.eye(RINGS, dtype=torch.float64)[:1])
    assert needed_side(narrowest) == MOST_SIDE
    assert len(rough.lobes) == 8


def test_what_is_no_picture_is_refused() -> None:
    class Two(Planted):
        channels = ("a", "b")

        def evaluate(self, wi: Tensor, wo: Tensor) -> Tensor:
            return super().evaluate(wi, wo).expand(-1, 2)

    with pytest.raises(BadInput, match="found 2 channels"):
        response_of(Two(blob))
    with pytest.raises(BadInput, match="not finite"):
        response_of(Planted(lambda wi, wo: torch.full_like(wi[:, 0], math.nan)))


MAIN = wgsl_main("values[id.x] = vec4<f32>(sky_reflected(lights[id.x].xyz, viewers[id.x].xyz), 0.0);")


@pytest.fixture(scope="module")
def data() -> Prefiltered:
    found = prefiltered(response_of(material("phong-30").model), lamps())
    return replace(found, table=found.table.float().double(), map=found.map.float().double())


def test_a_gpu_gives_what_python_gives(data: Prefiltered) -> None:
    n, wo = normals(2000)
    code = shader(program_of_light(data, ("light",), 0), WGSL, "sky") + MAIN
    images = [Image.of(each.numpy().astype(np.float32)) for each in (data.table, data.map)]
    found = Gpu().run(code, images, n, wo, 2)[:, :3]
    expected = data.radiance(n, wo).numpy()
    assert np.median(np.abs(found / expected - 1)) < 1e-4
    # A sampler has 256 steps between two texels.
    assert np.quantile(np.abs(found / expected - 1), 0.99) < 2e-2


def test_glsl_and_hlsl_compile(data: Prefiltered, tmp_path: Path) -> None:
    program = program_of_light(data, ("light",), 3)
    value = "sky_reflected(n, wo)"
    main = f"in vec3 n;\nin vec3 wo;\nout vec4 f;\nvoid main() {{\n    f = vec4({value}, 1.0);\n}}\n"
    glslang("#version 300 es\nprecision highp float;\n" + shader(program, GLSL, "sky") + main, tmp_path, "frag")
    text = shader(program, HLSL, "sky")
    assert "sky_texture_1 : register(t4);" in text
    assert "sky_sampler : register(s1);" in text
    main = f"float4 main(float3 n : A, float3 wo : B) : SV_Target\n{{\n    return float4({value}, 1.0);\n}}\n"
    glslang(text + main, tmp_path, "frag", "-D", "-V", "-e", "main")
    assert "@binding(5) var sky_sampler" in shader(program, WGSL, "sky")
