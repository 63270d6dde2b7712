"""Result folders: all or nothing, whatever step fails, and the older result unharmed."""

import json
import os
from pathlib import Path

import numpy as np
import pytest
import torch

from homofact.brdf.log_transform import LogTransform
from homofact.errors import BadInput
from homofact.exporting import result
from homofact.exporting.result import open_result, write_result
from homofact.factor.factorization import Factorization, Term
from homofact.factor.projection import fixed_projection
from homofact.files import folder as folders
from homofact.files import private
from homofact.files.folder import check_new_folder
from homofact.files.kinds import RESULT

CONTENTS = {
    "factorization.npz",
    "manifest.json",
    "report.json",
    "texture_0.exr",
    "texture_0.png",
    "texture_1.exr",
    "texture_1.png",
    "compare.png",
}


def fitted(level=0.0):
    square = Term(
        fixed_projection("h", True), torch.full((4, 4, 3), level).double(), torch.ones(4, 4, dtype=torch.bool)
    )
    line = Term(fixed_projection("theta_d", True), torch.zeros(1, 8, 3).double(), torch.ones(1, 8, dtype=torch.bool))
    return Factorization((square, line), LogTransform(1e-5, torch.ones(3).double()), ("R", "G", "B"))


def picture(folder):
    (folder / "compare.png").write_bytes(b"picture")


def write(folder, level=0.0, **more):
    write_result(folder, factorization=fitted(level), report={"level": level}, **{"pictures": picture, **more})


def snapshot(folder):
    return {path.relative_to(folder): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def test_contents_and_reading_back(tmp_path):
    write(tmp_path / "deep" / "out", 0.25)
    assert {path.name for path in (tmp_path / "deep" / "out").iterdir()} == CONTENTS
    assert [path.name for path in (tmp_path / "deep").iterdir()] == ["out"]
    for place in (tmp_path / "deep" / "out", tmp_path / "deep" / "out" / "factorization.npz"):
        assert np.array_equal(open_result(place).terms[0].texture, fitted(0.25).terms[0].texture)
    assert json.loads((tmp_path / "deep" / "out" / "report.json").read_text()) == {"level": 0.25}
    files = json.loads((tmp_path / "deep" / "out" / "manifest.json").read_text())["textures"][1]["files"]
    assert files == {"exr": "texture_1.exr", "png": "texture_1.png"}


def test_force_replaces_what_is_ours(tmp_path):
    out = tmp_path / "out"
    write(out)
    (out / "texture_7.exr").write_text("of an older one with more textures")
    (out / "notes.txt").write_text("not homofact's")
    (out / "drafts").mkdir()
    (out / "drafts" / "texture_0.png").write_text("neither")
    with pytest.raises(BadInput, match="existing result, expected a new folder or `force=True`"):
        write(out, 1.0)
    assert json.loads((out / "report.json").read_text()) == {"level": 0.0}
    write(out, 1.0, force=True)
    assert json.loads((out / "report.json").read_text()) == {"level": 1.0}
    assert {path.name for path in out.iterdir()} == {*CONTENTS, "notes.txt", "drafts"}
    assert (out / "notes.txt").read_text() == "not homofact's"
    assert (out / "drafts" / "texture_0.png").read_text() == "neither"
    assert [path.name for path in tmp_path.iterdir()] == ["out"]


def test_an_empty_folder_will_do(tmp_path):
    (tmp_path / "out").mkdir()
    write(tmp_path / "out")
    assert {path.name for path in (tmp_path / "out").iterdir()} == CONTENTS


@pytest.mark.parametrize("force", [False, True])
def test_a_folder_that_is_no_result_is_never_deleted(tmp_path, force):
    (tmp_path / "thesis.tex").write_text("years of work")
    with pytest.raises(BadInput, match=r"thesis\.tex in it and no result"):
        write(tmp_path, force=force)
    assert (tmp_path / "thesis.tex").read_text() == "years of work"


def test_a_file_in_the_way(tmp_path):
    (tmp_path / "out").write_text("a file")
    with pytest.raises(BadInput, match="found a file, expected a folder"):
        write(tmp_path / "out", force=True)
    with pytest.raises(BadInput, match="is not a folder"):
        write(tmp_path / "out" / "below")
    assert [path.name for path in tmp_path.iterdir()] == ["out"]


def test_an_unwritable_place(tmp_path, monkeypatch):
    (tmp_path / "locked").mkdir(mode=0o500)
    honest = os.access
    # Permissions do not bind every user who runs the tests.
    monkeypatch.setattr(result.os, "access", lambda path, mode: honest(path, mode) and path.name != "locked")
    with pytest.raises(BadInput, match="locked is not writable"):
        check_new_folder(tmp_path / "locked" / "out", RESULT, force=False)
    with pytest.raises(BadInput, match="locked is not writable"):
        write(tmp_path / "locked" / "deep" / "out")
    assert not list((tmp_path / "locked").iterdir())


class Failure(Exception):
    """Raised on purpose."""


def _fail(*_args, **_more):
    raise Failure


def _full(*_args, **_more):
    raise OSError(28, "No space left on device")


def _interrupt(*_args, **_more):
    raise KeyboardInterrupt


STEPS = ["write_textures", "manifest", "write_json"]


@pytest.mark.parametrize("exists", [False, True])
@pytest.mark.parametrize(("fail", "error"), [(_fail, Failure), (_full, BadInput), (_interrupt, KeyboardInterrupt)])
@pytest.mark.parametrize("step", [*STEPS, "pictures", "save", "rename", "exchange"])
def test_failure_at_any_step_leaves_everything_as_it_was(tmp_path, monkeypatch, step, fail, error, exists):
    """But for the fit alone, once it is saved, and the whole new folder, once it is made."""
    out = tmp_path / "deep" / "out"
    if exists:
        write(out)
    before = snapshot(tmp_path)
    places = {path for path in tmp_path.rglob("*") if path.is_dir()}
    pictures = picture
    kept = {Path("deep/out.npz")}
    if step == "pictures":

        def pictures(folder):
            picture(folder)
            fail()

    elif step == "save":
        kept = set()
        monkeypatch.setattr(Factorization, "save", fail)
    elif step in ("exchange", "rename"):
        kept = {Path("deep/out-new") / name for name in CONTENTS}
        honest = os.rename

        def rename(source, target):
            # The move of the finished folder to an empty place fails, the moves of the older one do not.
            if Path(target) == out and Path(source).parent.name == "new" and not out.exists():
                fail()
            honest(source, target)

        monkeypatch.setattr(folders.os, "rename", rename)
        monkeypatch.setattr(folders, "exchange", fail if step == "exchange" else lambda *_: False)
    else:
        module = "images" if step == "write_textures" else "manifest"
        monkeypatch.setattr(f"homofact.exporting.{module}.{step}", fail)
    with pytest.raises(error) as caught:
        write(out, 1.0, force=True, pictures=pictures)
    if error is KeyboardInterrupt:
        kept = set()
    if error is BadInput:
        assert "No space left" in str(caught.value)
        assert "\n" not in str(caught.value)
        assert not kept or f"kept in {tmp_path / 'deep' / 'out'}" in str(caught.value)
    after = snapshot(tmp_path)
    assert set(after) - set(before) == kept
    assert {name: after[name] for name in before} == before
    if kept:
        monkeypatch.undo()
        place = tmp_path / min(kept)
        fit = open_result(place if place.suffix == ".npz" else place.parent)
        assert np.array_equal(fit.terms[0].texture, fitted(1.0).terms[0].texture)
    # The folders above stay where something came into them.
    found = {path for path in tmp_path.rglob("*") if path.is_dir()} - {tmp_path / "deep" / "out-new"}
    assert found == places | ({tmp_path / "deep"} if kept else set())


def test_an_old_result_that_cannot_be_deleted_does_not_undo_the_new(tmp_path, monkeypatch):
    out = tmp_path / "out"
    write(out)
    monkeypatch.setattr(private.shutil, "rmtree", lambda *_, **__: None)
    write(out, 1.0, force=True)
    assert json.loads((out / "report.json").read_text()) == {"level": 1.0}


def test_what_comes_while_the_pictures_are_drawn_is_not_replaced(tmp_path):
    out = tmp_path / "out"

    def pictures(folder):
        picture(folder)
        out.mkdir()
        (out / "thesis.tex").write_text("years of work")

    with pytest.raises(BadInput, match=r"out: found thesis\.tex in it and no result.*kept in .*out-new"):
        write(out, pictures=pictures)
    assert snapshot(out) == {Path("thesis.tex"): b"years of work"}
    assert np.array_equal(open_result(tmp_path / "out-new").terms[0].texture, fitted().terms[0].texture)


def test_opening_what_is_no_result(tmp_path):
    with pytest.raises(BadInput, match=r"found no factorization\.npz"):
        open_result(tmp_path)
    with pytest.raises(BadInput, match="no such file"):
        open_result(tmp_path / "none")
