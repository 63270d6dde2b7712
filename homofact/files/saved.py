"""Read the file of a saved fit: every array and every entry is checked when it is read."""

import os
from dataclasses import dataclass

from homofact.files.archive import read_archive
from homofact.files.arrays import Arrays
from homofact.files.fields import Fields


@dataclass(frozen=True)
class SavedFit(Arrays):
    """A saved fit: `fields` are the entries of its header, and `floats` and `flags` return its arrays."""

    fields: Fields

    @classmethod
    def read(cls, path: str | os.PathLike[str], form: str, newest: int) -> "SavedFit":
        """Read a file of the format `form` with a version of at most `newest`. Raises BadInput for any other file."""
        arrays, header = read_archive(path)
        fields = Fields(f"{os.fspath(path)}: ", header)
        fields.text("format", (form,))
        fields.version("format_version", newest)
        return cls(os.fspath(path), arrays, fields)
