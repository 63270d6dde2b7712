"""Files that version 0.1.0 wrote are read by today's code, with the values that they had (tests/golden/0.1.0)."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from slow_cases import slow_among

import homofact
from homofact.cli.main import main
from homofact.errors import BadInput
from homofact.evaluation.metrics import measure
from homofact.evaluation.reopening import reopen, settings_of

ROOT = Path(__file__).resolve().parents[2]
OLD = ROOT / "tests" / "golden" / "0.1.0"
VALUES = {name: array for name, array in np.load(OLD / "values.npz").items() if name not in ("wi", "wo")}
FILES = sorted(name for name in VALUES if not name.startswith("folder_"))
SEARCHED: dict[str, Any] = {"size": 4, "epsilon": 0.01, "restarts": 1, "search_size": 4, "search_samples": 300}
# What each file is read as: the method with what the old settings are called today.
# What 0.1.0 did without being told.
LOGS: dict[str, Any] = {"textures": 2, "budget": 1.0, "objective": "log", "reciprocal": True}
METHODS: dict[str, Any] = {
    "search": homofact.Search(**LOGS, **SEARCHED),
    "search_half_diff": homofact.Search(projections=("half-diff",), **LOGS, **SEARCHED),
    "search_anisotropic": homofact.Search(projections=("in-out", "h"), **LOGS, **SEARCHED),
    "cole": homofact.Cole(textures=2, confidence=True, **SEARCHED),
    "cole_in_out": homofact.Cole(textures=1, coordinates="in-out", bound="cube", **SEARCHED),
    "mccool": homofact.McCool(size=4, epsilon=0.01),
    "mccool_png8": homofact.McCool(size=4, epsilon=0.01, projections=("h", "theta_h-theta_d"), quantize="png8"),
    "svd": homofact.Svd(textures=2, size=4, epsilon=0.01),
    "svd_half_diff": homofact.Svd(textures=2, size=4, epsilon=0.01, coordinates="half-diff", map="polar"),
    "nmf": homofact.Nmf(textures=2, size=4, epsilon=0.01),
}


def directions() -> tuple[np.ndarray, np.ndarray]:
    with np.load(OLD / "values.npz") as found:
        return found["wi"], found["wo"]


def place(name: str) -> str:
    return str(OLD / (name if name.startswith("folder_") else f"{name}.npz"))


def test_every_file_has_its_values_and_its_settings() -> None:
    assert {path.stem for path in OLD.glob("*.npz")} == {*FILES, "values"}
    assert {path.name for path in OLD.iterdir() if path.is_dir()} == VALUES.keys() - FILES
    assert METHODS.keys() == set(FILES)


@pytest.mark.parametrize("name", VALUES)
def test_it_evaluates_to_what_it_did(name: str) -> None:
    fitted: Any = homofact.load(place(name))
    assert (type(fitted.factorization).__name__ == "Separable") == name.startswith(("svd", "nmf"))
    np.testing.assert_allclose(fitted.evaluate(*directions()), VALUES[name], rtol=1e-11, atol=0)


@pytest.mark.parametrize("name", FILES)
def test_its_settings_are_known_by_the_names_of_today(name: str) -> None:
    fitted = homofact.load(place(name))
    assert fitted.provenance["homofact_version"] == "0.1.0"
    assert settings_of(fitted) == METHODS[name]


@pytest.mark.parametrize("name", FILES)
def test_saved_anew_it_is_the_same_fit(name: str, tmp_path: Path) -> None:
    fitted: Any = homofact.load(place(name))
    fitted.save(tmp_path / "again.npz")
    again: Any = homofact.load(str(tmp_path / "again.npz"))
    assert np.array_equal(again.evaluate(*directions()), fitted.evaluate(*directions()))
    assert again.provenance == fitted.provenance


@pytest.mark.parametrize("name", ["folder_search", "folder_cole", "folder_export"])
def test_a_result_finds_its_samples_and_its_errors_again(name: str) -> None:
    fitted = homofact.load(place(name))
    found = reopen(fitted, near=(ROOT / "data_synthetic",))
    assert found.known
    assert found.held_out
    made = "folder_search" if name == "folder_export" else name
    report = json.loads((OLD / made / "report.json").read_text())
    error = measure(fitted, found.parts["held_out"], fitted.transform)
    # An export's texels are floats of 32 bits.
    close = 1e-5 if name == "folder_export" else 1e-9
    assert {key: getattr(error, key) for key in report["error"]["held_out"]} == pytest.approx(
        report["error"]["held_out"], rel=close
    )


@pytest.mark.usefixtures("rough_sampling")
@pytest.mark.parametrize(
    "name",
    slow_among(
        VALUES,
        "svd_half_diff",
        "folder_cole",
        "mccool_png8",
        "search_half_diff",
        "search_anisotropic",
        "cole_in_out",
        "nmf",
    ),
)
def test_the_commands_take_it(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(ROOT / "data_synthetic")
    out = tmp_path / "engine"
    if name == "folder_export":
        assert main(["render", place(name), "--size", "16", "--out", str(tmp_path / "sphere.png"), "-q"]) == 0
        assert (tmp_path / "sphere.png").is_file()
        return
    assert main(["export", place(name), "--out", str(out), "-q"]) == 0
    again: Any = homofact.load(str(out))
    np.testing.assert_allclose(again.evaluate(*directions()), VALUES[name], rtol=1e-4, atol=1e-6)


def test_a_file_of_a_later_format_is_refused_by_name(tmp_path: Path) -> None:
    with np.load(OLD / "mccool.npz") as found:
        arrays = dict(found)
    arrays["header"] = np.array(str(arrays["header"]).replace('"format_version": 1', '"format_version": 99'))
    np.savez(tmp_path / "later.npz", **arrays)
    with pytest.raises(BadInput, match=r"later\.npz: format version 99, expected at most \d+ \(update homofact\)"):
        homofact.load(str(tmp_path / "later.npz"))
