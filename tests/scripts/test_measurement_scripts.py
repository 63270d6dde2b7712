"""The programs behind the figures of measurements and of equal bytes, in their short forms."""

import math
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import ModuleType

import pytest
import torch

from homofact.brdf.analytic import Lambert
from homofact.brdf.quality.extrapolation import Extrapolation
from homofact.brdf.samples import Samples
from homofact.brdf.source import open_source
from homofact.brdf.table import ring_weights
from homofact.geometry.directions import draw_uniform, from_spherical
from homofact.rendering.environment import read_environment

ROOT = Path(__file__).resolve().parents[2]
SYNTHETIC = ROOT / "data_synthetic" / "synthetic_cornell.brdf"


@pytest.mark.slow
def test_rings_are_left_out_whole(script: Callable[[str], ModuleType], tmp_path: Path) -> None:
    module = script("accuracy.left_out_rings")
    samples = open_source(str(SYNTHETIC)).samples
    rings = list(module.left_out(samples))
    # θi 10, 30, 50, 70°: two of them are inner ones.
    assert [round(ring.degrees) for ring in rings if ring.direction == "θi"] == [30, 50]
    for ring in rings:
        assert len(ring.train) + len(ring.test) == len(samples)
        own, rest = ((part.wi if ring.direction == "θi" else part.wo)[:, 2] for part in (ring.test, ring.train))
        assert float((own[:, None] - rest).abs().min()) > 1e-4
    assert module.relative_rms(1.1 * samples.values, samples) == pytest.approx(0.1)
    rows = module.compared(SYNTHETIC, 4, 5.0, 1)
    lines = module.summary("paint", rows)
    assert [line[1] for line in lines] == ["Cole error", "relative RMS"]
    both = rows[0][1]
    # McCool's centred grid has one texel less.
    assert both["search"].nbytes == 2 * 16 * 3 * 4
    assert both["McCool"].nbytes in (2 * 16 * 3 * 4, 2 * 15 * 3 * 4)
    assert lines[0][-1] == ("1 of 1" if both["search"].cole <= both["McCool"].cole else "0 of 1")
    assert module.main(["--short", "--data", str(tmp_path)]) == 0


def test_neighbours_are_nearest_whatever_the_azimuth(script: Callable[[str], ModuleType]) -> None:
    module = script("accuracy.beyond_the_measurement")
    samples = open_source(str(SYNTHETIC)).samples
    moved = samples.rotated_at_random(3)
    own = module.closeness(moved.wo, moved.wi, samples)
    # A sample, turned, mirrored and exchanged, is its own neighbour, at no distance.
    assert torch.allclose(own.diagonal(), torch.full((len(samples),), 2.0, dtype=torch.float64))
    assert float(own.max()) < 2 + 1e-12
    neighbours = module.largest_neighbours(moved.wi, moved.wo, samples)
    assert bool((neighbours >= samples.values).all())
    assert bool((neighbours < samples.values.amax(0)).any())
    wi, wo = module.pairs_outside(samples, 100)
    assert len(wi) == 100
    assert bool(Extrapolation(samples).outside(wi, wo).all())


def test_what_a_fit_does_beyond_the_measurement_is_told(
    script: Callable[[str], ModuleType], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    module, out = script("accuracy.beyond_the_measurement"), tmp_path / "beyond.md"
    assert module.main(["--short", "--data", str(tmp_path), "--out", str(out)]) == 0
    assert capsys.readouterr().err.count("skipped") == 4
    rows = re.findall(r"^\|(.*)\|$", out.read_text(encoding="utf-8"), re.MULTILINE)
    cells = [cell.strip() for cell in rows[-1].split("|")]
    assert cells[:2] == ["synthetic_cornell", "1 × 4²"]
    middle, most, largest = (float(cell) for cell in cells[2:5])
    assert 0 < middle <= most <= largest


def bins(step: float) -> Samples:
    """All bins of a table up to 66 and 80°, of a Lambert surface, weighted by their solid angles."""
    theta = (torch.arange(round(90 / step), dtype=torch.float64) + 0.5) * math.radians(step)
    phi = (torch.arange(18, dtype=torch.float64) + 0.5) * (math.pi / 18)
    rows, columns = round(66 / step), round(80 / step)
    angles = [each.reshape(-1) for each in torch.meshgrid(theta[:rows], theta[:columns], phi, indexing="ij")]
    weights = ring_weights(theta)[:rows, None, None] * ring_weights(theta)[:columns, None].expand(rows, columns, 18)
    wi, wo = from_spherical(angles[0], torch.zeros_like(angles[0])), from_spherical(angles[1], angles[2])
    weights = weights.reshape(-1)
    values = torch.full((len(wi), 1), 0.5 / math.pi)
    return Samples(
        wi, wo, values, channels=("Y",), isotropic=True, weights=weights / weights.mean(),
    )  # fmt: skip


def test_the_albedo_of_bins_is_that_of_what_they_measure(script: Callable[[str], ModuleType], tmp_path: Path) -> None:
    module = script("accuracy.car_paint_albedo")
    samples = bins(2.0)
    raw = samples.values.clone()
    raw[samples.wi[:, 2] < math.cos(math.radians(40))] *= 0.9
    rings = module.rings_of(samples, raw, Lambert((0.4,), channels=("Y",)))
    # Up to 80° a Lambert surface sends sin² 80° of its light.
    expected = math.sin(math.radians(80)) ** 2
    assert rings.read[:, 0].tolist() == pytest.approx([0.5 * expected] * len(rings.degrees), rel=2e-3)
    assert rings.fit[:, 0].tolist() == pytest.approx([0.4 * expected] * len(rings.degrees), rel=2e-3)
    text, worst = module.table(rings, ("Y",))
    assert worst == pytest.approx(0.2)
    assert [line.split("|")[-2].strip() for line in text.splitlines()[2:]] == ["clean"] * 3 + ["noise"] * 2
    assert float(module.ring_noise(rings.read)) < 1e-3
    assert module.main(["--short", "--data", str(tmp_path)]) == 0


@pytest.mark.slow
def test_more_is_held_against_the_best_with_fewer(script: Callable[[str], ModuleType], tmp_path: Path) -> None:
    module = script("accuracy.more_is_never_worse")
    one = module.Fitted(1, 1, 16, 1.0, 0.2, 1.0)
    fits = [one, replace(one, textures=2, taken=2, cole=0.5), replace(one, textures=3, taken=2, cole=0.6, rms=0.1)]
    assert module.against_fewer(fits) == [(1.0, 1.0), (0.5, 1.0), (pytest.approx(1.2), pytest.approx(0.5))]
    lines, violations = module.rows_of("paint", "textures", fits)
    assert lines[2][2] == "3 (2 taken)"
    assert violations == ["paint, 3 × 16²: Cole error 1.20 times the best with fewer"]
    out = tmp_path / "more.md"
    assert module.main(["--short", "--out", str(out)]) == 0
    assert out.read_text(encoding="utf-8").count("| lafortune-blue-paint |") == 4


@pytest.mark.slow
def test_a_sum_of_products_is_one_reflectance(script: Callable[[str], ModuleType], tmp_path: Path) -> None:
    module = script("accuracy.sums_of_products")
    parts = Lambert((0.2,), channels=("Y",)), Lambert((0.3,), channels=("Y",))
    wi, wo = draw_uniform(10, torch.Generator().manual_seed(0))
    both = module.Sum(tuple(part.evaluate for part in parts), ("Y",))
    assert torch.allclose(both.evaluate(wi, wo), torch.full((10, 1), 0.5 / math.pi, dtype=torch.float64))
    one, two = module.Figures(0.2, 0.01, 40.0), module.Figures(0.1, 0.02, 45.0)
    assert one.best(two) == module.Figures(0.1, 0.01, 45.0)
    out = tmp_path / "sums.md"
    assert module.main(["--short", "--out", str(out)]) == 0
    assert "| lafortune-blue-paint |" in out.read_text(encoding="utf-8")


def test_seconds_are_of_commands_that_succeed(script: Callable[[str], ModuleType], tmp_path: Path) -> None:
    module = script("speed.render_seconds")
    assert module.seconds_of(["--version"]) > 0
    with pytest.raises(RuntimeError, match=r"render nothing: exit 2"):
        module.seconds_of(["render", "nothing"])
    assert float(read_environment(module.sky_file(tmp_path)).radiance.max()) == 500
