"""Reading an environment map from a file: Radiance .hdr or OpenEXR, told apart by content."""

import os
from pathlib import Path

import numpy as np
import torch

from homofact.containers.exr import decode_exr
from homofact.containers.hdr import decode_hdr
from homofact.errors import BadInput
from homofact.files.reading import read_bytes
from homofact.files.text import beginning
from homofact.rendering.light import EnvironmentMap

_EXR_MAGIC = b"\x76\x2f\x31\x01"


def read_environment(path: str | os.PathLike[str], turn: float = 0.0) -> EnvironmentMap:
    """Return the lat-long map in a .hdr or .exr file, linear radiance on the file's own scale; see `rendering.light`.

    An EXR gives its channels R, G, B, or Y. Raises BadInput for a missing, foreign, truncated or padded
    file, missing channels, and pixels that are negative or not finite.
    """
    target = Path(path)
    data = read_bytes(target, "a .hdr or .exr picture")
    if data.startswith(_EXR_MAGIC):
        planes = decode_exr(data, str(target))
        names = ("R", "G", "B") if "R" in planes else ("Y",)
        missing = [name for name in names if name not in planes]
        if missing:
            raise BadInput(f"channels are {', '.join(planes)}", where=target, expected="R, G, B or Y")
        pixels = np.stack([planes[name] for name in names], -1).astype(np.float64)
    elif data.startswith(b"#?"):
        pixels = decode_hdr(data, str(target))
    else:
        raise BadInput(f"begins with {beginning(data)}", where=target, expected="a Radiance .hdr or an OpenEXR file")
    try:
        return EnvironmentMap(torch.from_numpy(pixels), turn, target.name)
    except BadInput as error:
        raise error.moved_to(target) from error
