"""The density of directions: it is one, it follows the lobe, and it lowers the variance. No Mitsuba is needed."""

import math

import pytest
import torch
from torch import Tensor

from homofact.brdf.log_transform import LogTransform
from homofact.brdf.materials import material
from homofact.brdf.reflectance import Reflectance
from homofact.factor.factorization import Factorization, Term
from homofact.factor.projection import fixed_projection
from homofact.geometry.directions import draw_uniform, from_spherical
from homofact.rendering.lobe_sampling import LEAST, LobeSampling, lobe_sampling

ANGLES = (0.0, 30.0, 60.0, 80.0)


class Planted:
    """f = exp(−(θh/width)²)·peak + base, or with a width along x and another along y."""

    channels = ("Y",)
    nbytes = 0
    fetches = 0

    def __init__(self, across: float, along: float, base: float = 0.0) -> None:
        self.across, self.along, self.base = across, along, base

    def evaluate(self, wi: Tensor, wo: Tensor) -> Tensor:
        half = wi + wo
        slope = half[:, :2] / half[:, 2:]
        exponent = (slope[:, 0] / self.across) ** 2 + (slope[:, 1] / self.along) ** 2
        above = (wi[:, 2] > 0) & (wo[:, 2] > 0)
        return ((torch.exp(-exponent) + self.base) * above)[:, None]


def at(degrees: float, azimuth: float = 0.4) -> Tensor:
    theta, phi = torch.tensor([math.radians(degrees), azimuth], dtype=torch.float64)
    return from_spherical(theta, phi)


def hemisphere(rows: int = 400, columns: int = 480) -> tuple[Tensor, Tensor]:
    """Directions (N, 3) and their solid angles (N,): the midpoint rule."""
    theta = (torch.arange(rows, dtype=torch.float64) + 0.5) * (math.pi / 2 / rows)
    phi = (torch.arange(columns, dtype=torch.float64) + 0.5) * (2 * math.pi / columns)
    grid = torch.meshgrid(theta, phi, indexing="ij")
    angle = torch.sin(grid[0]) * (math.pi / 2 / rows * 2 * math.pi / columns)
    return from_spherical(*grid).reshape(-1, 3), angle.reshape(-1)


def variances(reflectance: Reflectance, mixture: LobeSampling, wo: Tensor) -> tuple[float, float]:
    """Relative variance of f cosθ/p, one direction a sample, for the mixture and for the cosine alone."""
    wi, angle = hemisphere()
    seen = wo.expand_as(wi)
    value = (reflectance.evaluate(wi, seen) * wi[:, 2:]).mean(1)
    albedo = float((value * angle).sum())
    found = []
    for density in (mixture.density(wi, seen), wi[:, 2] / math.pi):
        found.append(float((value**2 / density * angle).sum()) / albedo**2 - 1)
    return found[0], found[1]


def wide(rows: int, columns: int, channels: int = 3) -> Factorization:
    """One texture over h, the same everywhere."""
    texture = torch.zeros(rows, columns, channels, dtype=torch.float64)
    term = Term(fixed_projection("h", True), texture, torch.ones(rows, columns, dtype=torch.bool))
    return Factorization((term,), LogTransform(1e-5, torch.ones(channels, dtype=torch.float64)), ("R", "G", "B"))


@pytest.mark.parametrize("planted", [Planted(0.1, 0.1), Planted(0.05, 0.3)], ids=["isotropic", "anisotropic"])
def test_the_density_of_half_vectors_is_one(planted: Planted) -> None:
    mixture = lobe_sampling(planted, planted.across == planted.along)
    h, angle = hemisphere(2000, 96)
    assert float((mixture.half_density(h) * angle).sum()) == pytest.approx(1, abs=2e-3)


@pytest.mark.parametrize("degrees", ANGLES)
@pytest.mark.parametrize("name", ["lafortune-blue-paint", "blinn-phong-50"])
def test_the_density_integrates_to_one_less_what_falls_under_the_horizon(name: str, degrees: float) -> None:
    mixture = lobe_sampling(material(name).model, True)
    wi, angle = hemisphere()
    found = float((mixture.density(wi, at(degrees).expand_as(wi)) * angle).sum())
    # The loss itself, by mirroring wo at half vectors of the table's density.
    h, solid = hemisphere(2000, 96)
    wo = at(degrees)
    towards = h @ wo
    under = (2 * towards * h[:, 2] - wo[2] <= 0) | (towards <= 0)
    lost = float((mixture.half_density(h) * solid)[under].sum())
    share = float(mixture.cosine_share(wo[None]))
    assert found == pytest.approx(1 - (1 - share) * lost, abs=4e-3)
    assert found <= 1 + 1e-3


@pytest.mark.parametrize(("width", "apart"), [(0.01, 0.05), (0.08, 0.5)])
def test_a_planted_lobe_is_found(width: float, apart: float) -> None:
    """g → exp(−(tanθh/w)²)/(πw²) as w → 0: the share of viewers that graze, and see one flank alone, goes as w."""
    mixture = lobe_sampling(Planted(width, width), True)
    slopes = torch.tensor([0.0, width, 2 * width], dtype=torch.float64)
    g = mixture.half_density(from_spherical(torch.atan(slopes), torch.zeros(3, dtype=torch.float64)))
    expected = torch.exp(-((slopes / width) ** 2)) / (math.pi * width**2)
    assert g.tolist() == pytest.approx(expected.tolist(), rel=apart)
    assert float(mixture.cosine.max()) == pytest.approx(LEAST)


def test_an_anisotropic_lobe_is_found() -> None:
    mixture = lobe_sampling(Planted(0.05, 0.3), False)
    theta = torch.full((2,), math.atan(0.1), dtype=torch.float64)
    g = mixture.half_density(from_spherical(theta, torch.tensor([0.0, math.pi / 2], dtype=torch.float64)))
    assert not mixture.isotropic
    assert float(g[0] / g[1]) == pytest.approx(math.exp(-4 + 1 / 9), rel=0.3)


def test_the_density_is_the_same_at_every_azimuth_where_the_material_is_isotropic() -> None:
    mixture = lobe_sampling(material("phong-30").model, True)
    wi, wo = draw_uniform(200, torch.Generator().manual_seed(0))
    cosine, sine = math.cos(1.1), math.sin(1.1)
    turn = torch.tensor([[cosine, sine, 0], [-sine, cosine, 0], [0, 0, 1]], dtype=torch.float64)
    assert torch.allclose(mixture.density(wi, wo), mixture.density(wi @ turn, wo @ turn), rtol=1e-9)


def test_the_first_and_the_last_column_are_one_direction() -> None:
    mixture = lobe_sampling(material("ward-brushed").model, False)
    phi = torch.tensor([-1e-9, 1e-9], dtype=torch.float64)
    g = mixture.half_density(from_spherical(torch.full((2,), 0.3, dtype=torch.float64), phi))
    assert float(g[0]) == pytest.approx(float(g[1]), rel=1e-6)


def test_a_diffuse_material_is_left_to_the_cosine() -> None:
    mixture = lobe_sampling(wide(4, 4), False)
    assert float(mixture.cosine.min()) > 0.4
    for degrees in ANGLES:
        assert variances(wide(4, 4), mixture, at(degrees))[0] < 0.03


@pytest.mark.parametrize(
    ("name", "isotropic", "times"),
    [("phong-30", True, 10), ("blinn-phong-50", True, 10), ("ward-brushed", False, 100)],
)
def test_a_sharp_lobe_is_drawn_with_a_fraction_of_the_variance(name: str, isotropic: bool, times: float) -> None:
    model = material(name).model
    mixture = lobe_sampling(model, isotropic)
    for degrees in ANGLES[:3]:
        ours, cosine = variances(model, mixture, at(degrees))
        assert ours < cosine / times
    ours, cosine = variances(model, mixture, at(80.0))
    assert ours < cosine / 2


@pytest.mark.parametrize("name", ["lafortune-blue-paint", "lafortune-clay", "cook-torrance-plastic"])
def test_weights_are_bounded(name: str) -> None:
    """P ≥ LEAST cosθ/π: no weight is above π f/LEAST."""
    model = material(name).model
    mixture = lobe_sampling(model, True)
    wi, wo = draw_uniform(20_000, torch.Generator().manual_seed(1))
    assert bool((mixture.density(wi, wo) >= LEAST * wi[:, 2] / math.pi * (1 - 1e-9)).all())
    assert float(mixture.cosine.max()) <= 1


def test_nothing_to_reflect_is_left_to_the_cosine() -> None:
    class Black(Planted):
        def evaluate(self, wi: Tensor, wo: Tensor) -> Tensor:
            return 0 * super().evaluate(wi, wo)

    mixture = lobe_sampling(Black(0.1, 0.1), True)
    wi, wo = draw_uniform(100, torch.Generator().manual_seed(2))
    assert torch.allclose(mixture.density(wi, wo), wi[:, 2] / math.pi)


def test_nothing_is_drawn_under_the_horizon() -> None:
    mixture = lobe_sampling(Planted(0.2, 0.2), True)
    above, below = at(40.0), torch.tensor([0.6, 0.0, -0.8], dtype=torch.float64)
    pairs = torch.stack((above, below)), torch.stack((below, above))
    assert mixture.density(*pairs).tolist() == [0, 0]
    assert float(mixture.half_density(below[None])) == 0


def test_what_is_isotropic() -> None:
    assert not wide(3, 3).evaluation.isotropic
    texture, mask = torch.zeros(3, 3, 3, dtype=torch.float64), torch.ones(3, 3, dtype=torch.bool)
    terms = tuple(
        Term(fixed_projection(name, True), texture, mask) for name in ("theta_h-theta_d", "theta_i-delta_phi")
    )
    transform = LogTransform(1e-5, torch.ones(3, dtype=torch.float64))
    assert Factorization(terms, transform, ("R", "G", "B")).evaluation.isotropic
    assert not Factorization((*terms, *wide(3, 3).terms), transform, ("R", "G", "B")).evaluation.isotropic
