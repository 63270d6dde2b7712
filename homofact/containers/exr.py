"""EXR pictures: 32-bit float or 16-bit half channels in one part, written losslessly packed, and read back."""

import contextlib
import io
import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from homofact.containers.pixels import finite_pixels, whole_shape
from homofact.errors import BadInput
from homofact.files import extras
from homofact.files.atomic import replace_file
from homofact.files.reading import read_bytes
from homofact.files.words import harmless

_LONGEST_NAME = 255  # bytes, of up to four a letter


def exr_channel_names(channels: Sequence[str]) -> tuple[str, ...]:
    """Return the names of the channels in an EXR: Y for a single channel, else their own names.

    EXR readers treat the text before a full stop as the name of a layer, so 400.5nm becomes 400,5nm. A name that is too
    long for the file becomes the channel's number and the beginning of the name.
    """
    return ("Y",) if len(channels) == 1 else tuple(_stored_name(k, name) for k, name in enumerate(channels))


def _stored_name(number: int, name: str) -> str:
    plain = harmless(name).replace(".", ",") or f"{number}"
    return plain if len(plain.encode()) <= _LONGEST_NAME else f"{number} {plain[: _LONGEST_NAME // 5]}"


def write_exr(path: str | os.PathLike[str], pixels: np.ndarray, names: Sequence[str], comment: str = "") -> None:
    """Write pixels (rows, columns, C) as 32-bit float channels, row 0 the first scanline, losslessly packed.

    Raises BadInput where the names do not fit, a value is not finite in float32, or the place cannot be
    written.
    """
    with np.errstate(over="ignore"):
        stored = np.asarray(pixels).astype(np.float32)
    if stored.ndim != 3 or stored.shape[2] != len(names) or len(set(names)) != len(names):
        wanted = f"(rows, columns, {len(names)}) and as many different names"
        raise BadInput(where=path, found=f"pixels of shape {stored.shape}", expected=wanted)
    if not np.isfinite(stored).all():
        row, column, _ = np.argwhere(~np.isfinite(stored))[0]
        raise BadInput(f"row {row}, column {column} is not finite in float32", where=path, expected="finite values")
    write_channels(path, stored, names, comment)


def write_half_exr(path: str | os.PathLike[str], pixels: np.ndarray, names: Sequence[str], comment: str = "") -> None:
    """Write floating pixels (rows, columns, C) as half channels, row 0 the first scanline, losslessly packed.

    Raises BadInput where the names do not fit, a value is not finite in float16, or the place cannot be
    written. `decode_exr` reads such a file in its stored type.
    """
    whole_shape(path, pixels, (len(names),))
    if len(set(names)) != len(names):
        raise BadInput(where=path, found=f"channels {', '.join(names)}", expected="different names")
    write_channels(path, finite_pixels(path, pixels, np.float16), names, comment)


def write_channels(path: str | os.PathLike[str], stored: np.ndarray, names: Sequence[str], comment: str = "") -> None:
    """Write finite pixels (rows, columns, C) of float32 or float16 as channels of that type, losslessly packed.

    Raises BadInput where the place cannot be written.
    """
    OpenEXR = extras.library("OpenEXR", f"{path}")
    planes = {name: np.ascontiguousarray(stored[..., c]) for c, name in enumerate(names)}
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage, "comments": comment}

    def write(beside: Path) -> None:
        # By way of memory: the library opens no file whose name is not UTF-8.
        buffer = io.BytesIO()
        OpenEXR.File(header, planes).write(buffer)
        beside.write_bytes(buffer.getvalue())

    folder = Path(path).parent
    if not os.access(folder, os.W_OK):
        raise BadInput(f"cannot be written, {folder} is not a writable folder", where=path, expected="one")
    replace_file(path, write)


def read_exr(path: str | os.PathLike[str]) -> dict[str, np.ndarray]:
    """Return the channels (rows, columns) of an EXR by name, row 0 the first scanline. Raises BadInput."""
    return decode_exr(read_bytes(path, "an EXR file"), str(path))


def decode_exr(data: bytes, name: str) -> dict[str, np.ndarray]:
    """Return the channels (rows, columns) of a single-part EXR file's bytes, row 0 on top, in their stored type.

    Raises BadInput for a file that cannot be decoded; `name` is for messages.
    """
    OpenEXR = extras.library("OpenEXR", name)
    try:
        # The library announces a damaged part on stdout, which belongs to the commands' output.
        with contextlib.redirect_stdout(io.StringIO()):
            file = OpenEXR.File(io.BytesIO(data), separate_channels=True)
            return {key: np.asarray(channel.pixels) for key, channel in file.channels().items()}
    except (RuntimeError, ValueError, TypeError) as error:
        raise BadInput(f"not a readable OpenEXR file ({error})", where=name, expected="whole scanlines") from error
