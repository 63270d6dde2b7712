"""One way to write a folder: whole or not at all. What a failure leaves of a result: tests/export/test_result.py."""

import os
from pathlib import Path

import pytest

from homofact.errors import BadInput
from homofact.files import folder as folders
from homofact.files.folder import check_new_folder, write_folder


def fill(text: str):
    def write(place: Path) -> None:
        (place / "inner").mkdir()
        (place / "inner" / "a.txt").write_text(text)

    return write


def content(place: Path) -> dict[str, str]:
    return {str(path.relative_to(place)): path.read_text() for path in place.rglob("*") if path.is_file()}


def test_a_folder_is_made_and_replaced_with_its_permissions(tmp_path: Path) -> None:
    target = tmp_path / "deep" / "out"
    write_folder(target, fill("one"))
    target.chmod(0o750)
    (target / "left over").write_text("of the first")
    write_folder(target, fill("two"))
    assert content(target) == {"inner/a.txt": "two"}
    assert target.stat().st_mode & 0o777 == 0o750
    assert [entry.name for entry in target.parent.iterdir()] == ["out"]


def test_a_link_to_a_folder_stays_one(tmp_path: Path) -> None:
    (tmp_path / "real").mkdir()
    (tmp_path / "link").symlink_to("real")
    write_folder(tmp_path / "link", fill("one"))
    assert (tmp_path / "link").is_symlink()
    assert content(tmp_path / "real") == {"inner/a.txt": "one"}


def test_an_older_folder_that_cannot_be_put_back_is_not_deleted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    target, rename = tmp_path / "out", os.rename
    write_folder(target, fill("old"))

    def only_away(source: Path, place: Path) -> None:
        if Path(source) != target:
            raise OSError(5, "Input/output error")
        rename(source, place)

    monkeypatch.setattr(folders.os, "rename", only_away)
    with pytest.raises(BadInput, match="Input/output error"):
        write_folder(target, fill("new"))
    assert [content(place) for place in tmp_path.iterdir()] == [{"inner/a.txt": "old"}]


def test_everything_is_on_the_disk_before_the_folder_has_its_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    flushed: list[str] = []

    def flush(place: Path) -> None:
        flushed.append(place.name)
        assert (tmp_path / "out").exists() == (place == tmp_path)

    monkeypatch.setattr(folders, "flush", flush)
    write_folder(tmp_path / "out", fill("one"))
    assert sorted(flushed[:-2]) == ["a.txt", "inner"]
    assert flushed[-2:] == ["new", tmp_path.name]


def test_where_no_folder_can_go_is_said_beforehand(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("mine")
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "mine.txt").write_text("mine")
    (tmp_path / "ours").mkdir()
    (tmp_path / "ours" / "mark").touch()
    for name, force, found in (
        ("file", True, "found a file, expected a folder for the result"),
        ("other", True, "found mine.txt in it and no result"),
        ("ours", False, "found an existing result"),
        ("file/below", True, "is not a folder"),
    ):
        with pytest.raises(BadInput, match=found):
            check_new_folder(tmp_path / name, "result", "mark", force)
    check_new_folder(tmp_path / "ours", "result", "mark", True)
    check_new_folder(tmp_path / "new" / "deep", "result", "mark", False)
