"""The programs behind the figures of light and of seeds, in their short forms."""

import re
import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import pytest
from PIL import Image


def test_seeds_are_told_apart(script: Callable[[str], ModuleType], tmp_path: Path) -> None:
    out = tmp_path / "seeds.md"
    assert script("accuracy.seeds").main(["--short", "--data", str(tmp_path), "--out", str(out)]) == 0
    text = out.read_text(encoding="utf-8")
    assert "a smoke test" in text
    cells = [cell.strip() for cell in re.findall(r"^\|(.*)\|$", text, re.MULTILINE)[-1].split("|")]
    assert cells[:2] == ["lafortune-blue-paint", "1"]
    best, middle, worst, ratio = (float(cell) for cell in cells[2:6])
    assert 0 < best <= middle <= worst
    assert ratio == pytest.approx(worst / best, abs=0.01)


def test_missing_measurements_are_named_and_the_light_of_a_row_is_its_own(
    script: Callable[[str], ModuleType], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    module = script("accuracy.kept_light")
    assert module.main(["--short", "--data", str(tmp_path)]) == 0
    said = capsys.readouterr()
    assert said.err.count("skipped") == len(module.RGL) + 1
    assert "| material |" not in said.out
    row = module.fitted("paint", "material:lafortune-blue-paint", 1, 4, 5.0, False, 400)
    older = module.fitted("paint", "material:lafortune-blue-paint", 1, 4, 5.0, True, 400)
    assert older.reciprocal
    assert row.energy != older.energy
    table = module.summary([row, older])
    assert "off by, 2 materials" in table
    assert module.ranked([1.0, 3.0, 2.0]) == (2.0, 3.0, 3.0)
    assert module.ranked([1.0, 3.0, 2.0], low=True) == (2.0, 1.0, 1.0)


def test_the_gallery_has_a_sheet_and_a_line_a_material(
    script: Callable[[str], ModuleType], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    module = script("pictures.gallery")
    page = tmp_path / "page" / "gallery.md"
    assert module.main(["--short", "--data", str(tmp_path), "--out", str(page)]) == 0
    count = len(module.PAINTS) + len(module.SAMPLED) + len(module.SURROGATES)
    assert capsys.readouterr().err.count("skipped") == count
    text = page.read_text(encoding="utf-8")
    assert "a smoke test" in text
    assert "| [phong-10](#phong-10) |" in text
    assert "![phong-10: source, fit, differences](pictures/gallery-phong-10.png)" in text
    assert str(tmp_path) not in text
    with Image.open(page.parent / "pictures" / "gallery-phong-10.png") as picture:
        assert picture.width > 400


@pytest.mark.slow
def test_a_command_is_timed_with_its_fit(
    script: Callable[[str], ModuleType], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    module, out = script("speed.command_time"), tmp_path / "times.md"
    assert module.main(["--short", "--data", str(tmp_path), "--out", str(out)]) == 0
    text = capsys.readouterr().out
    assert out.read_text(encoding="utf-8") == text
    assert "a smoke test" in text
    (row,) = [line for line in text.splitlines() if line.startswith("| lafortune")]
    fit, command, rest, _, peak = (float(cell) for cell in row.strip("| ").split(" | ")[2:])
    assert 0 < fit < command
    assert rest == pytest.approx(command - fit, abs=0.11)
    assert 100 < peak < 10_000
    with pytest.raises(RuntimeError, match="ended with 1"):
        module.timed([sys.executable, "-c", "raise SystemExit(1)"])


@pytest.mark.slow
def test_imports_and_evaluations_without_torch_are_timed(
    script: Callable[[str], ModuleType], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    module, out = script("speed.runtime_numbers"), tmp_path / "runtime.md"
    assert module.main(["--short", "--out", str(out)]) == 0
    text = capsys.readouterr().out
    assert out.read_text(encoding="utf-8") == text
    assert "a smoke test" in text
    rows = [line.strip("| ").split(" | ") for line in text.splitlines() if line.startswith("| ")]
    assert [row[0] for row in rows if row[0].startswith("`")] == [f"`import {name}`" for name in module.IMPORTED]
    assert all(float(row[1]) > 0 for row in rows if row[0].startswith(("`", "torch", "NumPy", "compiled")))


def test_the_cost_model_is_told_beside_what_work_takes(
    script: Callable[[str], ModuleType], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    module, out = script("speed.cost_model"), tmp_path / "cost.md"
    assert module.main(["--short", "--out", str(out)]) == 0
    text = capsys.readouterr().out
    assert out.read_text(encoding="utf-8") == text
    assert "a smoke test" in text
    rows = [line.strip("| ").split(" | ") for line in text.splitlines() if " samples, " in line]
    assert len(rows) == 8
    for _, took, said, ratio in rows:
        assert float(ratio) == pytest.approx(float(said) / float(took), rel=0.2, abs=0.01)
    # The parts that constants are multiplied by are those of the model itself.
    units = sum(a * b for a, b in zip((2e-3, 1e-7, 8e-9, 5e-9, 1.2e-11), module.parts(8000, 2, 512), strict=True))
    for count, lookups, texels in ((8000, 2, 512), (500, 3, 64)):
        own = sum(
            a * b for a, b in zip((2e-3, 1e-7, 8e-9, 5e-9, 1.2e-11), module.parts(count, lookups, texels), strict=True)
        )
        assert own / units == pytest.approx(module.effort.cost_of_evaluation(count, lookups, texels))
