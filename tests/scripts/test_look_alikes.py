"""The table of look-alikes: a row a source, what is measured of the material that was fitted to it."""

from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import pytest

from homofact.brdf.analytic.metallic_roughness import MetallicRoughness
from homofact.brdf.source import open_source
from homofact.evaluation.appearance import appearance

LOOK = MetallicRoughness((0.3, 0.4, 0.7), 0.1, 0.65, 0.2, 0.3, specular=0.5)
MEASURED = Path(__file__).parents[2] / "data_synthetic" / "synthetic_cornell.brdf"


def test_a_row_has_the_numbers_of_the_material_and_its_likeness(
    script: Callable[[str], ModuleType], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    module = script("engines.look_alikes")
    asked = []
    monkeypatch.setattr(module, "fit_metallic_roughness", lambda _, isotropic: asked.append(isotropic) or LOOK)
    place = "material:lafortune-blue-paint"
    module.main([place])
    assert asked == [True]
    head, _, row = (
        [cell.strip() for cell in line.strip("|").split(" | ")] for line in capsys.readouterr().out.strip().splitlines()
    )
    found = dict(zip(head, row, strict=True))
    likeness = appearance(LOOK, open_source(place, count=100))
    assert likeness is not None
    assert found["source"] == "lafortune-blue-paint"
    assert (found["metallic"], found["roughness"]) == ("0.10", "0.65")
    assert found["extensions"] == "specular 0.50, coat 0.20"
    assert float(found["albedo, worst"]) == pytest.approx(likeness.energy.albedo_worst, rel=0.01)
    # Of the channel that is farthest off.
    assert float(found["albedo, mean"]) == pytest.approx(
        max(likeness.energy.energy, key=lambda ratio: max(ratio, 1 / ratio)), rel=0.01
    )
    assert float(found["lamp dB"]) == pytest.approx(likeness.psnr_light, rel=0.01)
    assert float(found["sky dB"]) == pytest.approx(likeness.psnr_sky, rel=0.01)


def test_samples_alone_are_refused(
    script: Callable[[str], ModuleType], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    module = script("engines.look_alikes")
    monkeypatch.setattr(module, "fit_metallic_roughness", lambda *_: LOOK)
    with pytest.raises(SystemExit, match="2"):
        module.main([str(MEASURED)])
    assert "expected a material, or a file that is a reflectance" in capsys.readouterr().err
