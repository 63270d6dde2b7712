"""Apply glTF's extension KHR_texture_transform: scale, rotate and translate texture coordinates."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from homofact.errors import BadInput

NAME = "KHR_texture_transform"
_MOST = 1e6  # of a number: more leaves no digits for the place in a texel


@dataclass(frozen=True)
class TextureTransform:
    """(u, v) ↦ offset + R scale (u, v), v downwards; R rotates by `rotation` radians, anticlockwise as displayed.

    The extension composes translation · rotation · scale, and rotates "the UVs counter-clockwise around the origin".
    (1, 0) therefore goes to (cos, −sin), as in three.js; the GLSL in the extension's README turns the other way.

    Parameters
    ----------
    offset : translation of the origin, in units of the texture's width and height.
    rotation : in radians.
    scale : of u and of v.

    Examples
    --------
    >>> TextureTransform(offset=(0.5, 0.0), scale=(2.0, 1.0)).applied(np.array([[0.25, 1.0]])).tolist()
    [[1.0, 1.0]]
    """

    offset: tuple[float, float] = (0.0, 0.0)
    rotation: float = 0.0
    scale: tuple[float, float] = (1.0, 1.0)

    @classmethod
    def of(cls, info: Any, where: str) -> "TextureTransform":
        """Return the transform of a glTF textureInfo; without the extension, it is the identity.

        Raises BadInput if the rotation is not a number, if offset or scale are not two numbers, or if a number exceeds
        a million.
        """
        extensions = info.get("extensions") if isinstance(info, dict) else None
        given = extensions.get(NAME) if isinstance(extensions, dict) else None
        if not isinstance(given, dict):
            return cls()
        offset, scale = (_pair(given.get(key, [usual] * 2), key, where) for key, usual in _PAIRS)
        (rotation,) = _numbers([given.get("rotation", 0.0)], 1, "rotation", where)
        return cls(offset, rotation, scale)

    def applied(self, uv: np.ndarray) -> np.ndarray:
        """Return the coordinates (V, 2) at which to read the texture."""
        cosine, sine = math.cos(self.rotation), math.sin(self.rotation)
        turn = np.array([[cosine, sine], [-sine, cosine]])
        return (uv * self.scale) @ turn.T + self.offset


def coordinate_set(info: Any) -> Any:
    """Return n of the TEXCOORD_n that a glTF textureInfo reads: `texCoord` of its transform, else its own.

    Examples
    --------
    >>> coordinate_set({"index": 0, "texCoord": 1})
    1
    >>> coordinate_set({"index": 0, "texCoord": 1, "extensions": {"KHR_texture_transform": {"texCoord": 0}}})
    0
    """
    if not isinstance(info, dict):
        return 0
    extensions = info.get("extensions")
    given = extensions.get(NAME) if isinstance(extensions, dict) else None
    own = info.get("texCoord", 0)
    return given.get("texCoord", own) if isinstance(given, dict) else own


_PAIRS = (("offset", 0.0), ("scale", 1.0))


def _pair(value: Any, key: str, where: str) -> tuple[float, float]:
    first, second = _numbers(value, 2, key, where)
    return first, second


def _numbers(value: Any, count: int, key: str, where: str) -> list[float]:
    real = isinstance(value, list) and len(value) == count
    if not real or any(isinstance(k, bool) or not isinstance(k, int | float) or not abs(k) <= _MOST for k in value):
        shown = value[0] if isinstance(value, list) and count == 1 else value
        expected = f"{'a number' if count == 1 else 'two numbers'} of at most {_MOST:g}"
        raise BadInput(f"a {NAME} of {key} {shown!r}"[:120], where=where, expected=expected)
    return [float(k) for k in value]
