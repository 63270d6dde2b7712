"""Bytes shared out over materials: the best choice of all, and that every rung of it was asked about."""

import itertools
import math
import random

import pytest

from homofact.planning.allocate import Buyer, allocate, best_choice
from homofact.planning.ladder import LADDER, WHOLE, Candidate, FitOptions, ladder
from homofact.planning.material_fits import MaterialFits
from homofact.planning.plan import plan_scene
from homofact.planning.scene import Budget, Scene, SceneMaterial
from homofact.planning.search import LadderOutcome
from homofact.planning.tolerance import Tolerance
from homofact.scene.lighting import named_lighting

Offer = tuple[int, float, Candidate | None]


def test_the_choice_is_the_best_of_all() -> None:
    draw = random.Random(1)
    for _ in range(30):
        offers: list[tuple[float, list[Offer]]] = []
        for _ in range(3):
            own: list[Offer] = [(0, 1e6, None)]
            own += [(draw.randint(1, 50), draw.uniform(0.1, 5), Candidate("search", k, 4)) for k in range(1, 6)]
            offers.append((draw.random(), own))
        limit = draw.randint(5, 120)
        chosen = best_choice(offers, limit)
        found = [next(each for each in own if each[2] == rung) for (_, own), rung in zip(offers, chosen, strict=True)]
        assert sum(size for size, _, _ in found) <= limit
        error = sum(share * each[1] for (share, _), each in zip(offers, found, strict=True))
        best = min(
            sum(share * each[1] for (share, _), each in zip(offers, taken, strict=True))
            for taken in itertools.product(*(own for _, own in offers))
            if sum(size for size, _, _ in taken) <= limit
        )
        assert error == pytest.approx(best)


def answers(level: float) -> dict[Candidate, LadderOutcome]:
    found = {}
    for each in LADDER:
        size = (
            2.0
            if not each.textures
            else (each.textures * each.size**2) ** -0.4 * (1.03 if each.storage == WHOLE else 1)
        )
        found[each] = LadderOutcome(level * size, each.most_bytes(3), each.most_fetches(True), each.textures)
    return found


def test_more_of_the_picture_gets_more_bytes_and_all_that_is_taken_was_asked() -> None:
    large, small = answers(10.0), answers(10.0)
    asked: list[Candidate] = []

    def buyer(share: float, table: dict[Candidate, LadderOutcome]) -> Buyer:
        def ask(candidate: Candidate) -> LadderOutcome:
            asked.append(candidate)
            return table[candidate]

        colours = {each: table[each] for each in LADDER if each.is_colour}
        return Buyer(share, ladder(), colours, ask, 3, True)

    buyers = [buyer(0.9, large), buyer(0.1, small)]
    chosen = allocate(buyers, 1000)
    sizes = [buyer.asked[each].bytes for buyer, each in zip(buyers, chosen, strict=True) if each is not None]
    assert sum(sizes) <= 1000
    assert sizes[0] > sizes[1]
    assert len(asked) < 20
    assert allocate([buyer(0.9, large), buyer(0.1, small)], 12)[1] is None


def test_what_takes_too_many_fetches_is_no_offer() -> None:
    table = answers(1.0)
    asked = {each: table[each] for each in (Candidate("constant"), Candidate("search", 3, 16))}
    found = Buyer(1.0, ladder(), asked, table.__getitem__, 3, True, 1).offers()
    assert all(rung is None or rung.most_fetches(True) <= 1 for _, _, rung in found)


def test_a_scene_over_its_budget_shares_it_out() -> None:
    options = FitOptions(effort=10, count=800)
    materials = (SceneMaterial("material:cook-torrance-plastic", 0.8), SceneMaterial("material:phong-10", 0.2))
    fits_by_source = {each.source: MaterialFits(each.source, options) for each in materials}
    for fits in fits_by_source.values():
        fits.__dict__["rungs"] = tuple(each for each in ladder() if each.size <= 8 and each.textures <= 1)
    light = (named_lighting("sun"),)
    tolerance = Tolerance.of(reflected=0.05)
    free = plan_scene(Scene("two", materials, light, tolerance), options, fits_by_source)
    assert not free.allocated
    scene = Scene("two", materials, light, tolerance, Budget(bytes=70))
    found = plan_scene(scene, options, fits_by_source)
    assert found.bytes <= 70
    assert found.allocated == (found.wanted_bytes > 70)
    assert free.wanted_bytes == free.bytes
    assert found.error < math.inf
    if free.bytes > 70:
        assert found.error >= free.error - 1e-12
    # No single exchange within the budget makes the picture better.
    for k, each in enumerate(found.materials):
        others = found.bytes - (each.outcome.bytes if each.outcome else 0)
        for outcome in each.walk.asked.values():
            if each.outcome is not None and others + outcome.bytes <= 70:
                assert outcome.error >= each.outcome.error - 1e-12, (k, outcome)
