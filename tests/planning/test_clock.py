"""What a plan says of its time: an expectation before the first fit, one that follows what the fits take."""

from types import SimpleNamespace
from typing import Any

import pytest
from plan_cases import PAINT, fits_of

from homofact.api import planning
from homofact.api.progress import ProgressStep, ProgressSteps
from homofact.evaluation import estimate
from homofact.evaluation.estimate import verdict_seconds
from homofact.evaluation.time_left import TimeLeft
from homofact.planning import clock as module
from homofact.planning.clock import LARGER, TEXTURED, PlanClock
from homofact.planning.ladder import CONSTANT, MODELS, Candidate, fits_among, ladder
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
    monkeypatch.setattr(estimate, "time", SimpleNamespace(monotonic=lambda: time[0]))
    monkeypatch.setattr(module, "fit_seconds", lambda *_: 2.0)
    monkeypatch.setattr(module, "verdict_seconds", lambda _, first: 0.0)
    return time


def clock() -> tuple[PlanClock, list[tuple[str, TimeLeft]]]:
    said: list[tuple[str, TimeLeft]] = []
    return PlanClock(lambda *step: said.append(step)), said


def of_fits(models: int, textured: int, larger: int, seconds: float = 2.0) -> list[float]:
    """The expected, the least and the most seconds of the fits of so many materials and larger steps."""
    both = zip(TEXTURED, LARGER, strict=True)
    usual, least, most = (seconds * (textured * each + larger * step) for each, step in both)
    models_seconds = models * len(MODELS) * module._MODEL
    return [models_seconds + usual, (models_seconds + least) / 2, 2 * (models_seconds + most)]


def range_of(left: TimeLeft) -> list[float]:
    return [left.seconds, left.least, left.most]


def test_a_range_is_expected_before_the_first_fit(now: list[float]) -> None:
    found, said = clock()
    found.expect(3, 3)
    found.stage("reading own")
    assert said[-1][0] == "reading own"
    assert range_of(said[-1][1]) == of_fits(3, 3, 3, module._UNREAD)
    found.material(fits_of(PAINT), "planning own")
    assert range_of(said[-1][1]) == of_fits(3, 3, 3)
    # What is not known in advance is no number.
    assert said[-1][1].words() == ""


def test_the_time_is_of_the_whole_plan(now: list[float], monkeypatch: pytest.MonkeyPatch) -> None:
    """Materials that follow, those of the plan under another lighting, larger steps and verdicts all count."""
    monkeypatch.setattr(module, "verdict_seconds", lambda _, first: 0.5)
    found, said = clock()
    found.following = 3
    found.expect(3, 3)
    found.material(fits_of(PAINT), "planning own")
    whole = of_fits(6, 6, 3)
    assert range_of(said[-1][1]) == [whole[0] + 1.5, whole[1] + 0.75, whole[2] + 3]
    assert said[-1][1].whole
    found.material(fits_of(PAINT), "planning second")
    one_less = of_fits(5, 5, 3)
    assert range_of(said[-1][1]) == [one_less[0] + 1.5, one_less[1] + 0.75, one_less[2] + 3]
    found.larger("fitting one step larger for own")
    steps = of_fits(3, 3, 3)
    assert range_of(said[-1][1]) == [steps[0] + 1.5, steps[1] + 0.75, steps[2] + 3]
    # The plan under the other lighting begins.
    found.following = 0
    found.expect(3, 0)
    found.stage("looking for one size for all")
    assert said[-1][1].seconds > 1.5


def test_where_choices_must_be_trusted_each_fit_is_judged(now: list[float], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "verdict_seconds", lambda _, first: 0.5)
    found, said = clock()
    found.expect(3, 3, trusted=True)
    found.material(fits_of(PAINT), "planning own")
    # None is judged again at the end.
    assert range_of(said[-1][1]) == of_fits(3, 3, 3, 2.5)


@pytest.mark.parametrize(("larger", "steps"), [(True, 2), (False, 0)])
def test_a_plan_expects_larger_steps_only_where_they_follow(larger: bool, steps: int, now: list[float]) -> None:
    found, said = clock()

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
    assert range_of(said[-1][1]) == of_fits(2, 2, steps, module._UNREAD)


def test_what_fits_take_corrects_the_rest(now: list[float]) -> None:
    found, said = clock()
    found.expect(1, 0)
    found.material(fits_of(PAINT), "planning own")
    found.asking(FIRST, None)
    assert said[-1][0] == "planning own: fit 1, 1 texture of 8², floats (search)"
    assert said[-1][1].seconds == 2.0 + 1 * 2.0
    assert said[-1][1].running == 4.0
    now[0] = 10.0  # five times as long as modelled: (10 + 1)/(2 + 1), and of what two fits take
    found.asking(SECOND, None)
    assert said[-1][1].seconds == pytest.approx(11 / 3 * (2.0 + 1 * 2.0))
    assert said[-1][1].most < 2 * 11 / 3 * TEXTURED[2] * 2.0
    now[0] = 20.0
    found.larger("fitting one step larger for own")
    assert said[-1][1].seconds == pytest.approx(21 / 5 * LARGER[0] * 2.0)
    found.stage("looking for one size for all")
    assert said[-1][1].seconds == 0.0


def test_models_which_are_quick_tell_nothing_of_textures(now: list[float]) -> None:
    found, said = clock()
    found.expect(1, 0)
    found.material(fits_of(PAINT), "planning own")
    found.asking(MODELS[0], None)
    now[0] = 0.1
    found.asking(MODELS[1], None)
    now[0] = 0.2
    found.asking(FIRST, None)
    assert said[-1][1].seconds >= 4.0 / 3


def test_one_colour_and_what_was_fitted_count_for_nothing(now: list[float]) -> None:
    found, said = clock()
    found.expect(1, 0)
    fits = fits_of(PAINT)
    found.material(fits, "planning own")
    found.asking(Candidate(CONSTANT), None)
    assert len(said) == 1
    fits.made[FIRST] = None  # pyright: ignore[reportArgumentType]
    found.asking(FIRST, None)
    assert said[-1][0].startswith("planning own: fit 0")
    assert said[-1][1].seconds == TEXTURED[0] * 2.0


def test_a_tolerance_that_is_not_met_says_how_many_fits_may_follow(now: list[float]) -> None:
    found, said = clock()
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
    # No fit may follow the one that runs.
    assert said[-1][1].most == pytest.approx(said[-1][1].running)
    assert 0 < said[-1][1].most < 4.0


def test_judging_the_choices_says_how_long_the_rest_of_them_takes(monkeypatch: pytest.MonkeyPatch) -> None:
    now = [0.0]
    monkeypatch.setattr(estimate, "time", SimpleNamespace(monotonic=lambda: now[0]))

    class Judged:
        """A material whose verdict takes twice as long as modelled."""

        def __init__(self, name: str, samples: int, choice: Candidate | None = FIRST) -> None:
            self.name, self.walk = name, SimpleNamespace(choice=choice, kept=lambda rung: rung)
            self.fits = SimpleNamespace(source=SimpleNamespace(samples=range(samples)))

        @property
        def verdict(self) -> None:
            now[0] += 2 * verdict_seconds(len(self.fits.source.samples), first=True)

    told: list[ProgressStep] = []
    distinct = (Judged("clay", 10_000), Judged("none", 10_000, None), Judged("paint", 1_000_000))
    found: Any = SimpleNamespace(distinct=distinct)
    verdicts = planning._verdicts(found, ProgressSteps(told.append))
    assert list(verdicts) == [f"clay, {FIRST.words}", f"paint, {FIRST.words}"]
    assert [step.stage for step in told] == [f"1/2 judging clay, {FIRST.words}", f"2/2 judging paint, {FIRST.words}"]
    clay, paint = (verdict_seconds(samples, first=True) for samples in (10_000, 1_000_000))
    slower = (2 * clay + 1) / (clay + 1)
    assert [step.left for step in told] == [pytest.approx(clay + paint), pytest.approx(slower * paint)]
