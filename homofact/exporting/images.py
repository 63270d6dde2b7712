"""Textures as images: float EXR for renderers, PNG for viewing.

An EXR stores the logarithm p̃ in float32. A renderer adds its fetches and computes one exponential, so the sampler's
bilinear interpolation equals that of the fit. (Interpolating exp(p̃) would not: for a 16² lobe the error is several
percent.) The scale A and ε are in the manifest. The first scanline is row 0, v = −1, and the first pixel of a scanline
is column 0, u = −1: an API that puts the first scanline at texture coordinate 0 needs no flip. Texels outside the mask
hold fill values from the smoothing; no direction reads them. The factors of a sum of products are stored unchanged too,
linear and with both signs: a renderer interpolates, multiplies and adds.

A PNG shows the logarithm p̃ over the whole texture square in the same orientation (row 0 on top), enlarged by integer
factors to at least 256 pixels per side. Texels outside the mask are hatched in yellow, as in the thesis (figure 4.3).
For a factor, the PNG shows the absolute values relative to the largest one with a gamma of 2.2, as Wang, Tran and
Luebke 2004 (figure 4) do. Its text chunk `Description` explains the mapping to grey values.
"""

import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from homofact.containers.exr import exr_channel_names, write_exr
from homofact.errors import Advice, BadInput
from homofact.factor.fitted import Fitted, Texture
from homofact.files import extras
from homofact.files.atomic import replace_file

SIDE = 256
OUTSIDE = (255, 213, 0)
HATCH = (176, 132, 0)
# A texture that varies by less than a factor e looks as flat as it is.
_LEAST_RANGE = 1.0
# What each kind of file is written by, for `extras.left_out`.
LIBRARIES = {"textures as EXR": "OpenEXR", "textures as PNG": "PIL"}
_WHAT = {"log": "logarithm p", "factor": "factor of a product, linear"}


def write_texture_exr(path: str | os.PathLike[str], texture: Texture, channels: Sequence[str]) -> None:
    """Write the texels of one texture unchanged. Raises BadInput as `write_exr`."""
    what = "coordinates of the spectral basis" if texture.components else _WHAT[texture.quantity]
    comment = f"{what}; first scanline is row 0, v = -1; see manifest.json"
    write_exr(path, texture.texels, exr_channel_names(texture.components or channels), comment)


def write_deviation_exr(path: str | os.PathLike[str], texture: Texture, channels: Sequence[str]) -> None:
    """Write the standard deviation of every texel. Raises BadInput if there is none, and as `write_exr`."""
    if texture.deviation is None:
        raise BadInput("the texture has no deviation", where=path, expected=f"a fit with {Advice('confidence', True)}")
    comment = "standard deviation of the logarithm p; rows as in the texture; 0 outside the mask"
    write_exr(path, texture.deviation, exr_channel_names(channels), comment)


def write_texture_png(path: str | os.PathLike[str], texture: Texture, channels: Sequence[str]) -> None:
    """Write one texture as a PNG for viewing (see this module's start). Raises BadInput if it cannot be written."""
    pixels, description = texture_picture(texture, channels)
    PngImagePlugin = extras.library("PIL.PngImagePlugin", f"{path}")
    text = PngImagePlugin.PngInfo()
    text.add_text("Description", description)
    picture = extras.library("PIL.Image", f"{path}").fromarray(pixels)
    replace_file(path, lambda beside: picture.save(beside, format="PNG", pnginfo=text))


def texture_picture(texture: Texture, channels: Sequence[str]) -> tuple[np.ndarray, str]:
    """Return (pixels (H, W, 3) uint8, text of the chunk `Description`) of one texture's PNG.

    Three channels become red, green and blue. Fewer channels become grey. Of more channels, red, green and blue are the
    means of the last, middle and first third, so long wavelengths are red.
    """
    grey, how = (_logarithms if texture.quantity == "log" else _absolute)(texture, texture.components or channels)
    rows, columns = texture.size
    tall, wide = _magnification(rows, columns)
    pixels = enlarged_and_hatched((grey * 255).round().to(torch.uint8), torch.from_numpy(texture.mask))
    description = (
        f"{how}; row 0 (v = -1) on top, column 0 (u = -1) at the left; {columns} x {rows} texels enlarged {wide} x"
        f" {tall} times; yellow hatching: outside the mask"
    )
    return pixels, description


def _logarithms(texture: Texture, channels: Sequence[str]) -> tuple[Tensor, str]:
    """(grey in [0, 1] (rows, columns, 3), words): linear from the least to the largest inside the mask, at least 1."""
    shown, words = three_channels(torch.from_numpy(texture.texels), channels)
    mask = torch.from_numpy(texture.mask)
    inside = shown[mask] if bool(mask.any()) else shown.reshape(-1, 3)
    low, high = float(inside.min()), float(inside.max())
    spare = max(0.0, _LEAST_RANGE - (high - low)) / 2
    low, high = low - spare, high + spare
    grey = ((shown - low) / (high - low)).clamp(0, 1)
    return grey, f"log texture p, 8 bit = 255 (p - low)/(high - low), low = {low:.6g}, high = {high:.6g}; {words}"


def _absolute(texture: Texture, channels: Sequence[str]) -> tuple[Tensor, str]:
    """(grey in [0, 1] (rows, columns, 3), words): absolute values over the largest, through the gamma 2.2."""
    shown, words = three_channels(torch.from_numpy(texture.texels).abs(), channels)
    high = float(shown.max())
    grey = (shown / high if high > 0 else shown) ** (1 / 2.2)
    return grey, f"8 bit = 255 (|g|/high)^(1/2.2), high = {high:.6g}; {words}"


def write_textures(folder: Path, fitted: Fitted) -> list[dict[str, str]]:
    """Write NAME.exr and NAME.png of every texture to `folder`; return the names of each texture's files.

    For a fit with confidence, it also writes NAME_deviation.exr. It skips file types whose library (`LIBRARIES`) is not
    installed.
    """
    files = []
    exr, png = (extras.installed(library) for library in LIBRARIES.values())
    for texture in fitted.textures:
        names = {kind: f"{texture.name}.{kind}" for kind, there in (("exr", exr), ("png", png)) if there}
        if exr:
            write_texture_exr(folder / names["exr"], texture, fitted.channels)
        if png:
            write_texture_png(folder / names["png"], texture, fitted.channels)
        if exr and texture.deviation is not None:
            names["deviation_exr"] = f"{texture.name}_deviation.exr"
            write_deviation_exr(folder / names["deviation_exr"], texture, fitted.channels)
        files.append(names)
    return files


def three_channels(texture: Tensor, channels: Sequence[str]) -> tuple[Tensor, str]:
    """Return three channels (rows, columns, 3) for display, and a description of them."""
    count = len(channels)
    if count == 3:
        return texture, f"red, green, blue = {', '.join(channels)}"
    if count < 3:
        return texture.mean(2, keepdim=True).expand(-1, -1, 3), f"grey = mean of {', '.join(channels)}"
    first, middle, last = (part.mean(2) for part in torch.tensor_split(texture, 3, 2))
    words = f"red, green, blue = last, middle, first third of {count} channels"
    return torch.stack((last, middle, first), 2), words


def enlarged_and_hatched(pixels: Tensor, mask: Tensor) -> np.ndarray:
    """Return pixels (rows, columns, 3) enlarged to (H, W, 3) uint8, hatched in yellow outside the mask."""
    tall, wide = _magnification(*mask.shape)
    outside = _enlarged((~mask).numpy(), tall, wide)
    y, x = np.mgrid[: outside.shape[0], : outside.shape[1]]
    hatch = np.where(((x + y) % 8 < 2)[..., None], HATCH, OUTSIDE)
    return np.where(outside[..., None], hatch, _enlarged(pixels.numpy(), tall, wide)).astype(np.uint8)


def _magnification(rows: int, columns: int) -> tuple[int, int]:
    return -(-SIDE // rows), -(-SIDE // columns)


def _enlarged(pixels: np.ndarray, tall: int, wide: int) -> np.ndarray:
    return pixels.repeat(tall, 0).repeat(wide, 1)
