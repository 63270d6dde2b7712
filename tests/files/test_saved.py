"""A saved fit's arrays and version, each refused in one line where it is not what was saved."""

import math
from pathlib import Path

import numpy as np
import pytest
from refusals import refused

from homofact.files.archive import write_archive
from homofact.files.arrays import MOST_VALUE
from homofact.files.saved import SavedFit


def saved(folder: Path, header: dict | None = None, **arrays: np.ndarray) -> SavedFit:
    write_archive(folder / "a.npz", {"format": "fit", "format_version": 2} | (header or {}), arrays)
    return SavedFit.read(folder / "a.npz", "fit", 2)


@pytest.mark.parametrize("value", [-1e-9, 2 * MOST_VALUE, math.nan, math.inf, -math.inf])
def test_numbers_that_cannot_be_are_refused(tmp_path: Path, value: float) -> None:
    fit = saved(tmp_path, a=np.array([1.0, 0.0, value]))
    with refused(where="a.npz"):
        fit.floats("a", (3,), least=0)


def test_the_ends_of_the_range_belong_to_it(tmp_path: Path) -> None:
    fit = saved(tmp_path, a=np.array([0, MOST_VALUE]), b=np.array([[-MOST_VALUE]]).astype(">f8"))
    assert fit.floats("a", (None,), least=0).tolist() == pytest.approx([0, MOST_VALUE])
    assert fit.floats("b", (1, None)).tolist() == [[-MOST_VALUE]]


@pytest.mark.parametrize(
    ("array", "shape"),
    [
        (np.zeros((0, 3)), (None, 3)),
        (np.zeros((2, 0)), (2, 0)),
        (np.zeros(3), (2,)),
        (np.zeros((2, 2)), (None,)),
        (np.zeros(2, np.int64), (2,)),
        (np.zeros(2, np.complex128).view(np.float64).astype("U4"), (4,)),
        (np.zeros(2, bool), (2,)),
    ],
)
def test_other_shapes_and_types_are_refused(tmp_path: Path, array: np.ndarray, shape: tuple) -> None:
    with refused(where="a.npz"):
        saved(tmp_path, a=array).floats("a", shape)


def test_flags_are_booleans_and_any_byte_but_0_is_true(tmp_path: Path) -> None:
    odd = np.array([0, 1, 2, 255], np.uint8).view(bool)
    assert saved(tmp_path, a=odd).flags("a", (4,)).tolist() == [False, True, True, True]
    with refused(where="a.npz"):
        saved(tmp_path, a=np.zeros(4, np.uint8)).flags("a", (4,))


def test_what_is_missing_newer_or_another_format_is_refused(tmp_path: Path) -> None:
    with refused(where="a.npz"):
        saved(tmp_path, a=np.zeros(1)).floats("b", (1,))
    for header, words in (
        ({"format_version": 3}, "format version 3, expected at most 2"),
        ({"format_version": 0}, "format_version"),
        ({"format": "poem"}, "format"),
    ):
        with refused(words):
            saved(tmp_path, header)
