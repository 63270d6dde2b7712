"""Reading a file whole: what is wrong with it is said in one line, beside what was expected."""

import os
from pathlib import Path

import pytest
from refusals import refused

from homofact.errors import BadInput
from homofact.files.reading import check_readable, read_bytes, read_json, read_toml, split_member


def test_what_cannot_be_read_is_named_with_what_was_expected(tmp_path: Path) -> None:
    (tmp_path / "empty").touch()
    for path, found in (
        (tmp_path / "gone", "no such file"),
        (tmp_path, "a folder"),
        (tmp_path / "empty", "the file is empty"),
        (tmp_path / ("x" * 300), r"cannot be read \(File name too long\)"),
        ("a\0b", r"cannot be read \(.*embedded null .*\)"),
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


def test_what_is_no_file_is_refused_without_waiting(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    for place in (tmp_path / "pipe", Path("/dev/zero"), Path("/dev/full")):
        for read in (read_bytes, read_toml, read_json, check_readable):
            with pytest.raises(BadInput, match=r"cannot be read \(a pipe or a device\), expected a file"):
                read(place, "a file")


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("[" * 5000 + "]" * 5000, "nested deeper than 100"),
        ('{"a":' * 101 + "1" + "}" * 101, "nested deeper than 100"),
        (f'{{"a": {"9" * 400}}}', "a number of 400 digits"),
        (f'{{"a": {"9" * 5000}}}', "a number of 5000 digits"),
    ],
    ids=["very deep", "deep", "long", "longer"],
)
def test_json_that_nobody_means_is_refused(text: str, expected: str, tmp_path: Path) -> None:
    (tmp_path / "a.json").write_text(text)
    with pytest.raises(BadInput, match=rf"a\.json: not JSON \({expected}\), expected a file"):
        read_json(tmp_path / "a.json", "a file")


def test_toml_that_would_take_for_ever_is_refused(tmp_path: Path) -> None:
    for text in (
        ".".join(["a"] * 50_000) + " = 1",
        "[" + ".".join(["a"] * 50_000) + "]",
        "x = {" + "a." * 500 + "b = 1}",
    ):
        (tmp_path / "a.toml").write_text(f"seed = 0\n{text}\n")
        with refused(where="a.toml: line 2", found="more than 100 dots between commas"):
            read_toml(tmp_path / "a.toml", "a file")
    (tmp_path / "a.toml").write_text("x = [" + ", ".join(["0.5"] * 5000) + "]\n")
    assert len(read_toml(tmp_path / "a.toml", "a file")["x"]) == 5000
    (tmp_path / "a.toml").write_text("x = 1\n" * 200_000)
    with refused(where="a.toml", found="1200000 bytes"):
        read_toml(tmp_path / "a.toml", "a file")
