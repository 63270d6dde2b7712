"""Models without textures: those that no shader is made of are refused, of a GGX model there is a result."""

import json
from pathlib import Path

import pytest

from homofact.cli.main import main


@pytest.mark.parametrize("method", ["gaussians:3", "npf", "nbrdf"])
def test_factorize_refuses_a_model_and_names_the_methods(method: str, tmp_path: Path, capsys) -> None:
    out = tmp_path / "out"
    assert main(["factorize", "material:phong-10", "--method", method, "--out", str(out)]) == 2
    words = capsys.readouterr().err
    assert f"method: found '{method}', expected one of search, cole, mccool, svd, nmf, ggx" in words
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(("method", "count"), [("ggx", 32), ("ggx:2", 52)])
def test_factorize_writes_a_ggx_model_that_can_be_exported_and_viewed(
    method: str, count: int, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out, engine = tmp_path / "out", tmp_path / "engine"
    assert main(["factorize", "material:cook-torrance-plastic", "--method", method, "--out", str(out)]) == 0
    words = " ".join(capsys.readouterr().out.split())
    assert f"a model without textures, {count} bytes as float32, 0 fetches per evaluation" in words
    assert "every texture" not in words
    written = json.loads((out / "manifest.json").read_text(encoding="utf-8"))
    assert written["format"] == "homofact model manifest"
    assert len(written["model"]["roughness"]) == (2 if method == "ggx:2" else 1)
    assert not list(out.glob("texture*"))
    assert main(["export", str(out), "--out", str(engine), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["cost"]["fetches"] == 0
    assert main(["view", str(out), "-q"]) == 0
    assert "homofact_evaluate" in (engine / "brdf.glsl").read_text(encoding="utf-8")
    # The page states the bytes of the model's numbers.
    assert f'"{count}"' in (out / "view.html").read_text(encoding="utf-8")
