"""Goniophotometer data of pab advanced technologies (Mountain), as Radiance's pabopto2bsdf reads them.

    #sample_name "paint"
    #format: theta phi BSDF         or BRDF; DSF is BSDF · cosθo and is divided by it; BTDF is refused
    #intheta 30                     direction of the light in degrees, or #incident_angle 30 180; the same coordinates
    #inphi 180                      as the rows', θ above 90 being the back
    #upphi 0                        the azimuth that points up, by default 0
    #colorimetry: CIE-Y             or CIE-XYZ, three values a row
    29.8 0.3 1.25                   θ and φ of the viewer in degrees, then the values

The program writes one file for each incidence. A file is read with all others of its folder that have the same
#sample_name and #format, the light on the same side, and the same colorimetry; a file without #sample_name is read
alone. One file may also hold several such tables, one after the other. FILE#front and FILE#back select the side of the
light; you can omit it if only one side is lit. Azimuths are rotated so that up is at 90°, seen from the front. On the
back, x points the other way. Rows with the viewer on the other side than the light are transmission; they are left out
and counted. If the reader divides by a cosine, so are rows within 0.6° of the horizon. If all light comes from one
azimuth, the material is read as isotropic; no other symmetry is assumed. Negative values are set to 0 and counted. XYZ
is converted to linear sRGB.
"""

import math
import os
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from homofact.brdf.channels import check_channels
from homofact.brdf.formats.reading import in_channels, line_fault
from homofact.brdf.klems import planar
from homofact.brdf.samples import Samples, lit_from_one_azimuth
from homofact.brdf.tristimulus import from_xyz
from homofact.errors import BadInput
from homofact.files.reading import read_bytes, split_member
from homofact.files.text import check_last_line, number_table, numbered_lines, short
from homofact.geometry.directions import from_spherical

NAME = "pabopto"
DESCRIPTION = "pab-opto goniophotometer tables (#format: theta phi BSDF, #intheta …; FILE#front or FILE#back)"
SIDES = ("front", "back")
_FORMATS = {"bsdf": False, "brdf": False, "dsf": True}
_COLOURS = {"cie-y": 1, "cie-xyz": 3}
_FORMAT = re.compile(r"#\s*format:\s*theta\s+phi\s+(\S+)\s*$", re.IGNORECASE)
_LEAST_COSINE = 0.01
_MOST_FILES = 2000
_HEAD = 65_536


@dataclass(frozen=True)
class _Head:
    """What stands before a table's rows."""

    name: str
    density: bool
    theta: float
    phi: float
    up: float
    columns: int

    @property
    def side(self) -> str:
        """The side of the light."""
        return SIDES[self.theta > 90]

    @property
    def kind(self) -> tuple[str, bool, int]:
        """What tables that belong together have in common, beside the side."""
        return self.name, self.density, self.columns


@dataclass(frozen=True)
class _Table:
    head: _Head
    rows: np.ndarray


def sniff(head: bytes) -> bool:
    """Return whether a file that begins with `head` is of this format: #format: theta phi … before any row."""
    for _, line in numbered_lines(head):
        if not line.startswith("#"):
            return False
        if _FORMAT.match(line):
            return True
    return False


def material_names(path: str | os.PathLike[str]) -> list[str]:
    """Return the lit sides in a file and in the other files of its sample. Raises BadInput for a damaged file."""
    lit = {table.head.side for table in _together(split_member(path)[0])[0]}
    return [side for side in SIDES if side in lit]


def read(path: str | os.PathLike[str], channels: str = "rgb") -> Samples:
    """Return the samples of a file and those beside it that belong to the same sample.

    Raises BadInput that names file and line for a header without the format or the direction of the light, an unknown
    format, wrong column counts, words that are not numbers, angles out of range, and a truncated file. Also raised if
    both sides are lit and none is selected, or if the file contains only transmission.
    """
    check_channels(channels)
    file, member = split_member(path)
    tables, names = _together(file)
    held = [side for side in SIDES if any(table.head.side == side for table in tables)]
    if member is not None and member.lower() not in held:
        known = f"#{' or #'.join(held)}"
        raise BadInput(f"no light on #{member}", where=file, expected=known)
    if member is None and len(held) > 1:
        name = os.path.basename(str(file))
        raise BadInput("light on both sides", where=file, expected=f"{name}#front or {name}#back")
    side = held[0] if member is None else member.lower()
    wi, wo, values, across, near = _samples(file, [table for table in tables if table.head.side == side], side)
    negative = int((values < 0).sum())
    values, outside = values.clamp_min(0), 0
    if values.shape[1] == 3:
        values = from_xyz(values)
        outside = int((values < 0).sum())
        values = values.clamp_min(0)
    density = tables[0].head.density
    samples = Samples(
        wi,
        wo,
        values,
        channels=("R", "G", "B") if values.shape[1] == 3 else ("Y",),
        isotropic=lit_from_one_azimuth(wi),
        provenance={
            "format": NAME,
            "comments": [f"sample {tables[0].head.name}"] if tables[0].head.name else [],
            "files": names,
            "side": side,
            "units": "1/sr, no cosine" + ("; cosine of the view divided out" if density else ""),
            "faults": {
                "transmitted": across,
                "at_horizon": near,
                "negative": negative,
                "out_of_gamut": outside,
                "exact_zeros": int((values == 0).sum()),
            },
        },
    )
    return in_channels(path, samples, channels)


def _samples(file: object, tables: list[_Table], side: str) -> tuple[Tensor, Tensor, Tensor, int, int]:
    """(wi, wo, values, rows of transmission, rows at the horizon) of one side's tables."""
    parts, across, near = [], 0, 0
    for table in tables:
        head = table.head
        rows = torch.from_numpy(table.rows)
        wo = from_spherical(rows[:, 0].deg2rad(), (rows[:, 1] + 90 - head.up).deg2rad())
        wi = from_spherical(
            torch.tensor(head.theta, dtype=torch.float64).deg2rad(),
            torch.tensor(head.phi + 90 - head.up, dtype=torch.float64).deg2rad(),
        )[None]
        if side == "back":
            # Seen from the back, up stays up and x points the other way.
            wi, wo = (planar(w * w.new_tensor([1.0, 1.0, -1.0]), True) for w in (wi, wo))
        same = wo[:, 2] >= -1e-9
        level = same & (wo[:, 2] < _LEAST_COSINE) if head.density else torch.zeros_like(same)
        across, near = across + int((~same).sum()), near + int(level.sum())
        keep = same & ~level
        wo, values = wo[keep], rows[keep, 2:]
        if head.density:
            values = values / wo[:, 2:]
        wi, wo = (torch.cat((w[:, :2], w[:, 2:].clamp_min(0)), 1) for w in (wi, wo))
        parts.append((wi.expand(len(wo), 3), wo / wo.norm(dim=1, keepdim=True).clamp_min(1e-300), values))
    wi, wo, values = (torch.cat(each) for each in zip(*parts, strict=True))
    if not len(wi):
        found = f"all rows ({across}) are transmission" if across else "no row above the horizon"
        raise BadInput(found, where=file, expected="rows on the light's side: homofact reads reflection alone")
    return wi / wi.norm(dim=1, keepdim=True), wo, values, across, near


def _together(file: object) -> tuple[list[_Table], list[str]]:
    """The tables of a file and of those beside it that belong to it, and the names of the files."""
    own = _tables(file, read_bytes(str(file), DESCRIPTION))
    place = Path(str(file))
    kind = own[0].head.kind
    if any(table.head.kind != kind for table in own):
        raise BadInput("tables of several samples, formats or colorimetries", where=file, expected="those of one")
    if not kind[0] or len(own) > 1:
        return own, [place.name]
    found = {place.name: own}
    for other in sorted(place.parent.iterdir())[:_MOST_FILES]:
        if other.name in found or other.suffix != place.suffix or not other.is_file():
            continue
        with open(other, "rb") as opened:
            head = opened.read(_HEAD)
        if sniff(head):
            tables = _tables(other, read_bytes(other, DESCRIPTION))
            if all(table.head.kind == kind for table in tables):
                found[other.name] = tables
    names = sorted(found)
    return [table for name in names for table in found[name]], names


def _tables(path: object, raw: bytes) -> list[_Table]:
    """The tables of a file, one after the other."""
    lines = list(numbered_lines(raw))
    if not lines or not sniff(raw):
        raise BadInput("no line #format: theta phi …", where=path, expected=DESCRIPTION)
    check_last_line(path, raw, lines[-1][0])
    tables: list[_Table] = []
    at = 0
    while at < len(lines):
        begun = at
        while at < len(lines) and lines[at][1].startswith("#"):
            at += 1
        head = _head(path, lines[begun:at])
        begun = at
        while at < len(lines) and not lines[at][1].startswith("#"):
            at += 1
        if begun == at:
            raise BadInput("a header without rows", where=path, expected=f"rows of {2 + head.columns} numbers")
        what = f"theta, phi and {head.columns} of {'CIE-XYZ' if head.columns == 3 else 'CIE-Y'}"
        rows, places = number_table(path, lines[begun:at], 2 + head.columns, what)
        wrong = (rows[:, 0] < 0) | (rows[:, 0] > 180) | (np.abs(rows[:, 1]) > 720)
        if wrong.any():
            row = int(wrong.argmax())
            found = f"theta {rows[row, 0]:g}, phi {rows[row, 1]:g}"
            raise line_fault(path, places[row], found, "degrees: theta from 0 to 180, phi of at most two turns")
        tables.append(_Table(head, rows))
    return tables


def _head(path: object, lines: list[tuple[int, str]]) -> _Head:
    name, density, columns = "", None, 1
    angles: dict[str, float] = {"upphi": 0.0}
    for number, line in lines:
        text = line.lstrip("# ")
        key, _, rest = text.partition(" ")
        if found := _FORMAT.match(line):
            if found[1].lower() not in _FORMATS:
                problem = "transmission (BTDF)" if found[1].lower() == "btdf" else f"format theta phi {short(found[1])}"
                raise line_fault(path, number, problem, "BSDF, BRDF or DSF: homofact reads reflection alone")
            density = _FORMATS[found[1].lower()]
        elif key == "sample_name":
            name = rest.strip().strip('"')
        elif key.lower() == "colorimetry:":
            if rest.strip().lower() not in _COLOURS:
                raise line_fault(path, number, f"colorimetry {short(rest.strip())}", "CIE-Y or CIE-XYZ")
            columns = _COLOURS[rest.strip().lower()]
        elif key == "incident_angle":
            angles["intheta"], angles["inphi"] = number_table(path, [(number, rest)], 2, "theta and phi")[0][0]
        elif key in ("intheta", "inphi", "upphi"):
            angles[key] = float(number_table(path, [(number, rest)], 1, "degrees")[0][0, 0])
    place = lines[-1][0] if lines else 1
    if density is None or "intheta" not in angles or "inphi" not in angles:
        missing = "#format: theta phi …" if density is None else "the light's direction"
        expected = "#format, and #intheta and #inphi or #incident_angle"
        raise line_fault(path, place, f"a header without {missing}", expected)
    if not 0 <= angles["intheta"] <= 180 or math.isclose(angles["intheta"], 90):
        raise line_fault(path, place, f"intheta {angles['intheta']:g}", "degrees from 0 to 180, not 90")
    return _Head(name, density, float(angles["intheta"]), float(angles["inphi"]), float(angles["upphi"]), columns)
