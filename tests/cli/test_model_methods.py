"""Models without textures are refused where textures are asked for, however many lobes they have."""

from pathlib import Path

import pytest

from homofact.cli.main import main


@pytest.mark.parametrize("method", ["ggx", "ggx:2", "gaussians:3", "npf"])
def test_factorize_refuses_a_model_and_names_the_methods(method: str, tmp_path: Path, capsys) -> None:
    out = tmp_path / "out"
    assert main(["factorize", "material:phong-10", "--method", method, "--out", str(out)]) == 2
    words = capsys.readouterr().err
    assert f"method: found '{method}', expected one of search, cole, mccool, svd, nmf" in words
    assert list(tmp_path.iterdir()) == []
