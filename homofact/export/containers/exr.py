"""EXR textures of 16-bit floats: half the bytes of `export.images.write_exr`, and what a GPU's RGBA16F holds."""

import os
from collections.abc import Sequence

import numpy as np

from homofact.errors import BadInput
from homofact.export.containers.pixels import finite_pixels, whole_shape
from homofact.export.images import write_channels


def write_half_exr(path: str | os.PathLike[str], pixels: np.ndarray, names: Sequence[str], comment: str = "") -> None:
    """Write floating pixels (rows, columns, C) as half channels, row 0 the first scanline, losslessly packed.

    Raises BadInput where the names do not fit, a value is not finite in float16, or the place cannot be
    written. `render.environment.decode_exr` reads such a file in its stored type.
    """
    whole_shape(path, pixels, (len(names),))
    if len(set(names)) != len(names):
        raise BadInput(f"{path}: found channels {', '.join(names)}, expected different names")
    write_channels(path, finite_pixels(path, pixels, np.float16), names, comment)
