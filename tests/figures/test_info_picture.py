"""The picture of `info`: what is drawn, and what the file says of itself."""

import math
from pathlib import Path

import pytest
import torch
from PIL import Image
from refusals import refused
from torch import Tensor

from homofact.brdf.analytic import Lambert, Phong
from homofact.brdf.channels import display_of
from homofact.brdf.sampling import sample_model
from homofact.cli.main import main
from homofact.figures.info_picture import info_picture, lobe_values, slice_values


def test_slice_and_lobes_of_lambert_are_flat() -> None:
    grey = Lambert((0.5, 0.5, 0.5))
    assert torch.allclose(slice_values(grey), torch.full((90, 90), 0.5 / math.pi, dtype=torch.float64), rtol=1e-6)
    assert lobe_values(grey, 45)[1].std() < 1e-9
    # Luminance, not the mean: green weighs .715.
    assert float(slice_values(Lambert((0.0, 1.0, 0.0)))[0, 0]) == pytest.approx(0.71516868 / math.pi)
    assert float(slice_values(Lambert((0.3,), channels=("Y",)))[0, 0]) == pytest.approx(0.3 / math.pi)


def test_the_highlight_is_at_theta_h_0_and_opposite_to_the_light() -> None:
    shiny = Phong((0.1, 0.1, 0.1), (0.5, 0.5, 0.5), 50)
    values = slice_values(shiny)
    assert float(values[20, 0]) > 2 * float(values[20, 60])
    theta, lobe = lobe_values(shiny, 45)
    assert float(theta[lobe.argmax()]) == pytest.approx(math.radians(45), abs=math.radians(1))


def test_the_picture_says_its_conditions(tmp_path: Path) -> None:
    model = Lambert((0.5, 0.2, 0.1))
    report = info_picture(tmp_path / "p.png", "a $strange_name", model, measured=sample_model(model, 100))
    with Image.open(tmp_path / "p.png") as picture:
        text = str(picture.info["Description"])
        colours = picture.convert("RGB").getcolors(1 << 24)
    for words in ("white point D65", f"Exposure {report.exposure:.4g}", "clipped to the gamut", "interpolated"):
        assert words in text
    assert colours is not None
    assert len(colours) > 500
    assert [path.name for path in tmp_path.iterdir()] == ["p.png"]


@pytest.mark.slow
def test_black_and_spectral_ones_are_drawn(tmp_path: Path) -> None:
    info_picture(tmp_path / "black.png", "black", Lambert((0.0, 0.0, 0.0)))
    five = Lambert((0.1, 0.2, 0.3, 0.4, 0.5), channels=("a", "b", "c", "d", "e"))

    def first_three(values: Tensor) -> Tensor:
        return values[:, :3]

    info_picture(tmp_path / "five.png", "five", five, to_rgb=first_three)
    with refused(where="reflectance", found="5 channels"):
        info_picture(tmp_path / "none.png", "five", five)
    assert not (tmp_path / "none.png").exists()


def test_info_draws_on_demand(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    target = tmp_path / "deep" / "p.png"
    assert main(["info", "material:blinn-phong-50", "--count", "300", "--plot", str(target), "--json"]) == 0
    assert '"plot"' in capsys.readouterr().out
    assert target.exists()
    assert main(["info", "material:blinn-phong-50", "--plot", str(tmp_path / "p.jpg")]) == 2
    assert "expected .png" in capsys.readouterr().err


@pytest.mark.slow
def test_a_spectral_preview_says_what_leaves_the_gamut(tmp_path: Path) -> None:
    # Nearly monochromatic green: its sRGB red is negative, which the picture clips and counts.
    names = tuple(f"{w}nm" for w in range(400, 710, 10))
    green = Lambert(tuple(1.0 if name == "520nm" else 0.0 for name in names), channels=names)
    shown = display_of(names)
    assert shown is not None
    assert float(shown(green.evaluate(*[torch.tensor([[0.0, 0.0, 1.0]]).double()] * 2)).min()) < 0
    report = info_picture(tmp_path / "g.png", "green", green, to_rgb=shown)
    # The dark side is black, not clipped.
    assert 0.5 < report.clipped < 0.95
    white = Lambert((0.5,) * len(names), channels=names)
    assert info_picture(tmp_path / "w.png", "white", white, to_rgb=shown).clipped < 0.02
