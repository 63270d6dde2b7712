"""Read and write BRDF files, with one module per format. The reader is chosen by the content of a file, never by its
name.
"""

import os
from types import ModuleType

from homofact.brdf.channels import check_channels
from homofact.brdf.formats import (
    alta,
    astm,
    cornell,
    csv,
    curet,
    mdl,
    merl,
    nbrdf,
    npz,
    pabopto,
    rgl,
    speos,
    utia,
    window,
    zemax,
)
from homofact.brdf.formats.hints import hint_of
from homofact.brdf.formats.reading import Drawing, Reading
from homofact.brdf.samples import Samples
from homofact.errors import BadInput
from homofact.files.reading import read_bytes, split_member
from homofact.files.text import beginning

# Every reader is a module with NAME, DESCRIPTION, sniff(head) and read(path, channels), or open_file(path, channels,
# drawing) where the file is a reflectance by itself. The first that knows the head has the file; a
# format without a header has SIZES, and gets a file of such a size that no head is known of.
READERS: tuple[ModuleType, ...] = (
    nbrdf, npz, rgl, mdl, merl, window, speos, zemax, pabopto, alta, astm, csv, curet, cornell, utia,
)  # fmt: skip
_HEAD = 65_536


def open_file(path: str | os.PathLike[str], channels: str = "rgb", drawing: Drawing | None = None) -> Reading:
    """Read a file of any known format in `channels` "rgb", "spectral" or "luminance"; FILE#NAME selects a material.

    `drawing` sets how a reflectance that is defined everywhere is sampled. Raises BadInput for a missing, unreadable or
    empty file, for a folder, and for content of no known format. The message names what a table of text lacks, or else
    lists the formats. The reader of the format may raise further errors.
    """
    check_channels(channels)
    file, member = split_member(path)
    # Of a missing "a#b" the name as it was given is what helps.
    raw = read_bytes(file if os.path.exists(file) else path, "a BRDF file or material:NAME")
    head, size = raw[:_HEAD], len(raw)
    del raw
    for reader in _readers_of(head, size):
        if member is not None and not hasattr(reader, "material_names"):
            raise BadInput(f"{reader.NAME} files hold one material", where=path, expected=f"no #{member}")
        return read_by(reader, path, channels, drawing)
    if str(file).lower().endswith(".toml"):
        raise BadInput(
            "a TOML file",
            where=file,
            expected="a BRDF file or material:NAME",
            hint="`homofact info` names what reads it",
        )
    if hint := hint_of(head):
        raise BadInput(hint, where=file)
    known = "; ".join(f"{reader.NAME}: {reader.DESCRIPTION}" for reader in READERS)
    raise BadInput(
        f"content of no known format (begins with {beginning(head)})", where=file, expected=f"one of: {known}"
    )


def format_of(path: str | os.PathLike[str]) -> str | None:
    """Return the name of a file's format, detected from its first bytes; None if no reader recognises it.

    Raises BadInput as `read_bytes`.
    """
    raw = read_bytes(path, "a BRDF file", may_be_empty=True)
    return next((reader.NAME for reader in _readers_of(raw[:_HEAD], len(raw))), None)


def _readers_of(head: bytes, size: int) -> list[ModuleType]:
    """The readers that know a file by its head, or, where none does, by its size."""
    known_heads = [reader for reader in READERS if reader.sniff(head)]
    return known_heads or [reader for reader in READERS if size in getattr(reader, "SIZES", ())]


def read_by(
    reader: ModuleType, path: str | os.PathLike[str], channels: str = "rgb", drawing: Drawing | None = None
) -> Reading:
    """Read a file with one of `READERS`.

    Raises the errors of the reader; errors about invalid samples also name the file.
    """
    try:
        if hasattr(reader, "open_file"):
            return reader.open_file(path, channels, drawing)
        return Reading(reader.read(path, channels))
    except BadInput as error:
        # Samples do not know whose they are.
        raise (error.at(path) if error.where.startswith("samples") else error) from error


def read_samples(path: str | os.PathLike[str], channels: str = "rgb") -> Samples:
    """Return only the samples of `open_file`. Raises the same errors."""
    return open_file(path, channels).samples
