"""Patterns on an object: spatially varying factors of the first term of its material.

    pattern = "wood"                   # grain along x, rings about the x axis, `pattern_size` apart
    pattern = "squares"                # light and dark cubes of that size
    pattern = "label.png"              # a picture at the mesh's texture coordinates, 1 at its mean colour

A picture multiplies by its colour divided by its mean colour, both in linear light, so that the mean of the material is
unchanged. It repeats beyond its edges and is interpolated between texels.
"""

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from homofact.containers.png import read_png
from homofact.containers.srgb import decode_srgb
from homofact.errors import BadInput

WOOD, SQUARES = "wood", "squares"
BUILT_IN = (WOOD, SQUARES)


@dataclass(frozen=True)
class PicturePattern:
    """The colours of a picture (H, W, 3), linear, over their mean, at texture coordinates."""

    picture: np.ndarray

    def __call__(self, points: np.ndarray, uv: np.ndarray) -> np.ndarray:
        """Return factors (P, 3) by bilinear lookup in the repeated picture; row 0 lies at v = 0."""
        height, width = self.picture.shape[:2]
        mean = self.picture.mean((0, 1))
        relative = np.where(mean > 0, self.picture / np.where(mean > 0, mean, 1.0), 1.0)
        at = np.stack((uv[:, 1] * height, uv[:, 0] * width), 1) - 0.5
        low = np.floor(at).astype(np.int64)
        share = at - low
        total = np.zeros((len(uv), 3))
        for down in (0, 1):
            for across in (0, 1):
                weight = np.abs(1 - down - share[:, 0]) * np.abs(1 - across - share[:, 1])
                texel = relative[(low[:, 0] + down) % height, (low[:, 1] + across) % width]
                total += weight[:, None] * texel
        return total


@dataclass(frozen=True)
class Wood:
    """Rings about the x axis, `size` apart, bent by the place along it, with fine grain along x."""

    size: float
    channels: int

    def __call__(self, points: np.ndarray, uv: np.ndarray) -> np.ndarray:
        """Return factors (P, C) up to 1.25; dark rings reflect less blue than red."""
        x, y, z = points.T / self.size
        radius = np.hypot(y + 0.15 * np.sin(0.9 * x), z + 0.15 * np.cos(0.7 * x) + 3.0)
        ring = 0.5 + 0.5 * np.sin(2 * math.pi * radius + 0.6 * np.sin(1.7 * x))
        grain = 0.5 + 0.5 * np.sin(37.0 * y + 3.0 * np.sin(2.3 * x)) * np.sin(41.0 * z)
        dark = np.clip(0.8 * ring**3 + 0.2 * grain, 0, 1)[:, None]
        tint = np.linspace(0.45, 0.65, self.channels) if self.channels == 3 else np.full(self.channels, 0.55)
        return 1.25 * (1 - tint * dark)


@dataclass(frozen=True)
class Squares:
    """Cubes of `size`, with brightness alternating between 1 and .35."""

    size: float
    channels: int

    def __call__(self, points: np.ndarray, uv: np.ndarray) -> np.ndarray:
        """Factors (P, C)."""
        # A little off, so that a level ground does not lie on the border of two layers.
        even = np.floor(points / self.size + 0.013).sum(1) % 2 == 0
        return np.where(even[:, None], 1.0, 0.35).repeat(self.channels, 1)


def open_pattern(words: str, size: float, channels: int, textured: bool) -> PicturePattern | Wood | Squares:
    """Return a pattern by its name or a picture's file. `textured`: whether the mesh has texture coordinates.

    Raises BadInput for a picture that cannot be read, on a mesh without texture coordinates, or of other channels than
    red, green and blue.
    """
    if words == WOOD:
        return Wood(size, channels)
    if words == SQUARES:
        return Squares(size, channels)
    if not textured:
        wanted = f"a mesh with them (glTF), or one of {', '.join(BUILT_IN)}"
        raise BadInput("a picture on a mesh without texture coordinates", where="pattern", expected=wanted)
    if channels != 3:
        raise BadInput(f"a picture on a material of {channels} channels", where="pattern", expected="3 channels")
    found = read_png(Path(words))
    encoded = found[..., :3] / float(np.iinfo(found.dtype).max)
    encoded = np.broadcast_to(encoded, (*encoded.shape[:2], 3))
    return PicturePattern(decode_srgb(encoded))
