"""BSDF files of Zemax OpticStudio (.bsdf), the interchange format of Radiant Imaging's measurements.

    # comments, anywhere
    Source  Measured
    Symmetry  PlaneSymmetrical          or Asymmetrical, or ASymmetrical4D with several rotations
    SpectralContent  Monochrome         or XYZ
    ScatterType  BRDF                   BTDF is refused
    SampleRotation  1                   how many, and on the next line the angles in degrees; so too
    AngleOfIncidence  13
    ScatterAzimuth  19                  about the mirror direction, 0 towards the normal, 180 towards the horizon
    ScatterRadial  11                   from the mirror direction
    Monochrome                          or TristimulusX, TristimulusY and TristimulusZ, one after the other
    DataBegin
    TIS 0.1345                          for each rotation and incidence the part of the light that is scattered,
    0.0638 …                            and a row of values over ScatterRadial for each azimuth
    DataEnd

Values are read as f in sr⁻¹ without the cosine. In a measured file, the integrals of the tables agree with its TIS
within 3–15%, the part that the grid does not cover. FILE#total instead scales each table to its TIS, for files whose
values are only proportional to f. The direction of azimuth 0 follows Ansys's own converter (ansys/optical-automation)
and agrees with a measured file, whose nodes below the horizon are 0. Nodes below the horizon are not read as samples.
XYZ is converted to linear sRGB. Negative values are set to 0 and counted. The sense of rotation is not known.

`write` writes one channel as Monochrome and others as XYZ. Nodes below the horizon are 0, as in measured files.
"""

import math
import os
from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import torch

from homofact.brdf.channels import check_channels
from homofact.brdf.formats.incidence_files import asymmetry, reading_of, tabulated
from homofact.brdf.formats.line_reader import LineReader
from homofact.brdf.formats.reading import Drawing, Reading
from homofact.brdf.incidences import IncidenceTable, IncidenceTables
from homofact.brdf.reflectance import Reflectance
from homofact.brdf.tristimulus import from_xyz, to_xyz
from homofact.errors import BadInput
from homofact.files.atomic import write_text
from homofact.files.reading import read_bytes, split_member
from homofact.files.text import check_last_line, numbered_lines, short
from homofact.geometry.directions import from_spherical
from homofact.geometry.quadrature import hemisphere_nodes

NAME = "zemax"
DESCRIPTION = "Zemax .bsdf (Symmetry, ScatterType, AngleOfIncidence …; FILE#total scales its tables to their TIS)"
MEMBER = "total"
_WORDS = {
    "Source": None,
    "Symmetry": ("PlaneSymmetrical", "Asymmetrical", "ASymmetrical4D"),
    "SpectralContent": ("Monochrome", "XYZ"),
    "ScatterType": ("BRDF", "BTDF"),
}
_ANGLES = ("SampleRotation", "AngleOfIncidence", "ScatterAzimuth", "ScatterRadial")
_BLOCKS = {"Monochrome": ("Monochrome",), "XYZ": ("TristimulusX", "TristimulusY", "TristimulusZ")}
_MOST_TOTAL = 1e6
# A measured file's tables and its TIS differ by 15% and less.
_FAR = 1.5


def sniff(head: bytes) -> bool:
    """Return whether `head` begins a file of this format: ScatterType or AngleOfIncidence in its first lines."""
    seen = 0
    for _, line in numbered_lines(head):
        if line.startswith("#"):
            continue
        key = line.split(None, 1)[0]
        if key in ("ScatterType", "AngleOfIncidence"):
            return True
        seen += 1
        if key not in _WORDS and key not in _ANGLES and seen > 12:
            return False
    return False


def material_names(path: str | os.PathLike[str]) -> list[str]:
    """Return what may follow FILE#."""
    return [MEMBER]


def open_file(path: str | os.PathLike[str], channels: str = "rgb", drawing: Drawing | None = None) -> Reading:
    """Return the nodes above the horizon as samples, and the tables as a reflectance; `drawing` is ignored.

    Raises BadInput that names file and line for transmission, missing or unknown keywords in the header, counts that
    disagree with the file, angles that do not increase or do not cover half a turn or a whole turn, words that are not
    numbers, and a truncated file.
    """
    check_channels(channels)
    file, member = split_member(path)
    if member not in (None, MEMBER):
        raise BadInput(f"no reading #{member}", where=file, expected=f"no # or #{MEMBER}")
    raw = read_bytes(file, DESCRIPTION)
    every = list(numbered_lines(raw))
    reader = LineReader(file, [(n, text) for n, text in every if not text.startswith("#")])
    words, angles, first = _header(reader)
    blocks = _BLOCKS[words["SpectralContent"]]
    totals, values = [], []
    for k, name in enumerate(blocks):
        total, block = _block(reader, name, first if k == 0 else reader.line(name), angles)
        totals.append(total)
        values.append(block)
    if reader.left:
        raise reader.fault(f"lines after DataEnd ({reader.left})", "the end of the file")
    if every[-1][1] != "DataEnd":
        check_last_line(file, raw, every[-1][0])
    stacked = np.stack(values, -1)
    facts = {
        "format": NAME,
        "comments": [text.lstrip("# ")[:200] for _, text in every if text.startswith("#")][:64],
        "faults": {"negative": int((stacked < 0).sum())},
        "tis": np.stack(totals, -1),
    }
    scale = facts["tis"] if member == MEMBER else np.zeros(0)
    try:
        return _reading(path, words["Symmetry"], angles, stacked, scale, channels, facts)
    except BadInput as error:
        raise (error if str(file) in error.where else error.at(file)) from error


def _header(reader: LineReader) -> tuple[dict[str, str], dict[str, np.ndarray], str]:
    """The words, the angles in degrees, and the first line that is no part of the header."""
    words: dict[str, str] = {}
    angles: dict[str, np.ndarray] = {}
    while True:
        line = reader.line("a header with " + ", ".join((*_WORDS, *_ANGLES)))
        key, _, text = line.partition(" ") if " " in line else line.partition("\t")
        text = text.strip()
        if key in angles or key in words:
            raise reader.fault(f"{key} for the second time", "it once")
        if key in _ANGLES:
            angles[key] = _angles(reader, key, reader.whole(text, f"the number of {key}"))
        elif key in _WORDS:
            known = _WORDS[key]
            found = text if known is None else next((word for word in known if word.lower() == text.lower()), None)
            if found is None:
                raise reader.fault(f"{key} is {short(text)}", f"one of {', '.join(known or ())}")
            words[key] = found
            if found == "BTDF":
                raise reader.fault("transmission (BTDF)", "BRDF: homofact reads and fits reflection alone")
        else:
            break
    missing = [name for name in (*_WORDS, *_ANGLES) if name not in words and name not in angles and name != "Source"]
    if missing:
        raise reader.fault(f"data before {', '.join(missing)}", "the whole header first")
    return words, angles, line


def _angles(reader: LineReader, key: str, count: int) -> np.ndarray:
    found = reader.numbers(count, f"{key} in degrees")
    most = {"AngleOfIncidence": 90, "ScatterRadial": 180}.get(key, 360)
    if (np.diff(found) <= 0).any() or found[-1] > most or (key not in _ANGLES[:1] and found[0] < 0):
        raise reader.fault(f"{key} {', '.join(f'{x:g}' for x in found[:8])}", f"rising angles up to {most}")
    return found


def _block(reader: LineReader, name: str, line: str, angles: dict[str, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """TIS (rotations, incidences) and values (rotations, incidences, azimuths, radials) of one channel."""
    if line != name:
        raise reader.fault(f"{short(line)}", name)
    turns, incidences, azimuths, radials = (len(angles[key]) for key in _ANGLES)
    totals, tables = [], []
    if reader.line("DataBegin") != "DataBegin":
        raise reader.fault("no DataBegin", f"it after {name}")
    # What the header promises is compared with the file before anything of that size is made of it.
    if turns * incidences * (azimuths + 1) > reader.left:
        raise BadInput(
            f"{reader.left} lines of data", where=reader.path,
            expected=f"{turns * incidences * (azimuths + 1)} or more, as the header counts",
        )  # fmt: skip
    for _ in range(turns * incidences):
        key, _, text = reader.line("TIS").replace("\t", " ").partition(" ")
        if key != "TIS":
            raise reader.fault(f"{short(key)}", "TIS and a number")
        totals.append(_total(text))
        if not 0 <= totals[-1] <= _MOST_TOTAL:
            raise reader.fault(f"TIS is {short(text)}", "a number of at least 0")
        tables.append(reader.table(azimuths, radials, "values over ScatterRadial"))
    if reader.line("DataEnd") != "DataEnd":
        raise reader.fault("more rows than the header counts", "DataEnd")
    shape = (turns, incidences)
    return np.array(totals).reshape(shape), np.stack(tables).reshape(*shape, azimuths, radials)


def _total(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return math.nan


def _reading(
    path: object,
    symmetry: str,
    angles: dict[str, np.ndarray],
    values: np.ndarray,
    totals: np.ndarray,
    channels: str,
    facts: dict[str, Any],
) -> Reading:
    """The reading of values (rotations, incidences, azimuths, radials, C); `totals` is empty where they are f."""
    turns, incidences, azimuth, radial = (np.radians(angles[key]) for key in _ANGLES)
    span = float(angles["ScatterAzimuth"][-1] - angles["ScatterAzimuth"][0])
    if (symmetry == "PlaneSymmetrical") != (abs(span - 180) < 1e-6):
        raise BadInput(
            f"{symmetry} with azimuths over {span:g} degrees", expected="180 with PlaneSymmetrical, else 360"
        )
    rows = tuple(
        tuple(
            IncidenceTable(
                float(theta), float(turn), torch.from_numpy(radial), torch.from_numpy(azimuth),
                torch.from_numpy(values[j, k].transpose(1, 0, 2).clip(0)),
            )
            for k, theta in enumerate(incidences)
        )
        for j, turn in enumerate(turns)
    )  # fmt: skip
    names = ("Y",) if values.shape[-1] == 1 else ("X", "Y", "Z")
    tables = IncidenceTables(rows, about_mirror=True, channels=names)
    own = np.array([[_total_of(table, names) for table in row] for row in rows])
    facts["tables_reflect"] = np.round(own, 6).tolist()
    if len(totals):
        scale = totals / np.where(own > 0, own, np.inf)
        tables = _scaled(tables, scale)
        facts["units"] = "1/sr, no cosine; scaled to the TIS of each incidence"
    else:
        facts["units"] = "1/sr, no cosine"
        off = np.abs(np.log(np.where((own > 0) & (facts["tis"] > 0), facts["tis"] / np.where(own > 0, own, 1), 1)))
        if off.max() > math.log(_FAR):
            ratio = float(np.exp(off.max()))
            facts["comments"].append(
                f"its TIS and its tables differ by up to {ratio:.3g} times: #{MEMBER} takes the TIS"
            )
    facts["tis"] = np.round(facts["tis"], 6).tolist()
    off = asymmetry(tables)
    if tables.isotropic and off > 1e-3:
        facts["comments"].append(f"not mirror-symmetric: off by {off:.1%} in the mean")
    if len(names) == 3:
        tables = _in_rgb(tables)
    return reading_of(path, tables, channels, facts)


def _total_of(table: IncidenceTable, names: tuple[str, ...]) -> np.ndarray:
    """∫ f cosθo dωo (C,) of one table about the mirror direction."""
    return _hemispherical(IncidenceTables(((table,),), about_mirror=True, channels=names), table).numpy()


def _changed(tables: IncidenceTables, values: Iterable[torch.Tensor], channels: tuple[str, ...]) -> IncidenceTables:
    """The tables with other values."""
    each = iter(values)
    rows = tuple(tuple(replace(table, values=next(each)) for table in row) for row in tables.tables)
    return replace(tables, tables=rows, channels=channels)


def _scaled(tables: IncidenceTables, scale: np.ndarray) -> IncidenceTables:
    every = [(table, scale[j, k]) for j, row in enumerate(tables.tables) for k, table in enumerate(row)]
    return _changed(tables, [table.values * torch.from_numpy(s) for table, s in every], tables.channels)


def _in_rgb(tables: IncidenceTables) -> IncidenceTables:
    every = [from_xyz(table.values).clamp_min(0) for row in tables.tables for table in row]
    return _changed(tables, every, ("R", "G", "B"))


def write(path: str | os.PathLike[str], reflectance: Reflectance, isotropic: bool, comments: Sequence[str] = ()) -> int:
    """Write a reflectance at the nodes of `incidence_files`; return the number of its values.

    One channel is written as Monochrome; R, G, B or a spectrum as XYZ. An isotropic reflectance is written as
    PlaneSymmetrical, others as ASymmetrical4D with 12 rotations. Values have six digits. Raises BadInput as `to_xyz`,
    and for a place that cannot be written.
    """
    tables = tabulated(reflectance, isotropic, about_mirror=True)
    every = [table for row in tables.tables for table in row]
    blocks = [to_xyz(table.values.reshape(-1, len(tables.channels)), tables.channels) for table in every]
    names = _BLOCKS["Monochrome" if blocks[0].shape[1] == 1 else "XYZ"]
    totals = [_hemispherical(reflectance, table) for table in every]
    head = {
        "SampleRotation": [math.degrees(row[0].turn) for row in tables.tables],
        "AngleOfIncidence": [math.degrees(table.theta_i) for table in tables.tables[0]],
        "ScatterAzimuth": every[0].azimuth.rad2deg().tolist(),
        "ScatterRadial": every[0].polar.rad2deg().tolist(),
    }
    lines = [f"# {' '.join(comment.split())}" for comment in comments]
    lines += ["Source  Measured", f"Symmetry  {'PlaneSymmetrical' if isotropic else 'ASymmetrical4D'}"]
    lines += [f"SpectralContent  {'XYZ' if len(names) == 3 else 'Monochrome'}", "ScatterType  BRDF"]
    for key, angles in head.items():
        lines += [f"{key}  {len(angles)}", "\t".join(f"{x:.10g}" for x in angles)]
    lines.append("")
    for c, name in enumerate(names):
        lines += [name, "DataBegin"]
        for table, block, total in zip(every, blocks, totals, strict=True):
            lines.append(f"TIS {max(0.0, float(to_xyz(total[None], tables.channels)[0, c])):.6g}")
            values = block[:, c].reshape(table.values.shape[:2]).T
            lines += ["\t".join(f"{x:.6g}" for x in row) for row in values.clamp_min(0).tolist()]
        lines.append("DataEnd")
    write_text(path, "\n".join(lines) + "\n")
    return len(names) * sum(len(block) for block in blocks)


def _hemispherical(reflectance: Reflectance, table: IncidenceTable) -> torch.Tensor:
    """What a reflectance reflects of the light at an incidence, (C,)."""
    wi = from_spherical(torch.tensor(table.theta_i), torch.tensor(table.turn)).double()
    wo, solid = hemisphere_nodes(wi[None])
    values = reflectance.evaluate(wi.expand(wo.shape[1], 3), wo[0]).double()
    return (values * (solid[0] * wo[0, :, 2])[:, None]).sum(0)
