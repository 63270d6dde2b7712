"""The pages' exposure and tone curve, in node: those of rendering/tonemap.py."""

import json
import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest
import torch

from homofact.rendering.sphere import SphereImage
from homofact.rendering.tonemap import DEFAULT_CURVE, automatic_exposure, displayed
from homofact.web.assembly import part


def image(radiance: torch.Tensor) -> SphereImage:
    """A picture of one row of pixels (N, C), all covered."""
    return SphereImage(radiance[None], torch.ones(1, len(radiance), dtype=torch.float64))


def drawn(count: int, channels: int, dark: int = 0, sign: float = 1.0) -> torch.Tensor:
    """Log-normal radiance over ten stops, of which the first `dark` pixels are black."""
    made = torch.randn(count, channels, generator=torch.Generator().manual_seed(count), dtype=torch.float64)
    radiance = torch.exp(2 * made) * sign
    radiance[:dark] = 0
    return radiance


CASES = {
    "many": drawn(1001, 3),
    "an even number": drawn(500, 3),
    "grey": drawn(301, 1),
    "partly black": drawn(400, 3, dark=150),
    "all but one black": drawn(400, 3, dark=399),
    "one": drawn(1, 3),
    "black": torch.zeros(9, 3, dtype=torch.float64),
}


@pytest.fixture(scope="module")
def answers(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """What the page's functions give: stops by case, and curves of a ramp under "filmic" and "srgb"."""
    if shutil.which("node") is None:
        pytest.skip("no node")
    file: Path = tmp_path_factory.mktemp("tones") / "tones.js"
    given = {name: [radiance.reshape(-1).tolist(), radiance.shape[1]] for name, radiance in CASES.items()}
    ask = (
        f"const cases = {json.dumps(given)}, found = {{}};\n"
        "for (const [name, given] of Object.entries(cases)) found[name] = automaticStops(...given);\n"
        f"const ramp = {json.dumps(RAMP.tolist())};\n"
        "found.filmic = ramp.map((x) => toneOf(x, true)); found.srgb = ramp.map((x) => toneOf(x, false));\n"
        "console.log(JSON.stringify(found));"
    )
    file.write_text(f"{part('homofact.web', 'tones.js')}\n{ask}", encoding="utf-8")
    done = subprocess.run(["node", file], capture_output=True, text=True, check=True, timeout=60)
    return json.loads(done.stdout)


RAMP = torch.cat((torch.zeros(1), torch.logspace(-4, 1.5, 60))).double()


@pytest.mark.parametrize("name", CASES)
def test_the_page_s_exposure_is_the_pictures(name: str, answers: dict[str, Any]) -> None:
    expected = automatic_exposure(image(CASES[name]))
    assert 2 ** answers[name] == pytest.approx(expected, rel=1e-5)


def test_the_median_and_the_highlight_both_count() -> None:
    """Or the cases above could hold with either alone."""
    base = CASES["many"]
    first = automatic_exposure(image(base))
    brighter = base.clone()
    brighter[base.amax(1) > torch.quantile(base.amax(1), 0.9)] *= 8
    assert automatic_exposure(image(brighter)) < 0.8 * first
    darker = base.clone()
    darker[base.mean(1) <= base.mean(1).median()] *= 0.5
    assert automatic_exposure(image(darker)) > 1.2 * first


@pytest.mark.parametrize("curve", ["filmic", "srgb"])
def test_the_page_s_curves_are_the_pictures(curve: str, answers: dict[str, Any]) -> None:
    expected = displayed(image(RAMP[:, None].expand(-1, 3)), 1.0, curve=curve)[0, :, 0]
    torch.testing.assert_close(torch.tensor(answers[curve], dtype=torch.float64), expected, atol=1e-9, rtol=0)


def test_pages_begin_with_the_pictures_curve() -> None:
    """The viewer's page has no other."""
    for package in ("homofact.relighting.page", "homofact.editing.page"):
        names = {"homofact.relighting.page": "curve", "homofact.editing.page": "tones"}
        assert f'{names[package]}: "{DEFAULT_CURVE}"' in part(package, "page.js")
