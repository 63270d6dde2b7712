"""What every writer of BRDF files must do. A new one joins `brdf_files.WRITERS` by how its file is written and read."""

import os
from pathlib import Path

import pytest
from brdf_files import WRITERS, Writer

from homofact.errors import BadInput

EVERY = pytest.mark.parametrize(
    "writer",
    [pytest.param(WRITERS[name], id=name, marks=pytest.mark.slow if name == "speos" else ()) for name in WRITERS],
)


def names(folder: Path) -> list[str]:
    return [path.name for path in folder.iterdir()]


@EVERY
def test_what_was_written_is_read_back(writer: Writer, tmp_path: Path) -> None:
    writer.write(tmp_path / "file", False)
    assert writer.same(writer.read(tmp_path / "file"))
    assert names(tmp_path) == ["file"]
    # The other content is another one, or the comparison says nothing.
    writer.write(tmp_path / "file", True)
    assert not writer.same(writer.read(tmp_path / "file"))
    assert names(tmp_path) == ["file"]


@EVERY
def test_the_same_gives_the_same_bytes(writer: Writer, tmp_path: Path) -> None:
    for name in ("a", "b"):
        writer.write(tmp_path / name, False)
    assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()


@EVERY
@pytest.mark.parametrize("step", ["fsync", "replace"])
@pytest.mark.parametrize("exists", [False, True])
def test_a_failure_leaves_what_was_there(
    writer: Writer, step: str, exists: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "file"
    if exists:
        writer.write(path, True)
    before = {each: each.read_bytes() for each in tmp_path.iterdir()}

    def full(*_args: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, step, full)
    with pytest.raises(BadInput, match="cannot be written") as caught:
        writer.write(path, False)
    monkeypatch.undo()
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)
    assert {each: each.read_bytes() for each in tmp_path.iterdir()} == before


@EVERY
def test_an_unwritable_place_is_one_line(writer: Writer, tmp_path: Path) -> None:
    (tmp_path / "folder").mkdir()
    for path in (tmp_path / "nowhere" / "file", tmp_path / "folder"):
        with pytest.raises(BadInput, match="cannot be written") as caught:
            writer.write(path, False)
        assert str(path) in str(caught.value)
        assert "\n" not in str(caught.value)
    assert names(tmp_path) == ["folder"]
    assert names(tmp_path / "folder") == []
