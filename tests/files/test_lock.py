"""One run at a time, and what a killed one leaves: claims end with their process, and the next write cleans up."""

import errno
import os
import signal
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from homofact.errors import BadInput
from homofact.files import lock as locks
from homofact.files.atomic import write_text
from homofact.files.folder import check_new_folder, write_folder
from homofact.files.kinds import RESULT
from homofact.files.lock import claimed
from homofact.files.private import NEW, PREVIOUS, private_folder

HOLD = """
import sys, time
from pathlib import Path
from homofact.files.lock import claimed
from homofact.files.private import private_folder
with claimed(sys.argv[1]), private_folder(Path(sys.argv[1])) as folder:
    (folder / "half").write_text("half")
    print("held", flush=True)
    time.sleep(60)
"""


def holder(place: Path) -> subprocess.Popen[str]:
    run = subprocess.Popen([sys.executable, "-c", HOLD, str(place)], stdout=subprocess.PIPE, text=True)
    assert run.stdout is not None
    assert run.stdout.readline() == "held\n"
    return run


def names(folder: Path) -> list[str]:
    return sorted(entry.name for entry in folder.iterdir())


def test_another_process_is_refused_until_the_first_has_ended(tmp_path: Path) -> None:
    place = tmp_path / "deep" / "out"
    run = holder(place)
    try:
        with pytest.raises(BadInput, match=rf"out: another run of homofact \(process {run.pid}\) writes there"):
            write_folder(place, RESULT, lambda _: None)
        with claimed(tmp_path / "deep" / "other"):
            pass
        # A living run's files are left alone.
        write_text(tmp_path / "deep" / "a.txt", "a")
        assert any(name.startswith(".partial-") for name in names(tmp_path / "deep"))
    finally:
        run.send_signal(signal.SIGKILL)
        run.communicate()
    with claimed(place):
        assert names(tmp_path / "deep")[-1] == "a.txt"
    write_text(tmp_path / "deep" / "a.txt", "b")
    assert names(tmp_path / "deep") == ["a.txt"]


def test_the_same_process_may_claim_again_and_leaves_nothing(tmp_path: Path) -> None:
    place = tmp_path / "deep" / "er" / "out"
    with claimed(place):
        with claimed(place):
            assert names(place.parent) != []
        assert names(place.parent) != []
    assert names(tmp_path) == []
    claims = [claimed(tmp_path / "out") for _ in range(8)]
    threads = [threading.Thread(target=lambda claim=claim: claim.__enter__()) for claim in claims]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    for claim in claims:
        claim.__exit__(None, None, None)
    assert names(tmp_path) == []


def test_a_system_without_locks_refuses_and_cleans_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(locks, "fcntl", None)
    (tmp_path / ".partial-of-someone").mkdir()
    with claimed(tmp_path / "out"):
        write_text(tmp_path / "out", "a")
    assert names(tmp_path) == [".partial-of-someone", "out"]


def test_a_claim_in_a_closed_place_is_refused() -> None:
    with pytest.raises(BadInput, match="cannot be written"), claimed("/proc/homofact/out"):
        pass


def test_planted_links_are_not_followed(tmp_path: Path) -> None:
    mine = tmp_path / "mine"
    mine.mkdir()
    (mine / "thesis.tex").write_text("years of work")
    place = tmp_path / "place"
    place.mkdir()
    (place / ".partial-planted").symlink_to(mine)
    (place / ".partial-file").write_text("a file")
    with private_folder(place / "out"):
        pass
    assert names(place) == [".partial-file", ".partial-planted"]
    with claimed(place / "out"):
        lock = next(each for each in place.iterdir() if each.name.endswith(".lock"))
    lock.symlink_to(mine / "thesis.tex")
    with pytest.raises(BadInput, match="cannot be written"), claimed(place / "out"):
        pass
    assert (mine / "thesis.tex").read_text() == "years of work"


def dead(parent: Path, where: str, name: str) -> Path:
    folder = parent / ".partial-dead" / where / name
    folder.mkdir(parents=True)
    (folder / RESULT.mark).write_text("dead")
    return folder


def test_what_a_dead_run_moved_aside_is_put_back(tmp_path: Path) -> None:
    dead(tmp_path, PREVIOUS, "out")
    dead(tmp_path, NEW, "other")
    with pytest.raises(BadInput, match="found an existing result"):
        check_new_folder(tmp_path / "out", RESULT, False)
    assert names(tmp_path) == ["out"]
    assert (tmp_path / "out" / RESULT.mark).read_text() == "dead"


def test_what_a_dead_run_replaced_is_deleted_but_for_what_is_not_ours(tmp_path: Path) -> None:
    old = dead(tmp_path, PREVIOUS, "out")
    (old / "thesis.tex").write_text("years of work")
    (old / "notes").mkdir()
    (tmp_path / "out" / "notes").mkdir(parents=True)
    write_text(tmp_path / "a", "a")
    assert names(tmp_path / "out") == ["notes", "thesis.tex"]
    # Its place is taken: it stays where it is.
    assert names(tmp_path) == [".partial-dead", "a", "out"]
    (tmp_path / "out" / "notes").rmdir()
    write_text(tmp_path / "a", "a")
    assert names(tmp_path) == ["a", "out"]


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() != 0, reason="only root may give files away")
def test_other_users_folders_are_left_alone(tmp_path: Path) -> None:
    (tmp_path / ".partial-other").mkdir()
    os.chown(tmp_path / ".partial-other", 12345, -1)
    write_text(tmp_path / "a", "a")
    assert names(tmp_path) == [".partial-other", "a"]


@pytest.mark.parametrize("again", [False, True])
def test_a_lock_on_a_file_that_is_gone_by_then_is_none(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, again: bool
) -> None:
    """The one who had it deletes it between the opening and the lock: two could hold a lock on one name."""
    place, flock = tmp_path / "a.lock", locks.fcntl.flock

    def deleted_meanwhile(handle: int, how: int) -> None:
        place.unlink(missing_ok=True)
        if again:
            place.touch()
        flock(handle, how)

    monkeypatch.setattr(locks.fcntl, "flock", deleted_meanwhile)
    assert locks.lock(place, os.O_RDWR | os.O_CREAT) is None
    monkeypatch.undo()
    handle = locks.lock(place, os.O_RDWR | os.O_CREAT)
    assert handle is not None
    os.close(handle)


def test_a_file_system_without_locks_refuses_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def unsupported(*_: object) -> None:
        raise OSError(errno.ENOLCK, "No locks available")

    monkeypatch.setattr(locks.fcntl, "flock", unsupported)
    (tmp_path / ".partial-of-someone").mkdir()
    with claimed(tmp_path / "out"):
        write_text(tmp_path / "out", "a")
    assert {".partial-of-someone", "out"} <= set(names(tmp_path))
    assert (tmp_path / "out").read_text() == "a"
