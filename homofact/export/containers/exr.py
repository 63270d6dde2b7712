"""EXR textures of 16-bit floats: half the bytes of `export.images.write_exr`, and what a GPU's RGBA16F holds."""

import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import OpenEXR

from homofact.errors import BadInput
from homofact.export.containers.pixels import finite_pixels, whole_shape
from homofact.render.files import replace_file


def write_half_exr(path: str | os.PathLike[str], pixels: np.ndarray, names: Sequence[str], comment: str = "") -> None:
    """Write floating pixels (rows, columns, C) as half channels, row 0 the first scanline, losslessly packed.

    Raises BadInput where the names do not fit, a value is not finite in float16, or the place cannot be
    written. `render.environment.decode_exr` reads such a file in its stored type.
    """
    whole_shape(path, pixels, (len(names),))
    if len(set(names)) != len(names):
        raise BadInput(f"{path}: found channels {', '.join(names)}, expected different names")
    stored = finite_pixels(path, pixels, np.float16)
    planes = {name: np.ascontiguousarray(stored[..., c]) for c, name in enumerate(names)}
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage, "comments": comment}

    def write(beside: Path) -> None:
        try:
            OpenEXR.File(header, planes).write(str(beside))
        except RuntimeError as error:
            raise OSError(str(error)) from error

    # The library speaks of a bad place on stderr by itself; asked first, it need not.
    folder = Path(path).parent
    if not os.access(folder, os.W_OK):
        raise BadInput(f"{path}: cannot be written, {folder} is not a writable folder, expected one")
    replace_file(path, write)
