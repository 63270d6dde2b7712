"""The README's picture of the demo: the plastic shows a highlight, and is what `make demo` fits first."""

import importlib
import tomllib
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

ROOT = Path(__file__).parents[2]


@pytest.mark.slow
def test_the_plastic_has_a_highlight_and_the_paint_has_none(tmp_path: Path) -> None:
    demo = importlib.import_module("scripts.pictures.demo_picture")
    assert demo.main(["--short", "--out", str(tmp_path / "demo.png")]) == 0
    page = np.asarray(Image.open(tmp_path / "demo.png").convert("RGB")).astype(int)
    step = demo.SIDE + demo.GAP
    assert page.shape[1] == demo.GAP + 4 * step
    # The first row of spheres begins under a title.
    top = demo.GAP // 2 + 18 + demo.GAP // 2
    plastic, _, paint, _ = (page[top : top + demo.SIDE, demo.GAP + k * step :][:, : demo.SIDE] for k in range(4))
    highlight, body = np.quantile(plastic.mean(2)[plastic.mean(2) > 60], (0.995, 0.5))
    brightest, middle = np.quantile(paint.mean(2)[paint.mean(2) > 60], (0.995, 0.5))
    assert highlight > 225
    assert highlight - body > brightest - middle + 40


def test_the_demo_s_first_fit_is_the_picture_s_first() -> None:
    demo = importlib.import_module("scripts.pictures.demo_picture")
    with (ROOT / "configs" / "plastic.toml").open("rb") as file:
        settings = tomllib.load(file)
    assert settings["source"]["path"] == demo.MATERIALS[0][1]
    recipe = (ROOT / "Makefile").read_text(encoding="utf-8").split("\ndemo:")[1]
    assert "configs/plastic.toml" in recipe.splitlines()[1]
