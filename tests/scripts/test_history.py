"""The history of what commands take: lines are kept whole, rises are found, times of other machines say nothing."""

import csv
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from threadpoolctl import threadpool_info, threadpool_limits

from scripts.speed import history
from scripts.speed.command_time import Run
from scripts.speed.history import Line, main, risen

LINE = Line("2026-01-02", "0.1.0", "fast, 2 cores", "info", 10.0, 2.0, 2.5, 300.0, 120.0, 0.05, None)


def _now(**changes: object) -> Line:
    return replace(LINE, version="0.2.0", **changes)


@pytest.mark.parametrize("name", ["work", "peak", "evaluations", "error"])
def test_a_rise_by_a_fifth_is_found_and_less_is_not(name: str) -> None:
    value = getattr(LINE, name)
    assert risen([LINE], [_now(**{name: 1.19 * value})]) == []
    (found,) = risen([LINE], [_now(**{name: 1.21 * value})])
    assert name in found
    assert "info" in found


def test_time_and_memory_of_another_machine_say_nothing_and_errors_do() -> None:
    assert risen([LINE], [_now(machine="slow, 2 cores", work=30.0, peak=900.0)]) == []
    assert len(risen([LINE], [_now(machine="slow, 2 cores", error=0.1)])) == 1


def test_the_last_line_of_another_version_counts() -> None:
    earlier = [LINE, replace(LINE, version="0.1.1", work=20.0), replace(LINE, version="0.2.0", work=1.0)]
    assert risen(earlier, [_now(work=21.0)]) == []
    assert risen(earlier, [_now(work=25.0)]) != []
    assert risen([LINE], [_now(command="view", work=99.0)]) == []
    assert risen([LINE], [_now(rms=0.5)]) == []


@pytest.mark.slow
def test_lines_are_appended_read_back_checked_and_drawn(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    kept, plot = tmp_path / "history.csv", tmp_path / "history.png"
    words = ["--short", "--write", "--csv", str(kept), "--data", str(tmp_path)]
    assert main([*words, "--plot", str(plot)]) == 0
    assert plot.read_bytes()[:4] == b"\x89PNG"
    before = kept.read_text()
    monkeypatch.setattr(history, "version_of", lambda checkout: "another")
    monkeypatch.setattr(history, "RISE", 1e-9)
    assert main([*words, "--check"]) == 1
    assert kept.read_text().startswith(before)
    with kept.open(newline="") as file:
        lines = [Line.read(row) for row in csv.DictReader(file)]
    assert [line.command for line in lines] == 2 * ["info", "factorize measurement"]
    assert lines[1].evaluations == lines[3].evaluations
    assert lines[1].error == lines[3].error
    assert all(line.work > 0 and line.peak > 50 and line.evaluations is None for line in lines[::2])


def test_the_reference_loop_runs_on_one_thread(monkeypatch: pytest.MonkeyPatch) -> None:
    """Threads that wait for work count as processor time: the loop would take as long as the machine has cores."""
    seen = []
    factor = np.linalg.cholesky

    def watched(matrix: np.ndarray) -> np.ndarray:
        seen.append(max(pool["num_threads"] for pool in threadpool_info() if pool["user_api"] == "blas"))
        return factor(matrix)

    monkeypatch.setattr(history, "LOOP_TURNS", 1)
    monkeypatch.setattr(np.linalg, "cholesky", watched)
    with threadpool_limits(2):
        assert history.reference() > 0
    assert seen == [1]


def test_lines_stay_when_a_later_command_fails(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    kept, asked = tmp_path / "history.csv", []

    def timed(command: list[str], ends: tuple[int, ...]) -> Run:
        asked.append((command[-2], ends))
        if "factorize" in command:
            raise RuntimeError("ended with 1")
        return Run(2.0, 1.5, 300.0)

    monkeypatch.setattr(history, "timed", timed)
    words = ["--repeats", "1", "--write", "--csv", str(kept), "--data", str(tmp_path)]
    with pytest.raises(RuntimeError):
        main([*words, "--only", "info,factorize measurement"])
    with kept.open(newline="") as file:
        (line,) = [Line.read(row) for row in csv.DictReader(file)]
    assert (line.command, line.wall, line.cpu) == ("info", 2.0, 1.5)
    assert len(asked) == 2


def test_a_missed_plan_is_timed(tmp_path: Path) -> None:
    for name in ("rgl/vch_golden_yellow_rgb.bsdf", "cornell/garnet_red.brdf"):
        (tmp_path / name).parent.mkdir()
        (tmp_path / name).touch()
    ends = {command.name: command.ends for command in history.commands(tmp_path, False, True)}
    assert ends.pop("plan of two measurements") == (0, 1)
    assert set(ends.values()) == {(0,)}
