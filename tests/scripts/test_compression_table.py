"""The comparison with published compressions: published formulas agree as their README says, scores are as named."""

import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import pytest
import torch

from homofact.brdf.analytic.ggx import GgxBrdf, GgxLobe
from homofact.brdf.factored import FactoredBrdf
from homofact.factor.search.gradient import Gradient
from homofact.factor.textures import LogSamples
from homofact.geometry.directions import draw_uniform
from homofact.geometry.interpret import interpret, value_of
from homofact.geometry.torch_functions import TORCH
from homofact.methods import search_fit
from homofact.methods.effort import FitBudget
from homofact.methods.known_mixes import known_mixes
from homofact.methods.materials import Materials, TrainingMaterial
from homofact.methods.models import Ggx as GgxMethod
from homofact.methods.structure_search import StructureSearch
from homofact.methods.trials import StructureSettings
from homofact.methods.validation import Partition, random_folds
from scripts.data.hybrid_fits import HybridBrdf

ROOT = Path(__file__).resolve().parents[2]
DATA = Path(os.environ.get("HOMOFACT_DATA", ROOT.parent / "shared" / "data"))
needs_data = pytest.mark.skipif(
    not (DATA / "merl_fits").is_dir(), reason="no published fits (HOMOFACT_DATA names the folder of measurements)"
)


@needs_data
def test_readings_agree_as_was_measured_of_them(script: Callable[[str], ModuleType]) -> None:
    """Median MALE of 10 of 100 materials; of all 100 the README has .0008, .0014 and .0015."""
    fits, table = script("data.published_fits"), script("compression.compression_protocol")
    wi, wo = (w[:4000] for w in table.pairs())
    found: dict[tuple[str, str], list[float]] = {}
    chosen = fits.names(DATA)
    assert len(chosen) == 100
    for name in chosen[::10]:
        light = {
            kind: torch.log1p(fits.published(kind, name, DATA).evaluate(wi, wo).double() * wi[:, 2:])
            for kind in fits.PUBLISHED
        }
        for a, b in (("nbrdf", "nps"), ("nbrdf", "npf"), ("npf", "nps"), ("abc", "nbrdf"), ("sgd", "nbrdf")):
            found.setdefault((a, b), []).append(float((light[a] - light[b]).abs().mean()))
    medians = [float(torch.tensor(values).median()) for values in found.values()]
    assert medians[:3] == pytest.approx([0.0008, 0.0014, 0.0015], rel=0.4)
    assert max(medians[3:]) < 0.006


def shown(module: ModuleType, scale: float, size: int = 24):
    wi, wo = module.pairs()
    values = scale * GgxBrdf((0.3, 0.3, 0.3), (GgxLobe((0.5, 0.5, 0.5), 0.2, 0.1),)).evaluate(wi, wo)
    ramp = torch.linspace(0.1, 1, size * size).reshape(1, size, size, 1).expand(3, -1, -1, 3).double()
    return module.Shown(values, scale * ramp, 32, 0, 0.0)


def test_scores_of_equals_and_of_a_darker_copy(script: Callable[[str], ModuleType]) -> None:
    module = script("compression.compression_protocol")
    coverage = torch.ones(24, 24, dtype=torch.float64)
    truth = shown(module, 1.0)
    same = module.scores(truth, truth, coverage)
    assert [same[name] for name in module.SCORES] == [0, 0, 0, 0, 0, pytest.approx(1), 100]
    darker = module.scores(truth, shown(module, 0.9), coverage)
    assert darker["energy"] == pytest.approx(0.1)
    wi, _ = module.pairs()
    cosine, values = wi[:, 2:], truth.values
    assert darker["MALE"] == pytest.approx(
        float((torch.log1p(values * cosine) - torch.log1p(0.9 * values * cosine)).mean()), rel=1e-9
    )
    assert 0 < darker["MAE"] <= darker["RMSE"]
    assert darker["SSIM"] < 1
    assert 15 < darker["PSNR"] < 60


def test_the_first_materials_are_spread_over_all(script: Callable[[str], ModuleType]) -> None:
    every = [str(k) for k in range(100)]
    found = script("compression.compression_table").spread(every)
    assert sorted(found, key=int) == every
    assert found[:20] == [str(k) for k in (*range(0, 100, 10), *range(5, 100, 10))]


def test_searches_that_ask_the_same_are_run_once(script: Callable[[str], ModuleType]) -> None:
    module = script("compression.compression_fits")
    wi, wo = draw_uniform(200, torch.Generator().manual_seed(0))
    samples = LogSamples(wi, wo, (wi[:, 2:] * wo[:, 2:]).log(), torch.ones(200, dtype=torch.float64))
    partitions = (Partition(random_folds(200, 4, 0), 1.0),)
    settings = StructureSettings(4, True, "disc", 1, Gradient(), None, 0)
    shared = module.SharedSearch()

    def found(
        data: LogSamples = samples, chosen: StructureSettings = settings, granted: float = 5.0
    ) -> tuple[Any, int]:
        with shared.during():
            search = search_fit.StructureSearch(
                Materials((TrainingMaterial(data, partitions),)), chosen, FitBudget(granted)
            )
            return search.run(1, (("theta_h-theta_d",),)), len(shared.known)

    first, count = found()
    assert count == 1
    assert shared.saved == 0
    again, count = found()
    assert again is first
    assert count == 1
    assert shared.saved > 0
    # The same as alone, and as another search of other data, settings or effort.
    alone = StructureSearch(Materials((TrainingMaterial(samples, partitions),)), settings, FitBudget(5.0)).run(
        1, (("theta_h-theta_d",),)
    )
    assert (alone.mix.kinds, alone.mix.error) == (first.mix.kinds, first.mix.error)
    assert found(replace(samples, wi=wo))[1] == 2
    assert found(replace(samples, logs=samples.logs + 1))[1] == 3
    assert found(chosen=replace(settings, seed=1))[1] == 4
    assert found(granted=6.0)[1] == 5
    assert found(chosen=replace(settings, known=known_mixes()))[1] == 6
    assert search_fit.StructureSearch is StructureSearch


def entries_of(module: ModuleType, values: dict[str, tuple[float, ...]], of: str = "npf") -> list[Any]:
    """Entries by nbrdf with MALE, energy and PSNR of each material; what is not published is fitted to `of`."""
    found = []
    for label, males in values.items():
        readings = (label,) if label in module.PUBLISHED else (of,)
        for k, male in enumerate(males):
            numbers = dict.fromkeys(module.SCORES, male) | {"energy": 2 * male, "PSNR": 40 - male}
            facts = SimpleNamespace(nbytes=100.0, fetches=1.0, seconds=2.0)
            found.append(module.Entry(f"m{k}", label, readings, "nbrdf", facts, numbers))
    return found


def test_where_ours_is_not_ahead_is_said(script: Callable[[str], ModuleType]) -> None:
    module = script("compression.compression_tables")
    # In the median ours is ahead of npf and behind abc; in the worse tenth behind npf.
    found = entries_of(module, {"npf": (1, 3, 5), "abc": (1, 1, 1), "ours 3.2 KiB": (2, 2, 6)})
    text, words = module.ahead(found)
    lines = {line.split("|")[2].strip(): line for line in text.splitlines()[2:]}
    assert set(lines) == {"npf", "abc"}
    cells = [cell.strip() for cell in lines["npf"].split("|")[5:-1]]
    assert cells == ["2 / 3", "**6 / 5**", "4 / 6", "**12 / 10**", "38 / 37", "**34 / 35**"]
    assert all(cell.strip().startswith("**") for cell in lines["abc"].split("|")[5:-1])
    assert words.startswith("homofact is ahead in 3 of 12 figures, level in 0")
    assert "behind in 9" in words
    near = module.ahead(entries_of(module, {"npf": (1, 3, 5), "ours 3.2 KiB": (2, 3.05, 6)}))
    assert near[0].splitlines()[2].split("|")[5].strip() == "3.05 / 3 ≈"
    # 36.95 against 37 dB.
    assert near[0].splitlines()[2].split("|")[9].strip().endswith("≈")
    assert near[1].startswith("homofact is ahead in 0 of 6 figures, level in 3")
    assert "Judged by nbrdf, it is behind npf in MALE (worse tenth), energy (worse tenth) and PSNR" in words
    # Ours fitted to another reading counts against what was published of MERL itself, not against npf.
    more = found + entries_of(module, {"ours 3.2 KiB": (0.1, 0.1, 0.1)}, of="nps")
    again = module.ahead(more)[0].splitlines()[2:]
    assert again[0] == lines["npf"]
    assert again[1] != lines["abc"]


def test_what_a_fit_adds_is_counted_material_by_material(script: Callable[[str], ModuleType]) -> None:
    module = script("compression.compression_tables")
    text = module.added(entries_of(module, {"npf": (1, 3, 5), "ours 3.2 KiB": (2, 2.5, 4)}))
    row = next(line for line in text.splitlines() if "ours" in line)
    cells = [cell.strip() for cell in row.split("|")[1:-1]]
    assert cells[:5] == ["ours 3.2 KiB of npf", "3", "2.5 (4)", "-0.5", "67%"]
    assert cells[-3:] == ["37.5 (36)", "+0.5", "67%"]


def test_worse_is_less_where_more_is_better(script: Callable[[str], ModuleType]) -> None:
    module = script("compression.compression_tables")
    values = [float(k) for k in range(11)]
    assert module.worse_tenth("MALE", values) == 9
    assert module.worse_tenth("PSNR", values) == 1


TORCH_FETCH = Callable[[int, list[torch.Tensor]], list[torch.Tensor]]


def row_fetch(textures: list[Any]) -> TORCH_FETCH:
    """Textures of one row, linear between texels and clamped."""

    def fetch(number: int, uv: list[torch.Tensor]) -> list[torch.Tensor]:
        texels = torch.from_numpy(textures[number][0]).double()
        place = (uv[0] * len(texels) - 0.5).clamp(0, len(texels) - 1)
        low = place.floor().clamp(max=len(texels) - 2).long()
        share = (place - low)[:, None]
        return list(((1 - share) * texels[low] + share * texels[low + 1]).T)

    return fetch


def published_models(fits: ModuleType) -> dict[str, Any]:
    sgd = {
        "rho_d": (0.05, 0.03, 0.02), "rho_s": (0.04, 0.66, 0.27), "alpha": (0.015, 0.03, 0.05), "p": (0.46, 0.45, 0.5),
        "f0": (6.1, 0.24, 0.58), "f1": (5.1, 0.18, 0.48), "kappa": (46.0, 25.0, 15.0), "lambda": (2.6, 3.0, 8e6),
        "c": (1.1e-7, 1.1e-7, 1e38), "k": (47.8, 36.3, 170.0), "theta0": (0.21, -0.07, 1.195),
    }  # fmt: skip
    table = torch.rand((272, 3), generator=torch.Generator().manual_seed(0), dtype=torch.float64).float()
    drawn = torch.Generator().manual_seed(1)
    sizes = ((10, 32), (32, 32), (32, 6))
    layers = [
        (torch.randn(size, generator=drawn, dtype=torch.float64) * 0.3, torch.full(size[1:], 0.2)) for size in sizes
    ]
    return {
        "hybrid": HybridBrdf(
            (0.1, 0.2, 0.3), (1.4, 1.6, 2.5), (0.1, 0.15), (0.2, -0.5, 0.7, 0.1), *map(tuple, zip(*layers, strict=True))
        ),
        "abc": fits.Abc((0.02, 0.02, 0.01), (50.0, 40.0, 30.0), 10000.0, 0.8, 2.2),
        "sgd": fits.Sgd(sgd),
        "npf": FactoredBrdf(table),
    }


@pytest.mark.parametrize("kind", ["abc", "sgd", "npf", "hybrid"])
def test_programs_are_the_published_models(script: Callable[[str], ModuleType], kind: str) -> None:
    programs, model = script("compression.published_programs"), published_models(script("data.published_fits"))[kind]
    program, textures = programs.program_of_any(model)
    wi, wo = draw_uniform(3000, torch.Generator().manual_seed(2))
    near = torch.nn.functional.normalize(wi * torch.tensor([-1.0, -1, 1], dtype=torch.float64) + 0.02 * wo, dim=1)
    for seen in (wo, near):
        values: dict[str, list[Any]] = {"wi": list(wi.T), "wo": list(seen.T)}
        values = interpret(program.statements, values, TORCH, row_fetch(textures))
        found = torch.stack(value_of(program.result, values, TORCH), -1)
        expected = model.evaluate(wi, seen)
        error = (found - expected).abs() / (expected + 1e-6 * expected.mean())
        # arccos has lost digits near the normal.
        assert float(error.max()) < 1e-5
        assert float(error.median()) < 1e-12
    # No statement overwrites another's component.
    scalars = [n for let in program.statements for n in names_of(let)]
    assert len(scalars) == len(set(scalars))
    below = {"wi": list(wi.T), "wo": list((-wo).T)}
    below = interpret(program.statements, below, TORCH, row_fetch(textures))
    assert not torch.stack(value_of(program.result, below, TORCH), -1).any()


def names_of(let: Any) -> list[str]:
    count = let.expression.dimension
    return [let.name] if count == 1 else [f"{let.name}_{k}" for k in range(count)]


@needs_data
def test_speeds_are_written_and_stand_in_the_table(
    script: Callable[[str], ModuleType], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    module = script("compression.compression_speed")
    monkeypatch.setattr(module, "PUBLISHED", ("abc",))
    # Compiling takes seconds a program.
    monkeypatch.setattr(module, "rates", lambda ways, *_: {way.name: (k + 1.5, 256) for k, way in enumerate(ways)})
    assert module.main(["--short", "--data", str(DATA), "--cache", str(tmp_path)]) == 0
    rows = module.read(tmp_path)
    assert [(row["method"], row["compiler"]) for row in rows] == [("abc", "ours"), ("GGX × 1", "ours")]
    assert module.median_of(rows, "abc") == 1.5
    assert module.median_of(rows, "sgd") is None
    text = script("compression.compression_tables").speeds(rows)
    assert [line.split("|")[1].strip() for line in text.splitlines()[2:]] == ["abc", "GGX × 1"]


@pytest.mark.slow
@needs_data
def test_seeds_and_limits_are_written_and_stand_in_the_table(
    script: Callable[[str], ModuleType], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    seeds, limits, protocol = (script(f"compression.compression_{name}") for name in ("seeds", "limits", "protocol"))
    # Imported before anything is patched: they take their names from the modules that are patched below.
    table, tables = (script(f"compression.compression_{name}") for name in ("table", "tables"))
    monkeypatch.setattr(protocol, "PIXELS", 24)
    protocol.surroundings.cache_clear()
    methods = {"ours, as if": GgxMethod(), "GGX × 1": GgxMethod()}
    for module in (seeds, limits, script("compression.compression_fits")):
        monkeypatch.setattr(module, "READINGS", ("nbrdf", "npf"))
        for name, value in (("DEFAULT_COUNT", 1500), ("METHODS", methods)):
            if hasattr(module, name):
                monkeypatch.setattr(module, name, value)
    monkeypatch.setattr(limits, "VARIANTS", {"few": (GgxMethod(), 1), "many": (GgxMethod(), 2)})
    shared = ["--short", "--data", str(DATA), "--cache", str(tmp_path)]
    assert seeds.main([*shared, "--seeds", "2"]) == 0
    assert limits.main([*shared, "--materials", "pvc"]) == 0
    protocol.surroundings.cache_clear()
    rows = table.rows_of(tmp_path / seeds.FILE)
    assert [(row["method"], row["seed"]) for row in rows] == [("ours, as if", "0"), ("ours, as if", "1")]
    assert rows[0]["MALE"] != rows[1]["MALE"]
    line = tables.seeds(rows).splitlines()[2].split("|")
    assert float(line[4].split("±")[0]) == pytest.approx(sum(float(row["MALE"]) for row in rows) / 2, rel=0.01)
    assert [row["fit"] for row in table.rows_of(tmp_path / limits.FILE)] == ["few"]
    assert "| pvc | few | 0 | 32 |" in table.limits(table.rows_of(tmp_path / limits.FILE))


@pytest.mark.slow
@needs_data
def test_what_is_done_is_not_done_again(
    script: Callable[[str], ModuleType],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    module, fits, protocol = (script(f"compression.compression_{name}") for name in ("table", "fits", "protocol"))
    # The processes' decoder takes most of the time.
    for each in (module, fits, script("compression.compression_tables"), script("compression.compression_charts")):
        monkeypatch.setattr(each, "PUBLISHED", ("nbrdf", "npf", "abc"))
        if hasattr(each, "READINGS"):
            monkeypatch.setattr(each, "READINGS", ("nbrdf", "npf"))
    monkeypatch.setattr(protocol, "PIXELS", 24)
    protocol.surroundings.cache_clear()
    arguments = ["--short", "--data", str(DATA), "--cache", str(tmp_path / "c"), "--plot", str(tmp_path / "p.png")]
    assert module.main(arguments) == 0
    first = capsys.readouterr().out
    kept = {path: path.stat().st_mtime_ns for path in (tmp_path / "c").rglob("*.npz")}
    assert len(kept) == len(fits.PUBLISHED) + len(fits.READINGS)
    assert module.main(arguments) == 0
    assert capsys.readouterr().out == first
    assert {path: path.stat().st_mtime_ns for path in kept} == kept
    protocol.surroundings.cache_clear()
    assert "| GGX × 1 | 1 | 32 | 0 |" in first
    # A method is not judged by what it was fitted to.
    by_npf = first.split("### Judged by npf")[1].split("\n##")[0]
    assert "| npf |" not in by_npf
    assert "| abc |" in by_npf
