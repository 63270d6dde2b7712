"""The expressions of the coordinates against the vectors' own definitions, at random and at awkward directions.

The references here are written from `directions` (half_difference, to_spherical), which share nothing with the
expressions.
"""

import itertools
import math

import numpy as np
import pytest
import torch
from refusals import refused
from torch import Tensor

from homofact.geometry.axes import MAPS, map_axes
from homofact.geometry.coordinates import COORDINATES, axes_of
from homofact.geometry.directions import draw_uniform, from_spherical, half_difference, to_spherical
from homofact.geometry.expression import call, constant, fetch, variable, vector
from homofact.geometry.interpret import value_of
from homofact.geometry.parabolic import to_disc
from homofact.geometry.torch_functions import TORCH
from homofact.separable.maps import direction_map


def at(theta: float, phi: float) -> list[float]:
    return from_spherical(*torch.tensor([theta, phi], dtype=torch.float64)).tolist()


GRAZING = math.pi / 2 - 1e-5
PLACES = [at(theta, phi) for theta in (0.0, 1e-9, 1e-4, 0.7, GRAZING) for phi in (0.0, 0.3, 2.0, math.pi, -1.2)]
EDGES = torch.tensor(list(itertools.product(PLACES, PLACES)), dtype=torch.float64)
RANDOM = draw_uniform(20_000, torch.Generator().manual_seed(7))
PAIRS = {
    "random": RANDOM,
    "edges": (EDGES[:, 0], EDGES[:, 1]),
    "equal": (RANDOM[0], RANDOM[0]),
    "mirrored": (RANDOM[0], RANDOM[0] * torch.tensor([-1.0, -1.0, 1.0], dtype=torch.float64)),
    "almost equal": (RANDOM[0], RANDOM[0] + 1e-9 * RANDOM[1]),
}
ALL = pytest.mark.parametrize("pairs", PAIRS.values(), ids=list(PAIRS))


def unit(pairs: tuple[Tensor, Tensor]) -> tuple[Tensor, Tensor]:
    return pairs[0] / pairs[0].norm(dim=1, keepdim=True), pairs[1] / pairs[1].norm(dim=1, keepdim=True)


@ALL
def test_discs(pairs: tuple[Tensor, Tensor]) -> None:
    wi, wo = unit(pairs)
    h, d = half_difference(wi, wo)
    assert torch.allclose(COORDINATES["in-out"].evaluate(wi, wo), torch.cat((to_disc(wi), to_disc(wo)), 1), atol=1e-14)
    found, expected = COORDINATES["half-diff"].evaluate(wi, wo), torch.cat((to_disc(h), to_disc(d)), 1)
    # Half vectors along the tangent, in the last 1e-4 rad over the horizon, turn the frame by all there is of it.
    steady = (h[:, 1:].norm(dim=1) > 1e-4) & (wi[:, 2] + wo[:, 2] > 1e-6)
    assert float(steady.double().mean()) > 0.9
    assert torch.allclose(found[steady], expected[steady], atol=1e-9)
    assert torch.allclose(found[:, :2], expected[:, :2], atol=1e-6)
    assert bool(torch.isfinite(found).all())


@ALL
def test_angles(pairs: tuple[Tensor, Tensor]) -> None:
    wi, wo = unit(pairs)
    h, _ = half_difference(wi, wo)
    names = ("theta_i", "theta_o", "theta_h", "theta_d", "phi_d", "delta_phi", "phi_h", "azimuth_d")
    found: dict[str, Tensor] = dict(zip(names, axes_of(names, wi, wo).unbind(1), strict=True))
    across = h[:, 0] * wi[:, 1] - h[:, 1] * wi[:, 0]
    along = (wi * h).sum(1) * h[:, 2] - wi[:, 2]
    apart = torch.linalg.cross(wi, wo).norm(dim=1)
    expected = {
        "theta_i": to_spherical(wi)[0],
        "theta_o": to_spherical(wo)[0],
        "theta_h": to_spherical(h)[0],
        "theta_d": torch.atan2(apart, (wi * wo).sum(1)) / 2,
    }
    for name, angle in expected.items():
        assert float((found[name] - angle).abs().max()) < 1e-8, name
    # An azimuth about an axis that is nearly wi's own is rounding alone.
    clear = (across**2 + along**2).sqrt() > 1e-7
    turn = torch.atan2(across, along)[clear]
    if bool(clear.any()):
        assert float((torch.exp(1j * found["azimuth_d"][clear]) - torch.exp(1j * turn)).abs().max()) < 1e-6
        folded = torch.atan2(across.abs(), along.abs())[clear]
        assert float((found["phi_d"][clear] - folded).abs().max()) < 1e-6
    standing = (wi[:, :2].norm(dim=1) > 1e-7) & (wo[:, :2].norm(dim=1) > 1e-7)
    phi = to_spherical(wi)[1] - to_spherical(wo)[1]
    assert float((torch.cos(found["delta_phi"]) - torch.cos(phi))[standing].abs().max()) < 1e-6
    assert 0 <= float(found["delta_phi"].min()) <= float(found["delta_phi"].max()) <= math.pi


def test_at_normal_incidence_an_isotropic_coordinate_does_not_know_the_azimuth() -> None:
    normal = torch.tensor([[0.0, 0.0, 1.0]], dtype=torch.float64).expand(8, 3)
    phi = torch.linspace(-3, 3, 8, dtype=torch.float64)
    around = from_spherical(torch.full_like(phi, 0.5), phi)
    for name in ("isotropic-half-diff", "isotropic-in-out"):
        for pair in ((normal, around), (around, normal)):
            x = COORDINATES[name].evaluate(*pair)
            assert torch.allclose(x, x[:1].expand_as(x), atol=1e-12), name


@pytest.mark.parametrize("name", MAPS)
def test_direction_maps_go_back(name: str) -> None:
    chosen = direction_map(name)
    w = RANDOM[0]
    assert torch.allclose(chosen.from_square(chosen.to_square(w)), w, atol=1e-9)
    wi, wo = RANDOM
    _, d = half_difference(wi, wo)
    found = axes_of(map_axes(name, "d"), wi, wo, chosen.scales)
    assert torch.allclose(chosen.from_square(found), d, atol=1e-9)


@pytest.mark.parametrize("width", [0.01, 0.3])
def test_a_warp_is_the_same_before_and_after(width: float) -> None:
    for name in ("half-diff", "isotropic-half-diff"):
        system = COORDINATES[name]
        stretched = system.stretch(system.evaluate(*RANDOM), width)
        assert torch.allclose(system.evaluate(*RANDOM, width), stretched, atol=1e-9)
    radius = to_disc(half_difference(*RANDOM)[0]).norm(dim=1)
    expected = torch.asinh(radius / width) / math.asinh(1 / width)
    assert torch.allclose(COORDINATES["half-diff"].evaluate(*RANDOM, width)[:, :2].norm(dim=1), expected, atol=1e-9)
    with refused(where="warp", found="the coordinates u_i, v_i, u_o, v_o"):
        COORDINATES["in-out"].evaluate(*RANDOM, width)


def test_any_leading_shape_and_type() -> None:
    wi, wo = (w[:24] for w in RANDOM)
    for system in COORDINATES.values():
        flat = system.evaluate(wi, wo)
        assert torch.equal(system.evaluate(wi.reshape(2, 3, 4, 3), wo.reshape(2, 3, 4, 3)).reshape(24, -1), flat)
        single = system.evaluate(wi.float(), wo.float())
        assert single.dtype == torch.float32
        assert torch.allclose(single.double(), flat, atol=1e-4)


def test_the_walk_over_expressions() -> None:
    x, y = torch.tensor([1.5, -2.25]), torch.tensor([0.5, 4.0])
    v, s = variable("v", 2), variable("s", 1)
    values = {"v": [x, y], "s": [y]}
    cases = [
        (v * s + 1, [x * y + 1, y * y + 1]),
        (1 - v / constant(2, 4), [1 - x / 2, 1 - y / 4]),
        (call("dot", v, v.yx), [2 * x * y]),
        (vector(v.y, call("max", 1.0, s), call("min", v.x, s)), [y, y.clamp_min(1), torch.minimum(x, y)]),
        (call("fract", v.x), [torch.tensor([0.5, 0.75])]),
        (call("floor", v.x), [torch.tensor([1.0, -3.0])]),
        (call("step", 0.5, v), [torch.tensor([1.0, 0.0]), torch.tensor([1.0, 1.0])]),
    ]
    for expression, expected in cases:
        found = value_of(expression, values, TORCH)
        assert len(found) == len(expected) == expression.dimension
        for a, b in zip(found, expected, strict=True):
            np.testing.assert_allclose(np.asarray(a), np.asarray(b), rtol=1e-6)
    read = value_of(fetch(3, v, 2), values, TORCH, lambda number, uv: [uv[0] * number, uv[1]])
    assert torch.equal(read[0], 3 * x)
