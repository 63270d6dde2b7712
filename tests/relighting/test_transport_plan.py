"""The plan of an object's transport: what is foretold is what is measured, the cheapest is taken, tolerances hold."""

from collections.abc import Iterator
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import torch
from coarse import coarse_terms
from relighting_cases import EYE, MATT, SHINY, knot, occluder, shiny
from relit_errors import errors_of

from homofact.errors import BadInput
from homofact.relighting.cube import environment_cube
from homofact.relighting.errors import relative
from homofact.relighting.factoring import factor
from homofact.relighting.factors import view_values
from homofact.relighting.harmonic import harmonic
from homofact.relighting.lit import lit_tuples
from homofact.relighting.plan import MARGIN, ObjectPlan, _choices, candidate_terms, plan_object
from homofact.relighting.precompute import TransportSettings, WaveletTransport, transport
from homofact.relighting.probe import TURNS, ProbedErrors, ProbedVertices, measured
from homofact.relighting.seen import SeenVertices, seen_vertices
from homofact.rendering.light import EnvironmentMap
from homofact.scene.lighting import named_environment

CUBE = 16
# One texel of a coarse map: a small lamp in the dark.
_DARK = torch.zeros(16, 32, 1, dtype=torch.float64)
_DARK[3, 20] = 9
LAMP = EnvironmentMap(_DARK)
STUDIO = named_environment("studio")


@pytest.fixture(scope="module", autouse=True)
def _coarse() -> Iterator[None]:
    with coarse_terms():
        yield


def seen(most: int = 12, seed: int = 0) -> SeenVertices:
    return seen_vertices(knot(), SHINY, occluder(), EYE, most, seed)


@cache
def probed() -> ProbedErrors:
    own = seen()
    spot = ProbedVertices(knot(), occluder(), own.which, own.wo)
    groups = np.array([0, 0, 0, 1, 1, 1])
    coarse = factor(SHINY, 6, map_size=8)
    return measured(spot, (coarse, shiny()), 1, groups, STUDIO, CUBE, (1, 3))


def of_turns(made: WaveletTransport, form: object = None) -> np.ndarray:
    """Light (turns, S, 3) of the vertices seen, in the four turns."""
    own = seen()
    h = view_values(made.factors, own.wo)
    parts = []
    for k in range(TURNS):
        sky = environment_cube(STUDIO.turned(2 * np.pi * k / TURNS), CUBE)
        tuples = lit_tuples(made, form, sky)[own.which]  # type: ignore[arg-type]
        parts.append(np.einsum("skc,skc->sc", h, tuples))
    return np.array(parts)


@pytest.mark.parametrize("terms", [3, 6])
def test_truncation_is_foretold(terms: int) -> None:
    """The error and the number of coefficients of the transport that is then made."""
    group = 0 if terms == 3 else 1
    tolerance, error, kept = probed().truncated(group, 0.1)
    assert error <= 0.1
    factors = shiny().first(terms)
    whole, cut = (
        transport(knot(), factors, TransportSettings(CUBE, tolerance=each), occluder()) for each in (0.0, tolerance)
    )
    assert relative(of_turns(cut), of_turns(whole)) == pytest.approx(error, rel=0.05)
    counts = np.diff(cut.start).reshape(-1, terms).sum(1)[seen().which]
    assert kept == pytest.approx(counts.mean(), rel=0.02)
    assert probed().truncated(group, 0.02)[2] > kept


def test_harmonics_are_foretold() -> None:
    whole = transport(knot(), shiny(), TransportSettings(CUBE, tolerance=0.0), occluder())
    for order, error in zip((1, 3), probed().harmonics(1), strict=True):
        found = relative(of_turns(whole, harmonic(whole, order)), of_turns(whole))
        assert error == pytest.approx(found, rel=0.02)


def test_maps_are_held_against_the_last() -> None:
    errors = probed().maps
    assert errors.shape == (2, 2)
    assert errors[:, 1] == pytest.approx(0)
    own = seen()
    sky = environment_cube(STUDIO, CUBE)
    coarse, fine = (own.dense(sky, CUBE, factor(SHINY, 6, map_size=each)) for each in (8, 32))
    # In one turn of the four.
    assert errors[1, 0] == pytest.approx(relative(coarse, fine), rel=0.6)


def test_numbers_of_terms_take_parts_of_the_tolerance_and_split_no_pair() -> None:
    whole = factor(SHINY, error=0.01, map_size=8)
    counts = candidate_terms(whole, 0.05)
    assert counts == sorted(set(counts))
    for count in counts:
        assert whole.first(count).expected_error <= 0.95 * 0.05
        assert count == whole.terms or whole.strength[count] != whole.strength[count - 1]
    # The first is the least: without its last term, or pair, the part is exceeded.
    assert whole.first(counts[0] - 2).expected_error > 0.95 * 0.05
    assert candidate_terms(whole.first(3), 0.001) == [3]


def test_maps_take_their_part_of_the_tolerance() -> None:
    rough = replace(probed(), maps=np.full((2, 2), 0.08))
    found = _choices(rough, 0, 0, 3, 0.03, 0.1, 192, 3)
    assert found
    assert all(each.of_maps == 0.08 and 0.08 < each.error <= 0.1 for each in found)
    assert _choices(replace(probed(), maps=np.full((2, 2), 0.11)), 0, 0, 3, 0.03, 0.1, 192, 3) == []


@cache
def planned(reflected: float, light: str = "studio", kind: str = "shiny") -> ObjectPlan:
    model = SHINY if kind == "shiny" else MATT
    sky = LAMP if light == "lamp" else named_environment(light)
    return plan_object(knot(), kind, model, occluder(), sky, EYE, reflected, TransportSettings(CUBE), seed=0)


@pytest.mark.slow
@pytest.mark.parametrize("reflected", [0.15, 0.05])
def test_a_plan_holds_at_vertices_that_it_has_not_seen(reflected: float) -> None:
    plan = planned(reflected)
    assert plan.met
    assert plan.warning is None
    assert plan.chosen.bytes == min(each.bytes for each in plan.choices)
    assert all(each.error * MARGIN <= reflected * 1.001 for each in plan.choices)
    made = transport(knot(), plan.factored.factors, plan.settings(TransportSettings(CUBE)), occluder())
    found = errors_of(seen(60, 9), made, None, STUDIO, ("together",)).errors["together"]
    assert 0.2 * reflected < found < reflected
    stored = made.nbytes + plan.factored.factors.view.nbytes
    assert plan.chosen.bytes == pytest.approx(stored, rel=0.15)
    assert (plan.factored.factors.terms, plan.factored.factors.view.shape[1]) == (
        plan.chosen.terms,
        plan.chosen.map_size,
    )


def test_a_wider_tolerance_is_cheaper() -> None:
    assert planned(0.15).chosen.bytes < planned(0.05).chosen.bytes
    assert planned(0.15).chosen.terms <= planned(0.05).chosen.terms


@pytest.mark.slow
def test_smooth_light_takes_nine_numbers_and_a_lamp_does_not() -> None:
    smooth, sharp = planned(0.02, "overcast", "matt"), planned(0.02, "lamp", "matt")
    assert smooth.chosen.form == "harmonics to order 2"
    assert smooth.chosen.coefficients == 9
    assert sharp.chosen.form == "all frequencies"
    assert smooth.chosen.bytes < sharp.chosen.bytes / 4
    made = transport(knot(), smooth.factored.factors, smooth.settings(TransportSettings(CUBE)), occluder())
    compact = harmonic(made, 2)
    light = named_environment("overcast")
    own = seen_vertices(knot(), MATT, occluder(), EYE, 60, 9)
    assert errors_of(own, made, compact, light, ("together",)).errors["together"] < 0.02
    assert smooth.chosen.bytes == compact.nbytes + smooth.factored.factors.view.nbytes


@pytest.mark.slow
def test_equal_seed_equal_plan() -> None:
    sky = named_environment("overcast")
    again = plan_object(knot(), "matt", MATT, occluder(), sky, EYE, 0.02, TransportSettings(CUBE), seed=0)
    assert again.choices == planned(0.02, "overcast", "matt").choices


@pytest.mark.slow
def test_terms_that_are_given_stay_and_what_cannot_be_met_is_said() -> None:
    plan = plan_object(knot(), "shiny", SHINY, occluder(), STUDIO, EYE, 0.01, TransportSettings(CUBE), terms=2, seed=0)
    assert plan.chosen.terms == 2
    assert not plan.met
    assert plan.warning is not None
    assert plan.warning.startswith(f"{knot().name}: reflected 0.01 cannot be met; the best reachable is 0.")
    assert plan.warning.endswith("with the margin of 1.25 and 2 terms")
    assert plan.chosen.error > 0.008


@pytest.mark.slow
def test_an_object_that_no_camera_sees_is_planned_all_the_same() -> None:
    plan = plan_object(knot(), "matt", MATT, occluder(), STUDIO, (0.0, 0.0, 0.0), 0.1, TransportSettings(8), seed=0)
    assert plan.met


@pytest.mark.slow
def test_no_light_is_refused() -> None:
    below = knot().positions[:, 1].min()
    lamp = STUDIO.radiance.clone() * 0
    lamp[-1, 0] = 1
    mesh = replace(knot(), normals=np.tile([0.0, 1.0, 0.0], (len(knot().positions), 1)), name="up")
    assert below < 0
    with pytest.raises(BadInput, match="up: no light reaches the vertices that were drawn, expected some"):
        plan_object(mesh, "matt", MATT, occluder(), EnvironmentMap(lamp), (0, 50, 0), 0.1, TransportSettings(8), seed=0)


def test_record_names_the_choice() -> None:
    record = planned(0.15).record()
    assert record["met"] is True
    assert record["chosen"] in record["choices"]
    assert {"form", "terms", "map_size", "bytes", "error", "of_terms"} <= set(record["chosen"])
