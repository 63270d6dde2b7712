"""A prepared scene in its file: it comes back as it was, of its own scene only, and whole."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from damages import array_damages, header_damages
from editing.scenes import PAINT, on_the_floor, prepared_paint

from homofact.editing import models, store
from homofact.editing.curves import banded, flat
from homofact.editing.page.build import write_edit_page
from homofact.editing.precompute import prepare
from homofact.editing.scene import PreparedScene
from homofact.editing.session import Session
from homofact.editing.store import digest_of, read_prepared, write_prepared
from homofact.errors import BadInput
from homofact.files.archive import read_archive, write_archive
from homofact.scene.lighting import named_lighting

TRIANGLES = 200


@pytest.fixture(scope="module")
def stored(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, PreparedScene]:
    place = tmp_path_factory.mktemp("stored") / "editing.npz"
    prepared = prepared_paint("low-rank")
    write_prepared(place, prepared, TRIANGLES)
    return place, prepared


def test_what_was_prepared_comes_back(stored: tuple[Path, PreparedScene]) -> None:
    place, prepared = stored
    again = read_prepared(place, on_the_floor(models.cook_torrance(PAINT, "paint", (64, 32))))
    before, after = Session(prepared), Session(again)
    for view in (0, 1):
        assert torch.equal(before.picture(view), after.picture(view))
    for session in (before, after):
        session.slide(("paint", "specular", "distribution"), sigma=0.4)
        session.set({("floor", "diffuse", "outgoing"): banded(flat(3, 0.5), 256)})
    assert torch.equal(before.picture(1), after.picture(1))
    assert again.nbytes == prepared.nbytes
    assert again.lights.count == prepared.lights.count


def test_another_scene_is_refused(stored: tuple[Path, PreparedScene]) -> None:
    place, prepared = stored
    scene = prepared.scene
    ball, floor = scene.objects
    moved = replace(ball, mesh=replace(ball.mesh, positions=ball.mesh.positions + 0.1))
    wider = replace(ball, material=models.cook_torrance(replace(PAINT, roughness=0.3), "paint", (64, 32)))
    redder = models.cook_torrance(replace(PAINT, specular=(0.7, 0.6, 0.7)), "paint", (64, 32))
    for other in (
        replace(scene, objects=(moved, floor)),
        replace(scene, objects=(wider, floor)),
        replace(scene, objects=(replace(ball, material=redder), floor)),
        replace(scene, objects=(ball, replace(floor, patterns={}))),
        replace(scene, lighting=named_lighting("studio")),
        replace(scene, cameras=(replace(scene.cameras[0], field=41.0), scene.cameras[1])),
    ):
        assert digest_of(other, TRIANGLES) != digest_of(scene, TRIANGLES)
        with pytest.raises(BadInput, match="made of another scene, or of another state of it, expected this one"):
            read_prepared(place, other)


def test_damage_is_named(stored: tuple[Path, PreparedScene], tmp_path: Path) -> None:
    place, prepared = stored
    broken = tmp_path / "broken.npz"
    broken.write_bytes(place.read_bytes()[:-2000])
    with pytest.raises(BadInput, match="a damaged archive"):
        read_prepared(broken, prepared.scene)
    arrays, header = read_archive(place)
    arrays.pop("header")
    for change, words in (
        (
            {"part_1_coefficients_codes": np.zeros((2, 3, 4), np.int16)},
            r"part_1_coefficients_codes is int16 of shape \(2, 3, 4\)",
        ),
        ({"part_1_outward_codes": np.zeros((6, 1, 4))}, "part_1_outward_codes is float64"),
        ({"part_0_rows": None}, "holds no part_0_rows"),
    ):
        left = {name: value for name, value in {**arrays, **change}.items() if value is not None}
        write_archive(broken, header, left)
        with pytest.raises(BadInput, match=words):
            read_prepared(broken, prepared.scene)
    write_archive(broken, {**header, "format_version": 2}, arrays)
    with pytest.raises(BadInput, match=r"broken\.npz: of an earlier homofact, expected format version 3 \(prepare it"):
        read_prepared(broken, prepared.scene)
    write_archive(broken, {**header, "format": "x"}, arrays)
    with pytest.raises(BadInput, match="format: found"):
        read_prepared(broken, prepared.scene)


@pytest.mark.slow
def test_a_damaged_scene_is_refused_in_a_line_or_shown(stored: tuple[Path, PreparedScene], tmp_path: Path) -> None:
    """Every array of a view and of a part, and every entry of the header, damaged in every way."""
    place, prepared = stored
    arrays, header = read_archive(place)
    arrays.pop("header")
    # The smallest part alone, so that a thousand archives are quickly written.
    header["parts"] = header["parts"][2:3]
    arrays = {
        name.replace("part_2", "part_0"): each for name, each in arrays.items() if name.startswith(("view", "part_2"))
    }
    file, shown = tmp_path / "edit.npz", 0
    damages = [(what, header, each) for what, each in array_damages(arrays)]
    damages += [(what, each, arrays) for what, each in header_damages(header)]
    digest = digest_of(prepared.scene, TRIANGLES)
    for what, head, each in damages:
        np.savez(file, allow_pickle=False, header=np.array(json.dumps(head)), **each)
        problem = ""
        try:
            with pytest.MonkeyPatch.context() as patch:
                # What a scene's digest is takes a while.
                patch.setattr(store, "digest_of", lambda *_: digest)
                opened = read_prepared(file, prepared.scene)
            shown += 1
            if shown % 20 == 1:
                write_edit_page(tmp_path / "page.html", opened, title="a scene")
        except BadInput as error:
            problem = str(error) if "\n" in str(error) or "edit.npz" not in str(error) else ""
        except Exception as error:
            problem = repr(error)
        assert not problem, what
    assert shown < len(damages) / 4


def test_full_transports_are_not_stored(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="found transports in full, expected them at low rank"):
        write_prepared(tmp_path / "x.npz", prepared_paint("full"), TRIANGLES)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_equal_scenes_have_equal_files(tmp_path: Path) -> None:
    scene = on_the_floor(models.from_reflectance(PAINT, ("theta_h",), "paint", (64,)))
    for name in ("a.npz", "b.npz"):
        write_prepared(tmp_path / name, prepare(scene, 20), 20)
    assert (tmp_path / "a.npz").read_bytes() == (tmp_path / "b.npz").read_bytes()
