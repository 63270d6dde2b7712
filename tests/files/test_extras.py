"""Libraries that are missing: one line with the extra that brings each; embedded files in any folder."""

import json
import re
import tomllib
from pathlib import Path

import numpy as np
import pytest

import homofact
from homofact.cli.main import main
from homofact.containers.exr import write_exr
from homofact.containers.png import write_png
from homofact.errors import MissingDependency
from homofact.files import extras
from homofact.files.embedded import FOLDERS, embedded, located, root

ROOT = Path(__file__).resolve().parents[2]
IMAGES = ("matplotlib", "PIL", "OpenEXR", "png", "plyfile")


@pytest.fixture
def bare(monkeypatch: pytest.MonkeyPatch) -> None:
    """As installed without any extra."""
    import sys

    for module in extras.LIBRARIES:
        for name in [each for each in sys.modules if each.partition(".")[0] == module]:
            monkeypatch.delitem(sys.modules, name)
        monkeypatch.setitem(sys.modules, module, None)
    # What has imported them before must do so again.
    for name in [each for each in sys.modules if each.startswith("homofact.figures")]:
        monkeypatch.delitem(sys.modules, name)


def test_every_library_is_in_the_extra_that_its_message_names() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    optional = project["optional-dependencies"]
    for package, extra in extras.LIBRARIES.values():
        assert any(re.match(rf"{package}\b", need) for need in optional[extra]), package
        assert not any(re.match(rf"{package}\b", need) for need in project["dependencies"]), package
    named = {extra for _, extra in extras.LIBRARIES.values()}
    (everything,) = optional["all"]
    assert set(re.findall(r"\w+", everything)) - {"homofact"} == named


@pytest.mark.usefixtures("bare")
def test_a_missing_library_is_one_line(tmp_path: Path) -> None:
    with pytest.raises(MissingDependency, match=r"^shadows: embreex is not installed, .* 'homofact\[relight\]'\)$"):
        extras.library("embreex.rtcore_scene", "shadows")
    with pytest.raises(MissingDependency, match=r"pip install 'homofact\[metrics\]'"):
        extras.check("metrics", "numpy", "skimage")
    containers = r"^\S+a\.x: \w+ is not installed, expected it \(pip install 'homofact\[containers\]'\)$"
    with pytest.raises(MissingDependency, match=containers):
        write_exr(tmp_path / "a.x", np.zeros((2, 2, 3), np.float32), ("R", "G", "B"))
    with pytest.raises(MissingDependency, match=containers):
        write_png(tmp_path / "a.x", np.zeros((2, 2, 3), np.uint8))
    assert extras.left_out({"EXR": "OpenEXR", "PNG": "PIL", "numbers": "numpy"}) == (
        "no EXR, no PNG: OpenEXR, pillow not installed, expected: pip install 'homofact[containers,pictures]'"
    )
    assert extras.left_out({"numbers": "numpy"}) == ""
    assert extras.lacking(ModuleNotFoundError("no", name="matplotlib.figure")) is not None
    assert extras.lacking(ModuleNotFoundError("no", name="homofact.gone")) is None


@pytest.mark.usefixtures("bare")
def test_a_fit_from_the_core_alone_works_and_says_what_it_leaves_out(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    line = ["factorize", "material:phong-10", "--count", "300", "--method", "mccool", "--size", "5", "--out", str(out)]
    assert main(line) == 0
    told = capsys.readouterr()
    wanted = "homofact: no textures as EXR, no textures as PNG, no pictures: OpenEXR, matplotlib, pillow not installed"
    assert wanted in told.err
    assert "compare.png" not in told.out
    assert sorted(each.name for each in out.iterdir()) == ["factorization.npz", "manifest.json", "report.json"]
    assert [each["files"] for each in json.loads((out / "manifest.json").read_text())["textures"]] == [{}, {}]
    assert homofact.load(str(out)).channels == ("R", "G", "B")


@pytest.mark.usefixtures("bare")
@pytest.mark.parametrize(
    ("line", "extra"),
    [
        (["compare", "material:phong-10", "--plot", "a.png"], "pictures"),
        (["compare", "material:phong-10", "--chart", "charts"], "pictures"),
        (["info", "--plot", "a.png"], "pictures"),
        (["info", "material:phong-10", "--plot", "a.png"], "pictures"),
        (["compare", "material:phong-10", "--metrics", "flip"], "metrics"),
    ],
)
def test_a_command_that_needs_an_extra_says_so_before_it_works(
    line: list[str], extra: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(line) == 2
    said = capsys.readouterr().err
    assert re.fullmatch(rf"homofact: .* is not installed, expected it \(pip install 'homofact\[{extra}\]'\)\n", said)
    assert list(tmp_path.iterdir()) == []


def test_embedded_files_stand_in_for_those_that_are_not_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    file = "data_synthetic/synthetic_cornell.brdf"
    assert embedded(file) == root() / file == located(file)
    assert embedded(tmp_path / file) == root() / file
    assert embedded("configs/scenes/../../data_synthetic/knot.ply") == root() / "data_synthetic" / "knot.ply"
    for other in ("data_synthetic", "data_synthetic/none", "other/paint.brdf", "../data_synthetic/knot.ply", "", "."):
        assert embedded(other) is None
    assert located("other/paint.brdf") == Path("other/paint.brdf")
    # What is there is never replaced, be it a link to nothing.
    (tmp_path / "data_synthetic").mkdir()
    (tmp_path / file).symlink_to(tmp_path / "nothing")
    assert embedded(file) is None
    assert {each.name for each in root().iterdir()} >= set(FOLDERS)


def test_a_command_is_given_the_embedded_file_but_never_to_write_to(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    from homofact.cli.main import _with_embedded

    monkeypatch.chdir(tmp_path)
    scene, paint = "configs/scenes/relight.toml", "data_synthetic/blue_paint.npz"
    assert _with_embedded(["relight", scene, "--out", "out"]) == ["relight", str(root() / scene), "--out", "out"]
    assert capsys.readouterr().err == f"homofact: {scene} is not in this folder: taken from {root() / scene}\n"
    asked = ["factorize", "-c", "configs/blue_paint.toml", "-q"]
    assert _with_embedded(asked) == ["factorize", "-c", str(root() / "configs" / "blue_paint.toml"), "-q"]
    for line in (["convert", "material:phong-10", paint], ["factorize", "a", "--out", paint], ["info", "no.brdf"]):
        assert _with_embedded(line) == line
    assert capsys.readouterr().err == ""
