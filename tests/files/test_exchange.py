"""Two names exchanged in one step, and what is said where the system cannot, or something is in the way."""

import ctypes
import errno
from pathlib import Path

import pytest

from homofact.files import exchange as exchanges
from homofact.files.exchange import exchange


def failing(number: int):
    def function(*_: object) -> int:
        ctypes.set_errno(number)
        return -1

    return lambda: function


def test_both_names_stand_for_the_other(tmp_path: Path) -> None:
    one, other = tmp_path / "one", tmp_path / "other"
    one.mkdir()
    (one / "inside").touch()
    other.write_text("a file")
    assert exchange(one, other)
    assert one.read_text() == "a file"
    assert [each.name for each in other.iterdir()] == ["inside"]


@pytest.mark.parametrize("number", [errno.ENOSYS, errno.EINVAL, errno.EPERM])
def test_a_system_that_cannot_says_so_and_changes_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, number: int
) -> None:
    monkeypatch.setattr(exchanges, "_renameat2", failing(number))
    assert exchange(tmp_path / "one", tmp_path / "other") is False
    monkeypatch.setattr(exchanges, "_renameat2", lambda: None)
    assert exchange(tmp_path / "one", tmp_path / "other") is False


def test_what_is_in_the_way_is_no_lack_of_the_system(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "one").touch()
    with pytest.raises(FileNotFoundError):
        exchange(tmp_path / "one", tmp_path / "other")
    monkeypatch.setattr(exchanges, "_renameat2", failing(errno.EIO))
    with pytest.raises(OSError, match="one"):
        exchange(tmp_path / "one", tmp_path / "other")
