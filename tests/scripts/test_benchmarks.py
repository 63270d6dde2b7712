"""The benchmark programs in their short forms: what they compare is the same work, and their figures hang together.

Times are printed by them and never judged here.
"""

import math
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import pytest

from homofact.errors import Report, Status

pytestmark = pytest.mark.usefixtures("one_thread")


def tables(text: str) -> list[list[dict[str, str]]]:
    """All Markdown tables of a text, as rows by column; of columns with one name the first counts."""
    found: list[list[list[str]]] = [[]]
    for line in text.splitlines():
        if line.startswith("|"):
            found[-1].append([cell.strip() for cell in line.strip("|").split(" | ")])
        elif found[-1]:
            found.append([])
    return [
        [dict(reversed(list(zip(head, row, strict=True)))) for row in rows] for head, _, *rows in filter(None, found)
    ]


def shown(text: str) -> None:
    """Conditions that every figure needs beside it."""
    for words in ("cores", "load average", "torch", "ε = 1e-05", "one torch thread", "a smoke test"):
        assert words in text


@pytest.mark.slow
def test_cole_is_extrapolated_from_what_was_counted_and_timed(
    script: Callable[[str], ModuleType], capsys: pytest.CaptureFixture[str]
) -> None:
    module = script("accuracy.search_against_cole")
    assert module.main(["--short", "--efforts", "20"]) == 0
    text = capsys.readouterr().out
    shown(text)
    fits, terms = tables(text)
    qmr, cholesky, free, pinned = fits
    assert qmr["fit"] == "cole, QMR (extrapolated)"
    assert free["fit"] == "search, any kinds, 20.0"
    assert pinned["fit"] == "search, half-diff, 20.0"
    evaluations = [int(row["evaluations"]) for row in terms]
    assert len(evaluations) == 3
    assert sum(evaluations) == int(qmr["evaluations"]) == int(cholesky["evaluations"])
    total = sum(count * float(row["ms, QMR"]) for count, row in zip(evaluations, terms, strict=True)) / 1000
    assert total == pytest.approx(float(qmr["seconds"]), rel=0.02)
    assert terms[1]["ms, QMR"] == terms[2]["ms, QMR"]
    assert int(terms[1]["timed with QMR"]) == 19
    assert [row["textures solved"] for row in terms] == ["1", "2", "2"]
    for row in (free, pinned):
        ratio = float(qmr["seconds"]) / float(row["seconds"])
        assert float(row["times faster"]) == pytest.approx(ratio, rel=0.02)
        assert float(row["seconds"]) < 30
    for row in fits:
        assert 0 < float(row["training"]) < 0.2
        assert 0 < float(row["second draw"]) < 0.4
    assert float(free["training"]) < float(cholesky["training"])
    # The first restart of both runs is the same search, whatever solves it.
    words = text[text.index("First restart of the first term:") :].split()
    own, theirs = (words[place] for place in (6, 12))
    assert own == theirs
    assert int(own) == int(terms[0]["timed with QMR"]) + 1
    assert float(words[9]) == pytest.approx(float(words[14]), rel=1e-5)


def test_later_terms_cost_what_the_second_does(script: Callable[[str], ModuleType]) -> None:
    module = script("accuracy.search_against_cole")
    # The first evaluation of a term begins with what ended the term before, so it is not counted.
    part = module.Tally(ends={1: [(5.0, 1.0), (7.0, 2.0), (9.0, 3.0)], 2: [(20.0, 9.0), (25.0, 12.0)]})
    each, total = module.extrapolate([100, 10, 1], part)
    assert each == [(2.0, 1.0), (5.0, 3.0), (5.0, 3.0)]
    assert total == (200 + 50 + 5, 100 + 30 + 3)


def test_an_exponent_is_the_slope_of_the_logarithms(script: Callable[[str], ModuleType]) -> None:
    module = script("speed.cost_against_samples")
    counts = [3000, 10_000, 70_000]
    assert module.exponent(counts, [2e-5 * count**1.3 for count in counts]) == pytest.approx(1.3, abs=1e-12)
    assert module.slope([0, 1, 2], [5, 7, 9.0]) == pytest.approx(2)


@pytest.mark.slow
def test_an_evaluation_holds_nothing_for_every_sample(
    script: Callable[[str], ModuleType], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    module, plot = script("speed.cost_against_samples"), tmp_path / "cost.png"
    assert module.main(["--short", "--plot", str(plot)]) == 0
    text = capsys.readouterr().out
    shown(text)
    assert plot.read_bytes().startswith(b"\x89PNG")
    seconds, exponents, memory, growth = tables(text)
    assert [int(row["samples"]) for row in seconds] == [int(row["samples"]) for row in memory] == [2000, 100_000]
    assert all(math.isfinite(float(row["all counts"])) for row in exponents)
    bytes_a_sample = {row["memory"]: float(row["bytes a sample"]) for row in growth}
    assert bytes_a_sample["the samples themselves"] == 10 * 8  # ωi, ωo, RGB, weight
    if Path("/proc/self/clear_refs").exists():
        # Two textures of four coordinates; and per evaluation nothing but what a page is rounded up to.
        assert bytes_a_sample["prepared coordinates, held by the search"] == pytest.approx(2 * 4 * 8, rel=0.1)
        assert bytes_a_sample["evaluations, peak beyond both"] < 8
        assert bytes_a_sample["whole search, peak beyond the samples"] > 2 * 4 * 8


def test_the_race_is_won_by_who_reaches_first(
    script: Callable[[str], ModuleType], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    module = script("speed.nlopt_race")
    names = [search.name for search in module.SEARCHES]
    assert names == [
        "gradient",
        "powell",
        *(f"nlopt-{name}" for name in ("PRAXIS", "SBPLX", "BOBYQA", "COBYLA", "LD_LBFGS", "LD_SLSQP", "MLSL")),
    ]

    def report(*trace: tuple[float, int, float]) -> Report:
        return Report(Status.BUDGET, 0, 50, 2.0, trace[-1][2], 0, trace)

    slow_and_low = report((0.1, 1, 9.0), (0.5, 4, 1.3), (1.5, 40, 1.0))
    quick = report((0.1, 1, 9.0), (0.2, 2, 1.24), (0.3, 3, 1.04))
    assert module.reached(quick, 1.05) == (0.3, 3)
    assert module.reached(slow_and_low, 0.9) == (math.inf, math.inf)
    near, stuck = report((0.1, 1, 9.0), (0.15, 2, 1.07)), report((0.1, 1, 9.0))
    monkeypatch.setattr(module, "PROBLEMS", module.PROBLEMS[:3])
    arrivals = {"gradient": slow_and_low, "powell": quick, "nlopt-PRAXIS": near}
    monkeypatch.setattr(module, "race", lambda *_: dict.fromkeys(names, stuck) | arrivals)
    assert module.main(["--within", "0.05", "0"]) == 0
    at_5, summary_5, at_0, summary_0 = tables(capsys.readouterr().out)
    assert [row["powell"] for row in at_5] == ["0.3 (3)"] * 3
    assert {row["search"]: row["first"] for row in summary_5} == dict.fromkeys(names, "0") | {"powell": "3"}
    assert [row["powell"] for row in at_0] == ["—"] * 3
    gradient = summary_0[0]
    assert (gradient["first"], gradient["reached"], gradient["median s"]) == ("3", "3", "1.5")
    assert gradient["evaluations a second"] == "25"
    assert summary_5[1]["median end / lowest"] == "1.04"
    assert (summary_5[2]["reached"], summary_5[2]["median s"]) == ("0", "—")
    assert at_5[0]["nlopt-PRAXIS"] == "—"


@pytest.mark.slow
def test_every_search_races_from_the_same_start(
    script: Callable[[str], ModuleType], capsys: pytest.CaptureFixture[str]
) -> None:
    module = script("speed.nlopt_race")
    assert len(module.PROBLEMS) == 10
    assert len({problem.name for problem in module.PROBLEMS}) == 10
    reports = module.race(module.PROBLEMS[1], 400, 5, 0.1)
    firsts = {report.trace[0][2] for report in reports.values()}
    assert max(firsts) == pytest.approx(min(firsts), rel=1e-9)
    assert all(report.seconds < 5 for report in reports.values())
    assert module.main(["--short", "--within", "0.05"]) == 0
    text = capsys.readouterr().out
    shown(text)
    race, summary = tables(text)
    assert len(race) == 2
    for row in race:
        assert any(row[name] != "—" for name in reports)
    # Whoever found the lowest value has reached it.
    assert sum(int(row["first"]) for row in summary) >= 2
    assert sum(int(row["reached"]) for row in summary) >= sum(int(row["first"]) for row in summary)
