"""One reader of .npz that believes nothing, one writer whose bytes are fixed, and the file that a fit is saved in."""

import io
import json
import zipfile
from pathlib import Path

import numpy as np
import pytest
from refusals import refused

from homofact.errors import BadInput
from homofact.files.archive import read_archive, read_arrays, write_archive, write_arrays
from homofact.files.fields import Fields

ARRAYS = {
    "plain": np.arange(6.0).reshape(2, 3),
    "fortran": np.asfortranarray(np.arange(6, dtype=np.float32).reshape(3, 2)),
    "mask": np.array([[True, False]]),
    "words": np.array(["R", "é"]),
    "number": np.array(7),
    "none": np.zeros((0, 3)),
}


def test_arrays_come_back_as_they_were_and_may_be_changed(tmp_path: Path) -> None:
    path = tmp_path / "a"
    write_arrays(path, ARRAYS)
    found = read_arrays(path, path.read_bytes(), [*ARRAYS, "absent"], "arrays")
    assert found.keys() == ARRAYS.keys()
    for name, array in ARRAYS.items():
        np.testing.assert_array_equal(found[name], array)
        assert found[name].dtype == array.dtype
        assert found[name].flags.writeable
    with np.load(path) as theirs:
        np.testing.assert_array_equal(theirs["fortran"], ARRAYS["fortran"])


def test_the_same_arrays_give_the_same_bytes(tmp_path: Path) -> None:
    write_arrays(tmp_path / "a", ARRAYS)
    write_arrays(tmp_path / "b", ARRAYS)
    assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()


def test_what_numpy_saved_is_read(tmp_path: Path) -> None:
    """Fits of version 0.1.0 were written by numpy.savez."""
    path = tmp_path / "a.npz"
    header = {"format": "homofact factorization", "format_version": 1}
    np.savez(path, plain=ARRAYS["plain"], mask=ARRAYS["mask"], header=np.array(json.dumps(header)))
    arrays, found = read_archive(path)
    assert found == header
    np.testing.assert_array_equal(arrays["plain"], ARRAYS["plain"])


def packed(member: bytes) -> bytes:
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        archive.writestr("a.npy", member)
    return buffer.getvalue()


def member_of(array: np.ndarray, allow_pickle: bool = False) -> bytes:
    buffer = io.BytesIO()
    np.lib.format.write_array(buffer, array, allow_pickle=allow_pickle)
    return buffer.getvalue()


@pytest.mark.parametrize(
    ("raw", "found"),
    [
        (b"nothing", "File is not a zip file"),
        (packed(b"no array"), "a is no numpy array"),
        (packed(member_of(np.array([{}], dtype=object), allow_pickle=True)), "a is no plain array"),
        (packed(member_of(np.zeros(3)).replace(b"(3,)", b"(9,)")), r"a has 24 bytes, expected \(9,\) of float64"),
        (packed(member_of(np.zeros(3))[:-1]), "a has 23 bytes"),
        (packed(member_of(np.zeros(3, dtype="U1"))[:-1] + b"\x7f"), "a holds what is no text"),
    ],
)
def test_what_is_no_plain_archive_is_refused(raw: bytes, found: str) -> None:
    with pytest.raises(BadInput, match=rf"x\.npz: a damaged archive \(.*{found}.*\), expected arrays"):
        read_arrays("x.npz", raw, ["a"], "arrays")


def test_a_small_file_that_unpacks_to_much_is_refused() -> None:
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("a.npy", member_of(np.zeros(10_000_000)))
    with pytest.raises(BadInput, match="unpacks to 80000128 bytes, too many for a file of"):
        read_arrays("x.npz", buffer.getvalue(), ["a"], "arrays")


@pytest.mark.parametrize(
    ("arrays", "found"),
    [
        ({"a": np.zeros(2)}, "holds no header"),
        ({"header": np.zeros(2)}, "holds no header"),
        ({"header": np.array("{")}, "header is not JSON"),
        ({"header": np.array("[1]")}, "header is a JSON list, expected an object"),
    ],
)
def test_a_fit_without_a_header_is_refused(tmp_path: Path, arrays: dict[str, np.ndarray], found: str) -> None:
    path = tmp_path / "f.npz"
    write_arrays(path, arrays)
    with pytest.raises(BadInput, match=rf"f\.npz: not a saved factorization: {found}"):
        read_archive(path)


def test_a_version_to_come_is_refused_by_name(tmp_path: Path) -> None:
    path = tmp_path / "f.npz"
    write_archive(path, {"format_version": 3}, {})
    fields = Fields("f.npz: ", read_archive(path)[1])
    fields.version("format_version", 3)
    with refused(r"f\.npz: format version 3, expected at most 2 \(update homofact\)"):
        fields.version("format_version", 2)
    for version in (-5, 0, True, "3", None, 2.0):
        with refused(where="f.npz: format_version"):
            Fields("f.npz: ", {"format_version": version}).version("format_version", 3)
