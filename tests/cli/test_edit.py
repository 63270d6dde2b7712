"""`homofact edit` as a user runs it: what it writes and says, what it takes back into textures, and what it refuses."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

import homofact
from homofact.brdf.analytic import CookTorrance
from homofact.brdf.log_transform import LogTransform
from homofact.brdf.materials import material
from homofact.cli.main import main
from homofact.containers.exr import write_exr
from homofact.containers.png import read_png
from homofact.editing.furnace import albedo_of
from homofact.editing.pairs import pairs_of
from homofact.evaluation.reopening import NotReopened, reopen
from homofact.exporting.result import write_result
from homofact.factor.factorization import Factorization
from homofact.factor.projection import fixed_projection
from homofact.factor.textures import LogSamples, solve_terms
from homofact.geometry.directions import draw_cosine_weighted

pytest.importorskip("embreex", reason="embreex is not installed: pip install 'homofact[relight]'")

SCENE = """
[[object]]
mesh = "ball.obj"
material = "material:cook-torrance-plastic"
name = "plastic"
bands = [64, 32]
[ground]
albedo = [0.4]
half = 1.5
steps = 4
[lighting]
named = "studio"
[[camera]]
eye = [0, 1, 4]
pixels = [20, 16]
[edit]
triangles = 60
"""
FIT_SCENE = """
[[object]]
mesh = "shape:sphere"
material = "paint"
[lighting]
named = "studio"
[[camera]]
eye = [0, 1, 4]
pixels = [8, 8]
"""
PAINT = CookTorrance((0.2, 0.1, 0.05), (0.5, 0.6, 0.7), 0.3, 0.05)


@pytest.fixture
def scene(tmp_path: Path) -> Path:
    from homofact.meshes.shapes import sphere

    ball = sphere(6)
    lines = [f"v {x:.6f} {y:.6f} {z:.6f}" for x, y, z in ball.positions]
    lines += [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in ball.triangles]
    (tmp_path / "ball.obj").write_text("\n".join(lines) + "\n")
    (tmp_path / "scene.toml").write_text(SCENE)
    return tmp_path / "scene.toml"


@pytest.fixture
def fit_scene(tmp_path: Path) -> Path:
    """A scene whose material is the result of a fit."""
    wi, wo = pairs_of(4000, 5)
    values = PAINT.evaluate(wi, wo)
    transform = LogTransform.of_values(values, 1e-5)
    samples = LogSamples(wi, wo, transform.forward(values), torch.ones(len(wi), dtype=torch.float64))
    projections = tuple(fixed_projection(name, True) for name in ("theta_h-theta_d", "theta_d-phi_d"))
    found = solve_terms(samples, projections, ((32, 8), (8, 8)), 1e-2, "cholesky")
    fit = Factorization(found.terms, transform, PAINT.channels)
    write_result(tmp_path / "paint", factorization=fit, report={})
    (tmp_path / "fit.toml").write_text(FIT_SCENE)
    return tmp_path / "fit.toml"


def curves_text(**changes: Any) -> dict[str, Any]:
    """A curve over θh of the fit's scene, raised about 0.5."""
    gamma = (np.arange(256) + 0.5) * (np.pi / 512)
    values = 1 + 1.5 * np.exp(-(((gamma - 0.5) / 0.25) ** 2))
    entry = {"material": "paint", "term": "whole", "curve": "theta_h", "angle": "theta_h"}
    entry |= {"values": np.repeat(values[:, None], 3, 1).tolist()}
    return {
        "format": "homofact curves", "format_version": 1, "channels": ["R", "G", "B"], "curves": [entry | changes],
    }  # fmt: skip


@pytest.mark.slow
def test_a_scene_is_prepared_and_its_errors_said(scene: Path, capsys: pytest.CaptureFixture[str]) -> None:
    from homofact.editing.result import open_edit
    from homofact.editing.session import Session

    out = scene.parent / "out"
    assert main(["edit", str(scene), "--out", str(out), "--json"]) == 0
    record = json.loads(capsys.readouterr().out)
    assert 1e-6 < record["error"]["low_rank"] < 3e-3
    assert 0.01 < record["error"]["lights_and_bands"]["view 1"] < 0.06
    assert [entry["curve"] for entry in record["materials"]["plastic"]] == [
        "incident", "outgoing", "distribution", "fresnel",
    ]  # fmt: skip
    assert sorted(each.name for each in out.iterdir()) == [
        "edit.json", "edit.npz", "picture_1.png", "view.html",
    ]  # fmt: skip
    assert "<title>scene</title>" in (out / "view.html").read_text()
    picture = read_png(out / "picture_1.png")
    assert picture.shape == (128, 160, 3)
    assert len(set(map(tuple, picture.reshape(-1, 3).tolist()))) > 60
    # Again from the folder, wherever the working folder is: the same scene, the curves as they start.
    saved = open_edit(out)
    session = Session(saved.prepared)
    before = session.picture(0)
    session.slide(("plastic", "specular", "distribution"), sigma=0.4)
    assert not torch.equal(session.picture(0), before)
    assert saved.report["bytes"] == saved.prepared.nbytes
    assert saved.file.settings.triangles == 60


@pytest.mark.slow
def test_the_errors_that_are_said_are_those_of_the_pictures(scene: Path) -> None:
    """Lights and bands: against all pixels under many lights; many triangles leave less than few."""
    from homofact.editing.build import open_edit_scene
    from homofact.editing.errors import light_error
    from homofact.editing.precompute import prepare
    from homofact.editing.scene_file import read_edit_scene

    built = open_edit_scene(read_edit_scene(scene))
    few, many = (light_error(prepare(built, count, "full"))["view 1"] for count in (40, 600))
    assert many < few / 3
    assert 0.01 < few < 0.5


@pytest.mark.slow
def test_a_folder_of_another_state_of_the_scene_is_refused(scene: Path) -> None:
    from homofact.editing.result import open_edit
    from homofact.errors import BadInput

    out = scene.parent / "out"
    assert main(["edit", str(scene), "--out", str(out), "--quiet"]) == 0
    mesh = scene.parent / "ball.obj"
    mesh.write_text(mesh.read_text().replace("v 0.000000 1.000000", "v 0.000000 1.100000"))
    with pytest.raises(BadInput, match=r"edit\.npz: made of another scene, or of another state of it"):
        open_edit(out)
    mesh.unlink()
    with pytest.raises(BadInput, match=r"edit\.json: scene\.object\[0\]\.mesh: no file"):
        open_edit(out)


@pytest.mark.slow
def test_what_is_there_stays_without_force(scene: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = scene.parent / "out"
    run = ["edit", str(scene), "--out", str(out), "--quiet"]
    assert main(run) == 0
    said = capsys.readouterr()
    assert (said.out, said.err) == ("", "")
    before = (out / "edit.npz").read_bytes()
    assert main(run) == 2
    assert "found an existing prepared scene, expected a new folder or --force" in capsys.readouterr().err
    scene.write_text(SCENE.replace("triangles = 60", "triangles = 4"))
    assert main([*run, "--force"]) == 2
    assert "edit.triangles: found 4, expected a whole number from 8 to 100000" in capsys.readouterr().err
    assert (out / "edit.npz").read_bytes() == before
    scene.write_text(SCENE.replace("triangles = 60", "triangles = 30"))
    assert main([*run, "--force"]) == 0
    assert (out / "edit.npz").read_bytes() != before


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ("triangles", "triangle", "edit.triangle: unknown key (nearest: edit.triangles)"),
        ("ball.obj", "bull.obj", "object[0].mesh: no file"),
        ('"material:cook-torrance-plastic"', '"paint.brdf"', "object[0].material: no file"),
        ('name = "plastic"', 'name = " "', "object[0].name: found an empty one, expected a name"),
        ('name = "plastic"', 'curves = "CT"', "object[0].curves: found 'CT', expected own, HF, HD or a list of angles"),
        ('name = "plastic"', 'curves = ["theta"]', "object[0].curves: angle: found 'theta', expected one of theta_h"),
        ('name = "plastic"', "curves = []", "object[0].curves: found 0 angles, expected one, two"),
        ("bands = [64, 32]", "bands = [64, 30]", "object[0].bands: found 30, expected some of 256, 128, 64, 32"),
        ("bands = [64, 32]", "bands = [64]", "object[0]: bands: found 1 numbers, expected 2, one a curve"),
        ("albedo = [0.4]", "albedo = [0.4]\nbands = [64]", "ground: bands: found some for a matt material"),
        ("albedo = [0.4]", 'albedo = [0.4]\nname = "plastic"', "ground: name: found 'plastic' twice"),
        ('named = "studio"', 'environment = "no.hdr"', "lighting.environment: no file"),
        ('named = "studio"', 'environment = "dark.exr"', "dark.exr: every pixel is 0, expected some light"),
        ('named = "studio"', 'named = "sun"\nturn = 90', "lighting.turn: sun is no environment map"),
        ("eye = [0, 1, 4]", "eye = [0, 0, 0]", "camera[0].eye: found the target's place, expected another"),
        ("pixels = [20, 16]", "pixels = [20, 4000]", "camera[0].pixels: found [20, 4000], expected at most 2048"),
        ("eye = [0, 1, 4]", "eye = [0, 1, 4]\ntarget = [0, 1, 8]", "views: found no object in any of them"),
    ],
)
def test_what_is_no_scene_is_refused(
    old: str, new: str, expected: str, scene: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write_exr(scene.parent / "dark.exr", np.zeros((4, 8, 3), np.float32), "RGB")
    assert old in SCENE
    scene.write_text(SCENE.replace(old, new))
    out = scene.parent / "out"
    assert main(["edit", str(scene), "--out", str(out)]) == 2
    error = capsys.readouterr().err
    assert expected in error
    # The note on the light of the ground comes first where the scene was opened.
    assert len([line for line in error.splitlines() if "bounces = 0" not in line]) == 1
    assert not out.exists()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("way", "more", "most"), [("texels", ["--refine", "4"], 0.005), ("texture", [], 0.003)], ids=["texels", "texture"]
)
def test_curves_become_textures_of_the_fit(
    way: str, more: list[str], most: float, fit_scene: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file, out = fit_scene.parent / "curves.json", fit_scene.parent / "edited"
    file.write_text(json.dumps(curves_text()))
    run = ["edit", str(fit_scene), "--apply", str(file), "--out", str(out), "--way", way, *more, "--json"]
    assert main(run) == 0
    record = json.loads(capsys.readouterr().out)
    assert record["way"] == [way]
    assert record["warning"] == ""
    before, after = homofact.load(str(fit_scene.parent / "paint")), homofact.load(str(out))
    assert after.fetches == before.fetches + (way == "texture")
    # The edit itself, looked up here: r(θh) times what was.
    wi, wo = draw_cosine_weighted(4000, torch.Generator().manual_seed(9))
    half = (wi + wo) / (wi + wo).norm(dim=1, keepdim=True)
    gamma = torch.acos(half[:, 2].clamp(-1, 1))
    wanted = (1 + 1.5 * torch.exp(-(((gamma - 0.5) / 0.25) ** 2)))[:, None] * before.evaluate(wi, wo)
    off = float((after.evaluate(wi, wo) - wanted).square().mean().sqrt() / wanted.square().mean().sqrt())
    assert off < most
    # The edited material has the curve in steps, of which `off` knows nothing.
    assert off < record["error"]["edited"] < off + 3e-3
    assert record["error"]["edits"][0]["rms"] == pytest.approx(off, rel=0.4)
    # In the manifest; and no error is measured on the source, which is another material now.
    (kept,) = json.loads((out / "manifest.json").read_text())["provenance"]["edits"]
    assert (kept["angle"], kept["way"]) == ("theta_h", way)
    assert (out / "compare.png").is_file()
    with pytest.raises(NotReopened, match="it is of an edited material"):
        reopen(after)
    assert main(["export", str(out), "--out", str(out.with_name("export")), "--quiet"]) == 0
    assert (out.with_name("export") / "brdf.glsl").is_file()


@pytest.mark.slow
def test_curves_of_what_is_no_fit_are_fitted_anew(
    scene: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    from homofact.brdf.source import open_source
    from homofact.editing import edited_fit
    from homofact.methods.mccool import McCool

    # Of few samples, by a method that searches nothing: what is fitted is looked at here, not how well.
    monkeypatch.setattr(edited_fit, "Search", lambda: McCool(size=8))
    monkeypatch.setattr(edited_fit, "open_source", lambda words: open_source(words, count=4000))
    slot = {"material": "plastic", "term": "diffuse", "curve": "incident", "angle": "theta_i"}
    file, out = scene.parent / "curves.json", scene.parent / "edited"
    file.write_text(json.dumps(curves_text(**slot, values=[[3.0, 3.0, 3.0]] * 256)))
    assert main(["edit", str(scene), "--apply", str(file), "--out", str(out), "--json"]) == 0
    streams = capsys.readouterr()
    record = json.loads(streams.out)
    assert record["warning"] in streams.err
    assert record["way"] == "fitted anew"
    after = homofact.load(str(out))
    # The diffuse part tripled, the highlight as it was.
    model = material("cook-torrance-plastic").model
    assert isinstance(model, CookTorrance)
    wi, wo = draw_cosine_weighted(4000, torch.Generator().manual_seed(9))
    wanted = model.evaluate(wi, wo) + 2 * torch.tensor(model.diffuse, dtype=torch.float64) / np.pi
    found = torch.as_tensor(after.evaluate(wi, wo))
    assert float(found.median()) == pytest.approx(float(wanted.median()), rel=0.25)
    assert float(found.median()) > 2 * float(model.evaluate(wi, wo).median())
    # Three times a red of 0.6 is more light than falls in.
    expected = albedo_of(after).warning()
    assert expected is not None
    assert record["warning"] == expected
    # What is said is what is left of the edited material, by any pairs.
    assert 0.01 < record["error"]["edited"] < 0.6
    assert after.provenance["source"]["edited"][0]["curve"] == "incident"
    with pytest.raises(NotReopened, match="it is of an edited material"):
        reopen(after)


WRONG = [
    ({"values": [[-1.0, 1.0, 1.0]] * 256}, "value 0 of channel 0 is -1.0, expected finite numbers >= 0"),
    ({"values": []}, "curves[0].values: found [], expected rows of 3 numbers"),
    ({"values": [[0.0, 0.0, 0.0]] * 256}, "found a curve that is 0 everywhere"),
    ({"values": [[1.0, 1.0, 1.0]] * 64}, "found a curve of 64 bands of 3 channels, expected 256 of 3"),
    ({"values": [[1.0, 1.0, 1.0]] * 100}, "found values of the shape (100, 3)"),
    ({"values": [[1.0, 1.0]] * 256}, "curves[0].values[0]: found [1.0, 1.0], expected 3 numbers"),
    ({"curve": "phi_h"}, "has no curve 'phi_h', expected one of theta_h, theta_d"),
    ({"term": "coat"}, "has no term 'coat', expected one of whole"),
    ({"angle": "theta_d"}, "curves[0].angle: found \"theta_d\", expected one of theta_h"),
    ({"material": "gold"}, "curves[0].material: found \"gold\", expected one of paint"),
    ({"values": [[1.0, 1.0, 1.0]] * 256}, "curves: all are as the materials start, expected an edit"),
]  # fmt: skip


@pytest.mark.parametrize(("changes", "expected"), WRONG)
def test_curves_that_are_none_are_refused(
    changes: dict[str, Any], expected: str, fit_scene: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file, out = fit_scene.parent / "curves.json", fit_scene.parent / "edited"
    file.write_text(json.dumps(curves_text(**changes)))
    assert main(["edit", str(fit_scene), "--apply", str(file), "--out", str(out)]) == 2
    error = capsys.readouterr().err
    assert expected in error
    assert str(file) in error
    assert error.count("\n") == 1
    assert not out.exists()


def test_curves_that_are_not_a_number_are_refused(fit_scene: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file, out = fit_scene.parent / "curves.json", fit_scene.parent / "edited"
    file.write_text(json.dumps(curves_text(values=[[float("nan"), 1.0, 1.0]] * 256)))
    assert main(["edit", str(fit_scene), "--apply", str(file), "--out", str(out)]) == 2
    error = capsys.readouterr().err
    assert str(file) in error
    assert "NaN" in error or "nan" in error
    assert error.count("\n") == 1
    assert not out.exists()


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (["--way", "texels"], "way: found texels without --apply, expected it with --apply CURVES.json"),
        (["--refine", "2"], "refine: found 2 without --apply"),
        (["--apply", "none.json"], "none.json: no such file, expected edited curves in JSON"),
        (["--apply", "curves.json", "--material", "gold"], "material: found 'gold', expected one of paint"),
        (["--apply", "curves.json", "--way", "paint"], "way: found 'paint', expected one of texels, solve, texture"),
        (["--apply", "curves.json", "--refine", "0"], "refine: found 0, expected 1 to 64"),
        (["--out", "fit.toml"], "found a file, expected a folder for the prepared scene"),
        (["--apply", "curves.json", "--out", "fit.toml"], "found a file, expected a folder for the result"),
    ],
)
def test_arguments_that_are_none(
    arguments: list[str],
    expected: str,
    fit_scene: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(fit_scene.parent)
    Path("curves.json").write_text(json.dumps(curves_text()))
    assert main(["edit", "fit.toml", "--out", "out", *arguments]) == 2
    error = capsys.readouterr().err
    assert expected in error
    assert error.count("\n") == 1
    assert not Path("out").exists()


@pytest.mark.slow
def test_a_folder_that_is_none_is_said(scene: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = scene.parent / "curves.json"
    file.write_text(json.dumps(curves_text()))
    out = scene.parent / "out"
    assert main(["edit", str(scene.parent), "--apply", str(file), "--out", str(out)]) == 2
    assert "found no edit.npz in it, expected a scene that homofact edit prepared" in capsys.readouterr().err
    assert main(["edit", str(scene), "--out", str(out), "--quiet"]) == 0
    assert main(["edit", str(out), "--out", str(out.with_name("again"))]) == 2
    assert "is a prepared scene already, expected a scene in TOML, or curves to apply" in capsys.readouterr().err


def test_one_material_at_a_time(scene: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Curves of two materials need a name; the one that is named is the one that is taken."""
    text = curves_text(material="plastic", term="diffuse", curve="incident", angle="theta_i")
    (entry,) = text["curves"]
    text["curves"].append(entry | {"material": "ground"})
    file, out = scene.parent / "curves.json", scene.parent / "out"
    file.write_text(json.dumps(text))
    assert main(["edit", str(scene), "--apply", str(file), "--out", str(out)]) == 2
    said = capsys.readouterr().err
    assert "curves: of plastic, ground are edited, expected one material" in said
    run = ["edit", str(scene), "--apply", str(file), "--out", str(out), "--material", "plastic", "--way", "texels"]
    assert main(run) == 2
    assert "way: plastic is edited by terms and is fitted anew, expected none" in capsys.readouterr().err
    assert not out.exists()
