"""Reading a file whole: what is wrong with it is said in one line, beside what was expected."""

import os
from pathlib import Path

import pytest

from homofact.errors import BadInput
from homofact.files.reading import read_bytes, read_json, read_toml, split_member


def test_what_cannot_be_read_is_named_with_what_was_expected(tmp_path: Path) -> None:
    (tmp_path / "empty").touch()
    for path, found in (
        (tmp_path / "gone", "no such file"),
        (tmp_path, "a folder"),
        (tmp_path / "empty", "the file is empty"),
        (tmp_path / ("x" * 300), r"cannot be read \(File name too long\)"),
        ("a\0b", r"cannot be read \(embedded null byte\)"),
        (tmp_path / "empty" / "below", r"cannot be read \(Not a directory\)"),
    ):
        with pytest.raises(BadInput, match=f"{found}, expected a PNG file$"):
            read_bytes(path, "a PNG file")
    assert read_bytes(tmp_path / "empty", "a PNG file", may_be_empty=True) == b""


@pytest.mark.skipif(os.geteuid() == 0, reason="root reads everything")
def test_a_closed_file(tmp_path: Path) -> None:
    path = tmp_path / "secret"
    path.write_bytes(b"x")
    path.chmod(0)
    with pytest.raises(BadInput, match=r"cannot be read \(Permission denied\), expected a PNG file"):
        read_bytes(path, "a PNG file")


def test_json_and_toml(tmp_path: Path) -> None:
    path = tmp_path / "a"
    path.write_text('{"é": [1, 2]}', encoding="utf-8")
    assert read_json(path, "a manifest") == {"é": [1, 2]}
    path.write_bytes(b"# only a comment\r\n[a]\r\nb = 1\r\n")
    assert read_toml(path, "a scene") == {"a": {"b": 1}}
    path.write_bytes(b"")
    assert read_toml(path, "a scene") == {}


@pytest.mark.parametrize(
    ("data", "found"),
    [
        (b"[1]", r"found \[1\], expected a manifest"),
        (b"{", r"not JSON \(.*\), expected a manifest"),
        (b"\xff", "not JSON"),
        (b"[" * 100_000, "not JSON"),
        (b"[" + b"1, " * 100 + b"1]", r"found \[1, .*\.\.\., expected"),
    ],
)
def test_what_is_no_json_object(tmp_path: Path, data: bytes, found: str) -> None:
    (tmp_path / "a").write_bytes(data)
    with pytest.raises(BadInput, match=f"a: {found}"):
        read_json(tmp_path / "a", "a manifest")


@pytest.mark.parametrize("data", [b"[a", b"\xff\xfe", b"a = 1\na = 2\n", b"a = " + b"[" * 100_000])
def test_what_is_no_toml(tmp_path: Path, data: bytes) -> None:
    (tmp_path / "a").write_bytes(data)
    with pytest.raises(BadInput, match="a: not TOML: ") as caught:
        read_toml(tmp_path / "a", "a scene")
    assert "\n" not in str(caught.value)


def test_a_member_of_a_file(tmp_path: Path) -> None:
    assert split_member("a/b#c") == ("a/b", "c")
    assert split_member("a#b#c") == ("a#b", "c")
    assert split_member("plain") == ("plain", None)
    assert split_member("#c") == ("#c", None)
    (tmp_path / "x#1").touch()
    assert split_member(tmp_path / "x#1") == (str(tmp_path / "x#1"), None)
