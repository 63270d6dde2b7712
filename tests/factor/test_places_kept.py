"""Coordinates that samples keep for the next mix: of the right system, warp and samples, and as computed anew."""

from itertools import product

import pytest
import torch

from homofact.factor import textures
from homofact.factor.projection import Projection, Warp, fixed_projection
from homofact.factor.textures import LogSamples
from homofact.geometry.directions import draw_cosine_weighted

NAMES = ("theta_h-theta_d", "theta_i-theta_o", "h")
WARPS = (None, Warp(0.05), Warp(0.2))


def samples(count: int = 50) -> LogSamples:
    wi, wo = draw_cosine_weighted(count, torch.Generator().manual_seed(1))
    ones = torch.ones(count, dtype=torch.float64)
    return LogSamples(wi, wo, ones[:, None], ones)


def projections() -> list[Projection]:
    made = [
        fixed_projection(name, True, warp=warp)
        for name, warp in product(NAMES, WARPS)
        if warp is None or name != "theta_i-theta_o"
    ]
    assert len({(each.coordinates, each.warp) for each in made}) == len(made)
    return made


def placed(own: LogSamples, projection: Projection) -> torch.Tensor:
    found = torch.empty(len(own.logs), projection.system.dimension, dtype=torch.float64)
    own.place(projection, found)
    return found


@pytest.mark.parametrize("kept", [0, 10_000])
def test_places_are_those_of_each_system_and_warp(kept: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(textures, "_PLACES_KEPT", kept)
    own = samples()
    for projection in projections() * 2:
        assert torch.equal(placed(own, projection), projection.prepare(own.wi, own.wo))


def test_few_samples_are_placed_once() -> None:
    own, asked = samples(), []

    class Counted(Projection):
        def prepare(self, wi: torch.Tensor, wo: torch.Tensor) -> torch.Tensor:
            asked.append(len(wi))
            return super().prepare(wi, wo)

    one = fixed_projection("h", True)
    for _ in range(3):
        placed(own, Counted(one.coordinates, one.matrix, True, one.name))
    assert asked == [50]


def test_what_is_done_with_places_does_not_change_those_kept() -> None:
    own, projection = samples(), fixed_projection("h", True)
    expected = projection.prepare(own.wi, own.wo)
    for _ in range(2):
        found = placed(own, projection)
        assert torch.equal(found, expected)
        found.zero_()


def test_chosen_samples_have_places_of_their_own() -> None:
    own, projection = samples(), fixed_projection("theta_h-theta_d", True)
    placed(own, projection)
    chosen = own.select(torch.arange(40, 10, -1))
    assert torch.equal(placed(chosen, projection), projection.prepare(chosen.wi, chosen.wo))
    longer = own.with_more(chosen)
    assert torch.equal(placed(longer, projection), projection.prepare(longer.wi, longer.wo))
