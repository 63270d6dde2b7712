"""The programs behind the figures of light and of seeds, in their short forms."""

import importlib
import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import pytest
from PIL import Image

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture
def script(monkeypatch: pytest.MonkeyPatch) -> Callable[[str], ModuleType]:
    monkeypatch.syspath_prepend(str(ROOT / "scripts"))
    return importlib.import_module


def test_seeds_are_told_apart(script: Callable[[str], ModuleType], tmp_path: Path) -> None:
    out = tmp_path / "seeds.md"
    assert script("seeds").main(["--short", "--data", str(tmp_path), "--out", str(out)]) == 0
    text = out.read_text(encoding="utf-8")
    assert "a smoke test" in text
    cells = [cell.strip() for cell in text.strip().splitlines()[-1].strip("|").split("|")]
    assert cells[:2] == ["lafortune-blue-paint", "1"]
    best, middle, worst, ratio = (float(cell) for cell in cells[2:6])
    assert 0 < best <= middle <= worst
    assert ratio == pytest.approx(worst / best, abs=0.01)


def test_missing_measurements_are_named_and_the_light_of_a_row_is_its_own(
    script: Callable[[str], ModuleType], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    module = script("kept_light")
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
    module = script("gallery")
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


def test_a_command_is_timed_with_its_fit(
    script: Callable[[str], ModuleType], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    module, out = script("command_time"), tmp_path / "times.md"
    assert module.main(["--short", "--data", str(tmp_path), "--out", str(out)]) == 0
    text = capsys.readouterr().out
    assert out.read_text(encoding="utf-8") == text.removesuffix("\n")
    assert "a smoke test" in text
    (row,) = [line for line in text.splitlines() if line.startswith("| lafortune")]
    fit, command, rest, _, peak = (float(cell) for cell in row.strip("| ").split(" | ")[2:])
    assert 0 < fit < command
    assert rest == pytest.approx(command - fit, abs=0.11)
    assert 100 < peak < 10_000
    with pytest.raises(RuntimeError, match="ended with 1"):
        module.timed([sys.executable, "-c", "raise SystemExit(1)"])


def test_the_cost_model_is_told_beside_what_work_takes(
    script: Callable[[str], ModuleType], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    module, out = script("cost_model"), tmp_path / "cost.md"
    assert module.main(["--short", "--out", str(out)]) == 0
    text = capsys.readouterr().out
    assert out.read_text(encoding="utf-8") == text.removesuffix("\n")
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


def test_the_blind_cases_are_judged_by_their_truth(
    script: Callable[[str], ModuleType], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    module, out = script("verdict_blind"), tmp_path / "blind.md"
    assert module.main(["--short", "--half", "test", "--data", str(tmp_path), "--out", str(out)]) == 0
    assert "a smoke test" in out.read_text(encoding="utf-8")
    capsys.readouterr()
    # Materials and stressors of the two halves have nothing in common.
    assert not {each.name for each in module.TUNING} & {each.name for each in module.TEST}
    assert not set(module.materials("tuning", tmp_path)) & set(module.materials("test", tmp_path))
    cases = [
        module.Case("one", "x", 1.3, 0.99, (), False),
        module.Case("two", "x", 1.0, 0.5, ("light",), False),
        module.Case("three", "x", 1.1, 0.95, ("zeros",), False),
        module.Case("four", "x", 1.1, 0.95, (), False),
        module.Case("five", "x", 0.8, 0.99, (), True),
    ]
    assert [case.bad for case in cases] == [True, True, False, False, True]
    text = module.tables(cases)
    assert "| bad, where it can be known | 2 | 1 | 1 | 50% |" in text
    assert "| good, where it can be known | 2 | 1 | 1 | 50% |" in text
    assert "| bad, where it cannot | 1 | 0 | 1 | 100% |" in text
    assert "| zeros | 0 | 1 |" in text
