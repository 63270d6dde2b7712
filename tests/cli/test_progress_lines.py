"""Lines that say where a command is: the first after some seconds, then now and then, none of a short command."""

import io
import math
import re
import subprocess
import sys
import time
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from rich.console import Console
from rich.text import Text

from homofact.api.charting import chart
from homofact.api.comparing import compare
from homofact.api.factorizing import factorize
from homofact.api.progress import ProgressStep, ProgressSteps
from homofact.brdf.analytic.lambert import Lambert
from homofact.brdf.sampling import sample_model
from homofact.cli import progress_lines
from homofact.cli.progress_lines import ProgressLines, duration
from homofact.cli.screen import PROGRESS, Screen
from homofact.evaluation import repeats
from homofact.evaluation.time_left import TimeLeft
from homofact.methods.fitting import FitProgress
from homofact.methods.mccool import McCool
from homofact.methods.svd import Svd


@pytest.fixture(autouse=True)
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(progress_lines, "FIRST", 0.1)
    monkeypatch.setattr(progress_lines, "EVERY", 0.1)
    monkeypatch.delenv(PROGRESS)


def until(lines: list[str], count: int) -> None:
    begun = time.monotonic()
    while len(lines) < count:
        assert time.monotonic() - begun < 20
        time.sleep(0.01)


def test_a_long_command_says_where_it_is_and_how_long_it_takes() -> None:
    lines: list[str] = []
    with ProgressLines(lines.append).running() as show:
        until(lines, 1)
        show(ProgressStep("tracing", 10, 40))
        time.sleep(0.1)
        show(ProgressStep("tracing", 30, 40, "9 rays"))
        show(ProgressStep(note="a note"))
        until(lines, len(lines) + 2)
        show(ProgressStep("writing"))
        until(lines, len(lines) + 2)
    assert lines[0].startswith("loading libraries")
    assert "tracing, 9 rays, under 10 s left in this step" in lines
    assert lines[-1].startswith("writing")
    assert not any("note" in line for line in lines)


def test_the_time_left_is_of_this_stage_and_of_what_it_has_done(monkeypatch: pytest.MonkeyPatch) -> None:
    now = [0.0]
    monkeypatch.setattr(progress_lines, "time", SimpleNamespace(monotonic=lambda: now[0]))
    lines: list[str] = []

    def said(seconds: float, step: ProgressStep) -> str:
        now[0] = seconds
        show(step)
        until(lines, len(lines) + 2)
        return lines[-1]

    with ProgressLines(lines.append).running() as show:
        assert said(0, ProgressStep("slow", 0, 4)) == "slow"
        assert said(100, ProgressStep("slow", 1, 4)) == "slow, about 3 to 9 min left in this step"
        # A stage of as many parts: what the first one took says nothing of it.
        assert said(110, ProgressStep("fast", 0, 4)) == "fast"
        assert said(114, ProgressStep("fast", 1, 4)) == "fast, up to 30 s left in this step"
        # A run that goes on has blocks that took no time: 10 of 20 were there, 5 took 50 s.
        assert said(200, ProgressStep("blocks", 10, 20)) == "blocks"
        assert said(250, ProgressStep("blocks", 15, 20)) == "blocks, about 50 s left in this step"
        # A block that takes longer slows the rest.
        assert said(300, ProgressStep("blocks", 15, 20)) == "blocks, about 2 min left in this step"
        assert said(310, ProgressStep("writing")) == "writing"
        assert said(340, ProgressStep("reading")).startswith("reading")


def test_a_time_that_is_expected_is_told_and_runs_down(monkeypatch: pytest.MonkeyPatch) -> None:
    now = [0.0]
    monkeypatch.setattr(progress_lines, "time", SimpleNamespace(monotonic=lambda: now[0]))
    lines: list[str] = []

    def said(seconds: float) -> str:
        now[0] = seconds
        until(lines, len(lines) + 2)
        return lines[-1]

    with ProgressLines(lines.append).running() as show:
        show(ProgressStep("planning", time=TimeLeft(40, 35, 60, 60, whole=True)))
        assert said(0) == "planning, about 40 s left"
        assert said(30) == "planning, up to 30 s left"
        # Nothing is promised that did not hold.
        assert said(60) == "planning, takes longer than expected"
        show(ProgressStep("rendering", time=TimeLeft.within(40)))
        assert said(60) == "rendering, about 20 to 80 s left in this step"


def test_no_slow_library_is_loaded_before_progress_is_shown() -> None:
    """Torch takes seconds: a command that loads it first says nothing in that time."""
    commands = [
        ["plan", "s.toml"], ["relight", "s.toml", "--out", "o"], ["edit", "s.toml", "--out", "o"],
        ["measure", "--out", "o"], ["compare", "material:phong-30"], ["factorize", "material:phong-30", "--out", "o"],
        ["sweep", "s.toml", "--out", "o"], ["export", "fit", "--out", "o"], ["info", "s.brdf"], ["view", "fit"],
        ["render", "fit", "--out", "o.png"],
    ]  # fmt: skip
    script = (
        "import sys\n"
        "from homofact.cli.screen import Screen\n"
        "from homofact.cli.main import main\n"
        "def shown(self):\n"
        "    print('shown', 'torch' in sys.modules)\n"
        "    raise KeyboardInterrupt\n"
        "Screen.progress = shown\n"
        f"for line in {commands!r}:\n"
        "    print(*line)\n"
        "    main(line)\n"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines() == [word for line in commands for word in (" ".join(line), "shown False")]


def test_each_stage_that_lasts_is_named_once_and_a_passing_one_is_not(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(progress_lines, "EVERY", 60.0)
    lines: list[str] = []
    with ProgressLines(lines.append).running() as show:
        until(lines, 1)
        show(ProgressStep("passing"))
        show(ProgressStep("fitting the table"))
        until(lines, 2)
        time.sleep(0.3)
        for done in range(4):
            show(ProgressStep(f"{done + 1}/4 paint", done, 4))
            time.sleep(0.15)
        show(ProgressStep("writing"))
        until(lines, 3)
    assert lines == ["loading libraries", "fitting the table", "writing"]


def test_a_counted_stage_and_one_with_an_expected_time_are_named_once_soon(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(progress_lines, "EVERY", 60.0)
    monkeypatch.setattr(progress_lines, "SOON", 0.3)
    lines: list[str] = []
    with ProgressLines(lines.append).running() as show:
        steps = ProgressSteps(show)
        until(lines, 1)
        # The parts of a run have the name of the run, however they are counted, and so have the terms of its fits.
        for done in range(6):
            steps.run("shadows on knot", done, 6)
            time.sleep(0.15)
        steps.run("cole", 0, 1)
        for restart in range(6):
            steps(FitProgress(1, 2, restart + 1, 8, 7, math.inf))
            time.sleep(0.15)
        steps.stage("rendering", 40.0)
        until(lines, 4)
        time.sleep(0.5)
    kinds = [re.sub(r"\d+", "#", line) for line in lines]
    assert len(lines) == 4
    assert kinds[0] == "loading libraries"
    assert kinds[1].startswith("#/# shadows on knot")
    assert kinds[2].startswith("#/# cole: term #/#, restart #/#")
    assert lines[3] == "rendering, about 20 to 80 s left in this step"


def test_a_short_command_and_one_that_answers_in_json_say_nothing(
    capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    with Screen(False, False).progress() as show:
        show(ProgressStep("quick"))
    for screen in (Screen(True, False), Screen(False, True)):
        with screen.progress() as show:
            show(ProgressStep("slow"))
            time.sleep(0.3)
    monkeypatch.setenv(PROGRESS, "0")
    with Screen(False, False).progress() as show:
        show(ProgressStep("slow"))
        time.sleep(0.3)
    assert capfd.readouterr() == ("", "")


def test_stderr_gets_the_lines(capfd: pytest.CaptureFixture[str]) -> None:
    with Screen(False, False).progress() as show:
        show(ProgressStep("slow"))
        time.sleep(0.5)
    out, err = capfd.readouterr()
    assert out == ""
    assert "homofact: slow" in err


@pytest.mark.parametrize(
    ("seconds", "words"), [(0.2, "1 s"), (119, "119 s"), (121, "3 min"), (3600, "60 min"), (7300, "2 h 2 min")]
)
def test_durations(seconds: float, words: str) -> None:
    assert duration(seconds) == words


def test_factorize_says_how_long_its_fits_take(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("homofact.api.progress.WORTH_SAYING", 0.0)
    notes: list[str] = []
    samples = sample_model(Lambert((0.6, 0.3, 0.1)), 300)
    method = McCool(size=4, projections=("theta_h-theta_d",))
    given = samples.wi, samples.wo, samples.values
    factorize(given, tmp_path / "o", method, progress=lambda step: notes.append(step.note))
    # McCool's own projections are fitted beside these.
    assert "2 fits, under 10 s" in notes


def test_a_run_with_an_expected_time_prints_one_time_and_keeps_it_during_its_fits(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    now = [0.0]
    for module in ("homofact.cli.progress_lines", "homofact.api.progress"):
        monkeypatch.setattr(f"{module}.time", SimpleNamespace(monotonic=lambda: now[0]))
    lines: list[str] = []
    with ProgressLines(lines.append).running() as show:
        steps = ProgressSteps(show)
        steps.run("paint: mccool", 0, 4, TimeLeft(80, 70, 90, 90, whole=True))
        now[0] = 30
        steps(FitProgress(2, 2, 1, 1, 7, math.inf))
        until(lines, len(lines) + 2)
        assert lines[-1] == "1/4 paint: mccool: term 2/2, 7 evaluations, about 50 s left"
        # A run without an expected time forgets that of the one before: a quarter took 60 s.
        steps.run("paint: search", 0, 4)
        now[0] = 90
        steps.run("paint: search", 1, 4)
        until(lines, len(lines) + 2)
        assert lines[-1] == "2/4 paint: search, about 1 to 6 min left in this step"


def test_a_chart_expects_one_time_for_all_its_runs(tmp_path: Path) -> None:
    steps: list[ProgressStep] = []
    chart("material:lafortune-clay", tmp_path, ["mccool"], sizes=[2, 3], progress=steps.append)
    runs = [step for step in steps if re.match(r"\d/2 ", step.stage)]
    assert {step.stage[:3] for step in runs} == {"1/2", "2/2"}
    assert all(step.time is not None and step.time.whole and "left" not in step.stage for step in runs)


def test_a_comparison_expects_one_time_for_all_its_fits_and_begins_every_one(monkeypatch: pytest.MonkeyPatch) -> None:
    """The first fits take as long as modelled, those of the other method ten times as long."""
    now = [0.0]
    monkeypatch.setattr("homofact.evaluation.estimate.time", SimpleNamespace(monotonic=lambda: now[0]))
    monkeypatch.setattr("homofact.evaluation.estimate.fit_seconds", lambda *_: 20.0)
    fit = repeats.fit_and_measure

    def fitted(source: Any, settings: Any, *given: Any) -> Any:
        now[0] += 20.0 if settings.size == 2 else 200.0
        return fit(source, settings, *given)

    monkeypatch.setattr(repeats, "fit_and_measure", fitted)
    told: list[ProgressStep] = []
    methods = {"quick": McCool(size=2), "slow": Svd(size=3)}
    compare("material:lafortune-clay", methods, splits=3, progress=told.append)
    runs = [step for step in told if re.match(r"\d/6 ", step.stage)]
    assert [step.stage for step in runs] == [
        f"{number + 1}/6 {'quick' if number < 3 else 'slow'}" for number in range(6)
    ]
    assert [step.left for step in runs] == pytest.approx([120, 100, 80, 60, 381, 195], rel=0.05)
    assert all(step.time is not None and step.time.whole for step in runs)
    assert [step.note for step in told if " fits" in step.note] == ["6 fits, about 60 s to 4 min"]


def test_the_bar_of_a_terminal_shows_one_time(monkeypatch: pytest.MonkeyPatch) -> None:
    terminal = io.StringIO()
    screen = Screen(False, False)
    monkeypatch.setattr(screen, "_err", Console(file=terminal, force_terminal=True, width=120))
    drawn: list[str] = []
    with screen.progress() as show:
        # Rich draws anew what has not begun twice a second.
        for left in (TimeLeft(40, 35, 50, 50, whole=True), None):
            show(ProgressStep("1/9 paint", 0, 9, "7 evaluations", time=left))
            time.sleep(0.8)
            # A terminal shows the last of the drawings, each of which goes back to the start of its line.
            drawn.append(Text.from_ansi(terminal.getvalue()).plain.splitlines()[-1])
    # Beside the time that has passed, the one that is expected, or else none.
    assert drawn[0].count("about 40 s left") == 1
    assert [len(re.findall(r"\d:\d\d:\d\d|-:--", line)) for line in drawn] == [1, 1]
    assert "left" not in drawn[1]
