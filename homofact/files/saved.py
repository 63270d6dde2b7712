"""The one file of a saved fit read with care: every array and every entry is checked where it is taken.

What is read once here is trusted afterwards: shapes agree, numbers are finite and of a size that a BRDF's can have.
"""

import os
from dataclasses import dataclass

import numpy as np

from homofact.errors import BadInput
from homofact.files.archive import read_archive
from homofact.files.fields import Fields

# Beyond this no product or difference of what a fit holds stays finite in float32.
MOST_VALUE = 1e30


@dataclass(frozen=True)
class SavedFit:
    """A saved fit as it was read: its `fields` are the header, each of its arrays is taken by `floats` or `flags`."""

    path: str
    fields: Fields
    _arrays: dict[str, np.ndarray]

    @classmethod
    def read(cls, path: str | os.PathLike[str], form: str, newest: int) -> "SavedFit":
        """A file of the format `form`, at most of the version `newest`. Raises BadInput for any other."""
        arrays, header = read_archive(path)
        fields = Fields(f"{os.fspath(path)}: ", header)
        fields.text("format", (form,))
        fields.version("format_version", newest)
        return cls(os.fspath(path), fields, arrays)

    def __contains__(self, name: str) -> bool:
        """Whether the file has an array of this name."""
        return name in self._arrays

    def floats(self, name: str, shape: tuple[int | None, ...], least: float = -MOST_VALUE) -> np.ndarray:
        """A float64 array of this shape (None: any from 1 on), its numbers from `least` to `MOST_VALUE`."""
        array = self._shaped(name, shape, "f")
        # A copy in this machine's order of bytes, and without a signalling NaN's warning.
        with np.errstate(invalid="ignore", over="ignore"):
            values = array.astype(np.float64)
            sound = (values >= least) & (values <= MOST_VALUE)
        if not sound.all():
            found = float(values[~sound].reshape(-1)[0])
            wanted = f"numbers from {least:g} to {MOST_VALUE:g}"
            raise BadInput(f"{name} holds {found:g}", where=self.path, expected=wanted)
        return values

    def flags(self, name: str, shape: tuple[int | None, ...]) -> np.ndarray:
        """An array of booleans of this shape."""
        array = self._shaped(name, shape, "b")
        # Any byte but 0 counts as True, but not alike everywhere.
        return array.view(np.uint8) != 0

    def _shaped(self, name: str, shape: tuple[int | None, ...], kind: str) -> np.ndarray:
        array = self._arrays.get(name)
        if array is None:
            raise BadInput(f"holds no {name}", where=self.path, expected="what save wrote")
        fits = array.ndim == len(shape) and all(
            side > 0 and wanted in (None, side) for side, wanted in zip(array.shape, shape, strict=True)
        )
        if not fits or array.dtype.kind != kind:
            words = ", ".join("any" if side is None else str(side) for side in shape)
            raise BadInput(
                f"{name} is {array.dtype} of shape {array.shape}",
                where=self.path,
                expected=f"{('floats' if kind == 'f' else 'booleans')} of shape ({words})",
            )
        return array
