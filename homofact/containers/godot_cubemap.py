"""Cube maps as text resources of Godot 4 (.tres): a Cubemap of six images of RGBA half floats with all their levels.

Godot loads such a file without an import. An Image with mipmaps has all levels down to one texel, face by face, largest
first; the missing ones are averages of 2 × 2 texels of the last level that is given. Bytes in base64 need Godot 4.3.
"""

import base64
from collections.abc import Sequence

import numpy as np

from homofact.containers.pixels import finite_levels

_IMAGE = """[sub_resource type="Image" id="{face}"]
data = {{
"data": PackedByteArray("{texels}"),
"format": "RGBAHalf",
"height": {side},
"mipmaps": {mipmaps},
"width": {side}
}}
"""


def godot_cubemap(name: str, levels: Sequence[np.ndarray]) -> str:
    """Return the text of a Cubemap with these levels.

    Parameters
    ----------
    name : str
        The name of the file in messages.
    levels : sequence of numpy.ndarray
        Levels (6, N, N, 4), largest first, rounded to float16. The faces are +x, −x, +y, −y, +z, −z. A single level
        gets no smaller ones.

    Returns
    -------
    str
        The file's text.

    Raises
    ------
    BadInput
        For another shape, for values not finite in float16, and if a level does not have half the side of the one
        before.
    """
    parts = list(finite_levels(name, levels))
    several = len(parts) > 1
    while several and parts[-1].shape[1] > 1:
        last = parts[-1].astype(np.float32)
        side = last.shape[1] // 2
        parts.append(last.reshape(6, side, 2, side, 2, 4).mean((2, 4)).astype(np.float16))
    images = [
        _IMAGE.format(
            face=face,
            texels=base64.b64encode(b"".join(part[face].tobytes() for part in parts)).decode(),
            side=parts[0].shape[1],
            mipmaps=str(several).lower(),
        )
        for face in range(6)
    ]
    faces = ", ".join(f'SubResource("{face}")' for face in range(6))
    head = '[gd_resource type="Cubemap" load_steps=7 format=4]\n'
    return "\n".join([head, *images, f"[resource]\n_images = [{faces}]\n"])
