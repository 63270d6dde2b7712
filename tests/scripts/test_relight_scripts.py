"""The scripts of relighting: what they truncate and light with is what they say."""

import importlib
import json
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from coarse import coarse_terms
from relighting_cases import knot, light, occluder, shiny, whole

from homofact.containers.png import read_png
from homofact.relighting.cube import environment_cube, solid_angles
from homofact.relighting.precompute import TransportSettings, transport
from homofact.relighting.relight import Relit


@pytest.fixture
def figures(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    return importlib.import_module("scripts.relighting.relight_figures")


def test_vectors_cut_short_are_those_of_fewer_coefficients(figures: ModuleType) -> None:
    cut, made = figures.by_largest(whole(), 20), transport(knot(), shiny(), TransportSettings(8, kept=20), occluder())
    found = []
    for each in (cut, made):
        relit = Relit(each)
        relit.relight(light(8))
        found.append(relit.tuples)
    assert cut.mean_kept <= 20
    # Numbers are rounded to a quarter of what is left out, the cut ones to finer steps.
    assert found[0] == pytest.approx(found[1], rel=0.03, abs=0.03 * float(np.abs(found[1]).max()))


def test_the_lamp_sends_what_a_furnace_does(figures: ModuleType) -> None:
    found = environment_cube(figures.lamp((0.6, 0.7, 0.5), 4, 0.0), 64)
    assert np.einsum("fijc,ij->c", found, solid_angles(64)) == pytest.approx(4 * np.pi, rel=0.02)


def test_a_turning_light_is_followed(monkeypatch: pytest.MonkeyPatch) -> None:
    numbers = importlib.import_module("scripts.relighting.relight_numbers")
    monkeypatch.setattr(numbers, "A_FRAME", 100)
    relit = Relit(whole())
    relit.relight(light(8, 0))
    seconds, errors = numbers.turning([relit], [light(8, 1)] * 5)
    assert seconds > 0
    # The same light is asked for again and again: after four steps of 100 all 384 are in.
    assert errors[0] > errors[1] > errors[2] > 0
    assert errors[3:] == [0, 0]


def coarse_light(monkeypatch: pytest.MonkeyPatch, script: ModuleType) -> None:
    """Light of 6 × 16² texels, a sixteenth of the script's own: each is a ray of every vertex."""
    monkeypatch.setattr(script, "SCENE", script.SCENE.replace("[transport]\n", "[transport]\ncube = 16\n"))


@pytest.mark.slow
def test_a_bounce_is_held_against_paths(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("mitsuba")
    bounce = importlib.import_module("scripts.relighting.relight_bounce")
    coarse_light(monkeypatch, bounce)
    with coarse_terms():
        assert bounce.main(["--short"]) == 0
    header, _, row = [line for line in capsys.readouterr().out.splitlines() if line.startswith("|")]
    columns = dict(zip(*[[cell.strip() for cell in line.strip("|").split("|")] for line in (header, row)], strict=True))
    names = ("without bounce", "with bounce", "bounce of all light")
    without, found, share = (float(columns[name].rstrip("%")) for name in names)
    # Even a picture 24 pixels wide, noisy as it is, is nearer with the bounce.
    assert found < without
    assert 2 < share < 20


@pytest.mark.slow
def test_separate_lobes_are_measured_once(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    """The short form: one object, whose separate lobe leaves one term; figures stand in their columns.

    --work keeps a row as a JSON line, and the next run measures only what is missing.
    """
    lobes = importlib.import_module("scripts.relighting.relight_lobes")
    work = tmp_path / "rows.jsonl"
    assert lobes.main(["--short", "--work", str(work)]) == 0
    first = capsys.readouterr().out
    header, _, row = first.splitlines()[:3]
    columns = dict(zip(*[[cell.strip() for cell in line.strip("|").split("|")] for line in (header, row)], strict=True))
    assert (columns["mesh"], columns["material"], columns["K"]) == ("knot", "exponent 2000", "1")
    assert 0 < float(columns["studio"].rstrip("%")) < 30
    assert float(columns["views/s"]) > 0
    key, row = json.loads(work.read_text(encoding="utf-8"))
    assert key == "knot | exponent 2000 | auto | 1024 kept | 100 pixels | own sun"
    assert (row["terms"], row["separate"], list(row["errors"])) == (1, True, ["studio"])
    assert f"{row['errors']['studio']:.1%}" in first
    assert lobes.main(["--short", "--work", str(work)]) == 0
    assert capsys.readouterr().out == first  # times included: nothing was measured
    few = ["--short", "--lobe", "factored", "--terms", "3", "--work", str(work)]
    with coarse_terms():
        assert lobes.main(few) == 0
    row = json.loads(work.read_text(encoding="utf-8").splitlines()[1])[1]
    assert (row["terms"], row["separate"]) == (3, False)
    assert lobes.main(["--data", "nowhere"]) == 2


@pytest.mark.slow
def test_textures_add_little_to_the_error(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    textures = importlib.import_module("scripts.relighting.relight_textures")
    coarse_light(monkeypatch, textures)
    with coarse_terms():
        assert textures.main(["--short", "--picture", str(tmp_path / "balls.png")]) == 0
    header, _, row = [line for line in capsys.readouterr().out.splitlines() if line.startswith("|")]
    columns = [[cell.strip() for cell in line.strip("|").split("|")] for line in (header, row)]
    found = dict(zip(*columns, strict=True))
    texture, plain, mean = (float(found[name].rstrip("%")) for name in ("texture", "mean colour", "as mean"))
    assert texture < plain + 1
    assert mean > 10 * texture
    assert read_png(tmp_path / "balls.png").shape == (60, 80, 3)


@pytest.mark.slow
def test_normal_maps_add_little_to_the_error(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    textures = importlib.import_module("scripts.relighting.relight_textures")
    coarse_light(monkeypatch, textures)
    with coarse_terms():
        assert textures.main(["--short", "--normals", "--picture", str(tmp_path / "balls.png")]) == 0
    header, _, row = [line for line in capsys.readouterr().out.splitlines() if line.startswith("|")]
    names, values = ([cell.strip() for cell in line.strip("|").split("|")] for line in (header, row))
    found = dict(zip(names, values, strict=True))
    mapped, plain, flat, functions = (
        float(found[name].rstrip("%")) for name in ("map", "no map", "as flat", "functions")
    )
    assert mapped < plain + 3
    assert functions < 1
    assert flat > 4
    assert read_png(tmp_path / "balls.png").shape == (60, 80, 3)
