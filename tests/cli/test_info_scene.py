"""`homofact info` of the folders of scenes: what it says of them, and what it refuses."""

import json
from pathlib import Path
from typing import Any

import pytest

from homofact.cli.main import main

CONFIGS = Path(__file__).resolve().parents[2] / "configs"
CURVE = {"term": "diffuse", "curve": "incident", "angle": "theta_i", "bands": 256, "sliders": []}
EDITED: dict[str, Any] = {
    "scene": "desk",
    "light": "studio: three soft boxes",
    "triangles": 398,
    "views": [{"name": "front", "pixels": 1}, {"name": "side", "pixels": 70}],
    "materials": {"paint": [CURVE, {**CURVE, "curve": "outgoing", "angle": "theta_o"}], "ground": [CURVE]},
    "bytes": 12_300_000,
    "error": {"low_rank": 0.00213, "lights_and_bands": {"front": 0.0123, "side": 0.02}},
}
BALL = {
    "mesh": "ball.obj", "material": "material:phong-10", "vertices": 42, "terms": 3, "form": "wavelets",
    "coefficients_per_vector": 63.6, "error": {"together": 0.0421},
}  # fmt: skip
RELIT: dict[str, Any] = {
    "scene": "hall",
    "light": "sky",
    "cube": 16,
    "objects": [BALL, {**BALL, "mesh": "ground", "terms": 1, "error": None}],
    "bytes": 456_000,
}


def folder_of(place: Path, kind: str, report: Any) -> Path:
    """A folder of a scene, without what is large in it."""
    (place / f"{kind}.npz").write_bytes(b"")
    (place / f"{kind}.json").write_text(json.dumps(report))
    return place


def wrapped(report: Any) -> dict[str, Any]:
    """A report as edit.json has it."""
    return {"format": "homofact editing scene", "format_version": 1, "name": "desk", "scene": {}, "report": report}


def test_a_prepared_scene_is_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    place = str(folder_of(tmp_path, "edit", wrapped(EDITED)))
    assert main(["info", place, "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == {"folder": place, "kind": "prepared scene", **EDITED}
    assert main(["info", place]) == 0
    said = capsys.readouterr().out
    for words in (
        "desk", "prepared scene", "studio: three soft boxes, 398 triangles", "front, 1 covered pixel\n",
        "side, 70 covered pixels", "material paint", "diffuse incident (theta_i, 256 bands)", "12.3 MB",
        "at most 0.21% (relative RMS)", "front 1.23%, side 2.00%",
    ):  # fmt: skip
        assert words in "\n".join(" ".join(line.split()) for line in said.splitlines()) + "\n"


def test_a_relit_scene_is_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    place = str(folder_of(tmp_path, "relight", RELIT))
    assert main(["info", place, "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == {"folder": place, "kind": "relit scene", **RELIT}
    assert main(["info", place]) == 0
    said = " ".join(capsys.readouterr().out.split())
    for words in ("hall", "relit scene", "42 vertices, 3 terms, wavelets, 64 numbers per vector; error", "16²",
                  "4.21% (relative RMS)", "42 vertices, 1 term,", "error not measured", "0.456 MB"):  # fmt: skip
        assert words in said


@pytest.mark.parametrize(
    ("kind", "report", "expected"),
    [
        ("edit", {"format": "x"}, 'edit.json: format: found "x", expected one of homofact editing scene'),
        ("edit", wrapped({**EDITED, "views": 3}), "edit.json: damaged (TypeError(\"'int' object is not iterable\"))"),
        ("edit", wrapped({"scene": "desk"}), "edit.json: damaged (KeyError('materials')), expected the report of a"),
        ("relight", {**RELIT, "objects": [{}]}, "relight.json: damaged (KeyError('error')), expected the report of a"),
        ("relight", [], "relight.json: "),
    ],
)
def test_a_damaged_report_is_named(
    kind: str, report: Any, expected: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["info", str(folder_of(tmp_path, kind, report))]) == 2
    error = capsys.readouterr().err
    assert expected in error
    assert error.count("\n") == 1


def test_a_scene_has_no_plot_and_other_folders_are_refused_as_before(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    place = folder_of(tmp_path, "edit", wrapped(EDITED))
    assert main(["info", str(place), "--plot", str(tmp_path / "x.png")]) == 2
    assert "plot:" in (said := capsys.readouterr().err)
    assert "is no source (prepared scene), expected none" in said
    assert not (tmp_path / "x.png").exists()
    (place / "edit.npz").unlink()
    assert main(["info", str(place)]) == 2
    assert "a folder, expected a BRDF file" in capsys.readouterr().err


COMMANDS = {
    "scenes/edit.toml": ("a scene for editing", ["edit {} --out FOLDER"]),
    "scenes/example.toml": ("a scene for planning", ["plan {}"]),
    "scenes/relight.toml": ("a scene for relighting", ["relight {} --out FOLDER"]),
    "scenes/relight_planned.toml": ("a scene for relighting", ["plan {}", "relight {} --out FOLDER"]),
    "sweep.toml": ("a sweep", ["sweep {} --out FOLDER"]),
    "thesis.toml": ("a configuration", ["factorize --config {}"]),
    "chart.toml": ("a configuration", ["compare --config {}"]),
}


@pytest.mark.parametrize("name", COMMANDS)
def test_a_toml_file_is_told_by_the_commands_that_read_it(
    name: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    place = CONFIGS / name
    kind, commands = COMMANDS[name]
    assert main(["info", str(place), "--json"]) == 0
    readers = [command.split()[0] for command in commands]
    assert json.loads(capsys.readouterr().out) == {"file": str(place), "kind": kind, "read_by": readers}
    monkeypatch.setenv("COLUMNS", "300")
    assert main(["info", str(place)]) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert f"kind {kind} read by {' '.join(f'homofact {command.format(place)}' for command in commands)}" in said


def test_what_a_toml_file_has_is_shown(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    place = tmp_path / "shop.toml"
    place.write_text('seed = 3\n[[material]]\nsource = "a"\n[[material]]\nsource = "b"\n[budget]\nbytes = 9\n')
    assert main(["info", str(place)]) == 0
    said = capsys.readouterr().out.splitlines()
    rows = [line.split(None, 1) for line in said if line.strip()]
    found = {row[0]: row[1].strip() for row in rows if len(row) > 1}
    assert (found["seed"], found["budget"]) == ("3", "bytes 9")
    assert [row[1:] for row in map(str.split, said) if row[:1] == ["material"]] == [
        ["1", "source", "a"],
        ["2", "source", "b"],
    ]


BAD_TOML = {
    "of no kind": ("[tool]\nx = 1\n", "found 'tool', expected the keys of a configuration"),
    "empty": ("", "found no keys, expected the keys of a configuration"),
    "no TOML": ("[tool\n", "not TOML"),
}


@pytest.mark.parametrize("case", BAD_TOML)
def test_a_toml_file_of_no_kind_is_refused_in_a_line(
    case: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text, expected = BAD_TOML[case]
    (tmp_path / "a.toml").write_text(text)
    assert main(["info", str(tmp_path / "a.toml")]) == 2
    said = capsys.readouterr().err
    assert expected in said
    assert said.count("\n") <= 2


def test_a_toml_file_is_no_measurement(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["factorize", str(CONFIGS / "sweep.toml"), "--out", str(tmp_path / "o")]) == 2
    said = capsys.readouterr().err
    assert "a TOML file, expected a BRDF file or material:NAME (`homofact info` names what reads it)" in said
    assert not (tmp_path / "o").exists()


def test_the_name_of_a_mesh_keeps_its_underscores(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    objects = [{**BALL, "mesh": name} for name in ("teapot_wdas.obj", "left_handle")]
    assert main(["info", str(folder_of(tmp_path, "relight", {**RELIT, "objects": objects}))]) == 0
    said = capsys.readouterr().out
    assert "object teapot_wdas.obj" in said
    assert "object left_handle" in said


CHOICE = {"method": "search", "textures": 2, "size": 4, "storage": "png8", "bytes": 96, "fetches": 3}
PAINT: dict[str, Any] = {
    "source": "paint.brdf", "name": "paint", "pixels": None, "choice": CHOICE, "met": True, "error": 0.698,
    "error_kind": "delta_e", "error_lighting": "studio", "of_tolerance": 0.803, "folder": "1-paint",
    "verdict": {"summary": "trusted; measured against the source: highlight within 11%"},
}  # fmt: skip
SMALL: dict[str, Any] = {
    **PAINT, "name": "gold", "source": "gold.brdf", "pixels": 40, "met": False, "of_tolerance": 12.0, "error": 9.0,
    "choice": {**CHOICE, "method": "constant", "textures": 0, "size": 0, "bytes": 12, "fetches": 0},
    "verdict": None, "folder": "2-gold",
}  # fmt: skip
PLANNED: dict[str, Any] = {
    "scene": "shop", "tolerance": {"delta_e": 1.0}, "lightings": [{"name": "studio"}], "bytes": 108,
    "fetches_per_pixel": 1.5,
    "materials": [PAINT, SMALL, PAINT, {**PAINT, "name": "none", "source": "no", "choice": None}],
    "warnings": ["gold: no representation was found"],
}  # fmt: skip


def test_a_plan_s_folder_is_described(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "plan.json").write_text(json.dumps(PLANNED))
    assert main(["info", str(tmp_path), "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == {"folder": str(tmp_path), "kind": "plan", **PLANNED}
    for place in (tmp_path, tmp_path / "plan.json"):
        assert main(["info", str(place)]) == 0
        said = " ".join(capsys.readouterr().out.split())
        for words in (
            "shop", "mean ΔE at most 1", "studio", "for 2 of 3 materials", "bytes 108", "1.5 per pixel",
            "2 textures of 4², 8 bits (search); 96 bytes, 3 fetches; mean ΔE 0.698 under studio, 80% of the limit; in"
            " 1-paint", "material gold, 40 pixels", "closest: one colour; 12 bytes, 0 fetches;", "12 × the limit",
            "no representation fits the budget", "trusted; measured against the source",
            "gold: no representation was found",
        ):  # fmt: skip
            assert words in said
        assert said.count("material paint") == 1


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("{", "plan.json: not JSON ("),
        (json.dumps({**PLANNED, "materials": [{"name": "x"}]}), "plan.json: damaged (KeyError('source'))"),
        (json.dumps({**PLANNED, "tolerance": {"loudness": 1}}), "loudness"),
    ],
)
def test_a_damaged_plan_is_one_line(
    text: str, expected: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "plan.json").write_text(text)
    assert main(["info", str(tmp_path)]) == 2
    error = capsys.readouterr().err
    assert expected in error
    assert error.count("\n") == 1
