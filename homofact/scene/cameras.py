"""The pinhole camera of scene files, pictures, fixed views and references, and its rays."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from homofact.errors import BadInput
from homofact.settings.options import option

# Of the camera without one: its direction, and its distance in radii; a ball fills 40° at 2.9.
_FRONT, _AWAY = (0.25, 0.35, 1.0), 3.1


@dataclass(frozen=True)
class Camera:
    """A pinhole at `eye` that looks at `target`, y up: `field` degrees from top to bottom, `pixels` width, height.

    Raises BadInput if `eye` or `target` is not a point, if they are equal, and for a field or size out of bounds.
    """

    eye: tuple[float, ...]
    target: tuple[float, ...] = (0.0, 0.0, 0.0)
    field: float = option(40.0, "Degrees from top to bottom", above=0, most=170)
    pixels: tuple[int, ...] = (480, 360)
    name: str | None = None

    def __post_init__(self) -> None:
        """Refuse what is no camera."""
        check_point("eye", self.eye)
        check_point("target", self.target)
        if tuple(self.eye) == tuple(self.target):
            raise BadInput(where="eye", found="the target's place", expected="another")
        if not 0 < self.field <= 170:
            raise BadInput(where="field", found=self.field, expected="a number above 0 and at most 170")
        if len(self.pixels) != 2 or not all(8 <= side <= 8192 for side in self.pixels):
            raise BadInput(where="pixels", found=list(self.pixels), expected="width and height of 8 to 8192")

    def rays(self, across: int = 1) -> np.ndarray:
        """Unit directions (H, W, across², 3) through each pixel, row 0 on top: `across` × `across` evenly spaced."""
        width, height = self.pixels
        forward = np.subtract(self.target, self.eye).astype(np.float64)
        forward /= np.linalg.norm(forward)
        # Straight up or down there is no horizon: x is to the right.
        level = np.cross(forward, (0.0, 1.0, 0.0))
        right = level / np.linalg.norm(level) if np.linalg.norm(level) > 1e-9 else np.array([1.0, 0.0, 0.0])
        up = np.cross(right, forward)
        half = math.tan(math.radians(self.field) / 2)
        columns, rows = width * across, height * across
        x = ((np.arange(columns) + 0.5) / columns * 2 - 1) * half * width / height
        y = (1 - (np.arange(rows) + 0.5) / rows * 2) * half
        rays = forward + x[None, :, None] * right + y[:, None, None] * up
        rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
        return rays.reshape(height, across, width, across, 3).swapaxes(1, 2).reshape(height, width, across**2, 3)


def chosen_camera(cameras: Sequence[Camera], name: str | None) -> Camera:
    """Return the camera of a name or a number from 1; the first one for None. Raises BadInput for any other name."""
    if name is None:
        return cameras[0]
    known = {each.name: each for each in reversed(cameras) if each.name} | {
        str(number): each for number, each in enumerate(cameras, 1)
    }
    if name not in known:
        names = [each.name or str(number) for number, each in enumerate(cameras, 1)]
        raise BadInput(where="camera", found=repr(name), expected=f"one of {', '.join(names)}")
    return known[name]


def camera_on(positions: np.ndarray) -> Camera:
    """Return a camera that sees all of the points (V, 3), from the front and a little above."""
    middle = (positions.min(0) + positions.max(0)) / 2
    radius = float(np.linalg.norm(positions - middle, axis=1).max())
    eye = middle + _AWAY * radius * np.array(_FRONT) / np.linalg.norm(_FRONT)
    return Camera(tuple(eye.tolist()), tuple(middle.tolist()))


def check_point(name: str, point: tuple[float, ...]) -> None:
    """Raise BadInput if `point` is not a point."""
    if len(point) != 3 or not all(abs(number) < 1e6 for number in point):
        raise BadInput(where=name, found=list(point), expected="three numbers below a million")
