"""`homofact view` of a scene that `homofact edit` prepared: the page, and what is refused in one line."""

import json
from pathlib import Path

import pytest

from homofact.cli.main import main

pytest.importorskip("embreex", reason="embreex is not installed: pip install 'homofact[relight]'")

SCENE = """
[[object]]
mesh = "shape:sphere"
material = "material:cook-torrance-plastic"
name = "plastic"
bands = [32, 32]
[ground]
albedo = [0.4, 0.4, 0.4]
half = 1.5
steps = 4
[lighting]
named = "overcast"
[[camera]]
eye = [0, 1, 4]
pixels = [20, 16]
[edit]
triangles = 60
"""


@pytest.fixture(scope="module")
def prepared(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("edit")
    (folder / "scene.toml").write_text(SCENE)
    assert main(["edit", str(folder / "scene.toml"), "--out", str(folder / "out"), "-q"]) == 0
    return folder / "out"


def test_a_prepared_scene_is_shown(prepared: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    capsys.readouterr()
    page = tmp_path / "p.html"
    assert main(["view", str(prepared), "--out", str(page), "--json"]) == 0
    record = json.loads(capsys.readouterr().out)
    assert record == {"result": str(prepared), "file": str(page), "bytes": page.stat().st_size}
    text = page.read_text()
    assert "<title>scene</title>" in text
    assert "<p>plastic, ground</p>" in text
    assert "Lights and bands against a finer division" in text


def refused(capsys: pytest.CaptureFixture[str], *arguments: str) -> str:
    """The one line that a command ends with."""
    capsys.readouterr()
    assert main(list(arguments)) == 2
    return " ".join(capsys.readouterr().err.split())


def test_what_a_prepared_scene_has_of_its_own_is_not_taken(
    prepared: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for option, value, setting in (("sky", "a.hdr", "skies"), ("mesh", "a.obj", "mesh"), ("source", "a.npz", "source")):
        said = refused(capsys, "view", str(prepared), "--out", str(tmp_path / "p.html"), f"--{option}", value)
        assert f"{setting}: {prepared} is a prepared scene, which has its own, expected none" in said
    assert not (tmp_path / "p.html").exists()


def test_the_results_of_another_scene_are_refused_and_the_old_page_stays(
    prepared: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    page = tmp_path / "p.html"
    page.write_text("before")
    assert "found an existing file" in refused(capsys, "view", str(prepared), "--out", str(page))
    report = prepared / "edit.json"
    kept = report.read_text()
    try:
        record = json.loads(kept)
        record["scene"]["ground"]["albedo"] = [0.2, 0.4, 0.4]
        report.write_text(json.dumps(record))
        said = refused(capsys, "view", str(prepared), "--out", str(page), "--force")
        assert "made of another scene, or of another state of it" in said
    finally:
        report.write_text(kept)
    assert page.read_text() == "before"
