"""The programs behind the figures of light and of seeds, in their short forms."""

import math
import re
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import ModuleType, SimpleNamespace

import pytest
import torch
from PIL import Image

from homofact.brdf.analytic import AnalyticModel, BlinnPhong, Lambert, Ward
from homofact.brdf.log_transform import LogTransform
from homofact.brdf.sampling import sample_model
from homofact.geometry.directions import from_spherical, normalize


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


@pytest.mark.slow
def test_the_blind_cases_are_judged_by_their_truth(
    script: Callable[[str], ModuleType], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    module, cases, out = script("verdict.verdict_blind"), script("verdict.verdict_cases"), tmp_path / "blind.md"
    for draw in ("test", "fresh"):
        assert module.main(["--short", "--draw", draw, "--data", str(tmp_path), "--out", str(out)]) == 0
        assert "a smoke test" in out.read_text(encoding="utf-8")
    capsys.readouterr()
    # Materials and stressors of the draws have nothing in common.
    for one, other in (("tuning", "test"), ("tuning", "fresh"), ("test", "fresh")):
        assert not {each.name for each in cases.STRESSORS[one]} & {each.name for each in cases.STRESSORS[other]}
    assert not set(cases.materials("tuning", tmp_path)) & set(cases.materials("test", tmp_path))
    truth = script("verdict.verdict_truth").Truth
    found = [
        module.Case("one", "x", truth(1.3, 0.99, 1.0), ()),
        module.Case("two", "x", truth(1.0, 0.5, 1.0), ("light",)),
        module.Case("three", "x", truth(1.1, 0.95, 1.0), ("zeros",)),
        module.Case("four", "x", truth(1.1, 0.95, 1.0), ()),
        module.Case("five", "x", truth(0.8, 0.99, 1.0, "between samples", "between samples"), (), ("sampling",)),
        module.Case("six", "x", truth(1.0, 0.99, 0.5), ("sampling",)),
    ]
    assert [case.truth.plainly_bad for case in found] == [True, True, False, False, True, False]
    assert [case.truth.bad for case in found] == [True, True, False, False, True, True]
    text = module.tables(found)
    assert "| bad, all, no rule applied | 3 | 1 | 2 | 66.7% |" in text
    assert "| bad, can be known | 2 | 1 | 1 | 50.0% |" in text
    assert "| good | 3 | 2 | 1 | 66.7% |" in text
    assert "| with the highlight: bad, can be known | 3 | 2 | 1 | 33.3% |" in text
    assert "| with the highlight: good | 2 | 1 | 1 | 50.0% |" in text
    assert "| between samples | 1 | 0 | 1 |" in text
    assert "| zeros | 0 | 1 |" in text


def test_what_cannot_be_known_is_told_by_samples_and_the_clean_material(
    script: Callable[[str], ModuleType],
) -> None:
    truth, cases = script("verdict.verdict_truth"), script("verdict.verdict_cases")
    broad = BlinnPhong((0.3,), (0.5,), 10, channels=("Y",))
    narrow = cases.Mixture(broad, Ward((0.0,), (0.6,), alpha_x=0.01, alpha_y=0.01, channels=("Y",)), 0.5)
    base = Lambert((0.2,), channels=("Y",))
    samples = sample_model(narrow, 3000, "discs", 0)
    far = samples.select(normalize(samples.wi + samples.wo)[:, 2] < math.cos(math.radians(5)))
    # The lobe is within 3 degrees: no sample of `far` knows of it, and those drawn by lobes do.
    wi = from_spherical(torch.tensor([0.5, 0.5]), torch.zeros(2))
    wo = from_spherical(torch.tensor([0.5, 0.5]), torch.tensor([math.pi, 2.0]))
    assert truth.blind(narrow, far, wi, wo).tolist() == [True, False]
    assert truth.blind(narrow, sample_model(narrow, 3000, "lobe", 0), wi, wo).tolist() == [False, False]

    def fitted(model: AnalyticModel, factor: float = 1.0) -> SimpleNamespace:
        return SimpleNamespace(
            channels=("Y",),
            transform=LogTransform(0.01, torch.tensor([0.1], dtype=torch.float64)),
            evaluate=lambda wi, wo: factor * model.evaluate(wi, wo),
        )

    seen = truth.truth_of(fitted(broad, 0.5), narrow, far, None, 0)
    assert seen.plainly_bad
    assert seen.plainly_unknowable == truth.BETWEEN
    # A scale is another material where it leaves the albedo under 1, and the fit is a good one of that.
    for factor, fit, why in ((2.0, 2.0, truth.ANOTHER), (2.0, 3.0, ""), (6.0, 6.0, "")):
        clean = sample_model(base, 500, "discs", 0)
        scaled = replace(clean, values=factor * clean.values)
        other = truth.truth_of(fitted(base, fit), base, scaled, lambda v, by=factor: by * v, 0)
        assert other.plainly_bad
        assert other.plainly_unknowable == why
    # What is cut at zero has left its trace.
    cut = replace(clean, values=torch.where(clean.wi[:, :1] > 0.9, 0.0, 2 * clean.values))
    assert truth.truth_of(fitted(base, 2.0), base, cut, lambda v: 2 * v, 0).unknowable == ""
    assert cases.UNTOUCHED
