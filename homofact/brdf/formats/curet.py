"""CUReT text (Dana, van Ginneken, Nayar and Koenderink 1999; the database's page on its BRDF measurements).

    abrdf.dat                 a row a sample: its number, 1 to 61, and 205 values; rbrdf.dat, gbrdf.dat and
                              bbrdf.dat likewise for red, green and blue, abrdf.dat being their mean
    table.txt                 a row a measurement: theta_v phi_v theta_i phi_i, polar angle and azimuth of the viewer
                              and of the light in radians

The directions are not in the file, so table.txt must lie beside it. If you read rbrdf.dat, gbrdf.dat or bbrdf.dat and
all three are in the folder, they are read together as RGB; otherwise the one file is read as a single channel.
abrdf.dat is read as luminance. FILE#7 picks the sample of that number. The values are f in sr⁻¹ without the cosine.
If all light comes from one azimuth, the material is read as isotropic. In this database it does not, and many of its
materials are anisotropic. Negative values are set to 0 and counted.

`write` writes the files of one material: table.txt, abrdf.dat with the mean of the channels, and for three channels
also rbrdf.dat, gbrdf.dat and bbrdf.dat. Values and angles are written with all digits. Weights are not written.
"""

import math
import os
from pathlib import Path

import numpy as np
import torch

from homofact.brdf.channels import check_channels
from homofact.brdf.formats.reading import check_azimuths, in_channels, line_fault
from homofact.brdf.samples import Samples, lit_from_one_azimuth
from homofact.errors import BadInput
from homofact.files.atomic import write_text
from homofact.files.reading import read_bytes, split_member
from homofact.files.text import check_last_line, number_table, numbered_lines
from homofact.geometry.directions import from_spherical, to_spherical

NAME = "curet"
DESCRIPTION = "CUReT text (rows of a sample's number and 205 values, table.txt beside; FILE#NUMBER picks a sample)"
MEASUREMENTS = 205
SAMPLES = 61
TABLE = "table.txt"
COLOURS = ("rbrdf.dat", "gbrdf.dat", "bbrdf.dat")
MEAN = "abrdf.dat"
_SLACK = 1e-6


def sniff(head: bytes) -> bool:
    """Whether a file that begins with `head` is of this format: a first row of 206 numbers, the first a sample's."""
    line = next((line for _, line in numbered_lines(head)), "").split()
    if len(line) != MEASUREMENTS + 1 or not _is_number_of_sample(line[0]):
        return False
    try:
        return all(math.isfinite(float(word)) for word in line)
    except ValueError:
        return False


def material_names(path: str | os.PathLike[str]) -> list[str]:
    """Return the numbers of the samples in a file, as text. Raises BadInput for a damaged one."""
    return [str(number) for number in _rows(split_member(path)[0])]


def read(path: str | os.PathLike[str], channels: str = "rgb") -> Samples:
    """Return the 205 samples of material FILE#NUMBER; the number is optional if the file has one material.

    Raises BadInput that names file and line if table.txt is missing or does not contain 205 rows of four angles above
    the horizon. Also raised for rows of another length, a truncated file, words that are not numbers, and material
    numbers that occur twice or are not from 1 to 61. Also raised if the file has several materials and none is
    selected, or if it does not contain the selected one.
    """
    check_channels(channels)
    file, member = split_member(path)
    place = Path(file)
    beside = [place.with_name(name) for name in COLOURS]
    coloured = place.name in COLOURS and all(own.is_file() for own in beside)
    files = beside if coloured else [place]
    tables = [_rows(own) for own in files]
    number = _chosen(file, tables[0], member)
    for own, table in zip(files, tables, strict=True):
        if number not in table:
            raise BadInput(f"holds no sample {number}", where=own, expected=f"it as in {place.name}")
    values = torch.from_numpy(np.stack([table[number] for table in tables], 1))
    theta_v, phi_v, theta_i, phi_i = torch.from_numpy(_directions(place.with_name(TABLE))).T
    negative = int((values < 0).sum())
    names = ("R", "G", "B") if coloured else ("luminance" if place.name not in COLOURS else place.name[0].upper(),)
    wi = from_spherical(theta_i, phi_i)
    samples = Samples(
        wi,
        from_spherical(theta_v, phi_v),
        values.clamp_min(0),
        channels=names,
        isotropic=lit_from_one_azimuth(wi),
        provenance={
            "format": NAME,
            "material": f"sample {number}",
            "comments": [],
            "units": "1/sr, no cosine; angles in radians, from table.txt",
            "faults": {"negative": negative, "exact_zeros": int((values == 0).sum())},
        },
    )
    return in_channels(file, samples, channels)


def _chosen(file: object, table: dict[int, np.ndarray], member: str | None) -> int:
    """The number of the sample asked for."""
    if member is None:
        if len(table) > 1:
            listed = ", ".join(map(str, list(table)[:4]))
            raise BadInput(
                f"holds {len(table)} samples ({listed}, …)",
                where=file,
                expected=f"one of them as {os.path.basename(str(file))}#{next(iter(table))}",
            )
        return next(iter(table))
    if not _is_number_of_sample(member) or int(member) not in table:
        raise BadInput(where=file, found=f"no sample {member!r}", expected=f"one of its {len(table)}")
    return int(member)


def _rows(path: str | os.PathLike[str]) -> dict[int, np.ndarray]:
    """The 205 values of every sample by its number, in the file's order."""
    raw = read_bytes(path, DESCRIPTION)
    numbers, places = number_table(
        path, numbered_lines(raw), MEASUREMENTS + 1, f"a sample's number and {MEASUREMENTS} values"
    )
    if places:
        check_last_line(path, raw, places[-1])
    table: dict[int, np.ndarray] = {}
    for row, line in zip(numbers, places, strict=True):
        if row[0] != int(row[0]) or not 1 <= row[0] <= SAMPLES or int(row[0]) in table:
            raise line_fault(path, line, f"sample {row[0]:g}", f"each of 1 to {SAMPLES} at most once")
        table[int(row[0])] = row[1:]
    if not table:
        raise BadInput("holds no row", where=path, expected=f"rows of a sample's number and {MEASUREMENTS} values")
    return table


def _directions(path: Path) -> np.ndarray:
    """theta_v, phi_v, theta_i, phi_i (205, 4) in radians."""
    raw = read_bytes(path, f"the database's table of {MEASUREMENTS} directions there")
    numbers, places = number_table(path, numbered_lines(raw), 4, "theta_v phi_v theta_i phi_i")
    if len(numbers) != MEASUREMENTS:
        raise BadInput(f"{len(numbers)} rows", where=path, expected=MEASUREMENTS)
    check_last_line(path, raw, places[-1])
    theta = numbers[:, [0, 2]]
    wrong = ((theta < -_SLACK) | (theta > math.pi / 2 + _SLACK)).any(1)
    if wrong.any():
        row = int(wrong.argmax())
        what = f"theta_v {theta[row, 0]:g}, theta_i {theta[row, 1]:g}"
        raise line_fault(path, places[row], what, "radians from 0 to pi/2")
    for column, name in ((1, "phi_v"), (3, "phi_i")):
        check_azimuths(path, places, name, torch.from_numpy(numbers[:, column].copy()), False)
    numbers[:, [0, 2]] = theta.clip(0, math.pi / 2)
    return numbers


def _is_number_of_sample(word: str) -> bool:
    return word.isascii() and word.isdecimal() and len(word) < 3 and 1 <= int(word) <= SAMPLES


def write(folder: str | os.PathLike[str], samples: Samples, number: int = 1) -> None:
    """Write the files of one material, of that number, into an existing `folder`.

    Raises BadInput unless there are 205 samples, one or three channels, and a material number from 1 to 61.
    """
    if len(samples) != MEASUREMENTS or len(samples.channels) not in (1, 3) or not 1 <= number <= SAMPLES:
        raise BadInput(
            f"{len(samples)} samples of {len(samples.channels)} channels as number {number}",
            where="CUReT files",
            expected=f"{MEASUREMENTS} samples of 1 or 3 channels and a number from 1 to {SAMPLES}",
        )
    columns = {MEAN: samples.values.mean(1)}
    if len(samples.channels) == 3:
        columns |= {name: samples.values[:, c] for c, name in enumerate(COLOURS)}
    for name, values in columns.items():
        write_text(Path(folder) / name, f"{number} {' '.join(map(repr, values.tolist()))}\n")
    table = torch.stack((*to_spherical(samples.wo), *to_spherical(samples.wi)), 1)
    write_text(Path(folder) / TABLE, "".join(f"{' '.join(map(repr, row))}\n" for row in table.tolist()))
