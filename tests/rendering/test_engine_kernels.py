"""Tables for the chains of engines: exact in a furnace, better with shares of any sign, grain and all."""

import math
from functools import cache

import numpy as np
import pytest
import torch
from skies import LAMBERT, Planted, lamps, normals
from torch import Tensor

from homofact.brdf.materials import material
from homofact.exporting.prefiltered import compared, picture
from homofact.rendering import split_sum
from homofact.rendering.chain_kernels import ggx_kernels
from homofact.rendering.filtered import render_filtered
from homofact.rendering.light import EnvironmentMap
from homofact.rendering.prefilter import Prefiltered, level_table
from homofact.rendering.sky_chain import FilteredSky, chain_of, own_kernels
from homofact.rendering.split_sum import Response, response_of

KERNELS = ggx_kernels((0.0, 0.2, 0.4, 0.6, 1.0), 0.02)
GRAIN = 0.4  # radians, the azimuth across which the planted lobe is wide


def streak(wi: Tensor, wo: Tensor) -> Tensor:
    """A lobe of half vectors that is five times as wide one way as the other."""
    h = wi + wo
    slope = h[:, :2] / h[:, 2:].clamp_min(1e-6)
    along = slope @ slope.new_tensor((math.cos(GRAIN), math.sin(GRAIN)))
    across = slope @ slope.new_tensor((-math.sin(GRAIN), math.cos(GRAIN)))
    return torch.exp(-((along / 0.3) ** 2) - (across / 0.06) ** 2)


@cache
def response(name: str) -> Response:
    return response_of(material(name).model, KERNELS, 3)


@cache
def brushed() -> Response:
    return response_of(Planted(streak), KERNELS)


def sky(light: EnvironmentMap) -> FilteredSky:
    return FilteredSky.of(light, KERNELS)


@pytest.mark.slow
def test_a_sky_filtered_where_it_is_read_is_what_a_chain_holds() -> None:
    light, own = lamps(), own_kernels(64)
    chain, direct = chain_of(light, 64), FilteredSky.of(light, own)
    n, _ = normals(200)
    level = torch.linspace(0, 3, 200, dtype=torch.float64)
    found, expected = direct.read(n, level), chain.cube.read(n, level)
    assert float((found - expected).norm() / expected.norm()) < 0.02
    assert torch.allclose(direct.lit.read(n, level), direct.read(n, torch.full_like(level, 3)))


@pytest.mark.slow
@pytest.mark.parametrize("name", ["phong-30", "lafortune-blue-paint"])
def test_in_a_furnace_it_is_the_sum_of_the_shares(name: str) -> None:
    found = response(name)
    n, wo = normals(50)
    data = Prefiltered(level_table(found), sky(EnvironmentMap.constant(2.0)))
    place = (n * wo).sum(1).clamp(0, 1) * (split_sum.COLUMNS - 1)
    low = place.long().clamp_max(split_sum.COLUMNS - 2)
    whole, part = found.shares.sum(1), (place - low)[:, None]
    expected = 2 * ((1 - part) * whole[low] + part * whole[low + 1])
    assert torch.allclose(data.radiance(n, wo), expected, rtol=1e-6)


@pytest.mark.slow
def test_shares_below_0_take_ggx_s_tails_off(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of a lobe of short tails, which no sum of GGX's has; and what is reflected is never below 0."""
    found, model = response("phong-30"), material("phong-30").model
    assert float(found.shares.min()) < 0
    exact = render_filtered(model, lamps(), 48)
    signed = compared(picture(Prefiltered(level_table(found), sky(lamps())), 48), exact)
    made = split_sum._Layout
    monkeypatch.setattr(split_sum, "_Layout", lambda count, paired, signed: made(count, paired, False))
    positive = response_of(model, KERNELS, 3)
    assert float(positive.shares.min()) >= 0
    assert signed < 0.6 * compared(picture(Prefiltered(level_table(positive), sky(lamps())), 48), exact)
    lamp = EnvironmentMap(
        torch.zeros(32, 64, 1, dtype=torch.float64).index_put_(
            (torch.tensor(9), torch.tensor(20)), torch.tensor(900.0).double()
        )
    )
    n, wo = normals(400)
    assert float(Prefiltered(level_table(found), sky(lamp)).radiance(n, wo).min()) == 0


def test_a_matte_surface_needs_no_lobe() -> None:
    found = response_of(LAMBERT, KERNELS, 1)
    assert found.shares[:, -1].flatten().tolist() == pytest.approx([0.6] * split_sum.COLUMNS, abs=0.02)


@pytest.mark.slow
def test_the_grain_is_found_and_the_lobes_stand_across_it() -> None:
    found = brushed()
    assert found.across == pytest.approx(GRAIN, abs=0.02)
    assert found.lobes.shape == (split_sum.COLUMNS, 3, 3)
    middle, left, right = found.lobes[20:].unbind(1)
    assert float(middle[:, 2].abs().max()) == 0
    assert float(left[:, 2].min()) > 0.05
    assert torch.equal(left * left.new_tensor((1, 1, -1)), right)


@pytest.mark.slow
def test_a_streak_is_nearer_with_its_grain_than_turned_or_round() -> None:
    found, exact = brushed(), render_filtered(Planted(streak), lamps(), 48)

    def off(across: float, spread: float = 1) -> float:
        lobes = found.lobes * found.lobes.new_tensor((1, 1, spread))
        table = level_table(found._replace(across=across, lobes=lobes))
        return compared(picture(Prefiltered(table, sky(lamps())), 48), exact)

    right = off(GRAIN)
    # Three round lobes are short of a streak five times as long as wide.
    assert right < 0.25
    assert off(GRAIN + math.pi / 2) > 1.25 * right
    assert off(GRAIN, 0) > 1.1 * right


@pytest.mark.slow
def test_equal_bits() -> None:
    one, two = (response_of(Planted(streak), KERNELS) for _ in range(2))
    assert all(np.array_equal(a, b) for a, b in zip(one[:2], two[:2], strict=True))
