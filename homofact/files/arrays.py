"""Arrays of an archive: each is checked when it is read, as `fields.Fields` checks a header's entries.

Later code does not check these arrays again: their shapes agree, their numbers are finite, and their indices into other
arrays are valid.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np

from homofact.errors import BadInput

# Beyond this no product or difference of what a fit holds stays finite in float32.
MOST_VALUE = 1e30
# A side of any length, none too; None is any from 1 on.
ANY: Final = -1
# What is written in float32 is off by as much at most.
_ROUNDED = 1e-3
Shape = tuple[int | None, ...]


@dataclass(frozen=True)
class Arrays:
    """The arrays of an archive, which messages call `path`."""

    path: str
    _arrays: Mapping[str, np.ndarray]

    def __contains__(self, name: str) -> bool:
        """Whether the file has an array of this name."""
        return name in self._arrays

    def floats(self, name: str, shape: Shape, least: float = -MOST_VALUE) -> np.ndarray:
        """Return an array of floats of this shape as float64, with numbers from `least` to `MOST_VALUE`."""
        # A copy in this machine's order of bytes, and without a signalling NaN's warning.
        with np.errstate(invalid="ignore", over="ignore"):
            values = self._shaped(name, shape, "f").astype(np.float64)
        self._bounded(name, values, least, MOST_VALUE)
        return values

    def flags(self, name: str, shape: Shape) -> np.ndarray:
        """Return an array of booleans of this shape."""
        # Any byte but 0 counts as True, but not alike everywhere.
        return self._shaped(name, shape, "b").view(np.uint8) != 0

    def stored(
        self,
        name: str,
        dtype: type,
        shape: Shape,
        least: float = -MOST_VALUE,
        most: float = MOST_VALUE,
        gaps: bool = False,
    ) -> np.ndarray:
        """Return an array of this type and shape, with numbers from `least` to `most` or, with `gaps`, NaN."""
        wanted = np.dtype(dtype)
        values = self._shaped(name, shape, wanted.kind, empty=True)
        if values.dtype != wanted:
            raise BadInput(f"{name} is of {values.dtype}", where=self.path, expected=f"{wanted}")
        self._bounded(name, values, least, most, gaps)
        return values

    def rotations(self, name: str, dtype: type, count: int) -> np.ndarray:
        """Return `count` rotations (count, 3, 3) of exactly this type, right-handed with orthonormal rows."""
        found = self.stored(name, dtype, (count, 3, 3), -2, 2)
        apart = np.abs(found @ found.transpose(0, 2, 1) - np.eye(3)).max((1, 2), initial=0.0)
        if not ((apart < _ROUNDED) & (np.linalg.det(found.astype(np.float64)) > 0)).all():
            raise BadInput(f"{name} holds what is no rotation", where=self.path, expected="rows at right angles")
        return found

    def _bounded(self, name: str, values: np.ndarray, least: float, most: float, gaps: bool = False) -> None:
        with np.errstate(invalid="ignore"):
            sound = (values >= least) & (values <= most)
            if gaps:
                sound |= np.isnan(values)
        if not sound.all():
            found = values[~sound].reshape(-1)[0].item()
            raise BadInput(f"{name} holds {found:g}", where=self.path, expected=f"numbers from {least:g} to {most:g}")

    def _shaped(self, name: str, shape: Shape, kind: str, empty: bool = False) -> np.ndarray:
        """An array of a kind and a shape; a side that is 0 as it should be is one only where arrays may be `empty`."""
        array = self._arrays.get(name)
        if array is None:
            raise BadInput(f"holds no {name}", where=self.path, expected="what save wrote")
        fits = array.ndim == len(shape) and all(
            (wanted in (ANY, side) and (side > 0 or empty)) or (wanted is None and side > 0)
            for side, wanted in zip(array.shape, shape, strict=True)
        )
        if not fits or array.dtype.kind != kind:
            words = ", ".join("any" if side in (None, ANY) else str(side) for side in shape)
            kinds = {"f": "floats", "b": "booleans", "i": "whole numbers", "u": "whole numbers"}
            raise BadInput(
                f"{name} is {array.dtype} of shape {array.shape}",
                where=self.path,
                expected=f"{kinds[kind]} of shape ({words})",
            )
        return array
