"""The scripts that need Mitsuba, in their short forms, on a made-up RGL file; what they say where it is missing."""

import importlib
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import pytest
import torch
from mitsuba_cases import variant
from PIL import Image
from rgl_files import constant, write_tensors

from homofact.errors import BadInput
from homofact.files import extras
from homofact.geometry.directions import draw_uniform
from homofact.rendering import mitsuba_bsdf


@pytest.fixture
def file(tmp_path: Path) -> Path:
    """f = 1/(8 cosθo)."""
    return write_tensors(tmp_path / "made_up_rgb.bsdf", constant())


@pytest.mark.slow
def test_the_comparison_draws_what_it_measured(
    script: Callable[[str], ModuleType], file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    variant("llvm_ad_rgb")
    main, out, picture = script("engines.mitsuba_comparison").main, tmp_path / "out", tmp_path / "pictures" / "a.png"
    assert main([str(file), "--short", "--out", str(out), "--picture", str(picture)]) == 0
    printed = capsys.readouterr().out
    written = (out / "made_up.md").read_text(encoding="utf-8")
    assert written in printed
    assert "a smoke test: the figures mean nothing" in written
    rows = [line for line in written.splitlines() if line.startswith("| made_up |")]
    assert len(rows) == 2
    cells = [cell.strip() for cell in rows[1].strip("|").split("|")]
    error, noise = (float(cells[k].removesuffix("%")) for k in (2, 4))
    # Eight samples per pixel are noisy, but the same material all the same.
    assert 0 < noise < 100
    assert 0 < error < 100
    with Image.open(picture) as image:
        assert image.size[0] > 3 * 96
    assert main([str(file), "--short", "--throughput", "--fit", str(out), "--out", str(out)]) == 0
    rates = (out / "throughput.md").read_text(encoding="utf-8")
    assert rates in capsys.readouterr().out
    assert "| measured: made_up | 1 |" in rates
    assert "| fit: " in rates


def test_missing_and_bad_files(
    script: Callable[[str], ModuleType], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    variant("llvm_ad_rgb")
    missing, text = tmp_path / "none.bsdf", tmp_path / "text.bsdf"
    text.write_text("no tensors")
    main = script("engines.mitsuba_comparison").main
    for place in (missing, text):
        assert main([str(place), "--short", "--out", str(tmp_path / "out")]) == 2
        said = capsys.readouterr().err
        assert str(place) in said
        assert said.count("\n") == 1


def test_no_mitsuba(
    script: Callable[[str], ModuleType], tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    def absent(name: str) -> ModuleType:
        raise ModuleNotFoundError(f"No module named {name!r}")

    main = script("engines.mitsuba_comparison").main
    monkeypatch.setattr(extras, "import_module", absent)
    assert main(["--short", "--out", str(tmp_path)]) == 2
    said = capsys.readouterr().err
    assert said.startswith("mitsuba: mitsuba is not installed, expected it (pip install")
    assert said.count("\n") == 1


def test_the_throughput_of_measured(script: Callable[[str], ModuleType], file: Path, tmp_path: Path) -> None:
    mi = variant("llvm_ad_rgb")
    timing, drjit = script("engines.mitsuba_throughput"), importlib.import_module("drjit")
    wi, wo = draw_uniform(300, torch.Generator().manual_seed(0))
    before = drjit.thread_count()
    found = timing.measured_throughput(file, wi, wo, threads=1, batches=(64, 1000), repeats=2)
    assert found.threads == 1
    assert drjit.thread_count() == before
    assert set(found.rates) == {64, 1000}
    assert found.best == max(found.rates.values()) == found.rates[found.batch] > 0
    assert mi.variant() == mitsuba_bsdf.VARIANT
    with pytest.raises(BadInput, match=r"none\.bsdf: Mitsuba's measured refused it"):
        timing.measured_throughput(tmp_path / "none.bsdf", wi, wo)


def test_relative_rms_is_over_the_pixels_inside(script: Callable[[str], ModuleType]) -> None:
    source = torch.tensor([[[3.0], [4.0], [100.0]]])
    error = torch.tensor([[[0.5], [0.0], [50.0]]])
    inside = torch.tensor([[True, True, False]])
    assert script("engines.mitsuba_comparison").relative_rms(error, source, inside) == pytest.approx(0.1)
