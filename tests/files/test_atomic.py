"""One way to write a file: whole or not at all, whatever fails, whoever else writes, whatever is there."""

import os
import threading
from collections.abc import Callable
from pathlib import Path

import pytest

from homofact.errors import BadInput
from homofact.files import atomic
from homofact.files.atomic import replace_file, write_bytes, write_text


def names(folder: Path) -> list[str]:
    return sorted(entry.name for entry in folder.iterdir())


def test_a_file_is_made_and_replaced(tmp_path: Path) -> None:
    path = tmp_path / "a.txt"
    write_text(path, "π\r\n")
    assert path.read_bytes() == "π\r\n".encode()
    write_bytes(path, b"two")
    assert path.read_bytes() == b"two"
    assert names(tmp_path) == ["a.txt"]


def test_the_one_who_writes_sees_the_files_own_name(tmp_path: Path) -> None:
    """numpy appends .npz to other names, and picture libraries go by the ending."""
    seen = []

    def write(place: Path) -> None:
        seen.append(place.name)
        place.write_bytes(b"x")

    long = "n" * 240 + ".tar.gz"
    replace_file(tmp_path / long, write)
    assert seen == [long]
    assert names(tmp_path) == [long]


class Failure(Exception):
    pass


@pytest.mark.parametrize("error", [Failure("no"), KeyboardInterrupt(), OSError(28, "No space left on device")])
@pytest.mark.parametrize("older", [True, False])
def test_a_failure_leaves_the_old_file_and_nothing_beside_it(tmp_path: Path, error: BaseException, older: bool) -> None:
    path = tmp_path / "a.txt"
    if older:
        path.write_text("old")

    def half(place: Path) -> None:
        place.write_text("half")
        place.with_suffix(".index").write_text("what some libraries leave beside")
        raise error

    expected = BadInput if isinstance(error, OSError) else type(error)
    with pytest.raises(expected) as caught:
        replace_file(path, half)
    if isinstance(error, OSError):
        assert str(caught.value) == f"{path}: cannot be written (No space left on device), expected a writable place"
    assert names(tmp_path) == (["a.txt"] if older else [])
    assert not older or path.read_text() == "old"


@pytest.mark.parametrize("step", ["replace", "fsync"])
def test_a_system_that_fails_late_leaves_the_old_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, step: str
) -> None:
    path = tmp_path / "a.txt"
    path.write_text("old")

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, step, full)
    with pytest.raises(BadInput, match=r"a\.txt: cannot be written \(No space left on device\)"):
        write_text(path, "new")
    assert path.read_text() == "old"
    assert names(tmp_path) == ["a.txt"]


def test_a_file_system_without_fsync_is_written_all_the_same(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def unsupported(_: int) -> None:
        raise OSError(22, "Invalid argument")

    monkeypatch.setattr(os, "fsync", unsupported)
    write_text(tmp_path / "a.txt", "new")
    assert (tmp_path / "a.txt").read_text() == "new"


def test_the_bytes_are_on_the_disk_before_the_name_points_to_them(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    steps: list[str] = []
    fsync, replace = os.fsync, os.replace

    def flushed(handle: int) -> None:
        steps.append("file" if os.path.isfile(f"/proc/self/fd/{handle}") else "folder")
        fsync(handle)

    def renamed(source: Path, target: Path) -> None:
        steps.append("rename")
        replace(source, target)

    monkeypatch.setattr(atomic.os, "fsync", flushed)
    monkeypatch.setattr(atomic.os, "replace", renamed)
    write_text(tmp_path / "a.txt", "new")
    assert steps == ["file", "rename", "folder"]


def test_writers_of_one_place_do_not_collide(tmp_path: Path) -> None:
    """Each sees only its own unfinished file; the last to end wins."""
    path, both_there, places = tmp_path / "a.txt", threading.Barrier(2, timeout=20), []

    def writer(word: str) -> Callable[[], None]:
        def write(place: Path) -> None:
            place.write_text(word)
            places.append(place)
            both_there.wait()
            place.write_text(place.read_text() + word)

        return lambda: replace_file(path, write)

    threads = [threading.Thread(target=writer(word)) for word in ("one", "two")]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(set(places)) == 2
    assert path.read_text() in ("oneone", "twotwo")
    assert names(tmp_path) == ["a.txt"]


def test_a_symbolic_link_stays_one(tmp_path: Path) -> None:
    (tmp_path / "far").mkdir()
    real, link = tmp_path / "far" / "real.txt", tmp_path / "link.txt"
    link.symlink_to(Path("far") / "real.txt")
    # Dangling at first, then to a file that is there.
    for text in ("one", "two"):
        write_text(link, text)
        assert link.is_symlink()
        assert real.read_text() == text
    assert (names(tmp_path), names(real.parent)) == (["far", "link.txt"], ["real.txt"])


def test_links_in_a_circle_are_refused(tmp_path: Path) -> None:
    (tmp_path / "a").symlink_to("b")
    (tmp_path / "b").symlink_to("a")
    with pytest.raises(BadInput, match=r"a: cannot be written .*leads back to itself"):
        write_text(tmp_path / "a", "x")
    assert (tmp_path / "a").is_symlink()


def test_the_permissions_of_an_existing_file_are_kept(tmp_path: Path) -> None:
    path, mask = tmp_path / "a.sh", os.umask(0o027)
    try:
        write_text(path, "one")
        assert path.stat().st_mode & 0o777 == 0o640
        for mode in (0o755, 0o600, 0o444):
            path.chmod(mode)
            write_text(path, f"{mode}")
            assert path.stat().st_mode & 0o777 == mode
    finally:
        os.umask(mask)


def test_what_is_no_file_is_refused(tmp_path: Path) -> None:
    (tmp_path / "folder").mkdir()
    os.mkfifo(tmp_path / "pipe")
    for name, found in (("folder", "a folder is there"), ("pipe", "what is there is no file")):
        with pytest.raises(BadInput, match=rf"{name}: cannot be written \({found}\), expected a writable place"):
            write_text(tmp_path / name, "x")
    for path in (tmp_path / "none" / "a", tmp_path / ("x" * 300), "/proc/a", "a\0b"):
        with pytest.raises(BadInput, match="cannot be written"):
            write_text(path, "x")
    assert names(tmp_path) == ["folder", "pipe"]
    assert names(tmp_path / "folder") == []


@pytest.mark.parametrize("links", [True, False])
def test_a_new_file_replaces_nothing_that_came_meanwhile(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, links: bool
) -> None:
    def unsupported(*_: object) -> None:
        raise OSError(1, "Operation not permitted")

    if not links:
        monkeypatch.setattr(atomic.os, "link", unsupported)
    path = tmp_path / "a.txt"

    def write(made: Path) -> None:
        made.write_text("new")
        path.write_text("mine")

    with pytest.raises(BadInput, match=r"a\.txt: cannot be written \(File exists\)"):
        replace_file(path, write, new=True)
    assert path.read_text() == "mine"
    path.unlink()
    write_bytes(path, b"new", new=True)
    assert path.read_text() == "new"
    assert names(tmp_path) == ["a.txt"]
