"""Writing the surface files of Ansys Speos (`formats.speos`) in text mode, version 8.

A .brdf contains one table per incidence and wavelength, for an isotropic material. R, G, B are converted to spectra of
14 wavelengths that have the same colours under D65 (`brdf.upsampling`). A spectrum keeps its wavelengths, and a single
channel is written at 550 nm. An .anisotropicbsdf contains tables of the luminance, for 12 rotations if the material is
anisotropic, and one spectrum, of the light reflected at normal incidence. So its colour does not change with direction.
Values are f in sr⁻¹. The percentages are the integrals of the tables, so readers that scale by them recover f.
"""

import math
import os
from collections.abc import Iterable, Sequence

from torch import Tensor

from homofact.brdf.formats.incidence_files import tabulated
from homofact.brdf.incidences import IncidenceTable, reflected
from homofact.brdf.reflectance import Reflectance
from homofact.brdf.tristimulus import to_xyz
from homofact.brdf.upsampling import NODES, to_spectra
from homofact.brdf.wavelengths import wavelengths_of
from homofact.errors import BadInput
from homofact.files.atomic import write_text

_GREY = 550.0
_VISIBLE = (380.0, 780.0)


def write_brdf(
    path: str | os.PathLike[str], reflectance: Reflectance, isotropic: bool, comments: Sequence[str] = ()
) -> int:
    """Write a .brdf and return the number of its values.

    Raises BadInput for an anisotropic reflectance, channels that are no colour, and a place that cannot be written.
    """
    if not isotropic:
        raise BadInput("an anisotropic material", where=path, expected="an ending .anisotropicbsdf, which holds one")
    row = tabulated(reflectance, True, about_mirror=False).tables[0]
    wavelengths = _spectra(row[0].values[:1, :1], reflectance.channels)[1]
    lines = [*_head("brdf", comments), "1\t0", "1", f"{len(row)}\t{len(wavelengths)}"]
    lines += [_row(math.degrees(table.theta_i) for table in row), _row(wavelengths)]
    for table in row:
        spectra = _spectra(table.values, reflectance.channels)[0].clamp_min(0)
        for k in range(len(wavelengths)):
            own = IncidenceTable(table.theta_i, 0.0, table.polar, table.azimuth, spectra[..., k : k + 1])
            lines += [f"{100 * float(reflected(own)[0]):.8g}", *_table(own)]
    write_text(path, "\n".join([*lines, "End of file"]) + "\n")
    return len(wavelengths) * sum(table.values[..., 0].numel() for table in row)


def write_anisotropic(
    path: str | os.PathLike[str], reflectance: Reflectance, isotropic: bool, comments: Sequence[str] = ()
) -> int:
    """Write an .anisotropicbsdf of any material; return the number of its values. Raises BadInput as `write_brdf`."""
    rows = tabulated(reflectance, isotropic, about_mirror=False).tables
    # Theirs is the scale of all others.
    first = rows[0][0]
    spectrum, wavelengths = _spectra(reflected(first), reflectance.channels)
    if len(wavelengths) == 1:
        spectrum, wavelengths = spectrum.repeat(2), list(_VISIBLE)
    lines = [*_head("Anisotropic BSDF", comments), "1\t0\t0", "1\t0", "1", str(len(rows))]
    lines.append(_row(math.degrees(row[0].turn) for row in rows))
    for row in rows:
        lines += [str(len(row)), _row(math.degrees(table.theta_i) for table in row)]
    lines += [_row((math.degrees(first.theta_i), math.degrees(first.turn))), "", str(len(wavelengths))]
    lines += [_row(pair) for pair in zip(wavelengths, (100 * spectrum).clamp_min(0).tolist(), strict=True)]
    for table in (table for row in rows for table in row):
        xyz = to_xyz(table.values.reshape(-1, table.values.shape[2]), reflectance.channels)
        luminance = xyz[:, 1 if xyz.shape[1] == 3 else 0].clamp_min(0).reshape(table.values.shape[:2])
        own = IncidenceTable(table.theta_i, table.turn, table.polar, table.azimuth, luminance[..., None])
        lines += _table(own)
    write_text(path, "\n".join([*lines, "End of file"]) + "\n")
    return sum(table.values[..., 0].numel() for row in rows for table in row)


def _spectra(values: Tensor, channels: Sequence[str]) -> tuple[Tensor, list[float]]:
    """(values (..., W), the wavelengths) of values (..., C)."""
    wavelengths = wavelengths_of(channels)
    if len(channels) == 1:
        return values, [wavelengths[0] if wavelengths else _GREY]
    if wavelengths is not None:
        return values, list(wavelengths)
    if tuple(channels) != ("R", "G", "B"):
        raise BadInput(f"channels {', '.join(channels)}", expected="R, G, B, one alone, or wavelengths")
    return to_spectra(values), list(NODES)


def _head(kind: str, comments: Sequence[str]) -> list[str]:
    comment = " ".join(" ".join(comments).split())[:200] or "homofact"
    described = "f in 1/sr without the cosine"
    return [f"OPTIS - {kind} surface file v8.0", "0", comment, str(len(described)), described]


def _table(table: IncidenceTable) -> list[str]:
    lines = [f"{len(table.polar)}\t{len(table.azimuth)}", "\t" + _row(table.azimuth.rad2deg().tolist())]
    for theta, values in zip(table.polar.rad2deg().tolist(), table.values[..., 0].tolist(), strict=True):
        lines.append(f"{theta:.10g}\t" + "\t".join(f"{x:.6g}" for x in values))
    return lines


def _row(numbers: Iterable[float]) -> str:
    return "\t".join(f"{x:.10g}" for x in numbers)
