"""The programs of the export's figures, in their short forms: what they print holds together."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import torch
from mitsuba_cases import variant
from skies import LAMBERT, chain, gradient

from homofact.brdf.adaptive import tabulated
from homofact.brdf.formats import rgl
from homofact.brdf.log_transform import LogTransform
from homofact.brdf.materials import material
from homofact.brdf.neural import LAYERS, NeuralBrdf
from homofact.brdf.sampling import sample_model
from homofact.evaluation.metrics import measure
from homofact.geometry.directions import draw_uniform
from homofact.meshes.shapes import torus_knot
from homofact.rendering.prefilter import LevelTable, Prefiltered
from homofact.rendering.surface import RADIUS
from homofact.shading.compiled import compiled_program


def rows(text: str) -> list[list[str]]:
    """The cells of all table rows, headers and rules left out."""
    lines = [line.strip("| ").split(" | ") for line in text.splitlines() if line.startswith("|")]
    return [
        cells
        for number, cells in enumerate(lines)
        if not set(cells[0]) <= {"-"} and not (number + 1 < len(lines) and set(lines[number + 1][0]) <= {"-"})
    ]


def test_costs_of_shaders(script, capsys: pytest.CaptureFixture[str]) -> None:
    module = script("speed.cost_of_shading")
    assert module.main([]) == 0
    found = {
        cells[0]: [int(cell) for cell in cells[1:]] for cell_count, cells in enumerate(rows(capsys.readouterr().out))
    }
    for name, cells in found.items():
        assert sum(cells[:7]) == cells[7] <= cells[8], name
    assert found["SVD, 4 terms"][9] == 8
    assert found["2 × general in-out"][0] == 4 * 2  # a matrix of two rows a lookup
    dearest = found[module.DEAREST]
    assert dearest[9] == 3
    assert dearest[7] < module.ALLOWED
    assert dearest[10] == 2 * 16 * 16 * 8


@pytest.mark.slow
def test_the_noise_of_sampling(script, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    variant("llvm_ad_rgb")
    main = script("engines.sampling_noise").main
    assert main(["--short", "--data", str(tmp_path)]) == 2
    assert "no RGL files" in capsys.readouterr().err
    (tmp_path / "rgl").mkdir()
    rgl.write(tmp_path / "rgl" / "phong_rgb.bsdf", tabulated(material("phong-30").model, True, side=32, thetas=8))
    assert main(["--short", "--data", str(tmp_path), "--out", str(tmp_path / "s.md")]) == 0
    shown = capsys.readouterr().out
    assert (tmp_path / "s.md").read_text(encoding="utf-8") == shown
    cosine, ggx, ours, measured, _, picture = rows(shown)
    # The first cell is empty but in the first line.
    assert [cosine[1], ggx[0], ours[0], measured[0]] == ["cosine", "GGX × 1", "ours", "`measured`"]
    for angle in range(1, 5):
        assert float(ours[angle]) < float(ggx[angle]) < float(cosine[angle + 1])
    assert float(ours[5].rstrip("%")) < 0.5
    assert ours[6:8] == ["0", "0"]
    assert picture[0] == "phong"


@pytest.mark.slow
def test_whole_texels(script, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert (
        script("accuracy.quantization").main(["--short", "--data", str(tmp_path), "--out", str(tmp_path / "q.md")]) == 0
    )
    text = capsys.readouterr().out
    assert (tmp_path / "q.md").read_text(encoding="utf-8") == text
    fitted, rounded, solved = rows(text)
    assert [row[1] for row in (fitted, rounded, solved)] == ["as fitted", "each texel rounded", "solved for 8 bits"]
    for row in (rounded, solved):
        for value, ratio, base in zip(row[2:4], row[4:6], fitted[2:4], strict=True):
            assert float(ratio) == pytest.approx(float(value) / float(base), rel=0.01)
    assert "smoke test" in text


def network(seed: int) -> NeuralBrdf:
    generator = torch.Generator().manual_seed(seed)
    w0, w1, w2 = (torch.randn(shape, generator=generator, dtype=torch.float64) * 0.4 for shape in LAYERS)
    b0, b1, b2 = (torch.randn(shape[1], generator=generator, dtype=torch.float64) * 0.4 for shape in LAYERS)
    return NeuralBrdf((w0, w1, w2), (b0, b1, b2))


WIDTH = 5  # of a network that compiles in a second: a program has a statement a neuron


def narrow(full: NeuralBrdf) -> SimpleNamespace:
    """The layers of its first WIDTH neurons."""
    first, *rest = full.weights
    between, last = rest
    weights = (first[:, :WIDTH], between[:WIDTH, :WIDTH], last[:WIDTH])
    return SimpleNamespace(weights=weights, biases=(full.biases[0][:WIDTH], full.biases[1][:WIDTH], full.biases[2]))


@pytest.mark.slow
def test_the_compiled_network_is_the_network(script) -> None:
    """Of the network whose other neurons are of no weight."""
    wi, wo = draw_uniform(3000, torch.Generator().manual_seed(1))
    full = network(0)
    for part in (*full.weights[1:], *full.biases[:2]):
        part[WIDTH:] = 0
    fast = compiled_program(script("speed.network_program").network_program(narrow(full)), [])
    expected = full.evaluate(wi, wo)
    error = (fast.evaluate(wi, wo) - expected).abs() / expected.clamp_min(1e-2)
    assert float(error.median()) < 1e-6
    assert float(torch.quantile(error, 0.99)) < 1e-4


@pytest.mark.slow
def test_a_network_learns_either_loss(script) -> None:
    module = script("speed.network_program")
    samples = sample_model(material("lafortune-clay").model, 4000, "discs", 0)
    transform = LogTransform.of(samples, 1e-2)
    for loss in module.LOSSES:
        early, late = (measure(module.train(samples, transform, loss, n), samples, transform).log_mse for n in (1, 400))
        assert late < 0.1 * early


@pytest.mark.slow
def test_throughput_of_all_ways(
    script, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    module, program = script("speed.throughput"), script("speed.network_program").network_program
    monkeypatch.setattr(module, "network_program", lambda network: program(narrow(network)))
    assert module.main(["--short", "--data", str(tmp_path)]) == 0
    streams = capsys.readouterr()
    found = {cells[0]: cells[1:] for cells in rows(streams.out)}
    assert set(found) == {
        "textures, compiled", "textures, torch", "network, torch", "network alone, torch", "network, compiled",
        "source", "copy",
    }  # fmt: skip
    base = float(found["network, torch"][2])
    for cells in found.values():
        assert float(cells[4]) == pytest.approx(float(cells[2]) / base, rel=0.02)
    assert found["network, torch"][0] == "2700"
    assert "skipped vch_golden_yellow_rgb" in streams.err


def test_a_copy_moves_what_an_evaluation_must(script) -> None:
    wi, wo = (w.float().numpy() for w in draw_uniform(100, torch.Generator().manual_seed(1)))
    moved = script("speed.throughput").copy(wi, wo)()
    assert np.array_equal(moved.numpy(), wi + wo)


@pytest.mark.slow
def test_errors_of_the_split_sum(script, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    picture = tmp_path / "spheres.png"
    arguments = ["--short", "--data", str(tmp_path), "--picture", str(picture), "--out", str(tmp_path / "e.md")]
    assert script("engines.split_sum_errors").main(arguments) == 0
    streams = capsys.readouterr()
    assert (tmp_path / "e.md").read_text(encoding="utf-8") == streams.out
    assert "skipped aurora_white" in streams.err
    line, median = rows(streams.out)
    assert line[:2] == ["phong-30", "overcast"]
    assert len(line) == 4
    for number in line[2:]:
        assert 0 < float(number) < 0.1
    # Of one environment the median is its own error, rounded.
    assert [float(cell.split()[0]) for cell in median[1:]] == pytest.approx(
        [float(cell) for cell in line[2:]], abs=1e-3
    )
    assert picture.read_bytes().startswith(b"\x89PNG")


@pytest.mark.slow
def test_the_nearest_part_of_the_knot_is_seen(script) -> None:
    found = script("engines.knot").Knot.of(48)
    assert float((found.normals.norm(dim=1) - 1).abs().max()) < 1e-12
    # Many points of a fine mesh; the nearest one that falls into each pixel.
    mesh = torus_knot(1600, 160)
    front = mesh.normals[:, 2] > 0
    points, normals = mesh.positions[front], mesh.normals[front]
    column, row = ((points[:, k] * sign * RADIUS + 1) * 24 for k, sign in ((0, 1), (1, -1)))
    place = row.astype(int) * 48 + column.astype(int)
    order = np.lexsort((points[:, 2], place))
    last = np.append(place[order][1:] != place[order][:-1], True)
    nearest = dict(zip(place[order][last].tolist(), normals[order][last], strict=True))
    seen = set(found.pixels.tolist())
    # At the silhouette, points fall into pixels whose middle is beside the knot.
    assert len(seen - set(nearest)) < 0.01 * len(seen)
    assert len(set(nearest) - seen) < 0.3 * len(seen)
    both = [(k, pixel) for k, pixel in enumerate(found.pixels.tolist()) if pixel in nearest]
    angles = [float(found.normals[k].numpy() @ nearest[pixel]) for k, pixel in both]
    assert np.quantile(angles, 0.1) > 0.9


@pytest.mark.slow
def test_the_knot_reflects_what_its_normals_say(script) -> None:
    found = script("engines.knot").Knot.of(16)
    sky, slope = gradient(rows=256), torch.tensor((0.3, 0.4, -0.2), dtype=torch.float64)
    # E/π of 1 + slope · ω, in three channels.
    expected = 0.6 * (1 + found.normals @ slope * (2 / 3))[:, None] * torch.tensor((1.0, 2.0, 3.0))
    image = found.exact(LAMBERT, sky)
    assert int(image.coverage.sum()) == len(found.pixels)
    torch.testing.assert_close(image.radiance.reshape(-1, 3)[found.pixels], expected, rtol=0.01, atol=0)
    table = torch.zeros(4, 64, 4, dtype=torch.float64)
    table[2, :, :3] = 0.6
    read = found.by_split_sum(Prefiltered(LevelTable(table), chain("gradient")))
    torch.testing.assert_close(read.radiance.reshape(-1, 3)[found.pixels], expected, rtol=0.01, atol=0)
