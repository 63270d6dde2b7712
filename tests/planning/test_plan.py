"""The planner: walks over ladders, laws of the choice, scenes that are refused."""

import math
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import pytest
import torch
from plan_cases import PAINT, QUICK, WHITE, fits_of, stage_of
from slow_cases import slow_among

from homofact.brdf.sampling import sample_model
from homofact.brdf.source import Source
from homofact.errors import BadInput, Report, Status
from homofact.exporting.result import open_result
from homofact.factor.fitted import Fitted
from homofact.methods.search import Search
from homofact.planning.export import write_plan
from homofact.planning.ladder import (
    CONSTANT,
    FITS,
    LADDER,
    LAMBERT,
    MODELS,
    WHOLE,
    Candidate,
    FitOptions,
    fit_candidate,
    fits_among,
    ladder,
    method_of,
)
from homofact.planning.material_fits import MaterialFits, as_texture, fitted_by_method
from homofact.planning.measure import best_colour
from homofact.planning.missed import missed_by_all
from homofact.planning.plan import MaterialPlan, plan_material, plan_scene
from homofact.planning.scene import Budget, Scene, SceneMaterial
from homofact.planning.search import ALIKE, UNTRUSTED, LadderOutcome, Walk, _settled, walk
from homofact.planning.tolerance import MARGINS, Tolerance
from homofact.scene.lighting import NAMED, named_lighting


@lru_cache
def paint_fits() -> MaterialFits:
    """One for all tests that ask it as it is: each rung is fitted once."""
    return fits_of(PAINT)


def planned(
    fits: MaterialFits, light: str, value: float, kind: str = "reflected", budget: Budget | None = None
) -> MaterialPlan:
    """A plan whose limit is `value` times the margin of its kind, so that errors up to `value` meet it."""
    material = SceneMaterial(fits.text, 1.0)
    used = Budget() if budget is None else budget
    tolerance = Tolerance(((kind, value * MARGINS[kind]),))
    return plan_material(material, fits, (stage_of(light),), tolerance, used)


# Walks


def oracle(level: float) -> dict[Candidate, LadderOutcome]:
    """Errors that fall with textures and size by powers, SVD six times as bad, McCool three times."""
    found = {}
    for each in LADDER:
        if each.is_colour:
            found[each] = LadderOutcome(4 * level, 12, 0)
        elif each.lobes:
            found[each] = LadderOutcome(5 * level, each.most_bytes(3), 0)
        else:
            factor = {"search": 1.0, "svd": 6.0, "mccool": 3.0}[each.method]
            error = factor * level * each.textures**-0.5 * (each.size / 8) ** -0.7
            error *= 1.02 if each.storage == WHOLE else 1.0
            found[each] = LadderOutcome(error, each.most_bytes(3), each.most_fetches(True), each.textures)
    return found


def walked(answers: dict[Candidate, LadderOutcome], tolerance: float, **limits: Any) -> Walk:
    return walk(ladder(), answers.__getitem__, tolerance, **limits)


def test_models_are_asked_about_before_any_texture() -> None:
    # They are nearest, though the least errors of textures, far from the limit, speak against all that is left.
    answers = oracle(0.8)
    answers |= {rung: replace(answers[rung], error=0.04) for rung in MODELS}
    found = walked(answers, 0.01)
    assert [rung for rung in found.asked if not rung.is_colour][:2] == list(MODELS)
    assert not found.met
    assert found.choice == MODELS[0]
    # One that meets the tolerance leaves nothing cheaper to ask about.
    assert walked(answers, 0.05).fits == 1


def test_a_walk_finds_the_optimum_with_few_questions() -> None:
    fits, cases = 0, 0
    for level in (0.1, 0.2, 0.4, 0.8):
        answers = oracle(level)
        for tolerance in (0.4, 0.2, 0.1, 0.05):
            meeting = [each.bytes for each in answers.values() if each.error <= tolerance]
            found = walked(answers, tolerance)
            assert found.met == bool(meeting)
            if found.met and found.choice is not None:
                assert found.asked[found.choice].error <= tolerance
                assert found.asked[found.choice].bytes == min(meeting)
            # Those of models take next to no time.
            fits, cases = fits + fits_among(rung for rung in found.asked if not rung.lobes), cases + 1
    # Of 33; these errors fall twice as fast with textures as the prior believes.
    assert fits / cases <= 10.5


def test_a_looser_tolerance_never_costs_more() -> None:
    answers = oracle(0.5)
    bills = []
    for tolerance in (3.0, 1.0, 0.5, 0.3, 0.2, 0.15):
        found = walked(answers, tolerance)
        assert found.choice is not None
        bills.append(found.asked[found.choice].bytes)
    assert bills == sorted(bills)
    assert bills[0] == 12 < bills[-1]


def test_what_cannot_be_met_is_answered_with_the_best() -> None:
    answers = oracle(1.0)
    found = walked(answers, 1e-4)
    assert not found.met
    assert found.choice is not None
    least = min(each.error for each in answers.values())
    assert answers[found.choice].error <= ALIKE * least
    # Of the ones that were asked about and err as little, it is the cheapest.
    alike = [each for each in found.asked.values() if each.error <= ALIKE * least]
    assert answers[found.choice].bytes == min(each.bytes for each in alike)
    assert found.fits <= len(FITS) / 5 + 1


def test_bytes_that_bring_nothing_are_not_spent_where_nothing_meets_the_tolerance() -> None:
    answers = {each: replace(one, error=1.8 + 1e-4 * one.terms) for each, one in oracle(1.0).items()}
    found = walked(answers, 1.0)
    assert not found.met
    assert found.choice is not None
    assert found.asked[found.choice].bytes == min(each.bytes for each in found.asked.values())


def test_what_meets_the_limits_without_trust_is_nearer_than_what_misses_them() -> None:
    # Larger rungs meet the limits, and no verdict trusts them; smaller ones miss a limit by little.
    answers = {
        each: replace(one, error=1.1, excess=math.log(1.1))
        if one.bytes < 2000
        else replace(one, error=UNTRUSTED, excess=0.0, trusted=False)
        for each, one in oracle(1.0).items()
    }
    found = walked(answers, 1.0)
    assert not found.met
    assert found.choice is not None
    assert not found.asked[found.choice].trusted


def test_a_limit_that_nothing_meets_does_not_hide_the_others() -> None:
    answers = oracle(1.0)
    colours = [each for each in answers if each.is_colour]
    # One colour is the nearest to a hopeless limit by a hair, and misses the other limit by far.
    for each, found in answers.items():
        excess = math.log(900.0) + math.log(8.0) if each.is_colour else math.log(1000.0)
        answers[each] = replace(found, error=900.0 if each.is_colour else 1000.0, excess=excess)
    found = walked(answers, 1.0)
    assert not found.met
    assert found.choice is not None
    assert found.choice not in colours
    # Of one limit alone the error decides.
    assert LadderOutcome(2.0, 1, 1).beyond < LadderOutcome(3.0, 1, 1).beyond
    assert LadderOutcome(0.2, 1, 1).beyond < LadderOutcome(0.3, 1, 1).beyond


def test_a_rung_is_fitted_by_the_effort_and_the_guard_asked_for() -> None:
    rung = Candidate("search", 3, 16)
    asked = method_of(rung, FitOptions(effort=7, budget=2.0, seed=4))
    assert isinstance(asked, Search)
    assert (asked.textures, asked.size, asked.effort, asked.budget, asked.seed) == (3, 16, 7, 2.0, 4)
    usual = method_of(rung, FitOptions())
    assert isinstance(usual, Search)
    assert (usual.effort, usual.budget) == ("quick", None)


def test_equal_seeds_give_equal_rungs() -> None:
    source = Source("own", "material", sample_model(PAINT, 300), PAINT, 1e-5, 0.0)
    first, second = (fit_candidate(Candidate("search", 1, 4), source, QUICK) for _ in range(2))
    assert first.report.status is not Status.GUARD
    wi, wo = source.samples.wi, source.samples.wo
    assert torch.equal(first.evaluate(wi, wo), second.evaluate(wi, wo))


def test_what_a_search_came_out_with_settles_more_textures_but_not_its_own_storage() -> None:
    floats = Candidate("search", 3, 16)
    asked = {floats: LadderOutcome(0.5, 6144, 2, 2)}
    assert not _settled(Candidate("search", 3, 16, WHOLE), asked)
    assert _settled(Candidate("search", 5, 16, WHOLE), asked)
    assert not _settled(Candidate("search", 2, 16), asked)


def test_a_budget_is_kept_and_may_leave_nothing() -> None:
    answers = oracle(1.0)
    found = walked(answers, 0.5, most_bytes=200)
    assert found.choice is not None
    assert not found.met
    assert answers[found.choice].bytes <= 200
    few = walked(answers, 0.4, most_fetches=1)
    assert few.choice is not None
    assert answers[few.choice].fetches <= 1
    assert few.met
    assert walked(answers, 0.4, most_bytes=11).choice is None


def test_a_fit_that_is_not_finite_is_passed_over() -> None:
    answers = {each: LadderOutcome(math.inf, found.bytes, found.fetches, 1) for each, found in oracle(1.0).items()}
    good = Candidate("search", 2, 16)
    answers[good] = LadderOutcome(0.1, good.most_bytes(3), 2, 2)
    answers[Candidate(CONSTANT)] = answers[Candidate(LAMBERT)] = LadderOutcome(2.0, 12, 0)
    assert not walked(answers, 1e-3).met


def test_equal_bytes_are_decided_by_reads_of_the_light() -> None:
    answers = oracle(0.05)
    for reads, expected in ((1, CONSTANT), (8192, LAMBERT)):
        found = walk(ladder(), answers.__getitem__, 0.5, light_reads={CONSTANT: reads, LAMBERT: 9})
        assert found.choice == Candidate(expected)
        assert found.fits == 0


# Choices


@pytest.mark.parametrize("light", slow_among(list(NAMED), "studio", "overcast"))
def test_a_lambertian_material_is_one_colour_without_error(light: str) -> None:
    found = planned(fits_of(WHITE), light, 1e-5)
    assert found.walk.choice == Candidate(CONSTANT)
    assert found.walk.fits == 0
    assert found.outcome is not None
    assert found.outcome.value < 1e-6
    for of_light in (True, False):
        assert best_colour(found.judges, of_light).diffuse == pytest.approx((0.6, 0.3, 0.1), rel=1e-6)


@pytest.mark.slow
def test_a_glossy_paint_costs_less_under_an_overcast_sky() -> None:
    fits = paint_fits()
    for tolerance in (0.4, 0.25):
        overcast, sun = (planned(fits, light, tolerance) for light in ("overcast", "sun"))
        assert overcast.walk.met
        assert sun.walk.met
        assert overcast.outcome is not None
        assert sun.outcome is not None
        assert overcast.outcome.bytes < sun.outcome.bytes
        assert overcast.needed_orders < sun.needed_orders


def test_the_lighting_does_not_change_a_plan_by_cole_error() -> None:
    fits = paint_fits()
    plans = [planned(fits, light, 0.05, "cole") for light in ("overcast", "sun")]
    assert plans[0].walk.choice == plans[1].walk.choice
    assert plans[0].walk.asked == plans[1].walk.asked
    assert Candidate(LAMBERT) not in plans[0].walk.asked


def test_a_rung_that_cannot_be_fitted_is_passed_over() -> None:
    fits = fits_of(PAINT)

    def fitter(candidate: Candidate, source: Source, options: FitOptions) -> tuple[Fitted, Report]:
        if candidate.size == 4:
            raise BadInput("samples: too few, expected more")
        return fitted_by_method(candidate, source, options)

    fits.fitter = fitter
    found = planned(fits, "sun", 0.2)
    assert found.walk.met
    assert found.walk.choice is not None
    assert found.walk.choice.size > 4
    assert fits.refused
    assert set(fits.refused.values()) == {"samples: too few, expected more"}


@pytest.mark.slow
def test_a_scene_is_planned_and_compared_with_one_size_for_all() -> None:
    fits_by_source = {"a": fits_of(WHITE, "a"), "b": fits_of(PAINT, "b")}
    materials = (SceneMaterial("a", 0.5), SceneMaterial("b", 0.3), SceneMaterial("a", 0.2))
    scene = Scene("two", materials, (named_lighting("sun"),), Tolerance.of(reflected=0.5))
    found = plan_scene(scene, QUICK, fits_by_source)
    assert found.materials[0].walk is found.materials[2].walk
    assert found.bytes < found.one_size.bytes if found.one_size is not None else False
    paint = found.materials[1].outcome
    assert paint is not None
    assert found.fetches == pytest.approx(0.3 * paint.fetches)
    assert found.exhaustive_fits == 2 * len(FITS + MODELS)
    assert found.planning_fits <= found.exhaustive_fits / 5
    assert missed_by_all(found) == ()


@pytest.mark.slow
def test_a_tolerance_holds_under_each_lighting() -> None:
    fits = paint_fits()
    stages = tuple(stage_of(name) for name in ("overcast", "sun"))
    material, tolerance = SceneMaterial("own", 1.0), Tolerance.of(reflected=0.9)
    alone = plan_material(material, fits, stages[:1], tolerance, Budget())
    both = plan_material(material, fits, stages, tolerance, Budget())
    assert alone.walk.choice in (Candidate(LAMBERT), Candidate(CONSTANT))
    assert both.outcome is not None
    assert both.outcome.bytes > 12
    assert both.outcome.lighting == "sun"
    assert both.walk.met
    assert [errors.reflected <= 0.9 / MARGINS["reflected"] for errors in both.errors] == [True, True]


@pytest.mark.slow
def test_all_limits_hold_and_the_one_that_is_met_worst_is_named() -> None:
    fits, stages = paint_fits(), (stage_of("studio"),)
    tolerance = Tolerance.of(delta_e=4.0, delta_e_peak=40.0)
    found = plan_material(SceneMaterial("own", 1.0), fits, stages, tolerance, Budget())
    assert found.outcome is not None
    errors = found.errors[0]
    parts = {kind: errors.of(kind) * MARGINS[kind] / limit for kind, limit in tolerance.limits}
    assert found.outcome.error == pytest.approx(max(parts.values()))
    assert parts[found.outcome.kind] == max(parts.values())
    assert found.outcome.excess == pytest.approx(sum(math.log(max(part, 1.0)) for part in parts.values()))
    assert found.walk.met == (max(parts.values()) <= 1)
    mean_alone = plan_material(SceneMaterial("own", 1.0), fits, stages, Tolerance.of(delta_e=4.0), Budget())
    assert mean_alone.outcome is not None
    assert mean_alone.outcome.bytes <= found.outcome.bytes


@pytest.mark.slow
def test_whole_texels_take_a_quarter_and_no_fit_of_their_own(tmp_path: Path) -> None:
    fits = fits_of(PAINT)
    floats, whole = Candidate("search", 1, 8), Candidate("search", 1, 8, WHOLE)
    fitted, stored = fits.fitted(floats)[0], fits.fitted(whole)[0]
    assert list(fits.made) == [floats]
    assert all(texture.grid is not None and texture.grid.levels == 255 for texture in stored.textures)
    found = planned(fits, "sun", 0.3)
    assert found.walk.choice is not None
    assert found.outcome is not None
    assert found.walk.choice.storage == WHOLE
    stored = fits.fitted(found.walk.choice)[0]
    texels = sum(texture.texels.size for texture in stored.textures)
    assert found.outcome.bytes == texels == stored.nbytes // 4
    assert fitted.nbytes == 4 * sum(texture.texels.size for texture in fitted.textures)
    scene = Scene("one", (SceneMaterial("own", 1.0),), (named_lighting("sun"),), Tolerance.of(reflected=0.5))
    plan = plan_scene(scene, QUICK, {"own": fits})
    folder = tmp_path / "plan" / write_plan(tmp_path / "plan", plan)["own"]
    choice = plan.materials[0].walk.choice
    assert choice is not None
    assert choice.storage == WHOLE
    stored = fits.fitted(choice)[0]
    assert (folder / "texture_0.png").read_bytes()[24] == 8
    assert (folder / "brdf.glsl").is_file()
    wi, wo = fits.source.samples.wi, fits.source.samples.wo
    torch.testing.assert_close(open_result(folder).evaluate(wi, wo), stored.evaluate(wi, wo), rtol=1e-5, atol=1e-7)


@pytest.mark.slow
def test_a_plan_is_replaced_by_one_of_other_kinds(tmp_path: Path) -> None:
    fits, folder = paint_fits(), tmp_path / "plan"
    for limit, mark in ((0.5, "brdf.glsl"), (3.0, "colour.json"), (0.5, "brdf.glsl")):
        scene = Scene("one", (SceneMaterial("own", 1.0),), (named_lighting("sun"),), Tolerance.of(reflected=limit))
        write_plan(folder, plan_scene(scene, QUICK, {"own": fits}), force=True)
        marks = {each.name for each in (folder / "1-own").iterdir()} & {"brdf.glsl", "colour.json"}
        assert marks == {mark}


def test_one_colour_is_judged_as_an_even_texture() -> None:
    fits = paint_fits()
    made = as_texture(WHITE, fits.training, 1e-5)
    wi, wo = fits.source.samples.wi, fits.source.samples.wo
    torch.testing.assert_close(made.evaluate(wi, wo), WHITE.evaluate(wi, wo), rtol=1e-9, atol=0)


@pytest.mark.slow
def test_a_choice_has_a_verdict_and_a_colour_none_on_what_it_lacks() -> None:
    fits = paint_fits()
    found = planned(fits, "overcast", 0.4)
    assert found.walk.choice is not None
    assert found.walk.choice.is_colour
    assert found.verdict is not None
    assert [each for each in found.verdict.findings if each.about.value == "fit"] == []
    textured = planned(fits, "sun", 0.3)
    assert textured.verdict is not None
    assert textured.verdict.figures.system.determined is None or 0 <= textured.verdict.figures.system.determined <= 1
    assert textured.verdict.summary
