"""Small whole files of every BRDF format, as tests of all readers and writers need them."""

import io
import json
import struct
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import lighting_files as lighting
import numpy as np
import torch
from rgl_files import rough, write_tensors
from torch import Tensor

from homofact.brdf.adaptive import tabulated
from homofact.brdf.analytic import Lambert
from homofact.brdf.formats import (
    alta,
    astm,
    cornell,
    csv,
    curet,
    merl,
    npz,
    read_samples,
    rgl,
    speos_writer,
    utia,
    window_writer,
    zemax,
)
from homofact.brdf.materials import material
from homofact.brdf.neural import LAYERS
from homofact.brdf.samples import Samples
from homofact.brdf.sampling import sample_model

PAINT = sample_model(material("lafortune-blue-paint").model, 12)
CLAY = sample_model(material("lafortune-clay").model, 205)
GREY = Lambert((0.3, 0.2, 0.1))
ANGLES = torch.tensor([[0.1, 0.0, 0.2, 3.0], [0.5, 0.0, 0.6, 2.0]], dtype=torch.float64)
SPECTRA = torch.tensor([[0.25, 0.5, 0.125, 0.75, 1.0], [0.5, 0.25, 0.75, 0.125, 0.5]], dtype=torch.float64)
WAVELENGTHS = (400.0, 450.0, 500.0, 600.0, 700.0)


@dataclass(frozen=True)
class WholeFile:
    """`make(folder)` writes a whole file and gives its path; `huge(raw)` are its bytes with an absurd size in front.

    `huge` is None where a file's head states no size.
    """

    make: Callable[[Path], Path]
    huge: Callable[[bytes], bytes] | None = None


def by(write: Callable[[Path], object]) -> Callable[[Path], Path]:
    """A maker from what writes one file."""

    def make(folder: Path) -> Path:
        write(folder / "whole")
        return folder / "whole"

    return make


def write_mdl(path: Path) -> None:
    entries = np.random.default_rng(0).random((4, 4, 6, 3)).astype("<f4")
    head = b'NVIDIA ARC MBSDF V1\nname="paint"\nMBSDF_DATA_REFLECTION=\n' + struct.pack("<3I", 1, 4, 6)
    path.write_bytes(head + entries.tobytes())


def write_network(path: Path) -> None:
    generator = np.random.default_rng(0)
    buffer = io.BytesIO()
    arrays = {f"tin/w{k}": generator.normal(0, 0.1, shape).astype("<f4") for k, shape in enumerate(LAYERS)}
    arrays |= {f"tin/b{k}": np.full(shape[1], 0.3, "<f4") for k, shape in enumerate(LAYERS)}
    np.savez_compressed(buffer, **arrays)  # pyright: ignore[reportArgumentType]
    path.write_bytes(buffer.getvalue())


def make_curet(folder: Path) -> Path:
    curet.write(folder, CLAY)
    return folder / "gbrdf.dat"


def swapped(old: bytes, new: bytes) -> Callable[[bytes], bytes]:
    """Bytes with the first `old` made `new`."""

    def change(raw: bytes) -> bytes:
        assert old in raw
        return raw.replace(old, new, 1)

    return change


_SHAPE = b"'shape': (12, 3), }"
WHOLE_FILES: dict[str, WholeFile] = {
    "npz": WholeFile(
        by(lambda path: npz.write(path, PAINT, {"name": "paint"})),
        swapped(_SHAPE, b"'shape': (10**11,3),}".ljust(len(_SHAPE))[: len(_SHAPE)]),
    ),
    "csv": WholeFile(by(lambda path: csv.write(path, PAINT, ("a paint",)))),
    "alta": WholeFile(by(lambda path: alta.write(path, PAINT)), swapped(b"#DIM 3 3", b"#DIM 3 999999999999")),
    "astm": WholeFile(by(lambda path: astm.write(path, PAINT)), swapped(b"NUM_POINTS 12", b"NUM_POINTS 999999999")),
    "merl": WholeFile(
        by(lambda path: merl.write(path, GREY, (4, 4, 8))), lambda raw: struct.pack("<3i", 4096, 4096, 4096) + raw[12:]
    ),
    "utia": WholeFile(by(lambda path: utia.write(path, GREY))),
    "cornell": WholeFile(
        by(lambda path: cornell.write(path, ANGLES, SPECTRA, WAVELENGTHS)), swapped(b"\n5\n", b"\n999999\n")
    ),
    "mdl": WholeFile(by(write_mdl), swapped(struct.pack("<3I", 1, 4, 6), struct.pack("<3I", 1, 2**31, 2**31))),
    "nbrdf": WholeFile(by(write_network)),
    "curet": WholeFile(make_curet),
    "window": WholeFile(
        by(lambda path: path.write_text(lighting.coloured_window())),
        swapped(b"<nPhis>4</nPhis>", b"<nPhis>20000</nPhis>"),
    ),
    "speos": WholeFile(by(lambda path: path.write_text(lighting.speos())), swapped(b"\n2\t3\n", b"\n99999\t99999\n")),
    "zemax": WholeFile(
        by(lambda path: path.write_text(lighting.zemax("XYZ"))), swapped(b"ScatterRadial  3", b"ScatterRadial  99999")
    ),
    "pabopto": WholeFile(by(lambda path: path.write_text(lighting.pabopto(colour=True)))),
    "rgl": WholeFile(
        lambda folder: write_tensors(folder / "whole", rough((0.0,))),
        lambda raw: raw[:14] + struct.pack("<I", 2**32 - 1) + raw[18:],
    ),
}


@dataclass(frozen=True)
class Writer:
    """`write(path, second)` puts one thing in a file, or another one; `expected` are its samples, from `read`.

    `same(found, expected)` says whether what is read back is what was written, as far as the format holds it.
    """

    write: Callable[[Path, bool], object]
    read: Callable[[Path], Samples]
    same: Callable[[Samples], bool]


def near(found: Tensor, expected: Tensor, tolerance: float) -> bool:
    return found.shape == expected.shape and bool(((found - expected).abs() <= tolerance).all())


def as_paint(found: Samples, directions: float, turned: bool = False) -> bool:
    """Whether samples are PAINT's: values to the bit, directions near, as pairs alone where the azimuth may differ."""
    same = torch.equal(found.values, PAINT.values) and found.channels == PAINT.channels and found.isotropic
    inner = near((found.wi * found.wo).sum(1), (PAINT.wi * PAINT.wo).sum(1), directions)
    heights = near(found.wi[:, 2], PAINT.wi[:, 2], directions) and near(found.wo[:, 2], PAINT.wo[:, 2], directions)
    whole = near(found.wi, PAINT.wi, directions) and near(found.wo, PAINT.wo, directions)
    return same and inner and heights and (turned or whole)


def is_grey(found: Samples, tolerance: float = 1e-15) -> bool:
    wanted = GREY.evaluate(found.wi, found.wo)
    return near(found.values, wanted, tolerance) and found.channels == ("R", "G", "B")


def is_nearly_grey(found: Samples) -> bool:
    """GREY as eight slices of an adaptive table hold it: linear between them, and rough at the horizon."""
    keep = (found.wi[:, 2] > 0.2) & (found.wo[:, 2] > 0.2)
    off = found.values[keep] / GREY.evaluate(found.wi[keep], found.wo[keep]) - 1
    return float(off.abs().median()) < 0.05 and found.channels == ("R", "G", "B")


def is_spectral(found: Samples) -> bool:
    names = tuple(f"{w:g}nm" for w in WAVELENGTHS)
    heights = near(found.wi[:, 2], ANGLES[:, 0].cos(), 1e-6) and near(found.wo[:, 2], ANGLES[:, 2].cos(), 1e-6)
    return torch.equal(found.values, SPECTRA) and found.channels == names and heights


HALF = PAINT.subset(6, 0)
DARK = Lambert((0.1, 0.1, 0.1))
WRITERS: dict[str, Writer] = {
    "npz": Writer(
        lambda path, second: npz.write(path, HALF if second else PAINT, {}),
        npz.read,
        lambda found: as_paint(found, 1e-15),
    ),
    "csv": Writer(
        lambda path, second: csv.write(path, HALF if second else PAINT), csv.read, lambda found: as_paint(found, 1e-15)
    ),
    "alta": Writer(
        lambda path, second: alta.write(path, HALF if second else PAINT),
        alta.read,
        lambda found: as_paint(found, 1e-12, turned=True),
    ),
    "astm": Writer(
        lambda path, second: astm.write(path, HALF if second else PAINT),
        astm.read,
        lambda found: as_paint(found, 1e-12, turned=True),
    ),
    "merl": Writer(lambda path, second: merl.write(path, DARK if second else GREY, (4, 4, 8)), read_samples, is_grey),
    "rgl": Writer(
        lambda path, second: rgl.write(path, tabulated(DARK if second else GREY, True, side=32, thetas=8)),
        read_samples,
        is_nearly_grey,
    ),
    "klems": Writer(
        lambda path, second: window_writer.write_klems(path, DARK if second else GREY, True, "grey"),
        read_samples,
        lambda found: is_grey(found, 1e-6),
    ),
    "tree": Writer(
        lambda path, second: window_writer.write_tree(path, DARK if second else GREY, True, "grey"),
        read_samples,
        lambda found: is_grey(found, 1e-6),
    ),
    "zemax": Writer(
        lambda path, second: zemax.write(path, DARK if second else GREY, True),
        read_samples,
        lambda found: is_grey(found, 1e-5),
    ),
    "speos": Writer(
        lambda path, second: speos_writer.write_brdf(path, DARK if second else GREY, True),
        read_samples,
        lambda found: is_grey(found, 1e-6),
    ),
    "speos anisotropic": Writer(
        lambda path, second: speos_writer.write_anisotropic(path, DARK if second else GREY, True),
        read_samples,
        lambda found: is_grey(found, 1e-6),
    ),
    "utia": Writer(lambda path, second: utia.write(path, DARK if second else GREY), read_samples, is_grey),
    "cornell": Writer(
        lambda path, second: cornell.write(path, ANGLES, SPECTRA / (2 if second else 1), WAVELENGTHS),
        lambda path: cornell.read(path, "spectral"),
        is_spectral,
    ),
}


def jsonable(facts: object) -> bool:
    """Whether facts come back from JSON as they are: lists and plain finite numbers, no tuples."""
    return json.loads(json.dumps(facts, allow_nan=False)) == facts
