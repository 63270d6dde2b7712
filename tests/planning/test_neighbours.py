"""One step smaller or larger than a choice: what the walk measured, or what it expects to be clearly better."""

from dataclasses import replace

import pytest
from plan_cases import PAINT, fits_of

from homofact.cli.plan_tables import step_table
from homofact.planning.ladder import LAMBERT, MODELS, Candidate, ladder
from homofact.planning.neighbours import (
    CLEARLY,
    TRIES,
    best_larger,
    far_smaller,
    larger,
    measure_larger,
    smaller,
    sufficient,
    with_larger_measured,
)
from homofact.planning.plan import MaterialPlan, ScenePlan
from homofact.planning.scene import Budget, SceneMaterial
from homofact.planning.search import UNTRUSTED, LadderOutcome, Walk, expected_errors
from homofact.planning.tolerance import Tolerance

COLOUR = Candidate(LAMBERT)
SMALL, CHOSEN, LARGE = (Candidate("search", 1, size, "png8") for size in (4, 8, 16))
OTHER = Candidate("svd", 1, 8, "png8")


def plan_of(asked: dict[Candidate, float], choice: Candidate | None = CHOSEN) -> MaterialPlan:
    """A plan whose walk had these errors, in parts of the limit."""
    outcomes = {
        rung: LadderOutcome(error, rung.most_bytes(3), rung.most_fetches(True), rung.textures)
        for rung, error in asked.items()
    }
    walk = Walk(1.0, outcomes, choice, choice is not None)
    return MaterialPlan(SceneMaterial("own", 1.0), fits_of(PAINT), (), Tolerance.of(reflected=0.1), walk)


def test_a_step_down_is_the_best_of_what_is_smaller_and_was_measured() -> None:
    found = smaller(plan_of({COLOUR: 9.0, SMALL: 1.5, CHOSEN: 0.7, LARGE: 0.1}))
    assert found is not None
    assert (found.candidate, found.bytes, found.error, found.measured) == (SMALL, 48, 1.5, True)
    assert found.record()["of_tolerance"] == 1.5
    assert smaller(plan_of({CHOSEN: 0.7, LARGE: 0.1})) is None
    assert smaller(plan_of({SMALL: float("inf"), CHOSEN: 0.7})) is None
    # A representation of as many bytes is no step down.
    assert OTHER.most_bytes(3) == CHOSEN.most_bytes(3)
    assert smaller(plan_of({OTHER: 3.0, CHOSEN: 0.7})) is None


def test_a_step_up_errs_less_and_is_the_cheapest_of_those_measured_and_expected() -> None:
    dearer = Candidate("search", 1, 32, "png8")
    plan = plan_of({SMALL: 1.5, CHOSEN: 0.7, dearer: 0.2})
    found = larger(plan)
    assert found is not None
    assert found.bytes < dearer.most_bytes(3)
    assert not found.measured
    assert found.error <= CLEARLY * 0.7
    assert found.error == pytest.approx(expected_errors([found.candidate], plan.walk.asked)[0])
    # The cheapest, measured, comes with its error, and is no step up where it errs more.
    cheapest = next(rung for rung in ladder() if rung.most_bytes(3) > CHOSEN.most_bytes(3))
    found = larger(plan_of({SMALL: 1.5, CHOSEN: 0.7, cheapest: 0.3}))
    assert found is not None
    assert (found.candidate, found.error, found.measured) == (cheapest, 0.3, True)
    found = larger(plan_of({SMALL: 1.5, CHOSEN: 0.7, cheapest: 0.9}))
    assert found is not None
    assert found.candidate != cheapest


def test_what_has_no_choice_or_no_error_has_no_step() -> None:
    none = plan_of({SMALL: 1.5}, None)
    assert (smaller(none), larger(none)) == (None, None)
    assert larger(plan_of({SMALL: 1.5, CHOSEN: 0.0})) is None


@pytest.mark.parametrize("error", [0.3, 0.9])
def test_a_step_up_that_is_only_expected_is_fitted(error: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """One that errs clearly less ends it; after TRIES more that do not, none is named as measured."""
    asked: list[Candidate] = []

    def ask(plan: MaterialPlan, rung: Candidate) -> LadderOutcome:
        asked.append(rung)
        plan.fits.refused[rung.fit] = "counted as a fit"
        return LadderOutcome(error, rung.most_bytes(3), rung.most_fetches(True), rung.textures)

    monkeypatch.setattr(MaterialPlan, "ask", ask)
    plan = plan_of({SMALL: 1.5, CHOSEN: 0.7})
    expected = larger(plan)
    whole = ScenePlan(None, (plan,), None, 2, 2, 60)  # pyright: ignore[reportArgumentType]
    assert with_larger_measured(whole).fits == 2 + len({rung.fit for rung in asked})
    found = larger(plan)
    assert expected is not None
    if error == 0.3:
        assert found is not None
        assert (found.measured, found.error) == (True, 0.3)
        assert found.bytes <= expected.bytes
        assert found.candidate in asked
        count = len(asked)
        assert count <= TRIES
        measure_larger(plan)
        assert len(asked) == count
    else:
        assert found is None or not found.measured
        assert len(set(asked)) == TRIES + 1


def test_a_larger_model_is_fitted_before_any_texture(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[Candidate] = []

    def ask(plan: MaterialPlan, rung: Candidate) -> LadderOutcome:
        asked.append(rung)
        return LadderOutcome(0.1, rung.most_bytes(3), rung.most_fetches(True), rung.textures)

    monkeypatch.setattr(MaterialPlan, "ask", ask)
    one, two = MODELS
    plan = plan_of({COLOUR: 3.0, one: 0.5}, one)
    measure_larger(plan)
    assert asked[0] == two
    step = larger(plan)
    assert step is not None
    assert step.measured


def test_what_more_bytes_buy_is_told_where_nothing_larger_errs_less() -> None:
    dearer = Candidate("search", 1, 32, "png8")
    plan = plan_of({SMALL: 1.5, CHOSEN: 0.7, LARGE: 0.8, dearer: 0.75, Candidate("svd", 1, 32): float("inf")})
    best = best_larger(plan)
    assert best is not None
    assert (best.candidate, best.bytes, best.error, best.measured) == (dearer, 3072, 0.75, True)
    # Of what was not tried, the best that is expected.
    expected = best_larger(plan_of({SMALL: 1.5, CHOSEN: 0.7}))
    assert expected is not None
    assert not expected.measured
    assert expected.bytes > CHOSEN.most_bytes(3)
    last = max(ladder(), key=lambda rung: rung.most_bytes(3))
    assert best_larger(plan_of({SMALL: 1.5, last: 0.7}, last)) is None
    assert best_larger(plan_of({SMALL: 1.5}, None)) is None


def test_what_meets_a_missed_tolerance_beyond_the_budget_is_named() -> None:
    dearer, dearest = Candidate("search", 1, 32, "png8"), Candidate("search", 2, 32, "png8")
    missed = plan_of({SMALL: 1.5, CHOSEN: 1.2, LARGE: 1.05, dearer: 1.0, dearest: 0.4})
    missed.walk.met, missed.walk.stepped = False, True
    found = sufficient(missed)
    assert found is not None
    assert (found.candidate, found.error, found.measured) == (dearer, 1.0, True)
    table = step_table(ScenePlan(None, (missed,), None, 2, 2, 60))  # pyright: ignore[reportArgumentType]
    assert table is not None
    assert list(table.columns[1].cells) == ["smaller", "larger", "within the limit"]
    assert list(table.columns[3].cells)[-1] == str(dearer.most_bytes(3))
    missed.walk.met = True
    assert sufficient(missed) is None
    # Nothing that was tried does.
    missed = plan_of({CHOSEN: 1.2, LARGE: 1.1})
    missed.walk.met = False
    assert sufficient(missed) is None


def test_a_far_smaller_one_that_misses_hardly_more_is_named() -> None:
    colour, model = COLOUR, MODELS[0]
    dearest = Candidate("search", 2, 32, "png8")
    missed = plan_of({colour: 9.0, model: 1.5, SMALL: 1.3, dearest: 1.1}, dearest)
    missed.walk.met = False
    found = far_smaller(missed)
    assert found is not None
    assert (found.candidate, found.bytes, found.error, found.measured) == (model, model.most_bytes(3), 1.5, True)
    table = step_table(ScenePlan(None, (missed,), None, 2, 2, 60))  # pyright: ignore[reportArgumentType]
    assert table is not None
    assert list(table.columns[1].cells)[:2] == ["far smaller", "smaller"]
    # A little too far off; too many bytes.
    for asked in ({colour: 9.0, model: 1.66, dearest: 1.1}, {Candidate("search", 1, 32, "png8"): 1.2, dearest: 1.1}):
        other = plan_of(asked, dearest)
        other.walk.met = False
        assert far_smaller(other) is None
    # Of a choice that meets the tolerance, one that misses it by at most a half.
    for error, named in ((1.5, True), (1.51, False)):
        met = plan_of({colour: 9.0, model: error, dearest: 0.9}, dearest)
        assert (far_smaller(met) is not None) is named


def test_the_table_of_steps_names_it_in_figures(monkeypatch: pytest.MonkeyPatch) -> None:
    def lines(asked: dict[Candidate, float], choice: Candidate = CHOSEN) -> list[str]:
        plan = plan_of(asked, choice)
        plan.walk.stepped = True
        monkeypatch.setattr("homofact.planning.neighbours.larger", lambda plan: None)
        table = step_table(ScenePlan(None, (plan,), None, 2, 2, 60))  # pyright: ignore[reportArgumentType]
        assert table is not None
        return [str(cell) for column in table.columns for cell in list(column.cells)[-1:]][1:]

    assert lines({SMALL: 1.5, CHOSEN: 0.7, LARGE: 0.8}) == [
        "larger",
        "none helps: 1 texture of 16², 8 bits (search) (768 bytes, 80% of the limit) has no smaller error, and"
        " others of up to 16 × the bytes are expected to gain little",
        "–", "–",
    ]  # fmt: skip
    # What was not tried has no figures.
    assert lines({SMALL: 1.5, CHOSEN: 0.7}) == [
        "larger",
        "none helps: no candidate of up to 16 × the bytes is expected to err clearly less",
        "–",
        "–",
    ]
    last = max(ladder(), key=lambda rung: rung.most_bytes(3))
    assert lines({SMALL: 1.5, last: 0.7}, last) == ["larger", "there is no larger candidate", "–", "–"]


def test_a_smaller_one_within_the_limits_that_is_not_trusted_is_nearer_than_one_beyond_them() -> None:
    plan = plan_of({COLOUR: 1.2, SMALL: UNTRUSTED, CHOSEN: 0.7})
    plan.walk.asked[SMALL] = replace(plan.walk.asked[SMALL], trusted=False)
    found = smaller(plan)
    assert found is not None
    assert (found.candidate, found.trusted) == (SMALL, False)


def test_what_the_budget_rules_out_is_no_step() -> None:
    three = Candidate("search", 3, 4, "png8")
    asked = {SMALL: 1.5, three: 0.4, CHOSEN: 0.7, LARGE: 0.1}
    assert three.most_bytes(3) < CHOSEN.most_bytes(3)
    free = plan_of(asked)
    down, up, best = smaller(free), larger(replace(free, walk=replace(free.walk, stepped=True))), best_larger(free)
    assert down is not None
    assert down.candidate == three
    assert up is not None
    assert up.candidate == LARGE
    assert best is not None
    assert best.candidate == LARGE
    few = replace(free, budget=Budget(bytes=CHOSEN.most_bytes(3), fetches=CHOSEN.most_fetches(True)))
    assert three.most_fetches(True) > CHOSEN.most_fetches(True)
    down = smaller(few)
    assert down is not None
    assert down.candidate == SMALL
    assert larger(few) is None
    assert best_larger(few) is None


@pytest.mark.parametrize(
    ("budget", "allowed"),
    [((None, None), True), ((48, None), True), ((47, None), False), ((None, 2), True), ((None, 1), False)],
)
def test_a_budget_allows_up_to_its_bytes_and_fetches(budget: tuple[int | None, int | None], allowed: bool) -> None:
    assert Budget(*budget).allows(48, 2) is allowed


def test_what_a_search_kept_is_named_and_not_what_it_was_allowed() -> None:
    several = replace(CHOSEN, textures=5)
    plan = plan_of({SMALL: 1.5, several: 0.7}, several)
    plan.walk.asked[several] = replace(plan.walk.asked[several], terms=4)
    assert plan.walk.kept(several).words == CHOSEN.words.replace("1 texture", "4 textures")
    # Terms are what the other methods are asked for, and what was not tried has kept nothing.
    terms = replace(several, method="svd")
    plan.walk.asked[terms] = replace(plan.walk.asked[several], terms=4)
    assert plan.walk.kept(terms) == terms
    assert plan.walk.kept(LARGE) == LARGE
