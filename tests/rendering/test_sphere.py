"""Laws of the lit sphere: Lambert's cosine, the furnace, symmetry under turns, the frame."""

import math

import pytest
import torch

from homofact.errors import BadInput
from homofact.rendering.light import DirectionalLight, EnvironmentMap
from homofact.rendering.sphere import render_sphere
from homofact.rendering.surface import RADIUS

ALBEDO = torch.tensor([0.8, 0.5, 0.2], dtype=torch.float64)


class Lambert:
    channels = ("R", "G", "B")
    nbytes = 12
    fetches = 0

    def evaluate(self, wi, wo):
        return (ALBEDO / torch.pi).expand(wi.shape[0], 3)


class Brushed:
    """Ward's lobe (1992), one channel, wide along x and narrow along y; turned by `angle`."""

    channels = ("Y",)
    nbytes = 12
    fetches = 0

    def __init__(self, wide=0.5, narrow=0.1, angle=0.0):
        self.wide, self.narrow, self.angle = wide, narrow, angle

    def evaluate(self, wi, wo):
        h = wi + wo
        h = h / h.norm(dim=1, keepdim=True)
        x = math.cos(self.angle) * h[:, 0] + math.sin(self.angle) * h[:, 1]
        y = math.cos(self.angle) * h[:, 1] - math.sin(self.angle) * h[:, 0]
        lobe = torch.exp(-((x / self.wide) ** 2 + (y / self.narrow) ** 2) / h[:, 2] ** 2)
        level = 4 * math.pi * self.wide * self.narrow * (wi[:, 2] * wo[:, 2]).clamp_min(1e-4).sqrt()
        return (0.2 * lobe / level)[:, None]


class Recorder:
    """Keeps the directions it is asked for."""

    channels = ("Y",)
    nbytes = 0
    fetches = 0

    def __init__(self):
        self.wi, self.wo = [], []

    def evaluate(self, wi, wo):
        self.wi.append(wi)
        self.wo.append(wo)
        return torch.ones(wi.shape[0], 1, dtype=torch.float64)


def normals(size):
    """Normals (H, W, 3) at pixel centres and whether the whole pixel is on the sphere."""
    ticks = ((torch.arange(size, dtype=torch.float64) + 0.5) * 2 / size - 1) / RADIUS
    x, y = torch.meshgrid(ticks, -ticks, indexing="xy")
    squared = x**2 + y**2
    return torch.stack((x, y, (1 - squared).clamp_min(0).sqrt()), 2), squared < (1 - 4 / size) ** 2


@pytest.mark.parametrize("direction", [(0.5, 0.5, 0.7), (-1.0, 0.2, -0.3), (0.0, 0.0, 2.0)])
def test_lambertian_sphere_follows_the_cosine_at_every_pixel(direction):
    light = DirectionalLight(direction, 2.5)
    image = render_sphere(Lambert(), light, 64)
    normal, inside = normals(64)
    towards = torch.tensor(direction, dtype=torch.float64) / math.hypot(*direction)
    cosine = (normal @ towards).clamp_min(0)
    expected = ALBEDO / torch.pi * cosine[..., None] * 2.5
    torch.testing.assert_close(image.radiance[inside], expected[inside], rtol=1e-12, atol=1e-14)
    assert image.radiance.max() > 0


def test_coverage_is_the_area_of_the_disc():
    coverage = render_sphere(Lambert(), size=64).coverage
    disc = math.pi * (RADIUS / 2) ** 2
    assert float(coverage.mean()) == pytest.approx(disc, rel=1e-3)
    assert float(coverage[0, 0]) == 0
    assert float(coverage[32, 32]) == 1
    edge = coverage[(coverage > 0) & (coverage < 1)]
    assert edge.numel() > 100


def test_light_adds_up():
    first, second = DirectionalLight((1, 0, 1), (1.0, 2.0, 3.0)), DirectionalLight((-1, 1, 0.2), 0.5)
    both = render_sphere(Lambert(), [first, second], 32).radiance
    apart = render_sphere(Lambert(), first, 32).radiance + render_sphere(Lambert(), second, 32).radiance
    torch.testing.assert_close(both, apart)
    assert not torch.allclose(both, render_sphere(Lambert(), first, 32).radiance)


def test_batches_do_not_change_the_picture():
    light = DirectionalLight((1, 1, 1))
    whole = render_sphere(Brushed(), light, 32)
    assert torch.equal(whole.radiance, render_sphere(Brushed(), light, 32, batch=7).radiance)
    sky = EnvironmentMap.constant()
    whole = render_sphere(Brushed(), sky, 16, samples=16).radiance
    torch.testing.assert_close(whole, render_sphere(Brushed(), sky, 16, samples=16, batch=40).radiance)


def test_directions_are_unit_and_in_the_local_frame():
    recorder = Recorder()
    render_sphere(recorder, DirectionalLight((0.3, 0.4, 0.8)), 48)
    wi, wo = torch.cat(recorder.wi[1:]), torch.cat(recorder.wo[1:])
    cosine = 0.8 / math.hypot(0.3, 0.4, 0.8)
    assert torch.allclose(wi.norm(dim=1), torch.ones(len(wi), dtype=torch.float64))
    assert torch.allclose(wo.norm(dim=1), torch.ones(len(wo), dtype=torch.float64))
    assert wi[:, 2].min() > 0
    assert wo[:, 2].min() >= 0
    # The angle between light and viewer is the world's, whatever frame it is told in.
    assert torch.allclose((wi * wo).sum(1), torch.full((len(wi),), cosine, dtype=torch.float64))
    # The tangent is horizontal: at the sphere's middle column ωo has no part along it.
    assert (wo[:, 0].abs() < 1e-12).sum() == 0
    recorder = Recorder()
    render_sphere(recorder, DirectionalLight((0, 0, 1)), 49)
    column = torch.cat(recorder.wo[1:])[:, 0]
    assert (column.abs() < 1e-12).sum() >= 40


def test_tangent_runs_along_the_parallels():
    """With t horizontal the lobe that is wide along t is wide from left to right."""
    light = DirectionalLight((0, 0, 1))
    lit = render_sphere(Brushed(), light, 65).radiance[..., 0]
    row, column = lit[32], lit[:, 32]
    assert (row > 0.5 * row.max()).sum() > 2 * (column > 0.5 * column.max()).sum()
    turned = render_sphere(Brushed(angle=math.pi / 2), light, 65).radiance[..., 0]
    assert (turned[:, 32] > 0.5 * turned.max()).sum() > 2 * (turned[32] > 0.5 * turned.max()).sum()


def test_furnace_returns_the_albedo():
    image = render_sphere(Lambert(), EnvironmentMap.constant(3.0), 24, samples=512)
    inside = image.coverage == 1
    expected = (3 * ALBEDO).expand(int(inside.sum()), 3)
    torch.testing.assert_close(image.radiance[inside], expected, rtol=0.06, atol=0)
    torch.testing.assert_close(image.radiance[inside].mean(0), 3 * ALBEDO, rtol=2e-3, atol=0)


@pytest.mark.slow
def test_environment_agrees_with_brute_force_on_a_gloss():
    """Three sets of directions, weighted, against a plain sum over the map's texels."""
    rows = 96
    level = torch.rand(rows // 8, rows // 4, 3, dtype=torch.float64, generator=torch.Generator().manual_seed(5)) ** 4
    fine = level.repeat_interleave(8, 0).repeat_interleave(8, 1)
    ours = render_sphere(Brushed(0.3, 0.2), EnvironmentMap(level), 16, samples=4096)
    colatitude = (torch.arange(rows, dtype=torch.float64) + 0.5) * torch.pi / rows
    azimuth = ((torch.arange(2 * rows, dtype=torch.float64) + 0.5) / (2 * rows) - 0.5) * 2 * torch.pi
    edges = torch.cos(torch.arange(rows + 1, dtype=torch.float64) * torch.pi / rows)
    angle = (edges[:-1] - edges[1:]) * torch.pi / rows
    total = torch.zeros(16, 16, 3, dtype=torch.float64)
    for r in range(0, rows, 1):
        y, around = math.cos(colatitude[r]), math.sin(colatitude[r])
        for c in range(0, 2 * rows, 1):
            strength = tuple((fine[r, c] * angle[r]).tolist())
            direction = (around * math.sin(azimuth[c]), y, -around * math.cos(azimuth[c]))
            if direction[2] > -0.98:
                total += render_brushed(direction) * torch.tensor(strength, dtype=torch.float64)
    inside = ours.coverage == 1
    error = (ours.radiance - total)[inside].norm() / total[inside].norm()
    assert float(error) < 0.02


_NORMAL, _ = normals(16)
_TANGENT = torch.stack((_NORMAL[..., 2], torch.zeros(16, 16).double(), -_NORMAL[..., 0]), 2)
_TANGENT = _TANGENT / _TANGENT.norm(dim=2, keepdim=True)
_BINORMAL = torch.linalg.cross(_NORMAL, _TANGENT)
_FRAME = torch.stack((_TANGENT, _BINORMAL, _NORMAL), 2).reshape(-1, 3, 3)


def render_brushed(direction):
    """Radiance of the brushed sphere under unit light, written out again without the renderer."""
    wi, wo = _FRAME @ torch.tensor(direction, dtype=torch.float64), _FRAME[:, :, 2]
    values = Brushed(0.3, 0.2).evaluate(wi, wo) * wi[:, 2:].clamp_min(0)
    return values.reshape(16, 16, 1)


def test_surroundings_and_viewer_turned_together_show_the_same_sphere():
    level = torch.rand(8, 16, 3, dtype=torch.float64, generator=torch.Generator().manual_seed(1))
    sky, angle = EnvironmentMap(level), 0.7
    still = render_sphere(Brushed(), sky, 16, samples=64)
    view = (math.sin(angle), 0.0, math.cos(angle))
    moved = render_sphere(Brushed(), sky.turned(angle), 16, view=view, samples=64)
    torch.testing.assert_close(moved.radiance, still.radiance, rtol=1e-9, atol=1e-12)
    only_sky = render_sphere(Brushed(), sky.turned(angle), 16, samples=64)
    assert not torch.allclose(only_sky.radiance, still.radiance, rtol=1e-2)


def test_isotropic_material_may_be_turned_about_its_normal():
    level = torch.rand(8, 16, 1, dtype=torch.float64, generator=torch.Generator().manual_seed(1))
    for light in (DirectionalLight((1, 1, 1)), EnvironmentMap(level)):
        first = render_sphere(Brushed(0.3, 0.3), light, 16, samples=64).radiance
        torch.testing.assert_close(first, render_sphere(Brushed(0.3, 0.3, 1.1), light, 16, samples=64).radiance)
        brushed = render_sphere(Brushed(0.3, 0.1), light, 16, samples=64).radiance
        assert not torch.allclose(
            brushed, render_sphere(Brushed(0.3, 0.1, 1.1), light, 16, samples=64).radiance, rtol=1e-2
        )


def test_the_seed_decides_the_grain():
    sky = EnvironmentMap.constant()
    first = render_sphere(Lambert(), sky, 16, samples=16, seed=4).radiance
    assert torch.equal(first, render_sphere(Lambert(), sky, 16, samples=16, seed=4).radiance)
    assert not torch.equal(first, render_sphere(Lambert(), sky, 16, samples=16, seed=5).radiance)


class Spectral:
    channels = tuple(f"{400 + 10 * k}nm" for k in range(31))
    nbytes = 0
    fetches = 0

    def evaluate(self, wi, wo):
        return torch.linspace(0.1, 0.4, 31, dtype=torch.float64).expand(wi.shape[0], 31)


def test_spectra_become_colours_by_matrix_or_callable():
    matrix = torch.rand(3, 31, dtype=torch.float64, generator=torch.Generator().manual_seed(2))
    by_matrix = render_sphere(Spectral(), size=16, to_rgb=matrix).radiance
    by_call = render_sphere(Spectral(), size=16, to_rgb=lambda values: values @ matrix.T).radiance
    torch.testing.assert_close(by_matrix, by_call)
    # n = (0, 0, 1) nearly in the middle of an even picture; the ratio of channels is exact everywhere.
    colour = matrix @ torch.linspace(0.1, 0.4, 31, dtype=torch.float64)
    torch.testing.assert_close(by_matrix[8, 8] / by_matrix[8, 8, 0], colour / colour[0])


class Broken(Spectral):
    channels = ("Y",)

    def evaluate(self, wi, wo):
        return torch.full((wi.shape[0], 1), torch.nan, dtype=torch.float64)


@pytest.mark.parametrize(
    ("words", "call"),
    [
        ("found 31 channels", lambda: render_sphere(Spectral(), size=16)),
        (
            "shape \\(3, 30\\), expected \\(3, 31\\)",
            lambda: render_sphere(Spectral(), to_rgb=torch.ones(3, 30)),
        ),
        ("not finite at wi", lambda: render_sphere(Broken(), size=16)),
        ("size: found 7", lambda: render_sphere(Lambert(), size=7)),
        ("samples: found 2", lambda: render_sphere(Lambert(), samples=2)),
        ("lights: found none", lambda: render_sphere(Lambert(), [])),
        ("found 2 channels", lambda: render_sphere(Lambert(), DirectionalLight((0, 0, 1), (1.0, 2.0)))),
        ("view: found", lambda: render_sphere(Lambert(), view=(0.0, 0.0, 0.0))),
    ],
)
def test_bad_input_is_one_line(words, call):
    with pytest.raises(BadInput, match=words) as caught:
        call()
    assert "\n" not in str(caught.value)
