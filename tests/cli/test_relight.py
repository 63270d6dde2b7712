"""`homofact relight` as a user runs it: what it writes and says, and what it refuses."""

import json
from io import StringIO
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console

from homofact.cli.main import main
from homofact.cli.relight import error_tables, interpolation_lines
from homofact.containers.png import read_png

pytest.importorskip("embreex", reason="embreex is not installed: pip install 'homofact[relight]'")

SCENE = """
[[object]]
mesh = "ball.obj"
material = "material:phong-10"
terms = 3
[ground]
albedo = [0.4]
half = 1.5
steps = 4
[lighting]
named = "studio"
[[camera]]
eye = [0, 1, 4]
pixels = [48, 36]
[transport]
cube = 8
kept = 64
"""

# Two maps to make, of one term each.
ALL_MATT = SCENE.replace('material = "material:phong-10"\nterms = 3', "albedo = [0.6]")


@pytest.fixture(autouse=True)
def once(monkeypatch: pytest.MonkeyPatch) -> None:
    """The materials that all runs here share are decomposed once."""
    from relighting_cases import factored_once

    from homofact.relighting import build

    monkeypatch.setattr(build, "factored", factored_once)


@pytest.fixture
def scene(tmp_path: Path) -> Path:
    from homofact.meshes.shapes import sphere

    ball = sphere(6)
    lines = [f"v {x:.6f} {y:.6f} {z:.6f}" for x, y, z in ball.positions]
    lines += [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in ball.triangles]
    (tmp_path / "ball.obj").write_text("\n".join(lines) + "\n")
    (tmp_path / "scene.toml").write_text(SCENE)
    return tmp_path / "scene.toml"


@pytest.mark.slow
def test_a_scene_is_relit_and_its_error_said(scene: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = scene.parent / "out"
    assert main(["relight", str(scene), "--out", str(out), "--vertices", "6", "--ledger", "--json"]) == 0
    said = capsys.readouterr()
    record = json.loads(said.out)
    assert sorted(record["error"]) == ["ball.obj", "ground"]
    stages = {"terms", "maps", "cube", "truncation", "quantisation", "interpolation", "together"}
    assert stages <= set(record["error"]["ball.obj"])
    assert 0 < record["error"]["ball.obj"]["together"] < 0.6
    assert record["objects"][0]["terms"] == 3
    assert "million rays, at most" in said.err
    picture = read_png(out / "picture_1.png")
    assert picture.shape == (36, 48, 3)
    assert len(set(map(tuple, picture.reshape(-1, 3).tolist()))) > 100
    assert json.loads((out / "relight.json").read_text())["bytes"] == record["bytes"]
    assert not (scene.parent / "out.blocks").exists()


def test_an_existing_result_stays_without_force(scene: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = scene.parent / "out"
    run = ["relight", str(scene), "--out", str(out), "--vertices", "0", "--quiet"]
    assert main(run) == 0
    assert "<title>scene</title>" in (out / "view.html").read_text()
    said = capsys.readouterr()
    assert (said.out, said.err) == ("", "")
    before = (out / "relight.npz").read_bytes()
    assert main(["view", str(out), "--quiet", "--force"]) == 0
    assert main(run) == 2
    assert "found an existing relit scene, expected a new folder or --force" in capsys.readouterr().err
    # Before anything is read.
    assert main(["relight", "missing.toml", *run[2:]]) == 2
    assert "found an existing relit scene" in capsys.readouterr().err
    scene.write_text(SCENE.replace("half = 1.5", "half = 0"))
    assert main([*run, "--force"]) == 2
    assert "half: found 0, expected a number above 0" in capsys.readouterr().err
    assert (out / "relight.npz").read_bytes() == before
    scene.write_text(SCENE.replace("kept = 64", "kept = 32"))
    assert main([*run, "--force"]) == 0
    assert (out / "relight.npz").read_bytes() != before


@pytest.mark.slow
def test_blocks_of_another_run_are_refused_by_name(scene: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """What a killed run left is used by the same run and refused by another."""
    out = scene.parent / "out"
    from homofact.relighting.build import open_relight_scene, relit_objects
    from homofact.relighting.scene_file import read_relight_scene

    scene.write_text(ALL_MATT)
    relit_objects(open_relight_scene(read_relight_scene(scene)), scene.parent / "out.blocks")
    (scene.parent / "out.blocks" / "object_1" / "block_00000.npz").unlink()
    assert main(["relight", str(scene), "--out", str(out), "--vertices", "0"]) == 0
    relit_objects(open_relight_scene(read_relight_scene(scene)), scene.parent / "out.blocks")
    scene.write_text(ALL_MATT.replace("kept = 64", "kept = 32"))
    assert main(["relight", str(scene), "--out", str(out), "--vertices", "0", "--force"]) == 2
    assert "out.blocks/object_0: holds transport of ball.obj with another mesh, material or setting" in (
        capsys.readouterr().err
    )


def test_objects_of_one_mesh_keep_their_own_errors(scene: Path, capsys: pytest.CaptureFixture[str]) -> None:
    ball = '[[object]]\nmesh = "ball.obj"\nalbedo = [0.6]\nat = [1, 0, 0]\nsize = 0.3\n'
    scene.write_text(ball + ALL_MATT)
    out = scene.parent / "out"
    assert main(["relight", str(scene), "--out", str(out), "--vertices", "4", "--json"]) == 0
    record = json.loads(capsys.readouterr().out)
    assert list(record["error"]) == ["ball.obj (1)", "ball.obj (2)", "ground"]
    assert [*record["error"].values()] == [each["error"] for each in record["objects"]]
    from unpacked import written

    named = [name for name, _ in written(out / "view.html")["numbers"]]
    assert named[0].endswith("(1)")
    assert len({*named}) == 3


MATT = ALL_MATT.replace(
    "eye = [0, 1, 4]\npixels = [48, 36]",
    "eye = [0, -3, 4]\npixels = [20, 16]\n[[camera]]\neye = [1, 2, 3]\npixels = [24, 18]",
)


def test_each_camera_has_its_own_picture_and_each_object_its_own_line(
    scene: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """From below the ground is not seen; a triangle without area is left out and said."""
    from homofact.relighting.result import open_relit

    ball = scene.parent / "ball.obj"
    ball.write_text(ball.read_text() + "f 1 1 2\n")
    scene.write_text(MATT.replace("kept = 64", "tolerance = 0.2"))
    run = ["relight", str(scene), "--vertices", "4", "--json"]
    assert main([*run, "--out", str(scene.parent / "out"), "--reference"]) == 0
    said = capsys.readouterr()
    record = json.loads(said.out)
    mesh, ground = record["notes"]
    assert mesh == "ball.obj: 1 degenerate triangles of 121 are left out"
    assert ground.startswith("bounces = 0: the light that the ground reflects does not reach the objects")
    assert f"homofact: {mesh}" in said.err
    assert f"homofact: {ground}" in said.err
    assert record["error"]["ground"] is None
    measured = {"truncation", "together", "rim", "picture", "psnr", "below_zero", "vertices"}
    assert set(record["error"]["ball.obj"]) == measured
    assert record["bytes"] == sum(each["bytes"] for each in record["objects"])
    assert (record["kept"], record["tolerance"]) == (None, 0.2)
    reference = open_relit(scene.parent / "out").reference
    assert reference is not None
    assert np.isnan(reference[1]).all()
    assert 0 < np.isfinite(reference[0]).all(1).sum() < len(reference[0])
    first, second = MATT.split("[[camera]]")[0], MATT.split("[[camera]]")[2]
    scene.write_text(f"{first}[[camera]]{second}".replace("kept = 64", "tolerance = 0.2"))
    assert main(["relight", str(scene), "--vertices", "4", "--out", str(scene.parent / "other")]) == 0
    said = capsys.readouterr()
    assert "ground" in said.out
    assert "not seen" not in said.out
    pictures = (scene.parent / "out" / "picture_2.png", scene.parent / "other" / "picture_1.png")
    assert pictures[0].read_bytes() == pictures[1].read_bytes()
    assert open_relit(scene.parent / "other").reference is None


def test_errors_of_many_objects_keep_their_stages_and_names_on_a_narrow_terminal() -> None:
    names = [f"left_quest2_mesh.00{number}" for number in range(7)]
    errors = {"truncation": 0.0123, "picture": 0.0456, "psnr": 38.5, "below_zero": 0.0, "vertices": 64}
    objects = [{"mesh": name, "error": None if name.endswith("3") else errors} for name in names]
    said = StringIO()
    Console(file=said, width=80).print(*error_tables(objects))
    lines = said.getvalue().splitlines()
    assert all(len(line) <= 80 for line in lines)
    assert sum(line.split()[:1] == ["picture"] for line in lines) == 2
    assert said.getvalue().count("0.0456") == 6
    assert said.getvalue().count("not seen") == 1
    assert "…" not in said.getvalue()
    # A name is folded, and whole.
    assert all(end in said.getvalue() for end in (".000", ".006"))


def test_what_is_not_seen_is_said(scene: Path, capsys: pytest.CaptureFixture[str]) -> None:
    scene.write_text(MATT)
    assert main(["relight", str(scene), "--vertices", "4", "--out", str(scene.parent / "out")]) == 0
    assert "not seen" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (["--vertices", "-1"], "vertices: found -1, expected 0 or more"),
        (["--out", "scene.toml"], "found a file, expected a folder for the relit scene"),
    ],
)
def test_arguments_that_are_none(
    arguments: list[str],
    expected: str,
    scene: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(scene.parent)
    assert main(["relight", "scene.toml", "--out", "out", *arguments]) == 2
    error = capsys.readouterr().err
    assert expected in error
    assert error.count("\n") == 1


def test_objects_whose_error_is_mostly_between_their_vertices_are_named() -> None:
    fine = {"mesh": "fine", "error": {"picture": 0.04, "together": 0.03}}
    coarse = {"mesh": "coarse", "error": {"picture": 0.05, "together": 0.03}}
    unseen, without = {"mesh": "unseen", "error": None}, {"mesh": "without", "error": {"picture": 0.05}}
    (line,) = interpolation_lines([fine, coarse, unseen, without])
    assert "(coarse)" in line
    assert interpolation_lines([fine, unseen]) == []
