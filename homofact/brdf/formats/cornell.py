"""The text format of the Cornell Program of Computer Graphics' reflectance measurements.

    # comments, the material's name among them
    31                                 number of wavelengths
    400 410 420 … 700                  the wavelengths in nm, over as many lines as it takes
    θi φi θs φs v1 … v31               one row per sample: radians, spectral BRDF in sr⁻¹ without the cosine

φ is absolute (the mirror direction of φi = 0 is φs = π). The file does not contain the number of rows. The reader
rejects a file that ends within a row, but cannot detect a file that was cut exactly between two rows.
"""

import math
import os
from collections.abc import Iterator, Sequence

import numpy as np
import torch
from torch import Tensor

from homofact.brdf.channels import check_channels
from homofact.brdf.formats.reading import check_azimuths, in_channels, line_fault, zeros_of
from homofact.brdf.samples import Samples
from homofact.brdf.wavelengths import spectral_names
from homofact.errors import BadInput
from homofact.files.atomic import write_text
from homofact.files.reading import read_bytes
from homofact.files.text import check_last_line, number_table, numbered_lines, short, text_of
from homofact.geometry.directions import from_spherical

NAME = "cornell"
DESCRIPTION = "Cornell text (number of wavelengths, wavelengths, rows of four angles and a spectrum)"
# π/2 rounded to six digits may lie above it; more is under the horizon.
_ANGLE_SLACK = 1e-6


def sniff(head: bytes) -> bool:
    """Return whether `head` begins a file of this format: a count on its own line, then increasing wavelengths."""
    lines = [line.split() for _, line in _content(head)]
    if b"# num wls" in head and (not lines or len(lines[0]) == 1):
        return True
    if len(lines) < 2 or len(lines[0]) != 1 or not _is_count(lines[0][0]):
        return False
    try:
        first = [float(word) for word in lines[1][: int(lines[0][0])]]
    except ValueError:
        return False
    return all(100 <= w <= 20_000 for w in first) and first == sorted(first)


def read(path: str | os.PathLike[str], channels: str = "rgb") -> Samples:
    """Return the samples of a file, isotropic, as "rgb" (linear sRGB under D65), "spectral" or "luminance".

    Exact zeros are kept: provenance["faults"] counts them. Raises BadInput that names file and line for words that are
    not numbers, numbers that are not finite or negative, wrong column counts, a truncated file, and directions below
    the horizon.
    """
    check_channels(channels)
    raw = read_bytes(path, DESCRIPTION)
    lines = list(_content(raw))
    wavelengths, start = _wavelengths(path, lines)
    expected = f"4 angles and {len(wavelengths)} values"
    table, places = number_table(path, lines[start:], 4 + len(wavelengths), expected)
    if not places:
        raise BadInput(
            "no samples after the wavelengths", where=path, expected=f"rows of {4 + len(wavelengths)} numbers"
        )
    check_last_line(path, raw, places[-1])
    _check(path, places, table)
    theta_i, phi_i, theta_s, phi_s = torch.from_numpy(table[:, :4].copy()).T
    for name, phi in (("phi_i", phi_i), ("phi_s", phi_s)):
        check_azimuths(path, places, name, phi, False)
    values = torch.from_numpy(table[:, 4:].copy())
    comments = [line.lstrip("# ").rstrip() for line in text_of(raw).splitlines() if line.startswith("#")]
    samples = Samples(
        from_spherical(theta_i.clamp_max(math.pi / 2), phi_i),
        from_spherical(theta_s.clamp_max(math.pi / 2), phi_s),
        values,
        channels=spectral_names(wavelengths),
        isotropic=True,
        provenance={
            "format": NAME,
            "comments": [line for line in comments if line],
            "wavelengths_nm": wavelengths,
            "faults": zeros_of(values),
        },
    )
    return in_channels(path, samples, channels)


def write(
    path: str | os.PathLike[str],
    angles: Tensor,
    spectra: Tensor,
    wavelengths: Sequence[float],
    comments: Sequence[str] = (),
) -> None:
    """Write angles (N, 4) in radians and spectra (N, W) in sr⁻¹, six digits after the point.

    Raises BadInput where the shapes disagree or the place cannot be written.
    """
    if angles.shape != (spectra.shape[0], 4) or spectra.shape[1] != len(wavelengths):
        raise BadInput(
            f"angles {tuple(angles.shape)}, spectra {tuple(spectra.shape)} and {len(wavelengths)} wavelengths disagree",
            where=path,
            expected="(N, 4), (N, W) and W",
        )
    text = [*(f"# {line}" for line in comments), "", "# num wls", str(len(wavelengths)), "", "# wls"]
    words = [f"{w:g}" for w in wavelengths]
    text += [" ".join(words[k : k + 19]) for k in range(0, len(words), 19)]
    text += ["", "# theta i, phi i, theta s, phi_s, spectral sample values", ""]
    text += [" ".join(f"{x:.6f}" for x in row) for row in torch.cat((angles, spectra), 1).tolist()]
    write_text(path, "\n".join(text) + "\n")


def _content(raw: bytes) -> Iterator[tuple[int, str]]:
    """(line number from 1, text) of every line that is neither blank nor a comment."""
    return ((number, line) for number, line in numbered_lines(raw) if not line.startswith("#"))


def _is_count(word: str) -> bool:
    """A positive whole number of at most six digits."""
    return word.isdecimal() and len(word) <= 6 and int(word) > 0


def _wavelengths(path: object, lines: list[tuple[int, str]]) -> tuple[list[float], int]:
    """The wavelengths in nm and the index of the first line after them."""
    if not lines:
        raise BadInput("only comments", where=path, expected="the number of wavelengths")
    number, line = lines[0]
    if not _is_count(line):
        raise BadInput(where=f"{path}: line {number}", found=short(line), expected="the number of wavelengths")
    count, wavelengths, index = int(line), [], 1
    while len(wavelengths) < count:
        if index == len(lines):
            raise BadInput(f"the file ends after {len(wavelengths)} wavelengths", where=path, expected=count)
        number, line = lines[index]
        words = line.split()
        for word, value in zip(words, number_table(path, [lines[index]], len(words), "")[0][0].tolist(), strict=True):
            if not value > (wavelengths[-1] if wavelengths else 0):
                raise line_fault(path, number, f"wavelength {word}", "rising numbers above 0")
            wavelengths.append(value)
        if len(wavelengths) > count:
            raise line_fault(path, number, f"{len(wavelengths)} wavelengths", count)
        index += 1
    return wavelengths, index


def _check(path: object, places: list[int], table: np.ndarray) -> None:
    """Raise BadInput for the first line with a direction under the horizon or a value below 0."""
    theta, values = table[:, [0, 2]], table[:, 4:]
    under, negative = (theta < 0) | (theta > math.pi / 2 + _ANGLE_SLACK), values < 0
    wrong = under.any(1) | negative.any(1)
    if not wrong.any():
        return
    row = int(wrong.argmax())
    if under[row].any():
        k = int(under[row].argmax())
        what = f"{('theta i', 'theta s')[k]} is {theta[row, k]:g}, under the horizon"
        raise line_fault(path, places[row], what, "0 to pi/2 radians")
    k = int(negative[row].argmax())
    raise line_fault(path, places[row], f"value {k + 1} is {values[row, k]:g}", "a BRDF >= 0")
