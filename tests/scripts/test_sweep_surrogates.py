"""The sweep of the surrogates: what it asks for, and its table."""

import importlib
from pathlib import Path
from types import ModuleType

import pytest
from swept import make_sweep

from homofact.methods.cole import Cole
from homofact.sweeps.summary import rows_of
from homofact.sweeps.sweep_file import read_sweep


@pytest.fixture
def script(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    return importlib.import_module("scripts.sweeps.sweep_surrogates")


def test_three_methods_at_three_sizes(script: ModuleType, tmp_path: Path) -> None:
    file = tmp_path / "surrogates.toml"
    file.write_text(
        script.sweep_of("material:lafortune-clay", script.SIZES, 700, 2, 12, tuple(script.METHODS)), encoding="utf-8"
    )
    asked = read_sweep(file)
    sizes = ("3276 B", "12288 B", "49152 B")
    assert [label for label, _ in asked.fits()] == [
        f"{name}, {size}" for name in ("ours", "cole", "mccool") for size in sizes
    ]
    assert asked.source.count == 700
    assert {method.restarts for _, method in asked.fits() if isinstance(method, Cole)} == {2}
    file.write_text(script.sweep_of("material:lafortune-clay", (5000,), 700, 2, 12, ("mccool",)), encoding="utf-8")
    assert [label for label, _ in read_sweep(file).fits()] == ["mccool, 5000 B"]


def test_the_table_s_brackets_are_the_worst_tenth(script: ModuleType, tmp_path: Path) -> None:
    rows = rows_of(make_sweep(tmp_path))
    for k, row in enumerate(rows):
        # Ratios either way of 1: .5 is as bad as 2.
        row.metrics.update(log_mse=float(k), energy_overall=(1.0, 1.1, 0.5, 1.2, 0.9, 1.3)[k])
    assert script.worse_tenth(rows, "log_mse") == (2.5, 5)
    assert script.worse_tenth(rows, "energy_overall") == (1.05, 0.5)
    assert "(" in script.table(rows)
