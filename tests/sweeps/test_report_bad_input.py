"""What cannot be reported is refused in one line, and nothing is written."""

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from damages import header_damages
from swept import make_sweep

from homofact.cli.main import main
from homofact.errors import BadInput
from homofact.sweeps.ledger import sealed
from homofact.sweeps.report.index_page import index_data
from homofact.sweeps.report.material_page import FitFiles, material_html
from homofact.sweeps.report.reading import read_results


@pytest.fixture(scope="module")
def sweep(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return make_sweep(tmp_path_factory.mktemp("sweep") / "s", labels=("ours", "bad"), refused=("bad",))


def edit(file: Path, change: Callable[[dict[str, Any]], object]) -> None:
    record = json.loads(file.read_text(encoding="utf-8"))
    change(record)
    file.write_text(json.dumps(record), encoding="utf-8")


def some(folder: Path, name: str) -> Path:
    return next(iter(sorted(folder.glob(f"results/*/{name}"))))


def reports(change: Callable[[dict[str, Any]], object]) -> Callable[[Path], object]:
    """A report that is odd as it was written, rather than changed since."""

    def spoil(folder: Path) -> None:
        file = some(folder, "report.json")
        edit(file, change)
        file.write_text(json.dumps(sealed(json.loads(file.read_text()), file.with_name("factorization.npz"))))

    return spoil


def headers(change: Callable[[dict[str, Any]], object]) -> Callable[[Path], object]:
    return lambda folder: edit(folder / "sweep.json", change)


DAMAGES: dict[str, tuple[Callable[[Path], object], str]] = {
    "no sweep": (lambda folder: (folder / "sweep.json").unlink(), "found no sweep.json in it, expected the folder of"),
    "gone": (shutil.rmtree, "found no sweep.json in it, expected the folder of a sweep"),
    "no JSON": (lambda folder: (folder / "sweep.json").write_text("{"), "sweep.json: not JSON"),
    "other JSON": (headers(lambda r: r.update(format="x")), 'format: found "x", expected one of homofact sweep'),
    "newer format": (headers(lambda r: r.update(format_version=2)), "format version 2, expected at most 1 (update"),
    "newer fits": (
        headers(lambda r: r["tasks"][0].update(version="99.1.0")),
        "sweep.json: found fits of homofact 99.1.0, expected at most",
    ),
    "no tasks": (headers(lambda r: r.update(tasks=3)), "sweep.json: found no tasks, expected it as homofact wrote it"),
    "odd task": (headers(lambda r: r["tasks"].append({})), "sweep.json: task: digest: found nothing, expected a text"),
    "no digest": (
        headers(lambda r: r["tasks"][0].update(digest="../x")),
        'sweep.json: task: digest: found "../x", expected 64',
    ),
    "nothing asked": (headers(lambda r: r.update(tasks=[])), "found no results of 0 fits, expected a sweep with one"),
    "no results": (lambda folder: shutil.rmtree(folder / "results"), "found no results of 6 fits, expected a sweep"),
    "changed fit": (
        lambda folder: some(folder, "factorization.npz").write_bytes(b"x"),
        "its fit or its figures were changed since they were written, expected it as homofact wrote it (delete the",
    ),
    "changed figure": (
        lambda folder: edit(some(folder, "report.json"), lambda r: r["error"]["held_out"].update(log_mse=1e-9)),
        "its fit or its figures were changed since they were written, expected it as homofact wrote it (delete the",
    ),
    "no report": (lambda folder: some(folder, "report.json").unlink(), "report.json: no such file, expected a sweep's"),
    "another's": (reports(lambda r: r["task"].update(held_out=0.3)), "report.json: found the task"),
    "bytes": (reports(lambda r: r.update(bytes="many")), 'bytes: found "many", expected a whole number'),
    "seconds": (reports(lambda r: r["seconds"].pop("fit")), "seconds.fit: found nothing, expected a finite number"),
    "error": (reports(lambda r: r.pop("error")), "error: found nothing, expected an object"),
    "figure": (
        reports(lambda r: r["error"]["held_out"].update(log_mse="0.1")),
        'error.held_out.log_mse: found "0.1", expected a finite number',
    ),
    "appearance": (reports(lambda r: r.update(appearance=[1])), "appearance: found [1], expected an object"),
    "verdict": (reports(lambda r: r["verdict"].update(trusted=1)), "verdict.trusted: found 1, expected true or false"),
    "bars": (
        reports(lambda r: r["verdict"]["bars"]["all"][0].update(error="0.1")),
        'verdict.bars.all[0].error: found "0.1", expected a finite number',
    ),
    "kind of a bar": (
        reports(lambda r: r["verdict"]["bars"]["all"][0].pop("kind")),
        "verdict.bars.all[0].kind: found nothing, expected one of measured",
    ),
    "finding": (
        reports(lambda r: r["verdict"].update(findings=[{"name": 1}])),
        "findings[0].name: found 1, expected",
    ),
    "aside": (
        lambda folder: edit(next(iter((folder / "aside").iterdir())), lambda r: r.update(task={})),
        ".json: task: digest: found nothing, expected a text (or delete the file)",
    ),
}


@pytest.mark.parametrize("which", ["itself", "against"])
@pytest.mark.parametrize("damage", DAMAGES)
def test_a_damaged_sweep_is_refused_in_one_line(
    damage: str, which: str, sweep: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "damaged"
    shutil.copytree(sweep, folder)
    do, words = DAMAGES[damage]
    do(folder)
    given = [str(folder)] if which == "itself" else [str(sweep), "--against", str(folder)]
    assert main(["report", *given, "--out", str(tmp_path / "site")]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.count("\n") == 1
    assert err.startswith(f"homofact: {folder}")
    assert words in err
    assert {each.name for each in tmp_path.iterdir()} <= {"damaged"}


@pytest.mark.slow
def test_a_sweeps_file_edited_by_hand_ends_in_a_line(sweep: Path, tmp_path: Path) -> None:
    """Every entry of sweep.json, of a report and of what was set aside, damaged in every way."""
    folder = tmp_path / "edited"
    shutil.copytree(sweep, folder)
    files = [folder / "sweep.json", some(folder, "report.json"), next(iter((folder / "aside").iterdir()))]
    for file in files:
        whole = json.loads(file.read_text(encoding="utf-8"))
        if file.name == "sweep.json":
            whole["tasks"] = whole["tasks"][:2]
        damages = list(header_damages(whole))
        # Some hundred of each: a report has thousands.
        for what, changed in damages[:: len(damages) // 300 + 1]:
            if file.name == "report.json":
                # As it was written, rather than changed since.
                sound = json.loads(json.dumps(changed))
                changed = sealed(sound, file.with_name("factorization.npz"))
            file.write_text(json.dumps(changed), encoding="utf-8")
            problem = ""
            try:
                read = read_results(folder)
                assert index_data(read, {fit.row.key: FitFiles(None, (), None, "") for fit in read.fits}, None, [])
                for fit in read.fits:
                    assert material_html(
                        fit.material, [fit], {fit.row.key: FitFiles(None, (), None, "")}, [], read.name
                    )
                    assert fit.task.words
            except BadInput as error:
                problem = str(error) if "\n" in str(error) or str(folder) not in str(error) else ""
            except Exception as error:
                problem = repr(error)
            assert not problem, what
        file.write_text(json.dumps(whole), encoding="utf-8")


def test_places_that_are_something_else_are_refused(
    sweep: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "file").write_text("x")
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "index.html").write_text("mine")
    for arguments, words in (
        (["--out", str(sweep)], f"{sweep}: found aside in it and no report, expected a new or empty folder"),
        (["--out", str(tmp_path / "file")], "found a file, expected a folder for the report"),
        (["--out", str(tmp_path / "mine"), "--force"], "found index.html in it and no report"),
        (["--out", str(tmp_path / "new"), "--against", str(sweep)], "which is the sweep itself, expected another one"),
    ):
        assert main(["report", str(sweep), *arguments]) == 2
        err = capsys.readouterr().err
        assert err.count("\n") == 1
        assert words in err
    assert (tmp_path / "mine" / "index.html").read_text() == "mine"
    assert sorted(each.name for each in tmp_path.iterdir()) == ["file", "mine"]
