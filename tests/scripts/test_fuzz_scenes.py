"""The fuzz program of scenes: every kind's whole file is used, and a short run finds nothing."""

import importlib
import io
import random
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

pytest.importorskip("embreex", reason="embreex is not installed: pip install 'homofact[relight]'")


@pytest.fixture
def fuzzer() -> ModuleType:
    return importlib.import_module("scripts.checks.fuzz_scenes")


@pytest.mark.slow
def test_a_short_run_finds_nothing(fuzzer: ModuleType, capsys: pytest.CaptureFixture[str]) -> None:
    assert fuzzer.main(["--count", "60", "--seed", "5"]) == 0
    lines = {line.split()[0]: line for line in capsys.readouterr().out.splitlines() if "wrong" in line}
    assert {"mesh", "sky", "relight", "edit", "relit", "prepared", "curves"} <= set(lines)
    for name, line in lines.items():
        assert line.endswith("wrong 0"), line
        assert " refused" in line, name


def test_what_is_whole_is_used(fuzzer: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Without damage nothing is refused: what is refused elsewhere is for its damage."""
    untouched = lambda value, dice: value  # noqa: E731
    results = importlib.import_module("scripts.checks.fuzz_results")
    for module in (fuzzer, results, importlib.import_module("scripts.checks.fuzz_pages")):
        monkeypatch.setattr(module, "DAMAGES", (lambda raw, dice: bytes(raw),))
    for name in ("json_damaged", "array_damaged"):
        monkeypatch.setattr(results, name, untouched)
    monkeypatch.setattr(fuzzer, "json_damaged", untouched)
    monkeypatch.setattr(fuzzer, "npz_damaged", lambda arrays, dice: whole(arrays))
    monkeypatch.setattr(fuzzer, "texts", lambda wholes: lambda dice, path: path.write_bytes(dice.choice(wholes)))
    for kind in fuzzer.kinds(tmp_path):
        if kind.name != "link":
            for number in range(6):
                kind.put(random.Random(number), tmp_path / "whole")
                kind.use(tmp_path / "whole", number)


def whole(arrays: dict[str, np.ndarray]) -> bytes:
    buffer = io.BytesIO()
    np.savez(buffer, allow_pickle=False, **arrays)
    return buffer.getvalue()
