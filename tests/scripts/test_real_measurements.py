"""The table of real measurements: shaders are read as they are written, figures are what they are called."""

import json
import math
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
import torch
from refusals import refused

from homofact.brdf.analytic.ggx import GgxBrdf, GgxLobe
from homofact.brdf.quality.tilt import ReciprocalMean
from homofact.brdf.samples import Samples
from homofact.geometry.directions import draw_uniform

Script = Callable[[str], ModuleType]
PLASTIC = GgxBrdf((0.3, 0.2, 0.1), (GgxLobe((0.5, 0.5, 0.5), 0.2, 0.1),))


class Scaled:
    """A reflectance times a factor per channel."""

    channels, isotropic, nbytes, fetches = ("R", "G", "B"), True, 0, 0

    def __init__(self, *factors: float) -> None:
        self.factors = torch.tensor(factors, dtype=torch.float64)

    def evaluate(self, wi: torch.Tensor, wo: torch.Tensor) -> torch.Tensor:
        return PLASTIC.evaluate(wi, wo) * self.factors


def shader() -> tuple[str, list[list[list[float]]], list[list[float]]]:
    """A shader as the hybrid's page has them, its weights [layer][input][output] and biases."""
    drawn = torch.Generator().manual_seed(0)
    sizes = ((10, 32), (32, 32), (32, 6))
    weights = [
        (torch.rand(size, generator=drawn, dtype=torch.float64) - 0.5).mul(1000).round().div(1000).tolist()
        for size in sizes
    ]
    biases = [
        (torch.rand(size[1], generator=drawn, dtype=torch.float64) - 0.5).mul(1000).round().div(1000).tolist()
        for size in sizes
    ]
    lines = ["analytic", "::begin parameters", "bool show_ggx 0"]
    numbers = {"diffuse_r": 0.1, "diffuse_g": 0.2, "diffuse_b": 0.3, "eta_r": 1.5, "eta_g": 1.7, "eta_b": 2.5,
               "alpha_x": 0.2, "alpha_y": 0.3,
               "latent_0": 0.5, "latent_1": -0.25, "latent_2": 1.5, "latent_3": -1.0}  # fmt: skip
    lines += [f"float {name} 0.0 1.0 {value}" for name, value in numbers.items()]
    lines += ["::end parameters", "vec4 relu(vec4 x)   { return max(x, vec4(0.0, 0.0, 0.0, 0.0)); }"]

    def parts(count: int) -> list[range]:
        return [range(first, min(first + 4, count)) for first in range(0, count, 4)]

    for layer, (weight, bias) in enumerate(zip(weights, biases, strict=True)):
        for j, rows in enumerate(parts(len(bias))):
            total = []
            for k, columns in enumerate(parts(len(weight))):
                square = len(rows) == len(columns)
                kind = f"mat{len(columns)}" + ("" if square else f"x{len(rows)}")
                values = ",".join(f"{weight[column][row]: .3f}" for column in columns for row in rows)
                total.append(f"{kind}({values}) * f{layer}_{k}")
            own = f"vec{len(rows)}({','.join(f'{bias[row]: .3f}' for row in rows)})"
            whole = f"{' + '.join(total)} + {own}"
            name = f"f{layer + 1}_{j}"
            lines.append(f"\tvec4 {name} = hardGeLU({whole});" if layer < 2 else f"\t{name} = {whole};")
    lines.append("\tvec4 f0_0 = vec4(wi.r, wi.g, wi.b, wo.r);")
    return "\n".join(lines), weights, biases


def by_hand(wi: list[float], wo: list[float], weights: Any, biases: Any) -> list[float]:
    """The shader's value, number by number."""
    x = [*wi, *wo, 0.5, -0.25, 1.5, -1.0]
    for layer in range(3):
        x = [
            biases[layer][j] + sum(x[k] * weights[layer][k][j] for k in range(len(x)))
            for j in range(len(biases[layer]))
        ]
        if layer < 2:
            x = [0.0 if v < -1.5 else v if v > 1.5 else v * (v + 1.5) / 3 for v in x]
    s = [a + b for a, b in zip(wi, wo, strict=True)]
    size = math.sqrt(sum(v * v for v in s))
    h, c = [v / size for v in s], size / 2
    d = 1 / (math.pi * 0.2 * 0.3 * ((h[0] / 0.2) ** 2 + (h[1] / 0.3) ** 2 + h[2] ** 2) ** 2)
    g1 = [2 / (1 + math.sqrt(1 + ((w[0] * 0.2) ** 2 + (w[1] * 0.3) ** 2) / w[2] ** 2)) for w in (wi, wo)]
    found = []
    for k, (eta, kd) in enumerate(zip((1.5, 1.7, 2.5), (0.1, 0.2, 0.3), strict=True)):
        g = math.sqrt(eta**2 + c * c - 1)
        fresnel = 0.5 * (g - c) ** 2 / (g + c) ** 2 * (1 + (c * (g + c) - 1) ** 2 / (c * (g - c) + 1) ** 2)
        base = kd / math.pi + fresnel * d * g1[0] * g1[1] / (4 * wi[2] * wo[2])
        found.append(math.exp(x[k]) + base / (1 + math.exp(-x[3 + k])))
    return found


def test_a_published_shader_is_read_as_it_is_written(script: Script, tmp_path: Path) -> None:
    module = script("data.hybrid_fits")
    text, weights, biases = shader()
    place = module.hybrid_file(tmp_path, "some")
    place.write_text(text)
    model = module.read_hybrid(place)
    wi, wo = draw_uniform(20, torch.Generator().manual_seed(3))
    found = model.evaluate(wi, wo)
    for k in range(20):
        assert found[k].tolist() == pytest.approx(by_hand(wi[k].tolist(), wo[k].tolist(), weights, biases), rel=1e-9)
    assert not model.isotropic
    assert (model.nbytes, model.shared_nbytes) == (6472, 6424)
    assert not model.evaluate(wi, -wo).any()


def test_a_shader_of_another_kind_is_refused(script: Script, tmp_path: Path) -> None:
    module, (text, _, _) = script("data.hybrid_fits"), shader()
    place = tmp_path / "x.brdf"
    for broken in ("", text.replace("float eta_g", "float tea_g"), text.split("\tvec4 f2_0")[0],
                   text.replace("float alpha_x 0.0 1.0 0.2", "float alpha_x 0.0 1.0 wide"),
                   "\n".join(line for line in text.splitlines() if "f2_3 =" not in line)):  # fmt: skip
        place.write_text(broken)
        with refused(where="x.brdf"):
            module.read_hybrid(place)
    with refused(where="absent.brdf"):
        module.read_hybrid(tmp_path / "absent.brdf")


def test_figures_of_equals_and_of_a_fit_that_is_too_dark(script: Script, tmp_path: Path, monkeypatch: Any) -> None:
    module = script("compression.real_judging")
    monkeypatch.setattr(module, "pictures", lambda *_: {})
    asked = module.Asked.of(PLASTIC, tmp_path)
    same = asked.numbers(PLASTIC)
    assert (same["MALE"], same["RMS"], same["energy"], same["highlight"]) == (0, 0, 1, 1)
    assert same["albedo"] == pytest.approx(1)
    dark = asked.numbers(Scaled(0.9, 1.0, 0.7))
    assert dark["energy"] == pytest.approx(0.7)
    assert dark["albedo"] == pytest.approx(0.7)
    assert dark["albedo at"].endswith(", B")
    assert dark["MALE"] > 0
    # As a factor: 0.7 is farther from 1 than 1.3.
    assert asked.numbers(Scaled(1.3, 1.0, 0.7))["energy"] == pytest.approx(0.7)


def test_albedos_are_those_of_a_diffuse_material(script: Script) -> None:
    found = script("compression.real_judging").albedos(GgxBrdf((0.3, 0.2, 0.1), ()))
    assert found.shape == (9, 3)
    assert found == pytest.approx(torch.tensor([0.3, 0.2, 0.1]).double().expand(9, 3), rel=2e-3)


def test_samples_are_judged_by_what_the_light_leaves(script: Script) -> None:
    wi, wo = draw_uniform(500, torch.Generator().manual_seed(1))
    test = Samples(wi, wo, PLASTIC.evaluate(wi, wo))
    judged = script("compression.real_judging").judged_at
    assert judged(test, PLASTIC) == {"MALE": 0, "RMS": 0}
    assert judged(test, Scaled(1.1, 1.1, 1.1))["RMS"] == pytest.approx(0.1)


def rows(script: Script, values: dict[tuple[str, str, str], dict[str, float]]) -> Any:
    tables = script("compression.real_tables")
    cost = {"bytes": 3000, "operations": 1, "scalar operations": 1, "fetches": 1, "seconds": 1.0}
    return tables.Table(
        tables.Row(name, "RGL", way, label, {"cost": cost, "own": own, "raw": {"MALE": own["MALE"] * 3}})
        for (name, way, label), own in values.items()
    )


def test_ratios_are_material_by_material_and_fall_back_on_the_raw_file(script: Script) -> None:
    fits, tables = script("compression.real_fits"), script("compression.real_tables")
    ours = fits.OURS[1]
    table = rows(
        script,
        {
            ("a", fits.RAW, fits.NBRDF): {"MALE": 4.0},
            ("b", fits.RAW, fits.NBRDF): {"MALE": 2.0},
            ("a", fits.RAW, ours): {"MALE": 3.0},
            ("b", fits.RAW, ours): {"MALE": 3.0},
            ("a", fits.STRAIGHT, ours): {"MALE": 1.0},
        },
    )
    names = table.materials("RGL")
    assert tables.ratios(table, names, ours, fits.RAW) == [0.75, 1.5]
    # No tilt was undone for b.
    assert tables.ratios(table, names, ours, fits.STRAIGHT) == [0.25, 1.5]
    assert tables.ratios(table, names, ours, fits.STRAIGHT, "raw") == [0.75, 1.5]
    assert tables.lower([0.25, 1.5]) == "0.88, lower on 1 of 2"
    last = tables.equal_bytes(table, names, fits.RAW).splitlines()[-1]
    assert last == "| **median** | 3 | 3 | 1.12, lower on 1 of 2 |"
    # What was published is no fit of the straightened measurement.
    assert table.labels(names, fits.STRAIGHT) == [ours]


def test_what_has_no_figures_is_said_with_its_reason(script: Script) -> None:
    fits, tables = script("compression.real_fits"), script("compression.real_tables")
    skipped = [
        tables.Row(name, group, fits.RAW, label, {"skipped": why})
        for name, group, label, why in (
            ("a", "RGL", fits.HYBRID, "its shaders are not at hand"),
            ("b", "RGL", fits.HYBRID, "its shaders are not at hand"),
            ("c", "tape", fits.NBRDF, fits.NONE_PUBLISHED),
        )
    ]
    lines = tables.missing(tables.Table(skipped))
    assert lines[0] == "- hybrid, published, a, b: its shaders are not at hand."
    assert lines[1].endswith("not fitted yet.")
    assert all(label in lines[1] for label in fits.METHODS)
    assert fits.NBRDF not in lines[1]


def test_targets_count_what_was_asked(script: Script) -> None:
    fits, tables = script("compression.real_fits"), script("compression.real_tables")
    own = {
        "MALE": 1.0,
        "RMS": 0.12,
        "floor": 0.1,
        "albedo": 0.96,
        "energy": 1.02,
        "PSNR, St Peter's": 41.0,
        "PSNR, Grace": 39.0,
    }
    table = rows(
        script, {(name, fits.RAW, fits.OURS[0]): own | {"albedo": albedo} for name, albedo in (("a", 0.96), ("b", 1.3))}
    )
    lines = {
        line.split("|")[1].strip(): line.split("|")[2].strip()
        for line in tables.targets(table, ["a", "b"]).splitlines()
    }
    assert lines["RMS within 1.25 of its floor"] == "2 of 2"
    assert lines["worst albedo within 5% (median), 10% (worst)"] == "17.0% (30.0%)"
    assert lines["energy within 1%"] == "0 of 2"
    assert lines["PSNR under St Peter's ≥ 40 dB"] == "2 of 2"
    assert lines["PSNR under Grace ≥ 40 dB"] == "0 of 2"


def test_names_are_listed_with_commas_that_no_space_follows(script: Script) -> None:
    listed = script("shared.harness").listed
    assert listed(None, ["a, b", "c"], "methods") == ["a, b", "c"]
    assert listed("c,a, b", ["a, b", "c"], "methods") == ["c", "a, b"]
    with refused(where="methods", found="'d'"):
        listed("c,d", ["a, b", "c"], "methods")


@pytest.mark.slow
def test_a_run_goes_on_where_it_was_stopped(
    script: Script, real_data: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: Any
) -> None:
    module = script("compression.real_measurements")
    done = tmp_path / "done.jsonl"
    asked = ["--short", "--data", str(real_data), "--done", str(done), "--materials", "garnet_red"]
    asked += ["--methods", "NBRDF, published,GGX × 1"]
    assert module.main(asked) == 0
    text, kept = capsys.readouterr().out, done.read_text(encoding="utf-8")
    found = dict(json.loads(line) for line in kept.splitlines())
    assert {"own", "cost"} == set(found["garnet_red | left-out rings | GGX × 1"])
    assert found["garnet_red | left-out samples | NBRDF, published"] == {"skipped": "none was published"}
    monkeypatch.setattr(module, "fitted_here", None)
    assert module.main(asked) == 0
    assert capsys.readouterr().out == text
    assert done.read_text(encoding="utf-8") == kept


@pytest.mark.slow
def test_the_published_network_is_judged_against_the_raw_file(script: Script, real_data: Path, tmp_path: Path) -> None:
    done, chart = tmp_path / "done.jsonl", tmp_path / "chart.png"
    asked = ["--short", "--data", str(real_data), "--done", str(done), "--methods", "NBRDF, published"]
    assert script("compression.real_measurements").main([*asked, "--plot", str(chart)]) == 0
    found = dict(json.loads(line) for line in done.read_text(encoding="utf-8").splitlines())
    assert not any("straightened" in key for key in found)
    published = found["vch_golden_yellow | raw | NBRDF, published"]
    # Of 20,000 pairs and published weights: nothing of it hangs on this project's fits.
    assert published["own"]["MALE"] == pytest.approx(0.00314, abs=2e-5)
    assert published["cost"]["bytes"] == 2700
    assert chart.stat().st_size > 5000


def test_without_data_and_with_unknown_methods_it_says_so(
    script: Script, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    main = script("compression.real_measurements").main
    assert main(["--data", str(tmp_path)]) == 2
    assert str(tmp_path) in capsys.readouterr().err
    (tmp_path / "mdl").mkdir()
    (tmp_path / "mdl" / "carpaint_red.mbsdf").touch()
    assert main(["--data", str(tmp_path), "--methods", "magic"]) == 2
    assert "magic" in capsys.readouterr().err


def test_the_reciprocal_mean_is_off_by_the_floor(script: Script, tmp_path: Path, monkeypatch: Any) -> None:
    class Leaning(Scaled):
        def evaluate(self, wi: torch.Tensor, wo: torch.Tensor) -> torch.Tensor:
            return super().evaluate(wi, wo) * (1 + 0.3 * (wi[:, 2:] - wo[:, 2:]))

    module = script("compression.real_judging")
    monkeypatch.setattr(module, "pictures", lambda *_: {})
    own = Leaning(1.0, 1.0, 1.0)
    mean = ReciprocalMean(own)
    wi, wo = draw_uniform(50, torch.Generator().manual_seed(2))
    assert mean.evaluate(wi, wo) == pytest.approx(mean.evaluate(wo, wi))
    found = module.Asked.of(own, tmp_path).numbers(mean)
    assert found["RMS"] == pytest.approx(found["floor"], rel=1e-9)
    assert found["MALE"] > 0.001
    assert ReciprocalMean(PLASTIC).evaluate(wi, wo) == pytest.approx(PLASTIC.evaluate(wi, wo), rel=1e-9)
