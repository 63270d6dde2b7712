"""The folder of a relit scene: everything comes back, and damaged files are refused."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from damages import array_damages, header_damages
from relighting.ball_scene import PLANNED, TEXT, read
from relighting_cases import light

from homofact.errors import BadInput
from homofact.files.archive import read_archive, write_archive
from homofact.relighting.build import RelightScene, open_relight_scene, relit_objects
from homofact.relighting.cube import environment_cube
from homofact.relighting.harmonic import Harmonic
from homofact.relighting.page.relit_page import write_relit_page
from homofact.relighting.relight import Relit
from homofact.relighting.result import RelightResult, open_relit
from homofact.scene.cameras import Camera
from homofact.scene.folders import picture_names

pytestmark = pytest.mark.usefixtures("decomposed_once")


@pytest.mark.parametrize(
    ("given", "written"),
    [
        (["A", None, "b c"], ["a", "2", "b-c"]),
        (["left", "Left", None], ["1", "2", "3"]),
        (["2", None], ["1", "2"]),
        (["§", "../x"], ["1", "x"]),
    ],
)
def test_pictures_have_the_names_of_their_cameras(given: list[str | None], written: list[str]) -> None:
    cameras = [Camera((0.0, 0.0, 3.0), name=name) for name in given]
    assert picture_names(cameras) == [f"picture_{word}.png" for word in written]


def test_a_folder_holds_everything_and_comes_back(ready: RelightScene, tmp_path: Path) -> None:
    objects = relit_objects(ready)
    shown = np.full((4, 5, 3), 77, np.uint8)
    cameras = (*ready.file.cameras, Camera((1.0, 2.0, 3.0), (0.1, 0.2, 0.3), 33.0, (31, 17), "Front view"))
    scene = replace(ready.file, cameras=cameras)
    reference = [np.full((len(each.mesh.positions), 3), number + 0.5) for number, each in enumerate(objects)]
    reference[1][3] = np.nan
    RelightResult.of(scene, objects, {"bytes": 7}, [shown, shown], reference).save(tmp_path / "out")
    names = sorted(each.name for each in (tmp_path / "out").iterdir())
    assert names == ["picture_1.png", "picture_front-view.png", "relight.json", "relight.npz"]
    found = open_relit(tmp_path / "out")
    assert found.report == {"bytes": 7}
    assert found.cameras == cameras
    assert found.sky.name == ready.file.light.name
    assert found.sky.cube == pytest.approx(environment_cube(ready.file.light, 8), rel=1e-3, abs=1e-3)
    assert found.reference is not None
    for before, after in zip(reference, found.reference, strict=True):
        assert np.array_equal(after, before, equal_nan=True)
    for before, after in zip(objects, found.objects, strict=True):
        assert after.material == before.material
        assert after.transport.factors.energy == before.transport.factors.energy
        assert after.transport.factors.channels == before.transport.factors.channels
        assert after.transport.settings == before.transport.settings
        assert after.mesh.name == before.mesh.name
        for name in ("positions", "normals", "triangles"):
            assert np.array_equal(getattr(after.mesh, name), getattr(before.mesh, name))
        assert (after.lit(light(8)).tuples == before.lit(light(8)).tuples).all()
        mine, theirs = Relit(before.transport), Relit(after.transport)
        mine.relight(light(8))
        theirs.relight(light(8))
        assert (mine.shade((0, 1, 3)) == theirs.shade((0, 1, 3))).all()
    with pytest.raises(BadInput, match="found an existing relit scene, expected a new folder or `force=True`"):
        RelightResult.of(ready.file, objects, {}).save(tmp_path / "out")
    assert [each.name for each in tmp_path.iterdir() if not each.name.startswith(".")] == ["out"]
    assert open_relit(tmp_path / "out").report == {"bytes": 7}


def test_pictures_of_earlier_cameras_go_and_a_person_s_files_stay(ready: RelightScene, tmp_path: Path) -> None:
    objects, shown, out = relit_objects(ready), np.full((4, 5, 3), 77, np.uint8), tmp_path / "out"
    for name in ("left", "right"):
        file = replace(ready.file, cameras=(Camera((1.0, 2.0, 3.0), name=name),))
        RelightResult.of(file, objects, {}, [shown]).save(out, force=True)
        (out / "notes.png").write_bytes(b"mine")
    names = sorted(each.name for each in out.iterdir())
    assert names == ["notes.png", "picture_right.png", "relight.json", "relight.npz"]


@pytest.mark.slow
def test_a_planned_scene_keeps_its_forms_in_the_folder(tmp_path: Path) -> None:
    """An overcast sky over matt things: nine numbers a vertex, there and back."""
    scene = read(tmp_path, PLANNED.replace("studio", "overcast").replace("0.1", "0.03"))
    assert scene.reflected == 0.03
    made = open_relight_scene(scene)
    objects = relit_objects(made)
    RelightResult.of(scene, objects, {}).save(tmp_path / "out")
    saved = open_relit(tmp_path / "out")
    for each, plan, back in zip(objects, made.plans, saved.objects, strict=True):
        assert isinstance(each.compact, Harmonic)
        assert isinstance(back.compact, Harmonic)
        assert each.compact.order == plan.chosen.order
        assert back.transport.settings.tolerance == plan.chosen.tolerance
        assert back.form == each.form == plan.chosen.form
        assert (back.lit(light(8)).tuples == each.lit(light(8)).tuples).all()
        assert each.nbytes == plan.chosen.bytes
    size = write_relit_page(tmp_path / "page.html", saved)
    page = (tmp_path / "page.html").read_text()
    assert size == (tmp_path / "page.html").stat().st_size
    # The scene's own sky is a built-in one: it is there once.
    assert [page.count(f'"name":"{name}"') for name in ("overcast", "studio", "uniform")] == [1, 1, 1]
    file = tmp_path / "out" / "relight.npz"
    arrays, header = read_archive(file)
    name = "object_0_harmonic_number"
    for numbers in (arrays[name][:2], arrays[name][:, :, :3]):
        write_archive(file, header, arrays | {name: numbers})
        with pytest.raises(BadInput, match=name):
            open_relit(tmp_path / "out")


def test_files_that_are_none_are_refused(ready: RelightScene, tmp_path: Path) -> None:
    RelightResult.of(ready.file, relit_objects(ready), {}).save(tmp_path / "out")
    file = tmp_path / "out" / "relight.npz"
    whole = file.read_bytes()
    file.write_bytes(whole[:2000])
    with pytest.raises(BadInput, match=r"relight\.npz"):
        open_relit(tmp_path / "out")
    file.write_bytes(whole)
    arrays, header = read_archive(file)
    arrays.pop("header")
    # What a compiled loop would read past the end of.
    for name, bad in (("object_0_index", 384), ("object_0_basis_index", 500)):
        spoiled = arrays | {name: np.full_like(arrays[name], bad)}
        write_archive(file, header, spoiled)
        with pytest.raises(BadInput, match=rf"{name} holds {bad}, expected numbers from 0 to 383"):
            open_relit(tmp_path / "out")
    write_archive(file, header, arrays | {"object_0_start": arrays["object_0_start"][:-1]})
    with pytest.raises(BadInput, match="object_0_start is int64 of shape"):
        open_relit(tmp_path / "out")
    late, short = arrays["object_1_start"].copy(), arrays["object_0_cluster"].copy()
    late[0] = 1
    short[2] = 60000
    fewer = arrays["object_0_frames"][:-1]
    for name, other in (("object_1_start", late), ("object_0_cluster", short), ("object_0_frames", fewer)):
        write_archive(file, header, arrays | {name: other})
        with pytest.raises(BadInput, match=name):
            open_relit(tmp_path / "out")
    write_archive(file, header, {name: each for name, each in arrays.items() if name != "object_1_scale"})
    with pytest.raises(BadInput, match="holds no object_1_scale"):
        open_relit(tmp_path / "out")
    write_archive(file, header | {"version": 9}, arrays)
    with pytest.raises(BadInput, match="format version 9, expected at most 8"):
        open_relit(tmp_path / "out")


def small_scene(folder: Path, text: str) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
    """The archive of a scene with a report and a reference: (arrays, header)."""
    corners = [f"v {x} {y} {z}" for x in (0, 1) for y in (0, 1) for z in (0, 1)]
    sides = ("1 2 4 3", "5 7 8 6", "1 5 6 2", "3 4 8 7", "1 3 7 5", "2 6 8 4")
    (folder / "box.obj").write_text("\n".join([*corners, *(f"f {side}" for side in sides)]) + "\n")
    text = text.replace("shape:sphere", "box.obj").replace("steps = 6", "steps = 2")
    file = read(folder, text)
    objects = relit_objects(open_relight_scene(file))
    reference = [np.full((len(each.mesh.positions), 3), 0.5) for each in objects]
    own = {
        "mesh": "sphere",
        "material": "albedo 0.5",
        "vertices": 9,
        "terms": 1,
        "bytes": 7,
        "error": {"together": 0.1},
    }
    report = {"objects": [own | {"coefficients_per_vector": 3.5}]}
    RelightResult.of(file, objects, report, (), reference).save(folder / "out")
    arrays, header = read_archive(folder / "out" / "relight.npz")
    arrays.pop("header")
    return arrays, header


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["clusters", "harmonics", "neither"])
def test_a_damaged_scene_is_refused_in_a_line_or_shown(kind: str, tmp_path: Path) -> None:
    """Every array and every entry of the header, each damaged in every way."""
    text = {
        "clusters": TEXT,
        "harmonics": PLANNED.replace("studio", "overcast").replace("0.1", "0.03"),
        "neither": TEXT.replace("clusters = 2\ncomponents = 3\n", ""),
    }[kind]
    arrays, header = small_scene(tmp_path, text)
    file, shown = tmp_path / "out" / "relight.npz", 0
    damages = [(what, header, each) for what, each in array_damages(arrays)]
    damages += [(what, each, arrays) for what, each in header_damages(header)] if kind == "clusters" else []
    for what, head, each in damages:
        np.savez(file, allow_pickle=False, header=np.array(json.dumps(head)), **each)
        problem = ""
        try:
            opened = open_relit(tmp_path / "out")
            shown += 1
            for thing in opened.objects:
                problem = (
                    "" if np.isfinite(thing.lit(light(thing.transport.settings.cube)).tuples).all() else "no number"
                )
            # A page takes a while: of every twelfth.
            if shown % 12 == 1:
                write_relit_page(tmp_path / "page.html", opened)
        except BadInput as error:
            problem = str(error) if "\n" in str(error) or "relight.npz" not in str(error) else ""
        except Exception as error:
            problem = repr(error)
        assert not problem, what
    assert shown < len(damages) / 4
