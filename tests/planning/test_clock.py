"""What a plan says of its time: an expectation before the first fit, one that follows what the fits take."""

from types import SimpleNamespace
from typing import Any

import pytest
from plan_cases import PAINT, fits_of

from homofact.api import planning
from homofact.api.progress import ProgressStep, ProgressSteps
from homofact.evaluation.estimate import verdict_seconds
from homofact.planning import clock as module
from homofact.planning.clock import LARGER, USUAL, PlanClock
from homofact.planning.ladder import CONSTANT, Candidate, fits_among, ladder
from homofact.planning.plan import plan_scene
from homofact.planning.scene import Scene, SceneMaterial
from homofact.planning.search import BEST_PART, LadderOutcome, walk
from homofact.planning.tolerance import Tolerance
from homofact.scene.lighting import named_lighting

FIRST, SECOND = Candidate("search", 1, 8), Candidate("search", 2, 16)


@pytest.fixture
def now(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """The time, which the test sets; every fit is modelled to take 2 s."""
    time = [0.0]
    monkeypatch.setattr(module, "time", SimpleNamespace(monotonic=lambda: time[0]))
    monkeypatch.setattr(module, "fit_seconds", lambda *_: 2.0)
    monkeypatch.setattr(module, "verdict_seconds", lambda _: 0.0)
    return time


def clock(now: list[float]) -> tuple[PlanClock, list[tuple[str, float, float]]]:
    said: list[tuple[str, float, float]] = []
    return PlanClock(lambda *step: said.append(step), _begun=now[0]), said


def test_a_time_is_expected_before_the_first_fit(now: list[float]) -> None:
    found, said = clock(now)
    found.expect(3, 3)
    found.stage("reading own")
    assert said[-1] == ("reading own", 0.0, (3 * USUAL + 3 * LARGER) * module._UNREAD)
    found.material(fits_of(PAINT), "planning own")
    assert said[-1] == ("planning own", 0.0, (USUAL + 2 * USUAL + 3 * LARGER) * 2.0)


def test_the_time_is_of_the_whole_plan(now: list[float], monkeypatch: pytest.MonkeyPatch) -> None:
    """Materials that follow, those of the plan under another lighting, larger steps and verdicts all count."""
    monkeypatch.setattr(module, "verdict_seconds", lambda _: 0.5)
    found, said = clock(now)
    found.following = 3
    found.expect(3, 3)
    found.material(fits_of(PAINT), "planning own")
    whole = (USUAL + 2 * USUAL + 3 * USUAL + 3 * LARGER) * 2.0 + 3 * 0.5
    assert said[-1][2] == whole
    found.asking(FIRST, None)
    assert said[-1][2] == whole
    found.material(fits_of(PAINT), "planning second")
    assert said[-1][2] < whole
    found.larger("fitting one step larger for own")
    assert said[-1][2] >= (LARGER + 2 * LARGER + 3 * USUAL) * module._UNREAD / 4 + 3 * 0.5
    # The plan under the other lighting begins.
    found.following = 0
    found.expect(3, 0)
    found.stage("looking for one size for all")
    assert said[-1][2] > 3 * 0.5


def test_where_choices_must_be_trusted_each_fit_is_judged(now: list[float], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "verdict_seconds", lambda _: 0.5)
    found, said = clock(now)
    found.expect(3, 3, trusted=True)
    found.material(fits_of(PAINT), "planning own")
    # None is judged again at the end.
    assert said[-1][2] == (USUAL + 2 * USUAL + 3 * LARGER) * 2.5
    found.asking(FIRST, None)
    now[0] += 2.5
    found.asking(SECOND, None)
    assert said[-1][2] == pytest.approx((USUAL - 1 + 2 * USUAL + 3 * LARGER) * 2.5)


@pytest.mark.parametrize(("larger", "steps"), [(True, 2), (False, 0)])
def test_a_plan_expects_larger_steps_only_where_they_follow(larger: bool, steps: int, now: list[float]) -> None:
    found, said = clock(now)

    class Begun(Exception):
        """The plan has said what it expects."""

    def stop(words: str) -> None:
        PlanClock.stage(found, words)
        raise Begun

    found.stage = stop
    two = (SceneMaterial("material:phong-10", 1.0), SceneMaterial("material:lafortune-clay", 0.5))
    scene = Scene("two", two, (named_lighting("studio"),), Tolerance.of(delta_e=1.0))
    with pytest.raises(Begun):
        plan_scene(scene, clock=found, larger=larger)
    assert said[-1][2] == (2 * USUAL + steps * LARGER) * module._UNREAD


def test_what_fits_take_corrects_the_rest(now: list[float]) -> None:
    found, said = clock(now)
    found.expect(1, 0)
    found.material(fits_of(PAINT), "planning own")
    found.asking(FIRST, None)
    assert said[-1][0] == "planning own: fit 1, 1 texture of 8², floats (search)"
    assert said[-1][2] == 2.0 + (USUAL - 1) * 2.0
    now[0] = 10.0  # five times as long as modelled: (10 + 2)/(2 + 2)
    found.asking(SECOND, None)
    assert said[-1][1:] == (10.0, 3 * (2.0 + (USUAL - 2) * 2.0))
    now[0] = 20.0
    found.larger("fitting one step larger for own")
    assert said[-1][2] == pytest.approx(22 / 6 * LARGER * 2.0)
    found.stage("looking for one size for all")
    assert said[-1][2] == 0.0


def test_one_colour_and_what_was_fitted_count_for_nothing(now: list[float]) -> None:
    found, said = clock(now)
    found.expect(1, 0)
    fits = fits_of(PAINT)
    found.material(fits, "planning own")
    found.asking(Candidate(CONSTANT), None)
    assert len(said) == 1
    fits.made[FIRST] = None  # pyright: ignore[reportArgumentType]
    found.asking(FIRST, None)
    assert said[-1][0].startswith("planning own: fit 0")
    assert said[-1][2] == USUAL * 2.0


def test_a_tolerance_that_is_not_met_says_how_many_fits_may_follow(now: list[float]) -> None:
    found, said = clock(now)
    found.expect(1, 0)
    found.material(fits_of(PAINT), "planning own")
    asked: list[int | None] = []

    def before(candidate: Candidate, most: int | None) -> None:
        asked.append(most)
        found.asking(candidate, most)

    def missed(candidate: Candidate) -> LadderOutcome:
        return LadderOutcome(900.0, candidate.most_bytes(3), candidate.most_fetches(True), candidate.textures)

    state = walk(ladder(), missed, 1.0, before=before)
    known = [most for most in asked if most is not None]
    assert not state.met
    # The last question was the last one that it could be.
    assert known[-1] == 1
    assert known[0] <= BEST_PART * fits_among(ladder()) + 1
    assert said[-1][0].endswith("none meets the tolerance so far, at most 1 fit left")
    assert said[-1][2] == pytest.approx(2.0 * 2.0 / (2.0 * (len(known) + 1 - 1) + 2.0), rel=1)


def test_judging_the_choices_says_how_long_the_rest_of_them_takes(monkeypatch: pytest.MonkeyPatch) -> None:
    now = [0.0]
    monkeypatch.setattr(planning, "time", SimpleNamespace(monotonic=lambda: now[0]))

    class Judged:
        """A material whose verdict takes twice as long as modelled."""

        def __init__(self, name: str, samples: int, choice: Candidate | None = FIRST) -> None:
            self.name, self.walk = name, SimpleNamespace(choice=choice, kept=lambda rung: rung)
            self.fits = SimpleNamespace(source=SimpleNamespace(samples=range(samples)))

        @property
        def verdict(self) -> None:
            now[0] += 2 * verdict_seconds(len(self.fits.source.samples))

    told: list[ProgressStep] = []
    distinct = (Judged("clay", 10_000), Judged("none", 10_000, None), Judged("paint", 1_000_000))
    found: Any = SimpleNamespace(distinct=distinct)
    verdicts = planning._verdicts(found, ProgressSteps(told.append))
    assert list(verdicts) == [f"clay, {FIRST.words}", f"paint, {FIRST.words}"]
    assert [step.stage for step in told] == [f"1/2 judging clay, {FIRST.words}", f"2/2 judging paint, {FIRST.words}"]
    clay, paint = verdict_seconds(10_000), verdict_seconds(1_000_000)
    assert [step.left for step in told] == [pytest.approx(clay + paint), pytest.approx(2 * paint)]
