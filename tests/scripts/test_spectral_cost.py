"""The spectral benchmark in its short form: both fits do the same work, and its ratio is that of its times."""

import importlib
from pathlib import Path
from types import ModuleType

import pytest
import torch


@pytest.fixture
def module(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    return importlib.import_module("scripts.speed.spectral_cost")


def test_the_same_evaluations_of_3_and_31_channels(
    module: ModuleType, real_data: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "s.md"
    assert module.main(["--short", "--data", str(real_data), "--out", str(out)]) == 0
    text = capsys.readouterr().out
    assert out.read_text(encoding="utf-8") == text
    rows = [line.strip("| ").split(" | ") for line in text.splitlines() if line.startswith("|")][2:]
    assert [row[2] for row in rows] == ["3", "31", "3", "31"]
    for rgb, spectral in zip(rows[::2], rows[1::2], strict=True):
        assert rgb[1] == spectral[1]  # samples
        assert rgb[3] == spectral[3] == "3"  # evaluations
        assert float(spectral[6]) == pytest.approx(float(spectral[4]) / float(rgb[4]), rel=0.02)
    assert "smoke test" in text


@pytest.mark.parametrize("kind", ["half-diff", "isotropic-half-diff"])
def test_every_evaluation_is_at_other_projections_and_counted(
    module: ModuleType, real_data: Path, kind: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen: list[torch.Tensor] = []
    evaluate = module.Objective.evaluate

    def told(self: object, vector: torch.Tensor) -> object:
        seen.append(vector)
        return evaluate(self, vector)

    monkeypatch.setattr(module.Objective, "evaluate", told)
    samples = module.training(real_data / "cornell" / "garnet_red.brdf", "rgb", kind).subset(400, 0)
    _, mean = module.fit(samples, kind, 3)
    assert len(seen) == 3
    assert len({tuple(vector.tolist()) for vector in seen}) == 3
    assert 0 < mean < 20
    assert torch.allclose(seen[0].reshape(-1, 4).norm(dim=1), torch.ones(len(seen[0]) // 4, dtype=torch.float64))


def test_a_missing_paint_is_said(module: ModuleType, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert module.main(["--data", str(tmp_path)]) == 1
    assert "garnet_red" in capsys.readouterr().err
