"""The accuracy programs in their short forms: what they print is what was found, on the real measurements."""

import importlib
from pathlib import Path

import pytest


@pytest.fixture(autouse=True)
def scripts_on_the_path(monkeypatch: pytest.MonkeyPatch, real_data: Path) -> None:
    monkeypatch.setenv("HOMOFACT_DATA", str(real_data))


def rows(text: str) -> list[list[str]]:
    """The cells of every table line below a header."""
    lines = [line for line in text.splitlines() if line.startswith("|")]
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in lines[2:]]


def test_left_out_samples_and_left_out_rings_disagree_on_garnet(capsys: pytest.CaptureFixture[str]) -> None:
    """The reason for judging by rings: a second texture over θi wins by samples and loses by rings."""
    importlib.import_module("scripts.accuracy.against_interpolant").main(["--only", "rings", "--short"])
    found = {(mix, judged): float(error) for _, mix, judged, error, _ in rows(capsys.readouterr().out)}
    one, two = "theta_h-theta_d", "theta_h-theta_d · theta_i"
    assert found[two, "samples"] < 0.8 * found[one, "samples"]
    assert found[two, "rings"] > found[one, "rings"]


@pytest.mark.slow
def test_the_shared_basis_is_held_against_textures_of_ones_own(capsys: pytest.CaptureFixture[str]) -> None:
    importlib.import_module("scripts.sweeps.shared_basis").main(["--short"])
    text = capsys.readouterr().out
    assert "4 materials, 500 pairs each" in text
    lines = [line.strip("| ").split(" | ") for line in text.splitlines() if line.startswith("| ") and line[2].isdigit()]
    basis, own = lines[:2], lines[2:]
    assert [line[0] for line in basis] == ["1", "2"]
    # More directions, more bytes; smaller textures of one's own, fewer.
    assert float(basis[0][4]) < float(basis[1][4])
    sizes = [float(line[0]) for line in own]
    assert sizes == sorted(sizes, reverse=True)
    assert all(0 < float(line[1]) <= float(line[2]) for line in (*basis, *own))


@pytest.mark.slow
def test_a_straightened_measurement_has_a_lower_floor_and_a_nearer_fit(capsys: pytest.CaptureFixture[str]) -> None:
    importlib.import_module("scripts.accuracy.straightening").main(["--short"])
    tilt, fit = (line for line in rows(capsys.readouterr().out) if line[0] == "vch_golden_yellow")
    assert tilt[3] == "yes"
    assert float(tilt[8]) < 0.8 * float(tilt[7])
    raw, against_straight, straight, floor = (float(cell) for cell in fit[2:6])
    # On this small tilt two textures of 16² are too few to gain: straightening must not cost, both lie over the floor.
    assert floor < straight < 1.05 * against_straight < raw
