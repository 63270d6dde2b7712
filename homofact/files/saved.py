"""The one file of a saved fit read with care: every array and every entry is checked where it is taken."""

import os
from dataclasses import dataclass

from homofact.files.archive import read_archive
from homofact.files.arrays import Arrays
from homofact.files.fields import Fields


@dataclass(frozen=True)
class SavedFit(Arrays):
    """A saved fit as it was read: its `fields` are the header, each of its arrays is taken by `floats` or `flags`."""

    fields: Fields

    @classmethod
    def read(cls, path: str | os.PathLike[str], form: str, newest: int) -> "SavedFit":
        """Return a file of the format `form`, at most of the version `newest`. Raises BadInput for any other."""
        arrays, header = read_archive(path)
        fields = Fields(f"{os.fspath(path)}: ", header)
        fields.text("format", (form,))
        fields.version("format_version", newest)
        return cls(os.fspath(path), arrays, fields)
