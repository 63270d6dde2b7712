"""Surface files of Ansys Speos, .brdf (by wavelength) and .anisotropicbsdf (by rotation), in text mode.

    OPTIS - brdf surface file v8.0      or OPTIS - Anisotropic BSDF surface file v8.0
    0                                   0 text, 1 binary, which is not read
    comment
    N, and on the next lines a description of N characters
    0 1 0                               .anisotropicbsdf alone: the vector that rotations are counted from
    1 0                                 whether there is reflection, and transmission, which is passed over
    1                                   1: proportional to the BSDF; 0: to the intensity, that is BSDF · cosθo
    .brdf: numbers of incidences and wavelengths, incidences in degrees, wavelengths in nm, and for each incidence and
        wavelength a percentage and a table
    .anisotropicbsdf: number of rotations, rotations in degrees, for each the number of incidences and these; the
        incidence and rotation of the spectrum, a line of comment, the number of wavelengths, and wavelength and
        percentage a line; a table for each rotation and incidence
    a table: numbers of θ and φ, the φ, and rows of θ and values; φ = 0 is the side of the mirror direction

Tables are only proportional to the BSDF. The percentage of reflected light sets their scale. In a .brdf, every table
has its own percentage. In an .anisotropicbsdf, the percentages of the spectrum scale the table at its incidence, and
all other tables share this scale. FILE#table reads the numbers without scaling, as sr⁻¹. The mirror direction at φ = 0
and the meaning of the flags 0 and 1 follow Ansys's own converter (ansys/optical-automation) and agree with two measured
files. The sense of rotation is not known. Several wavelengths are converted to linear sRGB or Y; a single one is read
as Y. Negative values are set to 0 and counted.

`formats.speos_writer` writes a .brdf of an isotropic reflectance and an .anisotropicbsdf of any reflectance. Its
docstring lists what is lost.
"""

import math
import os
import re
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import torch

from homofact.brdf.channels import check_channels
from homofact.brdf.formats.incidence_files import asymmetry, reading_of
from homofact.brdf.formats.line_reader import LineReader
from homofact.brdf.formats.reading import Drawing, Reading
from homofact.brdf.incidences import IncidenceTable, IncidenceTables, reflected
from homofact.brdf.tristimulus import spectra_in
from homofact.errors import BadInput
from homofact.files.reading import read_bytes, split_member
from homofact.files.text import text_of

NAME = "speos"
DESCRIPTION = "Ansys Speos .brdf or .anisotropicbsdf, text mode (FILE#table takes its numbers as they are)"
MEMBER = "table"
_SPECTRAL, _ANISOTROPIC = "brdf", "Anisotropic BSDF"
_HEAD = re.compile(r"OPTIS - (brdf|Anisotropic BSDF) surface file v(\d+)(\.\d+)?\s*$")
_OLDEST = 7
_END = "End of file"
_LEAST_COSINE = 0.01


def sniff(head: bytes) -> bool:
    """Return whether a file that begins with `head` is of this format."""
    return _HEAD.match(text_of(head[:200]).split("\n")[0].strip()) is not None


def material_names(path: str | os.PathLike[str]) -> list[str]:
    """Return what may follow FILE#."""
    return [MEMBER]


@dataclass(frozen=True)
class _Grid:
    theta: np.ndarray
    phi: np.ndarray
    values: np.ndarray


def open_file(path: str | os.PathLike[str], channels: str = "rgb", drawing: Drawing | None = None) -> Reading:
    """Return the nodes as samples, and the tables as a reflectance; `drawing` is ignored.

    Raises BadInput that names file and line for binary mode, versions before 7, files with only transmission, counts
    that disagree with the file, angles that do not increase or are below the horizon, a percentage above 0 for a table
    of zeros, and a truncated file.
    """
    check_channels(channels)
    file, member = split_member(path)
    if member not in (None, MEMBER):
        raise BadInput(f"no reading #{member}", where=file, expected=f"no # or #{MEMBER}")
    raw = read_bytes(file, DESCRIPTION)
    lines = text_of(raw).replace("\r\n", "\n").split("\n")
    reader = LineReader(file, list(enumerate(lines, 1)))
    kind, comments = _head(reader)
    own = member == MEMBER
    try:
        if kind == _SPECTRAL:
            tables, facts = _spectral(reader, channels, own)
        else:
            tables, facts = _anisotropic(reader, channels, own)
        rest = [text.strip() for text in lines[len(lines) - reader.left :] if text.strip()]
        if rest not in ([_END], []) or (not rest and not raw.endswith(b"\n")):
            raise BadInput(
                f"{rest[0][:24]!r} after the last table" if rest else "no line end after the last table",
                where=file,
                expected=f"a whole file, which ends with {_END!r}",
            )
        off = asymmetry(tables)
        if tables.isotropic and off > 1e-3:
            comments.append(f"not mirror-symmetric: off by {off:.1%} in the mean")
        facts = {"format": NAME, "comments": comments} | facts | {"units": _units(facts.pop("density"), own)}
        return reading_of(path, tables, channels, facts)
    except BadInput as error:
        raise (error if str(file) in error.where else error.at(file)) from error


def _head(reader: LineReader) -> tuple[str, list[str]]:
    """(kind, comments), the reader standing behind the description."""
    found = _HEAD.match(reader.line("OPTIS - brdf surface file"))
    if found is None:
        raise reader.fault("no head of a Speos file", "OPTIS - brdf surface file v8.0 or the anisotropic one")
    if int(found[2]) < _OLDEST:
        raise reader.fault(f"version {found[2]}", f"{_OLDEST} or later, as the BSDF viewer of Speos saves it")
    if reader.flags(1, "0 for text, 1 for binary")[0]:
        raise reader.fault("binary mode", "text mode, as the BSDF viewer of Speos saves it")
    comment = reader.line("a comment")
    word = reader.line("the description's length")
    if not (word.isascii() and word.isdecimal() and len(word) < 7):
        raise reader.fault(f"a description of {word[:24]!r} characters", "their number")
    described, length = [], 0
    while True:
        described.append(reader.line("the description"))
        length += len(described[-1]) + 1
        if length > int(word):
            break
    return found[1], [text[:200] for text in (comment, *described) if text][:64]


def _parts(reader: LineReader) -> tuple[bool, bool, bool]:
    """(reflection, transmission, whether values are the BSDF's)."""
    reflection, transmission = reader.flags(2, "reflection and transmission")
    if not reflection:
        held = "transmission alone" if transmission else "neither reflection nor transmission"
        raise reader.fault(held, "reflection: homofact reads and fits that alone")
    return reflection, transmission, reader.flags(1, "1 for BSDF, 0 for intensity")[0]


def _incidences(reader: LineReader, count: int) -> np.ndarray:
    angles = reader.numbers(count, "incidences in degrees")
    if (np.diff(angles) <= 0).any() or angles[0] < 0 or angles[-1] > 90:
        raise reader.fault(f"incidences {', '.join(f'{x:g}' for x in angles[:8])}", "rising angles from 0 to 90")
    return angles


def _grid(reader: LineReader, density: bool) -> _Grid:
    """A table's angles in degrees and values, those of an intensity divided by cosθ."""
    rows, columns = reader.wholes(2, "numbers of theta and phi")
    phi = reader.numbers(columns, "phi in degrees")
    found = reader.table(rows, columns + 1, "theta and its values")
    theta, values = found[:, 0], found[:, 1:]
    if (np.diff(theta) <= 0).any() or (np.diff(phi) <= 0).any() or theta[0] < 0 or theta[-1] > 180:
        raise reader.fault("angles of a table that do not rise or leave the sphere", "theta and phi that rise")
    if not density:
        cosine = np.abs(np.cos(np.radians(theta)))
        sound = np.maximum.accumulate(np.where(cosine >= _LEAST_COSINE, np.arange(len(theta)), 0))
        values = (values / cosine.clip(_LEAST_COSINE)[:, None])[sound]
    return _Grid(theta, phi, values)


def _table(reader: LineReader, grid: _Grid, incidence: float, turn: float, values: np.ndarray) -> IncidenceTable:
    if grid.theta[-1] > 90 + 1e-6:
        raise reader.fault(f"theta up to {grid.theta[-1]:g} in reflection", "angles up to 90")
    return IncidenceTable(
        math.radians(incidence),
        math.radians(turn),
        torch.from_numpy(np.radians(grid.theta)),
        torch.from_numpy(np.radians(grid.phi)),
        torch.from_numpy(values.clip(0)),
    )


def _scale(reader: LineReader, table: IncidenceTable, percent: np.ndarray, own: bool) -> tuple[np.ndarray, np.ndarray]:
    """(what makes a table f in sr⁻¹, the reflectance of its own numbers), each (C,)."""
    total = reflected(table).numpy()
    if own:
        return np.ones_like(total), total
    if ((total <= 0) & (percent > 0)).any():
        raise reader.fault(f"a table of zeros that reflects {percent.max():g}%", "values above 0")
    return np.where(total > 0, percent / 100 / np.where(total > 0, total, 1), 0), total


def _spectral(reader: LineReader, channels: str, own: bool) -> tuple[IncidenceTables, dict[str, Any]]:
    """Tables and facts of a .brdf."""
    _, transmission, density = _parts(reader)
    incidences, waves = reader.wholes(2, "numbers of incidences and wavelengths")
    angles = _incidences(reader, incidences)
    wavelengths = reader.numbers(waves, "wavelengths in nm").tolist()
    row, stated, totals, negative = [], [], [], 0
    names, colour = ("Y",), {}
    for angle in angles:
        percents, grid = _of_wavelengths(reader, waves, density)
        negative += int((grid.values < 0).sum())
        scale, total = _scale(reader, _table(reader, grid, float(angle), 0.0, grid.values), percents, own)
        values = torch.from_numpy(grid.values.clip(0) * scale)
        if waves > 1:
            values, names, colour = spectra_in(values, wavelengths, channels)
        row.append(_table(reader, grid, float(angle), 0.0, values.numpy()))
        stated.append(np.round(percents, 6).tolist())
        totals.append([float(f"{100 * x:.4g}") for x in total])
    if transmission:
        for _ in range(incidences * waves):
            reader.numbers(1, "the percentage that a table transmits")
            _grid(reader, density)
    facts = {"reflected_percent": stated, "tables_percent": totals, "faults": {"negative": negative}}
    facts |= {"wavelengths_nm": wavelengths, "density": density} | ({"colour": colour} if colour else {})
    return IncidenceTables((tuple(row),), about_mirror=False, channels=names), facts


def _of_wavelengths(reader: LineReader, count: int, density: bool) -> tuple[np.ndarray, _Grid]:
    """Percentages (W,) and the grid of one incidence, its values (θ, φ, W)."""
    percents, grids = [], []
    for _ in range(count):
        percents.append(float(reader.numbers(1, "the percentage that a table reflects")[0]))
        if percents[-1] < 0:
            raise reader.fault(f"a table that reflects {percents[-1]:g}%", "0% or more")
        grids.append(_grid(reader, density))
        one, other = grids[0], grids[-1]
        if not (np.array_equal(one.theta, other.theta) and np.array_equal(one.phi, other.phi)):
            raise reader.fault("tables of an incidence with different angles", "the same at each wavelength")
    return np.array(percents), _Grid(grids[0].theta, grids[0].phi, np.stack([grid.values for grid in grids], -1))


def _anisotropic(reader: LineReader, channels: str, own: bool) -> tuple[IncidenceTables, dict[str, Any]]:
    """Tables and facts of an .anisotropicbsdf."""
    vector = reader.numbers(3, "the anisotropy vector")
    _, transmission, density = _parts(reader)
    places = [_places(reader) for _ in range(1 + transmission)]
    (theta, turn), wavelengths, percent = _spectrum(reader)
    if transmission:
        _spectrum(reader)
    rows, negative = [], 0
    for rotation, angles in places[0]:
        grids = [_grid(reader, density) for _ in angles]
        negative += sum(int((grid.values < 0).sum()) for grid in grids)
        rows.append(
            [_table(reader, g, float(a), rotation, g.values[:, :, None]) for g, a in zip(grids, angles, strict=True)]
        )
    for _, angles in places[1] if transmission else ():
        for _ in angles:
            _grid(reader, density)
    every = [table for row in rows for table in row]
    reference = min(every, key=lambda each: _distance(each, theta, turn))
    grey = own or bool((percent == percent[0]).all())
    scale, total = _scale(reader, reference, percent[:1] if grey else percent, own)
    names, colour = ("Y",), {}
    if not grey:
        converted, names, colour = spectra_in(torch.from_numpy(scale)[None], wavelengths, channels)
        scale = converted[0].numpy()
    tables = tuple(tuple(replace(t, values=t.values * torch.from_numpy(scale)) for t in row) for row in rows)
    facts = {
        "reflected_percent": np.round(percent, 6).tolist(),
        "at_degrees": [round(math.degrees(reference.theta_i), 4), round(math.degrees(reference.turn), 4)],
        "tables_percent": float(f"{100 * total[0]:.4g}"),
        "anisotropy_vector": vector.tolist(),
        "wavelengths_nm": wavelengths,
        "density": density,
        "faults": {"negative": negative},
    }
    return IncidenceTables(tables, about_mirror=False, channels=names), facts | ({"colour": colour} if colour else {})


def _distance(table: IncidenceTable, theta: float, turn: float) -> float:
    """How far a table is from an incidence and a rotation, in degrees."""
    round_ = abs(math.degrees(table.turn) - turn) % 360
    return abs(math.degrees(table.theta_i) - theta) + min(round_, 360 - round_)


def _places(reader: LineReader) -> list[tuple[float, np.ndarray]]:
    """Rotations in degrees, each with its incidences."""
    count = reader.wholes(1, "the number of rotations")[0]
    turns = reader.numbers(count, "rotations in degrees")
    return [(float(turn), _incidences(reader, reader.wholes(1, "the number of incidences")[0])) for turn in turns]


def _spectrum(reader: LineReader) -> tuple[tuple[float, float], list[float], np.ndarray]:
    """((incidence, rotation), wavelengths, percentages)."""
    theta, turn = reader.numbers(2, "incidence and rotation of the spectrum")
    reader.line("a comment on the spectrum")
    count = reader.wholes(1, "the number of wavelengths")[0]
    found = reader.table(count, 2, "wavelength and percentage")
    if (np.diff(found[:, 0]) <= 0).any():
        raise reader.fault("wavelengths that do not rise", "rising ones")
    if (found[:, 1] < 0).any():
        raise reader.fault("a percentage below 0", "0 or more")
    return (float(theta), float(turn)), found[:, 0].tolist(), found[:, 1]


def _units(density: bool, own: bool) -> str:
    scale = "the tables' own numbers" if own else "scaled to the percentage reflected"
    return f"1/sr, no cosine; {scale}" + ("" if density else "; cosine of the view divided out")
