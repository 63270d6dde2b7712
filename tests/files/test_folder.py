"""One way to write a folder: whole or not at all. What a failure leaves of a result: tests/exporting/test_result.py."""

import errno
import os
from pathlib import Path

import pytest

from homofact.errors import BadInput
from homofact.files import folder as folders
from homofact.files.folder import check_new_folder, write_folder
from homofact.files.kinds import FolderKind

KIND = FolderKind("result", "manifest.json")


def fill(text: str):
    def write(place: Path) -> None:
        (place / "manifest.json").write_text(text)

    return write


def content(place: Path) -> dict[str, str]:
    return {str(path.relative_to(place)): path.read_text() for path in place.rglob("*") if path.is_file()}


@pytest.fixture(params=[True, False], ids=["exchange", "two renames"])
def exchanging(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> bool:
    if not request.param:
        monkeypatch.setattr(folders, "exchange", lambda *_: False)
    return request.param


@pytest.mark.usefixtures("exchanging")
def test_a_folder_is_made_and_replaced_with_its_permissions(tmp_path: Path) -> None:
    target = tmp_path / "deep" / "out"
    write_folder(target, KIND, fill("one"))
    target.chmod(0o750)
    (target / "texture_9.png").write_text("of the first")
    (target / "left over").write_text("somebody's")
    (target / "link").symlink_to("/nowhere")
    os.mkfifo(target / "pipe")
    write_folder(target, KIND, fill("two"), force=True)
    assert sorted(entry.name for entry in target.iterdir()) == ["left over", "link", "manifest.json", "pipe"]
    assert (target / "manifest.json").read_text() == "two"
    assert target.stat().st_mode & 0o777 == 0o750
    assert [entry.name for entry in target.parent.iterdir()] == ["out"]


def test_without_force_nothing_is_replaced(tmp_path: Path) -> None:
    write_folder(tmp_path / "out", KIND, fill("one"))
    with pytest.raises(BadInput, match=r"existing result.*kept in .*out-new"):
        write_folder(tmp_path / "out", KIND, fill("two"))
    with pytest.raises(BadInput, match=r"kept in .*out-1-new"):
        write_folder(tmp_path / "out", KIND, fill("three"))
    found = {"out/manifest.json": "one", "out-new/manifest.json": "two", "out-1-new/manifest.json": "three"}
    assert content(tmp_path) == found


@pytest.mark.usefixtures("exchanging")
def test_a_link_to_a_folder_stays_one(tmp_path: Path) -> None:
    (tmp_path / "real").mkdir()
    (tmp_path / "link").symlink_to("real")
    for text in ("one", "two"):
        write_folder(tmp_path / "link", KIND, fill(text), force=True)
        assert (tmp_path / "link").is_symlink()
        assert content(tmp_path / "real") == {"manifest.json": text}


def test_an_older_folder_that_cannot_be_put_back_is_not_deleted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    target, rename = tmp_path / "out", os.rename
    write_folder(target, KIND, fill("old"))
    monkeypatch.setattr(folders, "exchange", lambda *_: False)

    def never_there(source: Path, place: Path) -> None:
        if Path(place) == target:
            raise OSError(errno.ENOTEMPTY if target.exists() else errno.EIO, "in the way")
        rename(source, place)

    monkeypatch.setattr(folders.os, "rename", never_there)
    with pytest.raises(BadInput, match="in the way"):
        write_folder(target, KIND, fill("new"), force=True)
    assert "old" in content(tmp_path).values()
    monkeypatch.undo()
    # The next who asks for it there puts it back.
    check_new_folder(target, KIND, True)
    assert content(target) == {"manifest.json": "old"}


def test_everything_is_on_the_disk_before_the_folder_has_its_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    flushed: list[str] = []

    def flush(place: Path) -> None:
        flushed.append(place.name)
        assert (tmp_path / "out").exists() == (place == tmp_path)

    monkeypatch.setattr(folders, "flush", flush)
    write_folder(tmp_path / "out", KIND, fill("one"))
    assert flushed == ["manifest.json", "out", tmp_path.name]


def test_where_no_folder_can_go_is_said_beforehand(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("mine")
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "mine.txt").write_text("mine")
    (tmp_path / "ours").mkdir()
    (tmp_path / "ours" / KIND.mark).touch()
    for name, force, found in (
        ("file", True, "found a file, expected a folder for the result"),
        ("other", True, "found mine.txt in it and no result"),
        ("ours", False, "found an existing result"),
        ("file/below", True, "is not a folder"),
    ):
        with pytest.raises(BadInput, match=found):
            check_new_folder(tmp_path / name, KIND, force)
    check_new_folder(tmp_path / "ours", KIND, True)
    check_new_folder(tmp_path / "new" / "deep", KIND, False)
