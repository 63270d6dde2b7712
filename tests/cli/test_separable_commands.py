"""`svd` and `nmf` through the commands: compared, charted, written, drawn again."""

import json
from pathlib import Path

import pytest

from homofact.cli.main import main

SMALL = ["material:blinn-phong-50", "--count", "600", "--size", "6"]


def answer(capsys: pytest.CaptureFixture[str], *arguments: object) -> dict:
    capsys.readouterr()
    assert main([*map(str, arguments), "--json"]) == 0
    return json.loads(capsys.readouterr().out)


@pytest.mark.slow
def test_they_are_compared_with_the_others(capsys: pytest.CaptureFixture[str]) -> None:
    found = answer(capsys, "compare", *SMALL, "--methods", "mccool,svd,nmf", "--textures", 3, "--metrics", "all")
    mccool, svd, nmf = found["rows"]
    assert [svd[key] for key in ("textures", "bytes", "fetches")] == [3, 3 * 36 * 3 * 4, 6]
    assert [nmf[key] for key in ("textures", "bytes", "fetches")] == [3, 6 * 36 * 3 * 4, 6]
    assert mccool["samples"] == svd["samples"] == 600


@pytest.mark.slow
@pytest.mark.parametrize("method", ["svd", "nmf"])
def test_a_result_is_left_and_drawn_again(method: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "o"
    options = ["--map", "orthographic", "--coordinates", "half-diff"]
    found = answer(capsys, "factorize", *SMALL, "--method", method, *options, "--out", out)
    assert found["method"] == method
    files = {path.name for path in out.iterdir()}
    sides = {f"term_{k}_{side}.{kind}" for k in (0, 1) for side in ("first", "second") for kind in ("exr", "png")}
    assert files == sides | {"factorization.npz", "manifest.json", "report.json", "compare.png"}
    assert json.loads((out / "manifest.json").read_text())["map"] == "orthographic"
    assert main(["render", str(out), "--out", str(tmp_path / "s.png"), "--size", "32", "-q"]) == 0
    assert (tmp_path / "s.png").is_file()


@pytest.mark.slow
def test_they_are_charted_once_a_size_and_count(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    options = ["--methods", "svd,nmf", "--textures", "1,2", "--size", "4", "--chart", tmp_path / "c"]
    assert len(answer(capsys, "compare", *SMALL[:3], *options)["rows"]) == 4


def test_what_does_not_go_together_is_refused_at_once(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    command = ["factorize", *SMALL, "--method", "svd", "--decomposition", "eigen", "--no-reciprocal"]
    assert main([*command, "--out", str(tmp_path / "o")]) == 2
    assert "decomposition: found 'eigen', which needs the symmetry" in capsys.readouterr().err
