"""What a sweep leaves: results that are those of a fit by itself, a ledger that tells when it was changed."""

import json
import math
import shutil
from collections.abc import Callable, Iterable
from dataclasses import replace
from io import StringIO
from pathlib import Path

import numpy as np
import pytest
import torch
from pictured import no_looks, small_spheres
from rich.console import Console

from homofact import load
from homofact.brdf.source import open_source
from homofact.cli.main import main
from homofact.cli.sweep import light_lines, summary_tables
from homofact.errors import BadInput
from homofact.evaluation.compare import fit_and_measure
from homofact.evaluation.metric_table import REPORTED
from homofact.geometry.directions import draw_uniform
from homofact.sweeps import local
from homofact.sweeps.cluster import DaskCluster, do_elsewhere
from homofact.sweeps.ledger import SWEEP, SweepLedger
from homofact.sweeps.local import TaskEnding
from homofact.sweeps.parcel import packed, unpacked
from homofact.sweeps.run import State, sweep
from homofact.sweeps.summary import FitRow, mixes_epsilons, rows_of, without_light
from homofact.sweeps.sweep_file import read_sweep
from homofact.sweeps.task import Task, tasks_of
from homofact.sweeps.work import do

FILE = """
sources = ["paint.npz", "material:phong-30"]
[source]
count = 600
[[method]]
method = "mccool"
size = 4
[[method]]
method = "svd"
size = 4
"""


class Here:
    """A worker in this process; test_workers has those of their own."""

    def __init__(self, folder: Path, count: int) -> None:
        self.folder = folder

    def run(self, tasks: Iterable[Task], ended: Callable[[TaskEnding], bool]) -> None:
        for task in tasks:
            answer = do(task, self.folder)
            assert not ended(TaskEnding(task, answer.get("seconds"), answer.get("refused")))


@pytest.fixture(scope="module")
def swept(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a small sweep's file, and its results in "sweep", with small pictures."""
    folder = tmp_path_factory.mktemp("swept")
    root = Path(__file__).parents[2]
    with np.load(root / "data_synthetic/plastic.npz") as whole:
        # Every tenth sample: the fits are quick.
        np.savez(folder / "paint.npz", **{name: each[::10] if each.ndim > 1 else each for name, each in whole.items()})
    (folder / "small.toml").write_text(FILE, encoding="utf-8")
    with pytest.MonkeyPatch.context() as patch, small_spheres(), no_looks():
        patch.setattr(local, "Local", Here)
        assert main(["sweep", str(folder / "small.toml"), "--out", str(folder / "sweep"), "--workers", "1", "-q"]) == 0
    return folder


@pytest.fixture
def copy(swept: Path, tmp_path: Path) -> Path:
    """The results, to be spoilt."""
    return Path(shutil.copytree(swept / "sweep", tmp_path / "sweep"))


@pytest.mark.slow
def test_a_sweep_ends_with_its_report(swept: Path, copy: Path, capsys: pytest.CaptureFixture[str]) -> None:
    site = swept / "sweep" / "report"
    assert {"index.html", "site.json", "fits.csv"} <= {each.name for each in site.iterdir()}
    assert "phong-30" in (site / "index.html").read_text(encoding="utf-8")
    # The same command again fits nothing, and writes a report that was lost.
    shutil.rmtree(copy / "report")
    arguments = ["sweep", str(swept / "small.toml"), "--out", str(copy), "--workers", "1", "--json"]
    assert main(arguments) == 0
    record = json.loads(capsys.readouterr().out)
    assert (record["done_before"], record["done"], record["site"]) == (4, 4, str(copy / "report"))
    assert (copy / "report" / "fits.csv").read_text() == (site / "fits.csv").read_text()
    # A folder of that name that is no report is refused before anything is fitted.
    shutil.rmtree(copy / "report")
    (copy / "report").mkdir()
    (copy / "report" / "mine.txt").write_text("mine")
    assert main(arguments) == 2
    assert "mine.txt in it and no report, expected a new or empty folder" in capsys.readouterr().err
    assert (copy / "report" / "mine.txt").read_text() == "mine"


def tasks(swept: Path) -> list[Task]:
    return tasks_of(read_sweep(swept / "small.toml"))


@pytest.mark.slow
def test_a_result_is_the_fit_that_is_made_without_a_sweep(swept: Path) -> None:
    task = next(each for each in tasks(swept) if each.method == "mccool" and each.source.endswith("paint.npz"))
    source = open_source(task.source, count=600)
    alone = fit_and_measure(source, task.fit_method(), task.held_out)
    result = SweepLedger(swept / "sweep").result(task)
    wi, wo = draw_uniform(50, torch.Generator().manual_seed(0))
    assert torch.equal(load(str(result.folder)).evaluate(wi, wo), alone.factorization.evaluate(wi, wo))
    assert result.report["error"]["held_out"]["log_mse"] == alone.held_out.log_mse
    assert (result.folder / "compare.png").is_file()


def test_rows_hold_every_metric_of_every_task(swept: Path) -> None:
    rows = rows_of(swept / "sweep")
    assert [(row.name, row.label) for row in rows] == [
        (name, label) for name in ("paint.npz", "phong-30") for label in ("mccool", "svd")
    ]
    reports = [each.report for each in SweepLedger(swept / "sweep").results()]
    for row, report in zip(rows, reports, strict=True):
        assert list(row.metrics) == [each.name for each in REPORTED]
        assert row.metrics["log_mse"] == report["error"]["held_out"]["log_mse"]
        assert row.bytes == report["bytes"] > 0
    # The material has a reflectance everywhere, so light to compare.
    assert rows[2].metrics["psnr_sky"] == reports[2]["appearance"]["psnr_sky"]


def test_a_label_with_its_bytes_fits_beside_the_medians() -> None:
    metrics: dict[str, float | None] = {each.name: 0.000123 if each.name == "log_mse" else 1.02 for each in REPORTED}
    rows = [
        FitRow(f"{k}", "a.brdf", "a", "search, 12288 B", 0, 12280 + k, 2, 2, 1e-5, 111.4, "direct", k == 0, metrics)
        for k in (0, 16)
    ]
    console = Console(width=80, file=StringIO())
    for each in summary_tables(rows):
        console.print(each)
    assert isinstance(console.file, StringIO)
    (line,) = [line for line in console.file.getvalue().splitlines() if "search" in line]
    assert line.split() == ["search,", "12288", "B", "1", "of", "2", "12288", "111", "0.000123", *["1.02"] * 3]


def fit_row(name: str, light: float | None, limits: dict[str, float]) -> FitRow:
    metrics: dict[str, float | None] = {
        each.name: light if each.computed_from == "light" else 0.0123 for each in REPORTED
    }
    return FitRow(name, name, name, "search, 12288 B", 0, 12288, 2, 2, 1e-2, 5.5, "direct", True, metrics, limits)


def printed(rows: list[FitRow]) -> list[str]:
    console = Console(width=80, file=StringIO())
    for each in summary_tables(rows):
        console.print(each)
    assert isinstance(console.file, StringIO)
    return console.file.getvalue().splitlines()


def test_medians_of_lists_of_samples_have_the_limits_of_their_verdicts() -> None:
    lists = [
        fit_row("a.csv", None, {"light_limit": 0.0201, "highlight_limit": 0.18, "sky_limit": 4.41}),
        fit_row("b.csv", None, {"light_limit": 0.0401, "highlight_limit": math.inf, "sky_limit": 4.41}),
    ]
    (head,) = [line for line in printed(lists) if "trusted  " in line]
    assert head.split()[-5:] == ["log", "mse", "light", "highlight", "sky"]
    (line,) = [line for line in printed(lists) if "search" in line]
    # Rounded up; the median of a known and an unknown limit is unknown.
    assert line.split()[3:] == ["2", "of", "2", "12288", "5.5", "0.0123", "3.1%", "unknown", "×5.5"]
    (said,) = light_lines(lists)
    assert said.startswith("Not measured: albedo, highlight and sky dB. These compare fit and source in all directions")


def test_medians_of_mixed_sources_have_the_limits_in_a_second_table() -> None:
    rows = [
        fit_row("a.csv", None, {"light_limit": 0.0201, "highlight_limit": 0.18, "sky_limit": 0.3}),
        fit_row("measured", 1.02, {}),
    ]
    first, second = [line.split() for line in printed(rows) if "search" in line]
    assert first[3:] == ["2", "of", "2", "12288", "5.5", "0.0123", "1.02", "1.02", "1.02"]
    assert second[3:] == ["2.1%", "18%", "30%"]
    assert light_lines(rows)[0].startswith("albedo, highlight and sky dB leave out a.csv. These compare")
    assert light_lines(rows[1:]) == []
    assert not any("unknown" in line or "×" in line for line in printed(rows[1:]))


def test_rows_of_several_epsilons_are_told(swept: Path) -> None:
    rows = rows_of(swept / "sweep")
    reports = [each.report for each in SweepLedger(swept / "sweep").results()]
    assert [row.cells()["epsilon"] for row in rows] == [report["epsilon"] for report in reports]
    assert not mixes_epsilons(rows)
    assert mixes_epsilons([*rows, replace(rows[0], epsilon=1e-3)])


def test_materials_whose_light_is_unknown_are_told(swept: Path) -> None:
    rows = rows_of(swept / "sweep")
    assert without_light(rows) == ("paint.npz",)
    assert without_light(rows[:2]) == ()
    assert without_light(rows[2:]) == ()


@pytest.mark.slow
def test_the_command_goes_on_and_says_so(swept: Path, copy: Path, capsys: pytest.CaptureFixture[str]) -> None:
    gone = tasks(swept)[1]
    shutil.rmtree(SweepLedger(copy).place(gone))
    kept = {
        each.key: (SweepLedger(copy).place(each) / "report.json").stat().st_mtime_ns
        for each in tasks(swept)
        if each != gone
    }
    assert main(["sweep", str(swept / "small.toml"), "--out", str(copy), "--workers", "1", "--json"]) == 0
    said = capsys.readouterr()
    record = json.loads(said.out)
    assert (record["tasks"], record["done_before"], record["done"], record["set_aside"]) == (4, 3, 4, [])
    assert sorted(record["error"]) == ["mccool", "svd"]
    assert "4 fits, 3 done before; 1 to do by 1 worker" in said.err
    for key, time in kept.items():
        assert (copy / "results" / key / "report.json").stat().st_mtime_ns == time


@pytest.mark.slow
def test_a_source_that_is_refused_is_named_and_the_others_are_done(
    swept: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    np.savez(tmp_path / "bad.npz", wi=np.zeros((4, 3)))
    text = FILE.replace('"paint.npz"', '"bad.npz"').replace('[[method]]\nmethod = "svd"\nsize = 4\n', "")
    (tmp_path / "small.toml").write_text(text, encoding="utf-8")
    assert main(["sweep", str(tmp_path / "small.toml"), "--out", str(tmp_path / "out"), "--workers", "1"]) == 0
    said = capsys.readouterr()
    line = next(line for line in said.out.splitlines() if line.startswith("set aside: "))
    assert "bad.npz, mccool, seed 0: " in line
    assert len(rows_of(tmp_path / "out")) == 1


def test_a_source_that_was_changed_since_is_refused(swept: Path, tmp_path: Path) -> None:
    place = tmp_path / "paint.npz"
    shutil.copy(swept / "paint.npz", place)
    task = next(each for each in tasks(swept) if each.source.endswith("paint.npz"))
    answer = do(task, tmp_path / "out", str(swept / "small.toml"))
    assert "was changed since the sweep began" in answer["refused"]


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (lambda place: (place / "factorization.npz").write_bytes(b"x"), "its fit or its figures were changed"),
        (lambda place: _edit(place / "report.json", ("error", "held_out", "log_mse"), 0.0), "its figures were changed"),
        (lambda place: _edit(place / "report.json", ("task", "held_out"), 0.5), "found the task "),
        (lambda place: _edit(place / "report.json", ("task", "method"), "magic"), "expected one of search, cole"),
        (lambda place: _edit(place / "report.json", ("sha256",), 7), "sha256: found 7, expected a text"),
    ],
)
def test_a_changed_result_is_told(swept: Path, copy: Path, spoil, message: str) -> None:
    task = tasks(swept)[0]
    spoil(SweepLedger(copy).place(task))
    with pytest.raises(BadInput) as refusal:
        rows_of(copy)
    assert message in str(refusal.value)
    assert "delete the folder to have it fitted again" in str(refusal.value)


def test_folders_that_are_no_sweeps_or_of_other_ones_are_refused(swept: Path, copy: Path, tmp_path: Path) -> None:
    def refusal(folder: Path, name: str = "small") -> str:
        with pytest.raises(BadInput) as found:
            SweepLedger(folder).begin(name, [])
        return str(found.value)

    other = tmp_path / "other"
    other.mkdir()
    (other / "note.txt").touch()
    assert refusal(other).endswith(f"found files and no {SWEEP}, expected a sweep's folder or an empty one")
    assert refusal(other / "note.txt").endswith("found a file, expected a folder for the sweep")
    assert refusal(copy, "large").endswith("found the sweep 'small', expected a new folder for 'large'")
    _edit(copy / SWEEP, ("format_version",), 99)
    assert refusal(copy).endswith("format version 99, expected at most 1 (update homofact)")
    with pytest.raises(BadInput, match=r"found no sweep\.json in it, expected the folder of a sweep"):
        rows_of(other)


def test_a_source_that_is_gone_since_the_sweep_began_is_named(tmp_path: Path) -> None:
    (tmp_path / "a.brdf").write_text("1")
    (tmp_path / "b.brdf").write_text("2")
    (tmp_path / "s.toml").write_text('sources = ["*.brdf"]\n[[method]]\nmethod = "mccool"\n')

    def nothing(*_: object) -> None:
        return None

    class Nobody:
        def run(self, tasks: list[Task], ended: Callable[[TaskEnding], bool]) -> None:
            return None

    out = tmp_path / "out"
    assert isinstance(sweep(read_sweep(tmp_path / "s.toml"), out, Nobody(), nothing), State)
    (tmp_path / "a.brdf").unlink()
    with pytest.raises(BadInput, match=r"a\.brdf: is gone since the sweep began, expected it there, or a new folder$"):
        sweep(read_sweep(tmp_path / "s.toml"), out, Nobody(), nothing)


@pytest.mark.slow
def test_a_worker_without_the_file_asks_for_it_and_fits_the_same(swept: Path, tmp_path: Path) -> None:
    task = next(each for each in tasks(swept) if each.method == "mccool" and each.source.endswith("paint.npz"))
    elsewhere = Task(**{**task.record(), "source": str(tmp_path / "paint.npz")})
    assert do_elsewhere(elsewhere.record(), None) == {"missing": True}
    answer = do_elsewhere(elsewhere.record(), packed(swept / "paint.npz"))
    found = unpacked(answer["result"], tmp_path / "found")
    assert found.name == task.key
    wi, wo = draw_uniform(50, torch.Generator().manual_seed(0))
    here = load(str(SweepLedger(swept / "sweep").place(task)))
    assert torch.equal(load(str(found)).evaluate(wi, wo), here.evaluate(wi, wo))
    assert load(str(found)).provenance["source"]["split"]["opening"]["path"] == elsewhere.source


def test_a_folder_comes_back_as_it_was_sent(tmp_path: Path) -> None:
    place = tmp_path / "rings"
    (place / "deep").mkdir(parents=True)
    (place / "deep/a").write_bytes(b"\0\1")
    (place / "b").write_text("b")
    found = unpacked(packed(place), tmp_path / "there")
    assert sorted(str(each.relative_to(found)) for each in found.rglob("*")) == ["b", "deep", "deep/a"]
    assert (found / "deep/a").read_bytes() == b"\0\1"


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("nowhere", "scheduler: found 'nowhere', expected local, an address such as tcp://host:8786"),
        ("missing.json", "scheduler: no file missing.json, expected local"),
        ("no_such_module:Cluster", "scheduler: found 'no_such_module:Cluster' (No module named 'no_such_module')"),
        ("distributed:NoCluster", "scheduler: found 'distributed:NoCluster' ("),
    ],
)
def test_a_scheduler_that_is_none_is_refused(tmp_path: Path, words: str, message: str) -> None:
    pytest.importorskip("distributed", reason="distributed is not installed: pip install 'homofact[cluster]'")
    engine = DaskCluster(tmp_path, words, 1, lambda _: None)
    with pytest.raises(BadInput) as refusal:
        engine.run([], lambda _: False)
    assert str(refusal.value).startswith(message)


def _edit(file: Path, path: tuple[str, ...], value: object) -> None:
    record = json.loads(file.read_text())
    inner = record
    for step in path[:-1]:
        inner = inner[step]
    inner[path[-1]] = value
    file.write_text(json.dumps(record))
