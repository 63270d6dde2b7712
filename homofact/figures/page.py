"""Lay out a page of pictures in whole pixels, without resampling, and of wrapped text."""

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from PIL import Image

from homofact.files.words import on_one_line

LINE = 18  # pixels a line of text takes
_DPI, _POINTS = 100, 9.5
_MARKS = "_-./"  # where names have their parts


class PicturePage:
    """A page of pictures and text at pixel positions from the top left; its height follows from its content."""

    def __init__(self, width: int, margin: int) -> None:
        """Create an empty white page `width` pixels wide, with `margin` pixels below its lowest content."""
        self.width, self.height, self._margin = width, 0, margin
        self._pictures: list[tuple[np.ndarray, int, int]] = []
        self._texts: list[tuple[str, int, float, bool]] = []
        self._figure = Figure(figsize=(1, 1), dpi=_DPI, facecolor="white")
        self._canvas = FigureCanvasAgg(self._figure)
        self._widths: dict[tuple[str, bool], float] = {}

    def picture(self, pixels: np.ndarray, left: int, top: int) -> int:
        """Place a picture (H, W, 3), uint8 or floats in [0, 1], at (left, top); return its bottom in pixels."""
        if pixels.dtype != np.uint8:
            pixels = (pixels * 255).round().astype(np.uint8)
        self._pictures.append((pixels, left, top))
        return self._reach(top + len(pixels))

    def text(self, text: str, left: int, top: int, width: int, bold: bool = False) -> int:
        """Write a paragraph wrapped at `width` pixels; return its bottom in pixels."""
        lines = self.wrapped(text, width, bold)
        for number, line in enumerate(lines):
            self._texts.append((line, left, top + (number + 0.5) * LINE, bold))
        return self._reach(top + LINE * len(lines))

    def wrapped(self, text: str, width: int, bold: bool = False) -> list[str]:
        """Return `text` broken at spaces into lines that fit `width` pixels.

        A longer word, such as a file name, breaks after its last mark (`_-./`) that fits, or anywhere if that mark
        comes too early.
        """
        lines, line = [], ""
        for word in on_one_line(text).split():
            while word:
                candidate = f"{line} {word}" if line else word
                if self.extent(candidate, bold) <= width:
                    line, word = candidate, ""
                elif line:
                    lines.append(line)
                    line = ""
                else:
                    cut = len(word) - 1
                    while cut > 1 and self.extent(word[:cut], bold) > width:
                        cut -= 1
                    marked = 1 + max(word.rfind(mark, 0, cut) for mark in _MARKS)
                    cut = marked if marked > cut // 2 else cut
                    lines.append(word[:cut])
                    word = word[cut:]
        return [*lines, line] if line else lines

    def save(self, path: Path) -> None:
        """Write the page as a PNG."""
        height = self.height + self._margin
        whole = np.full((height, self.width, 3), 255, dtype=np.uint8)
        for pixels, left, top in self._pictures:
            whole[top : top + pixels.shape[0], left : left + pixels.shape[1]] = pixels
        self._figure.set_size_inches(self.width / _DPI, height / _DPI)
        self._figure.figimage(whole, 0, 0)
        for line, left, middle, bold in self._texts:
            self._figure.text(left / self.width, 1 - middle / height, line, va="center", **_font(bold))
        self._canvas.draw()
        Image.fromarray(np.asarray(self._canvas.buffer_rgba())[..., :3]).save(path, format="PNG")

    def _reach(self, bottom: int) -> int:
        self.height = max(self.height, bottom)
        return bottom

    def extent(self, text: str, bold: bool = False) -> float:
        """Return the width in pixels of a text on one line."""
        if (text, bold) not in self._widths:
            drawn = self._figure.text(0, 0, text, **_font(bold))
            self._widths[text, bold] = drawn.get_window_extent(self._canvas.get_renderer()).width
            drawn.remove()
        return self._widths[text, bold]


def _font(bold: bool) -> dict[str, Any]:
    return {"fontsize": _POINTS, "weight": "bold" if bold else "normal", "parse_math": False}
