"""The program of Wang's figure 4 in its short form, and one point of it at full size."""

import importlib
from pathlib import Path

import pytest
import torch

from homofact.geometry.directions import draw_uniform


@pytest.mark.slow
def test_it_leaves_a_table_and_a_figure(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert importlib.import_module("scripts.accuracy.wang_figure_4").main(["--short", "--out", str(tmp_path)]) == 0
    text = (tmp_path / "wang_figure_4.md").read_text()
    assert text in capsys.readouterr().out
    assert "(equal to 1e-6)" in text
    assert sum(line.startswith("| lafortune-skin | ") for line in text.splitlines()) == 6
    assert (tmp_path / "wang_figure_4.png").stat().st_size > 5000


def test_skin_needs_few_terms() -> None:
    pairs = draw_uniform(5000, torch.Generator().manual_seed(0))
    found = importlib.import_module("scripts.accuracy.wang_figure_4").curve(
        "lafortune-skin", "polar", False, 16, 8, pairs
    )
    assert list(found.errors) == sorted(found.errors, reverse=True)
    assert found.errors[7] < 0.5 * found.errors[0] < 0.03
