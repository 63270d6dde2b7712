"""What everything that reflects must do. A new one joins `MEMBERS` by a line: how it is made, which symmetries it has.

`isotropic` is whether turning both directions about the normal together leaves the value alone, `reciprocal` whether
exchanging them does; both are held to be true and to be said truly, where the thing says it.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
import torch
from rgl_files import rough
from shading_cases import CASES, SEPARABLE
from torch import Tensor

from homofact.brdf.analytic import AshikhminShirley, Lambert, Ward
from homofact.brdf.channels import LuminanceOf, OneChannel
from homofact.brdf.log_transform import LogTransform
from homofact.brdf.materials import MATERIALS, material
from homofact.brdf.merl import MerlGrid, MerlTable
from homofact.brdf.neural import LAYERS, NeuralBrdf
from homofact.brdf.reflectance import Reflectance
from homofact.brdf.rgl import AdaptiveTable
from homofact.brdf.sampling import sample_model
from homofact.brdf.scattered import GLOBAL_LIMIT, Scattered
from homofact.brdf.table import AngleTable, TableAxis
from homofact.brdf.wavelengths import spectral_names
from homofact.containers.formats import format_named
from homofact.exporting.exported import exported, write_exported
from homofact.exporting.exported_reader import open_exported
from homofact.factor.factorization import Factorization, Term
from homofact.factor.projection import fixed_projection
from homofact.factor.spectral_basis import SpectralBasis
from homofact.factor.spectral_fit import SpectralFit
from homofact.geometry.directions import draw_uniform
from homofact.separable.resampling import LocalPlanes
from homofact.separable.separable import Separable
from homofact.theory.in_out import DirectionGrid, decompose

GREY = (0.2, 0.3, 0.4)
RGB = ("R", "G", "B")


@dataclass(frozen=True)
class Member:
    """How one is made (given a folder that it may write in), its symmetries, and how far float32 may be off.

    `single` is the largest |float32 − float64| in units of the mean value, at all but 1 in 100 pairs: at the edge of
    a table's bin rounding may choose the other side.
    """

    make: Callable[[Path], Reflectance]
    isotropic: bool = True
    reciprocal: bool = True
    single: float = 1e-3


def adaptive(*degrees: float) -> AdaptiveTable:
    fields = rough(degrees)
    tensors = {name: torch.from_numpy(array.copy()) for name, array in fields.items()}
    table = tensors["rgb"].movedim(2, -1).contiguous()
    angles = (tensors["theta_i"], tensors["phi_i"])
    return AdaptiveTable(*angles, tensors["ndf"], tensors["sigma"], tensors["vndf"], table, True, RGB)


def merl(lookup: str, shape: tuple[int, int, int] = (6, 8, 16)) -> MerlTable:
    """Random entries, some of them not measured; φd over the half turn, or the whole one for (·, n, 4n)."""
    generator = np.random.default_rng(0)
    raw = generator.lognormal(3, 1, (3, *shape))
    raw[:, generator.random(shape) < 0.1] = -1
    assert MerlGrid(shape).count == raw[0].size
    return MerlTable(torch.from_numpy(raw), lookup)  # type: ignore[arg-type]


def network() -> NeuralBrdf:
    """Random weights, and last biases that keep every channel above zero."""
    generator = np.random.default_rng(0)
    w0, w1, w2 = (torch.from_numpy(generator.normal(0, 0.2, shape).astype("f4")) for shape in LAYERS)
    b0, b1, b2 = (torch.from_numpy(generator.normal(0, 0.5, shape[1]).astype("f4")) for shape in LAYERS)
    return NeuralBrdf((w0, w1, w2), (b0, b1, b2.abs() + 1))


def angle_table(isotropic: bool) -> AngleTable:
    def rise(n: int, end: float) -> Tensor:
        return torch.linspace(0, end, n, dtype=torch.float64)

    theta = TableAxis(rise(5, 1.4))
    turn = TableAxis(rise(7, 2 * math.pi)[:-1], periodic=True)
    axes = (theta, theta, TableAxis(rise(5, math.pi))) if isotropic else (theta, turn, theta, turn)
    shape = (*(len(axis.nodes) for axis in axes), 3)
    return AngleTable(axes, torch.from_numpy(np.random.default_rng(1).random(shape)), RGB)


def scattered(name: str, count: int) -> Scattered:
    return Scattered(sample_model(material(name).model, count))


def terms_of(name: str) -> Reflectance:
    return decompose(material(name).model, DirectionGrid(6, 12, math.pi / 2)).truncated(3)


def read_back(fitted: Factorization | Separable, name: str) -> Callable[[Path], Reflectance]:
    """The export of a fit in a texture format, written and read again."""

    def make(folder: Path) -> Reflectance:
        write_exported(folder / "out", exported(fitted, format_named(name)), {}, False)
        return open_exported(folder / "out")

    return make


def spectral() -> SpectralFit:
    """Seven bands by three vectors, on an isotropic projection."""
    drawn = np.random.default_rng(2)
    term = Term(fixed_projection("theta_h-theta_d", True), drawn.normal(0, 0.5, (6, 5, 3)), np.ones((6, 5), bool))
    basis = SpectralBasis(drawn.normal(0, 0.5, (3, 7)), drawn.normal(0, 0.2, 7), drawn.normal(0, 0.5, (7, 3)))
    transform = LogTransform(1e-3, drawn.uniform(0.1, 0.3, 7))
    return SpectralFit((term,), basis, transform, spectral_names(range(400, 701, 50)))


ANISOTROPIC = ("ward-brushed", "ashikhmin-shirley-wang")
MEMBERS: dict[str, Member] = {
    name: Member(lambda _, model=item.model: model, isotropic=name not in ANISOTROPIC)
    for name, item in MATERIALS.items()
} | {
    "lambert": Member(lambda _: Lambert(GREY)),
    "ward-isotropic": Member(lambda _: Ward(GREY, GREY, 0.1, 0.1)),
    "ashikhmin-shirley-isotropic": Member(lambda _: AshikhminShirley(GREY, GREY, 30, 30)),
    "network": Member(lambda _: network()),
    "merl, linear": Member(lambda _: merl("linear")),
    "merl, nearest": Member(lambda _: merl("nearest")),
    "merl, whole turn": Member(lambda _: merl("linear", (6, 4, 16)), reciprocal=False),
    "angle table": Member(lambda _: angle_table(True), reciprocal=False),
    "angle table, anisotropic": Member(lambda _: angle_table(False), isotropic=False, reciprocal=False),
    "adaptive table": Member(lambda _: adaptive(0.0), reciprocal=False),
    "adaptive table, anisotropic": Member(lambda _: adaptive(-180, -90, 0, 90, 180), False, False),
    "scattered": Member(lambda _: scattered("lafortune-blue-paint", 300)),
    "scattered, by neighbours": Member(lambda _: scattered("lafortune-blue-paint", GLOBAL_LIMIT + 100)),
    "scattered, anisotropic": Member(lambda _: scattered("ward-brushed", 300), False),
    "local planes": Member(lambda _: LocalPlanes(sample_model(material("ward-brushed").model, 300)), False),
    "local planes, not reciprocal": Member(
        lambda _: LocalPlanes(sample_model(material("ward-brushed").model, 300), False), False, False
    ),
    "luminance": Member(lambda _: LuminanceOf(material("phong-10").model)),
    "one channel": Member(lambda _: OneChannel(material("phong-10").model, "G")),
    "terms of in-out, isotropic": Member(lambda _: terms_of("phong-10")),
    "terms of in-out, anisotropic": Member(lambda _: terms_of("ward-brushed"), isotropic=False),
} | {
    f"factorization, {name}": Member(
        lambda _, fitted=fitted: fitted,
        all(term.projection.system.isotropic for term in fitted.terms),
        "not reciprocal" not in name and name not in ("fixed wi", "McCool, one channel"),
    )
    for name, fitted in CASES.items()
    if not name.startswith("fixed") or name in ("fixed h", "fixed d", "fixed wi", "fixed theta_i", "fixed theta_h")
} | {
    f"separable, {name}": Member(lambda _, fitted=fitted: fitted, False, "shared" in name)
    for name, fitted in SEPARABLE.items()
} | {
    f"export, {name}": Member(read_back(CASES["warped isotropic half-diff"], name)) for name in ("exr", "ktx2", "png8")
} | {
    "spectral basis": Member(lambda _: spectral()),
    "export, blocks": Member(read_back(SEPARABLE["in-out, parabolic, shared"], "bc6h"), isotropic=False),
}  # fmt: skip
# A fixed "wi" texture is looked up at ωo, too, where it is reciprocal: the conjugate.
MEMBERS["factorization, fixed wi"] = Member(lambda _: CASES["fixed wi"], isotropic=False)
MEMBERS["factorization, McCool, one channel"] = Member(lambda _: CASES["McCool, one channel"], isotropic=False)


@pytest.fixture(scope="module", params=MEMBERS, ids=list(MEMBERS))
def member(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> tuple[Member, Reflectance]:
    chosen = MEMBERS[request.param]
    return chosen, chosen.make(tmp_path_factory.mktemp("member"))


def pairs(count: int = 400, seed: int = 3) -> tuple[Tensor, Tensor]:
    return draw_uniform(count, torch.Generator().manual_seed(seed))


def turned(w: Tensor, angle: float) -> Tensor:
    cos, sin = math.cos(angle), math.sin(angle)
    return torch.stack((cos * w[:, 0] - sin * w[:, 1], sin * w[:, 0] + cos * w[:, 1], w[:, 2]), 1)


def same(one: Tensor, other: Tensor) -> bool:
    """Alike but for rounding."""
    return bool(((one - other).abs() <= 1e-8 * (one.abs() + one.abs().mean())).all())


def test_it_says_what_it_is_and_costs(member: tuple[Member, Reflectance]) -> None:
    stated, reflectance = member
    assert isinstance(reflectance, Reflectance)
    assert isinstance(reflectance.channels, tuple)
    assert len(set(reflectance.channels)) == len(reflectance.channels) > 0
    assert all(isinstance(name, str) and name for name in reflectance.channels)
    assert type(reflectance.nbytes) is int
    assert type(reflectance.fetches) is int
    assert reflectance.nbytes >= len(reflectance.channels)
    assert reflectance.fetches >= 0
    assert getattr(reflectance, "isotropic", stated.isotropic) == stated.isotropic


def test_values_are_finite_not_negative_and_not_all_zero(member: tuple[Member, Reflectance]) -> None:
    _, reflectance = member
    wi, wo = pairs()
    values = reflectance.evaluate(wi, wo)
    assert values.shape == (400, len(reflectance.channels))
    assert values.dtype == torch.float64
    assert bool(torch.isfinite(values).all())
    assert float(values.min()) >= 0
    assert bool((values > 0).any(0).all())
    assert torch.equal(reflectance.evaluate(wi, wo), values)


def test_grazing_normal_and_back_to_back_are_finite(member: tuple[Member, Reflectance]) -> None:
    edge = math.pi / 2
    spherical = [(t, p) for t in (0, 1e-9, 0.5, edge - 1e-9) for p in (0, 1.0, math.pi)]
    places = [(math.sin(t) * math.cos(p), math.sin(t) * math.sin(p), math.cos(t)) for t, p in spherical]
    places += [(1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0.6, 0.8, 0)]
    w = torch.tensor(places, dtype=torch.float64)
    wi, wo = w.repeat_interleave(len(w), 0), w.repeat(len(w), 1)
    for dtype in (torch.float64, torch.float32):
        values = member[1].evaluate(wi.to(dtype), wo.to(dtype))
        assert bool(torch.isfinite(values).all())
        assert float(values.min()) >= 0


def test_nothing_is_reflected_under_the_horizon(member: tuple[Member, Reflectance]) -> None:
    _, reflectance = member
    wi, wo = pairs()
    down = torch.tensor([1.0, 1.0, -1.0], dtype=torch.float64)
    # One side after the other, and among pairs that are above.
    mixed = torch.where(torch.arange(400)[:, None] % 2 == 0, wo * down, wo)
    above = reflectance.evaluate(wi, wo)
    for one, other in ((wi, mixed), (mixed, wi), (wi * down, wo * down)):
        values = reflectance.evaluate(one, other)
        under = (one[:, 2] < 0) | (other[:, 2] < 0)
        assert bool((values[under] == 0).all())
        assert torch.equal(torch.signbit(values[under]), torch.zeros_like(values[under], dtype=torch.bool))
    assert same(reflectance.evaluate(wi, mixed)[1::2], above[1::2])


def test_the_dtype_is_that_of_the_directions(member: tuple[Member, Reflectance]) -> None:
    stated, reflectance = member
    wi, wo = pairs()
    double, single = reflectance.evaluate(wi, wo), reflectance.evaluate(wi.float(), wo.float())
    assert single.dtype == torch.float32
    off = (single.double() - double).abs().amax(1) / double.mean()
    assert float(torch.quantile(off, 0.99)) < stated.single


def test_no_pairs_give_no_values(member: tuple[Member, Reflectance]) -> None:
    _, reflectance = member
    for dtype in (torch.float64, torch.float32):
        none = torch.zeros(0, 3, dtype=dtype)
        values = reflectance.evaluate(none, none)
        assert values.shape == (0, len(reflectance.channels))
        assert values.dtype == dtype


def test_a_pair_does_not_depend_on_those_beside_it(member: tuple[Member, Reflectance]) -> None:
    _, reflectance = member
    wi, wo = pairs()
    whole = reflectance.evaluate(wi, wo)
    one_by_one = torch.cat([reflectance.evaluate(wi[k : k + 1], wo[k : k + 1]) for k in range(12)])
    assert torch.allclose(one_by_one, whole[:12], rtol=1e-9, atol=1e-12)
    assert torch.allclose(reflectance.evaluate(wi.flip(0), wo.flip(0)).flip(0), whole, rtol=1e-9, atol=1e-12)


def test_strided_directions_are_read_right_and_left_alone(member: tuple[Member, Reflectance]) -> None:
    _, reflectance = member
    wi, wo = pairs()
    expected = reflectance.evaluate(wi, wo)
    # Columns of one table, every second row of it: neither rows nor columns are next to each other.
    table = torch.stack((torch.cat((wi, wo), 1), torch.full((400, 6), torch.nan, dtype=torch.float64)), 1)
    table = table.reshape(800, 6).T.contiguous().T
    one, other = table[::2, :3], table[::2, 3:]
    before = table.clone()
    assert not one.is_contiguous()
    assert torch.allclose(reflectance.evaluate(one, other), expected, rtol=1e-9, atol=1e-12)
    assert torch.equal(table.nan_to_num(), before.nan_to_num())
    # A view that repeats a row without holding it twice.
    light = wi[:1].expand(400, 3)
    assert torch.allclose(
        reflectance.evaluate(light, wo), reflectance.evaluate(light.clone(), wo), rtol=1e-9, atol=1e-12
    )


def test_a_result_is_the_callers_to_change(member: tuple[Member, Reflectance]) -> None:
    _, reflectance = member
    wi, wo = pairs(50)
    first = reflectance.evaluate(wi, wo)
    kept = first.clone()
    first[:] = -1
    assert torch.equal(reflectance.evaluate(wi, wo), kept)


def test_it_is_reciprocal_where_it_is_said_to_be(member: tuple[Member, Reflectance]) -> None:
    stated, reflectance = member
    wi, wo = pairs()
    assert same(reflectance.evaluate(wi, wo), reflectance.evaluate(wo, wi)) is stated.reciprocal


@pytest.mark.parametrize("angle", [0.9, math.pi / 2, 4.0])
def test_it_is_isotropic_where_it_is_said_to_be(member: tuple[Member, Reflectance], angle: float) -> None:
    stated, reflectance = member
    wi, wo = pairs()
    moved = reflectance.evaluate(turned(wi, angle), turned(wo, angle))
    assert same(reflectance.evaluate(wi, wo), moved) is stated.isotropic
