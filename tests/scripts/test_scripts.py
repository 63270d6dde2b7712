"""The programs of figures, in their short forms: what they print and write holds together."""

import argparse
import csv
import math
import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from PIL import Image

from homofact.brdf.source import open_source
from homofact.evaluation.compare import fit_and_measure
from homofact.methods.cole import Cole

ROOT = Path(__file__).resolve().parents[2]
SYNTHETIC = ROOT / "data_synthetic" / "synthetic_cornell.brdf"
PAINT, PLASTIC = "lafortune-blue-paint", "cook-torrance-plastic"

pytestmark = pytest.mark.usefixtures("one_thread")


def table(text: str, first: str) -> list[dict[str, str]]:
    """The rows of the Markdown table whose header begins with `first`."""
    lines = text.splitlines()
    begin = next(n for n, line in enumerate(lines) if line.startswith(f"| {first} |"))

    def cells(line: str) -> list[str]:
        return [cell.strip() for cell in line.strip("|").split("|")]

    rows = []
    for line in lines[begin + 2 :]:
        if not line.startswith("|"):
            break
        rows.append(dict(zip(cells(lines[begin]), cells(line), strict=True)))
    return rows


@pytest.mark.slow
def test_a_ladder_gives_the_fits_of_fewer_textures(script: Callable[[str], ModuleType]) -> None:
    source = open_source(f"material:{PAINT}", count=900)
    settings = Cole(textures=3, size=6, restarts=2, search_size=4, search_samples=200, seed=3)
    rows = script("accuracy.ladder").ladder(source, settings)
    assert [len(row.factorization.terms) for row in rows] == [1, 2, 3]
    for count, row in enumerate(rows, 1):
        single = fit_and_measure(source, Cole(**{**vars(settings), "textures": count}))
        for mine, theirs in zip(row.factorization.terms, single.factorization.terms, strict=True):
            assert np.array_equal(mine.projection.matrix, theirs.projection.matrix)
            assert np.array_equal(mine.texture, theirs.texture)
        assert row.train == single.train
        assert row.held_out == single.held_out
        assert row.report.evaluations == single.report.evaluations
        assert row.settings.textures == count
        assert row.settings.epsilon == 1e-5


@pytest.mark.slow
def test_the_comparison_writes_what_it_measured(
    script: Callable[[str], ModuleType], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out, none = tmp_path / "out", tmp_path / "none"
    page, plot = tmp_path / "docs" / "page.md", tmp_path / "docs" / "plot.png"
    arguments = [
        str(SYNTHETIC),
        "--short",
        "--out",
        str(out),
        "--data",
        str(none),
        "--page",
        str(page),
        "--plot",
        str(plot),
    ]
    assert script("accuracy.compare_with_mccool").main(arguments) == 0
    printed = capsys.readouterr()
    for paint in ("garnet_red", "krylon_blue", "cayman"):
        assert f"skipped {paint}: no {none / 'cornell' / paint}.brdf" in printed.err
    with open(out / "errors.csv", encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 3 * (2 + 4 * 2)
    keys = {(row["source"], row["coordinates"], row["grid"], row["reciprocal"], row["textures"]) for row in rows}
    assert len(keys) == len(rows)
    error: dict[tuple[str, str], list[float]] = {}
    for row in rows:
        for part in ("train", "held_out"):
            six = [float(row[f"{part}_{name}"]) for name in ("log_mse", "log_mae", "log_max", "mse", "mae", "max")]
            assert all(0 < value < math.inf for value in six)
            assert six[1] ** 2 <= six[0] <= six[2] ** 2
            assert six[4] ** 2 <= six[3] <= six[5] ** 2
        own = 3 if row["method"] == "mccool" else int(row["textures"]) * (1 + int(row["reciprocal"]))
        assert int(row["fetches"]) == own
        texels = 6 * 6 if row["grid"] == "plain" else 7 * 5
        assert int(row["bytes"]) == int(row["textures"]) * texels * 3 * 4
        assert row["epsilon"] == ("0.01" if row["source"] == SYNTHETIC.name else "1e-05")
        assert row["sampling"].startswith(
            "284 measured" if row["source"] == SYNTHETIC.name else "1500 pairs (scheme discs"
        )
        assert "torch" in row["machine"]
        error.setdefault((row["source"], row["method"] + row["textures"] + row["grid"]), []).append(
            float(row["train_log_mse"])
        )
    # The page has the Cole errors by number of textures, training / held out.
    lines = table(page.read_text(encoding="utf-8"), "source")
    for row in (row for row in rows if row["method"] == "cole" and row["coordinates"] == "in-out"):
        way = "reciprocal" if row["reciprocal"] == "1" else "free"
        line = next(x for x in lines if (x["source"], x["projections"]) == (row["source"], f"in-out, {way}"))
        pair = line[f"{row['textures']} texture{'s' * (row['textures'] != '1')}"]
        for text, part in zip(pair.split(" / "), ("train", "held_out"), strict=True):
            assert float(text) == pytest.approx(float(row[f"{part}_log_mse"]), rel=0.01)
    assert plot.read_bytes()[:4] == b"\x89PNG"
    written = (out / "errors.md").read_text(encoding="utf-8")
    assert written in printed.out
    assert "seed 0" in written
    for grid, part in zip(("plain", "centred"), written.split("## Statements of the thesis")[1:], strict=True):
        verdicts = table(part, "statement (Cole 2002, 4.4)")
        ratio = min(error[PAINT, "cole2plain"]) / error[PAINT, f"mccool2{grid}"][0]
        assert verdicts[0]["training"] == f"cut by {1 - ratio:.0%}"
        plastic = min(error[PLASTIC, "cole2plain"]) / error[PLASTIC, f"mccool2{grid}"][0]
        assert verdicts[2]["training"] == f"{plastic:.2f} of McCool's at two textures"
        assert verdicts[1]["training"].startswith("no figures")
    with Image.open(out / "errors.png") as image:
        pixels = np.asarray(image.convert("L"))
    assert min(pixels.shape) > 600
    assert pixels.min() < 50
    assert sorted(path.name for path in out.iterdir()) == ["errors.csv", "errors.md", "errors.png"]


def thesis_table(module: ModuleType) -> dict[Any, float]:
    """Errors as the thesis's words would have them."""
    at = {
        PAINT: (0.1, {"in-out": (0.05, 0.016, 0.012, 0.01, 0.007), "half-diff": (0.06, 0.04, 0.03, 0.02, 0.015)}, 1.1),
        PLASTIC: (0.1, {"in-out": (0.4, 0.3, 0.2, 0.2, 0.15), "half-diff": (0.2, 0.1, 0.08, 0.07, 0.06)}, 1.1),
        "garnet_red.brdf": (0.3, {"in-out": (0.8, 0.5, 0.4, 0.3, 0.28), "half-diff": (0.5, 0.25, 0.2, 0.2, 0.2)}, 0.9),
        "cayman.brdf": (0.1, {"in-out": (0.3, 0.2, 0.2, 0.1, 0.1), "half-diff": (0.2, 0.09, 0.08, 0.08, 0.07)}, 1.1),
    }
    errors: dict[Any, float] = {}
    for source, (mccool, variants, free) in at.items():
        errors[module.Key(source, module.MCCOOL, True, 2)] = mccool
        for name, values in variants.items():
            for count, value in enumerate(values, 1):
                errors[module.Key(source, name, True, count)] = value
                errors[module.Key(source, name, False, count)] = value * free
    return errors


def test_the_statements_are_judged_by_the_numbers(script: Callable[[str], ModuleType]) -> None:
    module = script("accuracy.thesis_statements")
    errors = thesis_table(module)
    verdicts = module.judge(errors)
    assert len(verdicts) == 12
    assert {verdict.verdict for verdict in verdicts} == {module.AGREES}
    assert verdicts[0].found == "cut by 84%"
    assert verdicts[5].found == "in-out / half-diff 0.47 at five textures, 0.40 at two"

    def differing(change: Callable[[Any, float], float]) -> list[int]:
        found = module.judge({key: change(key, value) for key, value in errors.items()})
        return [n for n, verdict in enumerate(found) if verdict.verdict == module.DIFFERS]

    assert differing(lambda k, v: v / 2 if k.coordinates == module.MCCOOL and k.source == PAINT else v) == [0]
    assert differing(lambda k, v: 0.009 if k.source == PAINT and k.textures == 5 else v) == [1, 5]
    assert differing(
        lambda k, v: v * 0.8 if k.source == PLASTIC and k.textures == 2 and "-" in k.coordinates else v
    ) == [2]
    assert differing(
        lambda k, v: v * 2 if k.source == "cayman.brdf" and k.textures == 2 and "-" in k.coordinates else v
    ) == [4]
    assert differing(lambda k, v: v * 9 if k.source == PLASTIC and k.coordinates == "half-diff" else v) == [
        2,
        3,
        6,
    ]
    assert differing(lambda k, v: v * 0.5 if k.source == PLASTIC and k.textures == 5 and not k.reciprocal else v) == [8]
    assert differing(
        lambda k, v: v * 2 if k.source.startswith("g") and k.textures == 5 and not k.reciprocal else v
    ) == [9]
    assert differing(
        lambda k, v: v * 0.5 if k.source.startswith("c") and k.textures == 5 and not k.reciprocal else v
    ) == [8, 10]
    assert [verdict.verdict for verdict in module.judge({})] == [module.NOT_TESTED] * 12


@pytest.mark.slow
def test_the_paint_figures_are_quotients_of_what_is_shown(
    script: Callable[[str], ModuleType], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "blue.md"
    assert script("accuracy.blue_paint_numbers").main(["--short", "--seeds", "0", "4", "--out", str(out)]) == 0
    text = out.read_text(encoding="utf-8")
    assert text in capsys.readouterr().out
    assert "ε = 1e-05" in text
    assert "1500 pairs uniform in the parabolic discs, r² < 0.98" in text
    assert "numba" in text
    mccool = {row["McCool, draw of seed"]: row for row in table(text, "McCool, draw of seed")}
    assert list(mccool) == ["0", "1", "2", "4"]
    assert all(row["training"] != row["second draw"] for row in mccool.values())
    searched = table(text, "two searched textures")
    assert [(row["two searched textures"], row["seed"]) for row in searched] == [
        ("in-out", "0"), ("in-out", "4"), ("half-diff", "0"), ("half-diff", "4"),
    ]  # fmt: skip
    for row in searched:
        for part, ratio in (("training", "/ McCool, training"), ("second draw", "/ McCool, second")):
            expected = float(row[part]) / float(mccool[row["seed"]][part])
            assert float(row[ratio]) == pytest.approx(expected, rel=0.02)
    verdicts = {row["figure"]: row for row in table(text, "figure")}
    worst = max(float(row["/ McCool, training"]) for row in searched if row["two searched textures"] == "half-diff")
    verdict = verdicts["half-diff / McCool, training"]["verdict"]
    assert verdict == f"worst {worst:.3g}: {'held' if worst <= 0.35 else 'NOT held'}"
    mean = sum(float(row["training"]) for row in mccool.values()) / 4
    assert float(verdicts["McCool, training"]["verdict"].split("%")[0]) == pytest.approx(
        100 * (mean / 0.069 - 1), abs=0.3
    )


@pytest.mark.slow
def test_the_paints_are_measured_beside_the_published_textures(
    script: Callable[[str], ModuleType], real_data: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert script("accuracy.cornell_numbers").main(["--short", "--data", str(real_data)]) == 0
    text = capsys.readouterr().out
    assert "ε = 0.01; split by seeds [0]" in text
    assert "read as: linear texels, parabolic map" in text
    rows = table(text, "paint")
    assert [row["paint"] for row in rows] == ["garnet_red"] * 6 + ["krylon_blue"] * 6 + ["cayman"] * 6
    for paint in ("garnet_red", "krylon_blue", "cayman"):
        own = {row["method"]: row for row in rows if row["paint"] == paint}
        theirs = own.pop("McCool's own textures (8 bits)")
        assert theirs["held out"] == "–"
        assert 0.05 < float(theirs["held out, scale-free"]) < 1
        # 6² against 32² and 64²; but so few texels with one at the highlight are no worse than many in 8 bits.
        assert float(theirs["held out, scale-free"]) < 3 * float(own["McCool (ωi, h, ωo), 2 textures"]["held out"])
        for row in own.values():
            # A constant found on training samples gains little where the fit has its scale.
            assert float(row["held out, scale-free"]) == pytest.approx(float(row["held out"]), rel=0.1)


def test_without_the_paints_there_is_nothing_to_measure(
    script: Callable[[str], ModuleType], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert script("accuracy.cornell_numbers").main(["--short", "--data", str(tmp_path)]) == 0
    printed = capsys.readouterr()
    assert printed.err.count("skipped") == 3
    assert "nothing to measure" in printed.out


def test_one_evaluation_costs_what_it_costs(script: Callable[[str], ModuleType]) -> None:
    module = script("speed.cost_of_evaluation")
    for solver, status in (("cholesky", "direct"), ("lsmr", "converged")):
        job = argparse.Namespace(channels=3, samples=800, size=6, repeats=2, seed=0, solver=solver)
        found = module.evaluation(job)
        assert len(found["seconds"]) == 2
        assert min(found["seconds"]) > 0
        assert found["apart"] < 1e-6
        assert found["status"] == [status]
        assert found["peak"] > found["rise"] >= 0


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="only Linux keeps the peak of one process apart")
def test_the_peak_is_of_the_work_alone(
    script: Callable[[str], ModuleType], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    module = script("speed.cost_of_evaluation")
    monkeypatch.setattr(module, "FITS", (("mccool", ""),))
    ballast = np.ones(90_000_000)  # 687 MiB that a child process must not inherit
    assert module.main(["--short", "--solvers", "cholesky", "--channels", "1"]) == 0
    text = capsys.readouterr().out
    assert "1500 pairs" in text
    assert "load average" in text
    (evaluation,), (fit,) = table(text, "solver"), table(text, "fit")
    for row in (evaluation, fit):
        assert 100 < int(row["peak MiB"]) < ballast.nbytes / module.MIB
        assert int(row["rise MiB"]) < int(row["peak MiB"])
    assert evaluation["error apart from cholesky"] == "0.0e+00"
    assert float(fit["Cole error"]) == pytest.approx(0.0887, rel=0.02)  # as in blue_paint_numbers --short
