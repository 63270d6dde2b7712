"""Where results go, through the commands: what is in the way is said before the work, and nobody's files are lost."""

import importlib
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from homofact.cli.main import main
from homofact.exporting.result import open_result
from homofact.files.lock import claimed

FIT = ["factorize", "material:phong-10", "--count", "400", "--method", "mccool", "--size", "4"]


def refused(arguments: list[str], capsys: pytest.CaptureFixture[str], *loaded: str) -> str:
    assert main(arguments) == 2
    err = capsys.readouterr().err
    assert err.count("\n") == 1
    return err


@pytest.mark.parametrize("name", ["é" * 130, "a/" + "b" * 256], ids=["bytes", "letters"])
def test_names_that_are_too_long_are_refused_first(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("homofact.brdf.source.Opening.open", None)
    assert "File name too long" in refused([*FIT, "--out", str(tmp_path / name)], capsys)
    assert "File name too long" in refused(
        ["render", "material:phong-10", "--out", str(tmp_path / f"{name}.png")], capsys
    )
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_a_name_as_long_as_can_be_will_do(tmp_path: Path) -> None:
    assert main([*FIT, "--out", str(tmp_path / ("n" * 255)), "-q"]) == 0
    assert [len(path.name) for path in tmp_path.iterdir()] == [255]


def test_a_mount_point_is_refused_first(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("homofact.brdf.source.Opening.open", None)
    (tmp_path / "disk").mkdir()
    monkeypatch.setattr("os.path.ismount", lambda path: Path(path).name == "disk")
    assert "is a mount point" in refused([*FIT, "--out", str(tmp_path / "disk")], capsys)


def test_a_bound_folder_is_a_mount_point_too(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    place = tmp_path / "a b"
    place.mkdir()
    line = f"36 35 98:0 /mnt {str(place).replace(' ', chr(92) + '040')} rw - ext4 /dev/root rw\n"
    honest = Path.read_text
    monkeypatch.setattr(
        Path, "read_text", lambda self, **more: line if str(self).endswith("mountinfo") else honest(self, **more)
    )
    assert "is a mount point" in refused([*FIT, "--out", str(place)], capsys)


def test_a_full_disk_is_noticed_first(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(_: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("homofact.brdf.source.Opening.open", None)
    monkeypatch.setattr(os, "fsync", full)
    assert "No space left on device" in refused([*FIT, "--out", str(tmp_path / "out")], capsys)
    assert list(tmp_path.iterdir()) == []


def test_a_disk_that_fills_up_at_the_picture_leaves_the_fit(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object, **__: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("homofact.figures.compare_picture.compare_picture", full)
    said = refused([*FIT, "--out", str(tmp_path / "out")], capsys)
    assert "No space left on device" in said
    assert "the fit alone is kept in" in said
    assert [path.name for path in tmp_path.iterdir()] == ["out.npz"]
    assert open_result(tmp_path / "out.npz").provenance["method"] == "mccool"


COMMANDS = {
    "factorize": [*FIT, "--out", "{place}"],
    "chart": ["compare", "material:phong-10", "--count", "400", "--methods", "mccool", "--chart", "{place}"],
    "stability": ["research", "stability", "--short", "-q", "--out", "{place}"],
}


@pytest.mark.slow
@pytest.mark.parametrize("command", COMMANDS)
def test_two_runs_into_one_place_do_not_meet(command: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    place = tmp_path / "out"
    taken = place / "phong-10.csv" if command == "chart" else place
    program = f"""
import sys
from homofact.cli.main import main
sys.exit(main({[each.format(place=place) for each in COMMANDS[command]]!r}))
"""
    with claimed(taken):
        ran = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert ran.returncode == 2, ran.stderr
    assert f"another run of homofact (process {os.getpid()}) writes there" in ran.stderr
    assert ran.stderr.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_force_leaves_what_is_not_homofacts(tmp_path: Path) -> None:
    out = str(tmp_path / "out")
    assert main([*FIT, "--out", out, "-q"]) == 0
    (tmp_path / "out" / "notes.txt").write_text("mine")
    assert main([*FIT, "--out", out, "-q", "--force", "--seed", "3"]) == 0
    assert (tmp_path / "out" / "notes.txt").read_text() == "mine"
    assert json.loads((tmp_path / "out" / "report.json").read_text())["seed"] == 3
    assert main(["export", out, "--out", str(tmp_path / "engine"), "-q"]) == 0
    (tmp_path / "engine" / "level.map").write_text("mine")
    assert main(["export", out, "--out", str(tmp_path / "engine"), "--format", "png8", "-q", "--force"]) == 0
    names = sorted(path.name for path in (tmp_path / "engine").iterdir())
    assert "level.map" in names
    assert not [name for name in names if name.endswith(".exr")]


def test_an_interrupted_atlas_leaves_its_cells_and_the_older_atlas(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    (tmp_path / "atlas.csv").write_text("older")
    monkeypatch.setattr("homofact.stability.solver_atlas.run_solvers", interrupt)
    arguments = [
        "research",
        "stability",
        "--short",
        "--methods",
        "mccool",
        "--stressors",
        "few-samples",
        "--out",
        str(tmp_path),
    ]
    assert main(arguments) == 130
    assert (tmp_path / "atlas.csv").read_text() == "older"
    assert (tmp_path / "unfinished.csv").read_text().count("\n") == 3
    monkeypatch.undo()
    monkeypatch.setattr("homofact.stability.solver_atlas.SYSTEMS", ())
    monkeypatch.setattr("homofact.stability.picture.draw_solvers", lambda *_: None)
    monkeypatch.setattr("homofact.stability.atlas.write_csv", lambda path, cells: path.write_text("new"))
    assert main(arguments) == 0
    assert sorted(path.name for path in tmp_path.iterdir()) == ["atlas.csv", "atlas.png", "solvers.csv"]


@pytest.mark.parametrize("command", ["convert", "view"])
def test_a_file_that_comes_while_another_is_made_is_not_replaced(
    command: str, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    if command == "convert":
        target = tmp_path / "a.csv"
        arguments = ["convert", "material:phong-10", str(target), "--count", "50"]
        place, name = "homofact.brdf.formats.csv", "write"
    else:
        target = tmp_path / "a.html"
        assert main([*FIT, "--out", str(tmp_path / "out"), "-q"]) == 0
        arguments = ["view", str(tmp_path / "out"), "--out", str(target)]
        place, name = "homofact.web.viewer", "viewer_html"
    honest = getattr(importlib.import_module(place), name)

    def slow(*given: object, **more: object) -> object:
        target.write_text("mine")
        return honest(*given, **more)

    monkeypatch.setattr(f"{place}.{name}", slow)
    assert main(arguments) == 2
    assert "File exists" in capsys.readouterr().err
    assert target.read_text() == "mine"
