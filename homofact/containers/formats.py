"""The texture formats of `homofact export`: what each can hold, how it is written, and what a sampler reads.

| name | file | a texel's channel | channels | sides |
|---|---|---|---|---|
| exr | EXR | float32 | any number | any |
| exr16 | EXR | float16 | any number | any |
| png8 | PNG | integer over 255 | 1, 3, 4 | any |
| png16 | PNG | integer over 65535 | 1, 3, 4 | any |
| ktx2 | KTX2, RGBA16F | float16 | 1, 3, 4 | any |
| dds | DDS, RGBA16F | float16 | 1, 3, 4 | any |
| bc6h | DDS, BC6H signed | a colour of its block | 1, 3 | multiples of 4 |

Sides end at 16384 texels, the largest 2D texture of Direct3D 11 (D3D11_REQ_TEXTURE2D_U_OR_V_DIMENSION); a
one-dimensional texture has one row. The layers of a texture array are stacked vertically. KTX2 and DDS give the number
of layers in their headers. EXR and PNG store one tall image, whose rows have the same order as an array in memory. If a
file has more channels than a texture, a single channel is copied to red, green and blue, and alpha is 1. To measure the
storage error of a texture, compare it with `read` after `write`: the reader's values are those of a GPU's sampler at
texel centres (integers still to be divided by 255 or 65535).
"""

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from homofact.containers.dds import read_dds, write_dds, write_dds_bc6h
from homofact.containers.exr import read_exr, write_exr, write_half_exr
from homofact.containers.format_names import FORMAT_NAMES
from homofact.containers.ktx2 import read_ktx2, write_ktx2
from homofact.containers.pixels import finite_pixels, layer_rows
from homofact.containers.png import read_png, write_png
from homofact.errors import BadInput
from homofact.version import __version__

MOST_SIDE = 16384
# The KTX 2.0 specification asks every writer to name itself.
_WRITER = {"KTXwriter": f"homofact {__version__}"}

_Place = str | os.PathLike[str]
# What writes (place, stored, names, key_values, layers), and what reads (place, names, layers).
_Writer = Callable[[_Place, np.ndarray, Sequence[str], Mapping[str, str], int], None]
_Reader = Callable[[_Place, Sequence[str] | None, int], np.ndarray]


@dataclass(frozen=True)
class Format:
    """One way to store a texture.

    `storage` is the type of a texel's channel: float32, float16, unorm8, unorm16 or bc6h; `dtype` the numpy type of the
    texels that are read, and of integer texels to write. `channels` are the numbers of channels it can hold (None:
    any), `most_side` the largest side and `multiple` what both sides must be multiples of.
    """

    name: str
    suffix: str
    storage: str
    dtype: type[np.generic]
    channels: tuple[int, ...] | None
    most_side: int
    multiple: int
    summary: str
    _write: _Writer = field(repr=False)
    _read: _Reader = field(repr=False)
    # Channels in the file whatever the texture has, or None where it has as many.
    _held: int | None = None

    def check(self, rows: int, columns: int, channels: int, name: str = "texture") -> None:
        """Raise BadInput, with `name` and the size, if the format does not support such a texture."""
        size = f"{name}: {columns} x {rows} texels of {channels} channel{'s' if channels != 1 else ''}"
        if channels < 1 or (self.channels is not None and channels not in self.channels):
            held = "1 or more" if self.channels is None else " or ".join(map(str, self.channels))
            raise BadInput(size, expected=f"{held} channels for {self.name}")
        if not 1 <= rows <= self.most_side or not 1 <= columns <= self.most_side:
            raise BadInput(size, expected=f"sides of 1 to {self.most_side} for {self.name}")
        if rows % self.multiple or columns % self.multiple:
            raise BadInput(size, expected=f"sides that are multiples of {self.multiple} for {self.name}")

    def write(
        self,
        path: _Place,
        stored: np.ndarray,
        names: Sequence[str] | None = None,
        key_values: Mapping[str, str] | None = None,
        layers: int = 1,
    ) -> None:
        """Write texels (layers · rows, columns, C), row 0 on top: floats, or uint8 and uint16 for png8 and png16.

        Floating values are rounded to the storage type. `names` are the names of the channels in an EXR (default: Y,
        RGB, RGBA or numbers). `key_values` are the key/value data of a KTX2; KTXwriter is added by default. Other
        formats ignore both. Raises BadInput as `check`, for a wrong type, for values that are not finite in the storage
        type, and if the file cannot be written.
        """
        if stored.ndim != 3:
            raise BadInput(where=path, found=f"pixels of shape {stored.shape}", expected="(rows, columns, channels)")
        rows, columns, channels = stored.shape
        self.check(layer_rows(path, rows, layers), columns, channels, str(path))
        floating = np.issubdtype(self.dtype, np.floating)
        if floating != np.issubdtype(stored.dtype, np.floating) or (not floating and stored.dtype != self.dtype):
            wanted = "floating-point numbers" if floating else np.dtype(self.dtype).name
            raise BadInput(where=path, found=f"values of type {stored.dtype}", expected=f"{wanted} for {self.name}")
        held = stored if self._held is None else _widened(stored, self._held)
        self._write(path, held, names or _channel_names(channels), key_values or {}, layers)

    def read(
        self, path: _Place, channels: int | None = None, names: Sequence[str] | None = None, layers: int = 1
    ) -> np.ndarray:
        """Return texels (layers · rows, columns, C) of `dtype`, row 0 on top, as a sampler finds them at texel centres.

        C is `channels`; 1 returns red of a file with more channels, and None returns all channels of the file. `names`
        are the names of an EXR's channels in order (default: the names of `write`, or sorted). Raises BadInput for a
        file that cannot be read, has another format, or has other channels.
        """
        texels = self._read(path, names, layers)
        if texels.dtype != self.dtype:
            wanted = f"{np.dtype(self.dtype).name} for {self.name}"
            raise BadInput(where=path, found=f"{texels.dtype} texels", expected=wanted)
        found = texels.shape[2]
        if self._held not in (None, found):
            raise BadInput(where=path, found=f"{found} channels", expected=f"{self._held} for {self.name}")
        if channels is None or channels == found:
            return texels
        if self._held is None or channels not in (self.channels or ()):
            raise BadInput(where=path, found=f"{found} channels", expected=channels)
        return np.ascontiguousarray(texels[..., :channels])

    def bytes_of(self, rows: int, columns: int, channels: int) -> int:
        """Return the bytes of a texture's texels on the GPU.

        GPUs have formats of 1, 2 and 4 channels. 3 channels need the space of 4, and more than 4 are divided into
        textures of 4 channels and one for the rest. Formats with fixed channels need 8 bytes per texel (RGBA16F) or 16
        bytes per block of 4 x 4 texels (BC6H).
        """
        if self.storage == "bc6h":
            return -(-rows // 4) * -(-columns // 4) * 16
        full, rest = divmod(self._held or channels, 4)
        return rows * columns * (4 * full + (0, 1, 2, 4)[rest]) * np.dtype(self.dtype).itemsize


def format_named(name: str) -> Format:
    """Return the format of that name. Raises BadInput that lists the names."""
    if name not in FORMATS:
        raise BadInput(f"texture format {name!r}", expected=f"one of {', '.join(FORMATS)}")
    return FORMATS[name]


def _widened(stored: np.ndarray, held: int) -> np.ndarray:
    """RGB of one channel thrice, and alpha 1 where 4 channels are held and there is none."""
    colour = np.repeat(stored, 3, 2) if stored.shape[2] == 1 else stored
    if colour.shape[2] == held:
        return colour
    return np.concatenate([colour, np.ones_like(colour[..., :1])], 2)


def _channel_names(channels: int) -> tuple[str, ...]:
    """Numbers have as many digits as the last: an EXR sorts its channels by name."""
    plain = {1: ("Y",), 3: ("R", "G", "B"), 4: ("R", "G", "B", "A")}
    return plain.get(channels) or tuple(f"{c:0{len(str(channels - 1))}d}" for c in range(channels))


def _read_exr(path: _Place, names: Sequence[str] | None, layers: int) -> np.ndarray:
    planes = read_exr(path)
    order = names or _channel_names(len(planes))
    if names is None and set(order) != set(planes):
        order = sorted(planes)
    if set(order) != set(planes) or len(order) != len(planes):
        raise BadInput(where=path, found=f"channels {', '.join(planes)}", expected=", ".join(order))
    if len({(plane.dtype, plane.shape) for plane in planes.values()}) != 1:
        raise BadInput(where=path, found="channels of different types or sizes", expected="them alike")
    return np.stack([planes[name] for name in order], -1)


def _write_float_exr(
    path: _Place, stored: np.ndarray, names: Sequence[str], key_values: Mapping[str, str], layers: int
) -> None:
    write_exr(path, finite_pixels(path, stored, np.float32), names)


_RGBA = (1, 3, 4)
_ALL = (
    Format(
        "exr", ".exr", "float32", np.float32, None, MOST_SIDE, 1, "EXR of 32-bit floats", _write_float_exr, _read_exr
    ),
    Format(
        "exr16", ".exr", "float16", np.float16, None, MOST_SIDE, 1, "EXR of 16-bit floats",
        lambda path, stored, names, key_values, layers: write_half_exr(path, stored, names), _read_exr,
    ),
    Format(
        "png8", ".png", "unorm8", np.uint8, _RGBA, MOST_SIDE, 1, "PNG of 8 bits a channel",
        lambda path, stored, names, key_values, layers: write_png(path, stored),
        lambda path, names, layers: read_png(path),
    ),
    Format(
        "png16", ".png", "unorm16", np.uint16, _RGBA, MOST_SIDE, 1, "PNG of 16 bits a channel",
        lambda path, stored, names, key_values, layers: write_png(path, stored),
        lambda path, names, layers: read_png(path),
    ),
    Format(
        "ktx2", ".ktx2", "float16", np.float16, _RGBA, MOST_SIDE, 1, "KTX2 of RGBA16F",
        lambda path, stored, names, key_values, layers: write_ktx2(path, stored, _WRITER | dict(key_values), layers),
        lambda path, names, layers: read_ktx2(path, layers), 4,
    ),
    Format(
        "dds", ".dds", "float16", np.float16, _RGBA, MOST_SIDE, 1, "DDS of RGBA16F",
        lambda path, stored, names, key_values, layers: write_dds(path, stored, layers),
        lambda path, names, layers: read_dds(path, layers), 4,
    ),
    Format(
        "bc6h", ".dds", "bc6h", np.float16, (1, 3), MOST_SIDE, 4, "DDS of BC6H signed blocks",
        lambda path, stored, names, key_values, layers: write_dds_bc6h(path, stored, layers),
        lambda path, names, layers: read_dds(path, layers), 3,
    ),
)  # fmt: skip
_BY_NAME = {each.name: each for each in _ALL}
FORMATS: dict[str, Format] = {name: _BY_NAME[name] for name in FORMAT_NAMES}
