"""`homofact compare --chart`: what it leaves, how it goes on, and how it ends."""

import csv
import json
import os
import re
import subprocess
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from ran import Ran

import homofact.brdf.source
import homofact.evaluation.chart
from homofact.evaluation.compare import fit_and_measure
from homofact.evaluation.wording import brief_figure

SMALL = ["material:blinn-phong-50", "--count", "200"]
FAST = ["--size", "3,4", "--textures", "1", "--restarts", "1", "--search-size", "3", "--search-samples", "60"]
FAST += ["--methods", "mccool,cole"]
FILES = {"csv", "_time.png", "_time.svg", "_cost.png", "_cost.svg"}


@pytest.fixture
def chart(run: Callable[..., Ran]) -> Callable[..., Ran]:
    return partial(run, "compare")


def lines(path: Path) -> list[dict[str, str]]:
    with open(path, newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


@pytest.mark.slow
def test_each_source_gets_its_charts_and_its_file(
    chart: Callable[..., Ran], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    out = tmp_path / "deep" / "o"
    ran = chart("material:blinn-phong-50", "material:lafortune-clay", *SMALL[1:], *FAST, "--chart", out)
    assert (ran.code, ran.err) == (0, "")
    names = {f"{name}{ending}" for name in ("blinn-phong-50", "lafortune-clay") for ending in FILES - {"csv"}}
    names |= {"blinn-phong-50.csv", "lafortune-clay.csv"}
    assert {path.name for path in out.iterdir()} == names
    for word in ("mccool", "cole", "McCool", "held-out Cole error, ε = 1e-05", str(out / "lafortune-clay_cost.svg")):
        assert word in ran.out
    assert all(len(line) <= 80 for line in ran.out.splitlines() if str(tmp_path) not in line)
    assert "…" not in ran.out
    assert [row["source"] for row in lines(out / "lafortune-clay.csv")] == ["lafortune-clay"] * 4
    assert "<svg" in (out / "blinn-phong-50_time.svg").read_text()
    assert (out / "blinn-phong-50_time.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.slow
def test_json_is_one_object_with_the_rows_of_the_csv(chart: Callable[..., Ran], tmp_path: Path) -> None:
    ran = chart(*SMALL, *FAST, "--chart", tmp_path, "--seed", 3, "--json")
    assert (ran.code, ran.err) == (0, "")
    answer = json.loads(ran.out)
    assert set(answer) == {"rows", "files"}
    assert [Path(each).name for each in answer["files"]] == [
        "blinn-phong-50.csv",
        *(f"blinn-phong-50_{what}.{kind}" for what in ("time", "cost") for kind in ("png", "svg")),
    ]
    rows, found = answer["rows"], lines(tmp_path / "blinn-phong-50.csv")
    assert len(rows) == len(found) == 4
    for row, line in zip(rows, found, strict=True):
        assert (row["label"], row["seed"], row["epsilon"]) == (line["label"], 3, 1e-5)
        for part in ("train", "held_out"):
            for metric, value in row["error"][part].items():
                assert value == float(line[f"{part}_{metric}"])
        assert row["seconds"]["fit"] == float(line["seconds_fit"])
        assert (row["bytes"], row["fetches"]) == (int(line["bytes"]), int(line["fetches"]))


@pytest.mark.slow
def test_a_long_chart_says_first_how_long(
    chart: Callable[..., Ran], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("homofact.api.progress.WORTH_SAYING", 0.0)
    assert chart(*SMALL, *FAST, "--chart", tmp_path, "--json").err == "homofact: 4 fits, under 10 s\n"
    # What is there already is no work.
    assert chart(*SMALL, *FAST, "--chart", tmp_path, "--json").err == "homofact: 0 fits, under 10 s\n"


@pytest.mark.slow
def test_seeds_are_lines_of_the_csv_and_one_of_the_table(chart: Callable[..., Ran], tmp_path: Path) -> None:
    ran = chart(*SMALL, *FAST, "--methods", "cole", "--size", "3", "--seeds", 2, "--seed", 5, "--chart", tmp_path)
    assert ran.code == 0
    found = lines(tmp_path / "blinn-phong-50.csv")
    assert [(line["seed"], line["split_seed"]) for line in found] == [("5", "5"), ("6", "5")]
    errors = [float(line["held_out_log_mse"]) for line in found]
    assert f"{sum(errors) / 2:.3g}" in ran.out
    assert f"±{brief_figure(abs(errors[0] - errors[1]) / 2**0.5)}" in ran.out
    assert chart(*SMALL, *FAST, "--seeds", 0, "--chart", tmp_path).code == 2


@pytest.mark.slow
def test_quiet_says_nothing(chart: Callable[..., Ran], tmp_path: Path) -> None:
    assert chart(*SMALL, *FAST, "--chart", tmp_path, "-q") == (0, "", "")


@pytest.mark.slow
def test_an_interrupt_keeps_what_is_finished_and_says_how_to_go_on(
    chart: Callable[..., Ran], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    calls: list[Any] = []

    def stop_third(source: Any, settings: Any, *rest: Any) -> Any:
        calls.append(settings)
        if len(calls) == 3:
            raise KeyboardInterrupt
        return fit_and_measure(source, settings, *rest)

    monkeypatch.setattr(homofact.evaluation.chart, "fit_and_measure", stop_third)
    ran = chart(*SMALL, *FAST, "--chart", tmp_path, "--json")
    assert (ran.code, ran.out) == (130, "")
    assert ran.err == (f"homofact: interrupted, 2 of 4 runs are kept in {tmp_path}: the same command goes on there\n")
    assert [path.name for path in tmp_path.iterdir()] == ["blinn-phong-50.csv"]
    kept = lines(tmp_path / "blinn-phong-50.csv")
    ran = chart(*SMALL, *FAST, "--chart", tmp_path, "--json")
    assert ran.code == 0
    assert len(calls) == 5
    assert len(json.loads(ran.out)["rows"]) == 4
    assert lines(tmp_path / "blinn-phong-50.csv")[:2] == kept
    # With --force everything is fitted again.
    assert chart(*SMALL, *FAST, "--chart", tmp_path, "--force", "-q").code == 0
    assert len(calls) == 9
    assert len(lines(tmp_path / "blinn-phong-50.csv")) == 4


@pytest.mark.slow
def test_runs_of_other_settings_stay_and_are_said(chart: Callable[..., Ran], tmp_path: Path) -> None:
    assert chart(*SMALL, *FAST, "--chart", tmp_path, "-q").code == 0
    ran = chart(*SMALL, *FAST, "--chart", tmp_path, "--epsilon", 0.1, "--json")
    csv_file = tmp_path / "blinn-phong-50.csv"
    assert ran.err == f"homofact: {csv_file}: 4 runs with other settings stay in the file but not in the chart\n"
    assert {row["epsilon"] for row in json.loads(ran.out)["rows"]} == {0.1}
    assert [row["epsilon"] for row in lines(csv_file)] == ["1e-05"] * 4 + ["0.1"] * 4


@pytest.mark.slow
def test_pinned_kinds_and_searches_are_taken(chart: Callable[..., Ran], tmp_path: Path) -> None:
    ran = chart(
        *SMALL, "--methods", "search", "--textures", 3, "--size", 4, "--search", "gradient,nlopt-COBYLA",
        "--projections", "theta_h-theta_d + theta_d-phi_d+isotropic-in-out", "--restarts", 1, "--budget", 1,
        "--search-samples", 60, "--chart", tmp_path, "--json",
    )  # fmt: skip
    assert ran.code == 0, ran.err
    rows = json.loads(ran.out)["rows"]
    assert [(row["search"], row["textures"]) for row in rows] == [("gradient", 3), ("nlopt-COBYLA", 3)]
    assert "projections=theta_h-theta_d+theta_d-phi_d+isotropic-in-out " in rows[0]["settings"]


@pytest.mark.slow
def test_a_configuration_gives_what_the_command_line_does_not(chart: Callable[..., Ran], tmp_path: Path) -> None:
    config = tmp_path / "run.toml"
    config.write_text(
        '[source]\ncount = 200\n[compare]\nsources = ["material:blinn-phong-50"]\nmethods = ["mccool"]\n'
        f'size = [3, 5]\nchart = "{tmp_path / "o"}"\n'
    )
    assert [row["size"] for row in json.loads(chart("-c", config, "--json").out)["rows"]] == [3, 5]
    rows = json.loads(chart("material:lafortune-clay", "-c", config, "--size", "4", "--json").out)["rows"]
    assert [(row["source"], row["size"]) for row in rows] == [("lafortune-clay", 4)]


PHONG = "material:phong-10"
OUT = ["--chart", "{here}/o"]
CASES = {
    "no source": (OUT, r"SOURCE: none given, expected a file or material:NAME"),
    "sizes without a chart": ([PHONG, "--size", "4,8"], r"size: found 4, 8, expected one value, or a folder for a"),
    "counts without a chart": ([PHONG, "--textures", "1,2"], r"textures: found 1, 2, expected one value, or a folder"),
    "a table beside it": (
        [PHONG, "--csv", "{here}/a.csv", *OUT],
        r"csv: given beside a chart, expected one of",
    ),
    "a judgement beside it": ([PHONG, "--strict", *OUT], r"strict: given beside a chart, expected one of the two"),
    "a list of seeds": ([PHONG, "--seeds", "3,5", *OUT], r"seeds: found '3,5', expected a whole number of at least 1"),
    "two of one name": (["a/x.brdf", "b/x.brdf", *OUT], r"SOURCE: found two named x, expected names that differ"),
    "unknown method": (
        [PHONG, "--methods", "mccool,col", *OUT],
        r"method: found 'col', expected one of .*cole.* \(nearest: cole\)",
    ),
    "unknown search": ([PHONG, "--search", "gradient,magic", *OUT], r"search: found 'magic', expected gradient"),
    "unknown algorithm": (
        [PHONG, "--search", "nlopt-MAGIC", *OUT],
        r"search: found 'nlopt-MAGIC', expected behind nlopt- PRAXIS",
    ),
    "no methods": ([PHONG, "--methods", ",", *OUT], r"methods: found none, expected at least one"),
    "no searches": ([PHONG, "--search", ",", *OUT], r"search: found none, expected at least one"),
    "no sizes": ([PHONG, "--size", ",", *OUT], r"size: found none, expected at least one"),
    "a size twice": ([PHONG, "--size", "8,8", *OUT], r"size: found 8, 8, expected at least one, no repeats"),
    "a size of words": ([PHONG, "--size", "8,big", *OUT], r"size: found '8,big', expected whole numbers"),
    "size 1": ([PHONG, "--size", "8,1", *OUT], r"size: found 1, expected .* at least 2"),
    "no textures": ([PHONG, "--textures", "0", *OUT], r"textures: found 0, expected"),
    "two kinds for three": (
        [PHONG, "--methods", "search", "--projections", "h+d", *OUT],
        r"projections: found 2 for 1 textures",
    ),
    "an unknown kind": (
        [PHONG, "--methods", "search", "--projections", "hh", *OUT],
        r"projections: found 'hh', expected one of wi, .*isotropic-in-out",
    ),
    "a missing file": (["{file}.gone", *OUT], r"file\.txt\.gone: no such file"),
    "a file for a folder": ([PHONG, "--chart", "{file}"], r"file\.txt: is a file, expected a folder"),
    "a folder in a file": ([PHONG, "--chart", "/dev/null/o"], r"/dev/null is a file, expected a folder"),
    "a closed place": ([PHONG, "--chart", "/proc/homofact/o"], r"/proc.*cannot be written"),
    "results of another version": ([PHONG, "--chart", "{old}"], r"phong-10\.csv: found other columns .*--force"),
}


@pytest.mark.parametrize(("arguments", "expected"), CASES.values(), ids=CASES)
def test_what_is_wrong_is_said_in_one_line_before_anything_is_opened(
    arguments: list[str],
    expected: str,
    chart: Callable[..., Ran],
    tmp_path: Path,
    tmp_path_factory: pytest.TempPathFactory,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def opened(*_: object, **__: object) -> None:
        raise AssertionError("the source was opened")

    monkeypatch.setattr(homofact.brdf.source.Opening, "open", opened)
    beside = tmp_path_factory.mktemp("beside")
    (beside / "file.txt").write_text("mine")
    (beside / "phong-10.csv").write_text("mine,too\n")
    ran = chart(*(each.format(here=tmp_path, file=beside / "file.txt", old=beside) for each in arguments))
    assert (ran.code, ran.out) == (2, "")
    assert re.fullmatch(r"homofact: [^\n]+\n", ran.err), ran.err
    assert re.search(expected, ran.err), ran.err
    assert list(tmp_path.iterdir()) == []
    assert {path.name: path.read_text() for path in beside.iterdir()} == {
        "file.txt": "mine", "phong-10.csv": "mine,too\n",
    }  # fmt: skip


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (["{here}/none.brdf"], r"none\.brdf"),
        # The second source is opened before the first is fitted.
        ([*SMALL, "{here}/none.brdf"], r"none\.brdf"),
        (["material:phong-10", "--count", "2"], r"too few to hold out"),
    ],
)
def test_a_source_that_cannot_be_used_leaves_nothing(
    arguments: list[str], expected: str, chart: Callable[..., Ran], tmp_path: Path
) -> None:
    ran = chart(*(each.format(here=tmp_path) for each in arguments), *FAST, "--chart", tmp_path / "o")
    assert (ran.code, ran.out) == (2, "")
    assert re.search(expected, ran.err), ran.err
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(os, "openpty"), reason="needs a pseudo-terminal")
def test_a_terminal_sees_how_many_runs_there_are(tmp_path: Path) -> None:
    terminal, theirs = os.openpty()
    command = [sys.executable, "-m", "homofact.cli.main", "compare", *SMALL, *FAST, "--chart", str(tmp_path), "--json"]
    environment = {**os.environ, "TERM": "xterm", "COLUMNS": "140", "OMP_NUM_THREADS": "1", "NUMBA_NUM_THREADS": "1"}
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=theirs, env=environment) as process:
        os.close(theirs)
        assert process.stdout is not None
        seen = b""
        try:
            while part := os.read(terminal, 65536):
                seen += part
        except OSError:  # Linux's way to say that the other end is closed.
            pass
        out = process.stdout.read()
    os.close(terminal)
    assert process.returncode == 0
    assert len(json.loads(out)["rows"]) == 4
    assert "3/4 blinn-phong-50: cole, 1 × 3²".encode() in seen
