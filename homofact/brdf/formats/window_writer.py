"""Writing the XML of WINDOW and Radiance (`formats.window`): means over Klems' full basis, or a tensor tree.

Reflection Front and Reflection Back describe the same material, each in the axes of its side, so a scene may show
either side. There is no transmission. R, G, B and spectra are converted to Visible, CIE-X and CIE-Z (for trees Visible,
CIE-u and CIE-v); a single channel is written as Visible.
"""

import os
from collections.abc import Callable, Sequence
from xml.sax.saxutils import escape

import numpy as np
import torch

from homofact.brdf.band_means import klems_means, tree_means
from homofact.brdf.formats.tensor_tree import tree_text
from homofact.brdf.klems import FULL, KlemsBasis, KlemsTable
from homofact.brdf.reflectance import Reflectance
from homofact.brdf.tensor_tree import to_yuv
from homofact.brdf.tristimulus import to_xyz
from homofact.files.atomic import write_text

# Cells along a side, and how far a leaf's values may be from their mean.
SIDE_OF_3, SIDE_OF_4, TOLERANCE, TOLERANCE_OF_COLOUR = 64, 16, 0.005, 0.002
_SIDES = ("Front", "Back")


def write_klems(
    path: str | os.PathLike[str],
    reflectance: Reflectance,
    isotropic: bool,
    name: str,
    comments: Sequence[str] = (),
    progress: Callable[[int, int], object] | None = None,
) -> dict[str, float | int]:
    """Write the means of a reflectance over pairs of patches; return their "error" and number ("values").

    Raises BadInput for channels that are no colour, and for a place that cannot be written.
    """
    _check_colour(reflectance)
    means = klems_means(reflectance, FULL, isotropic, progress=progress)
    xyz = to_xyz(means.table.values.reshape(-1, len(means.table.channels)), reflectance.channels).clamp_min(0)
    table = KlemsTable(FULL, FULL, xyz.reshape(FULL.size, FULL.size, -1), ("X", "Y", "Z")[: xyz.shape[1]])
    sides = {"Back": table, "Front": table if isotropic else table.other_side()}
    blocks = []
    for side in _SIDES:
        bands = {"Visible": 0} if xyz.shape[1] == 1 else {"Visible": 1, "CIE-X": 0, "CIE-Z": 2}
        for band, column in bands.items():
            rows = sides[side].values[:, :, column].T.tolist()
            text = "\n".join(",\t".join(f"{x:.6g}" for x in row) + "," for row in rows)
            bases = "".join(f"<{which}AngleBasis>{FULL.name}</{which}AngleBasis>" for which in ("Column", "Row"))
            blocks.append(_block(side, band, bases, text))
    write_text(path, _document("Columns", _basis(FULL), blocks, name, comments))
    return {"error": means.error, "values": len(blocks) * FULL.size**2}


def write_tree(
    path: str | os.PathLike[str],
    reflectance: Reflectance,
    isotropic: bool,
    name: str,
    comments: Sequence[str] = (),
    progress: Callable[[int, int], object] | None = None,
) -> dict[str, float | int]:
    """Write a TensorTree3 if isotropic, else a TensorTree4; return the numbers of "cells" and of leaves ("values").

    Raises BadInput as `write_klems`.
    """
    side = SIDE_OF_3 if isotropic else SIDE_OF_4
    _check_colour(reflectance)
    values = tree_means(reflectance, side, isotropic, progress=progress)
    xyz = to_xyz(values.reshape(-1, values.shape[-1]), reflectance.channels).clamp_min(0)
    colours = xyz if xyz.shape[1] == 1 else to_yuv(xyz)
    cube = colours.reshape(*values.shape[:-1], -1)
    if isotropic:
        # The half that is no light costs no leaf.
        cube = torch.cat((cube[: side // 2], torch.zeros_like(cube[side // 2 :])))
    blocks, leaves = [], 0
    for which in _SIDES:
        # On the other side x points the other way; three dimensions are symmetric to begin with.
        own = cube.flip(0, 2) if which == "Front" and not isotropic else cube
        for band, column in {"Visible": 0, "CIE-u": 1, "CIE-v": 2}.items():
            if column < own.shape[-1]:
                tolerance = TOLERANCE_OF_COLOUR if column else TOLERANCE
                text = tree_text(np.ascontiguousarray(own[..., column].numpy()), tolerance)
                leaves += sum(word not in ("{", "}") for word in text.split())
                blocks.append(_block(which, band, "<AngleBasis>LBNL/Shirley-Chiu</AngleBasis>", text))
    write_text(path, _document(f"TensorTree{3 if isotropic else 4}", "", blocks, name, comments))
    return {"cells": len(colours), "values": leaves}


def _document(structure: str, basis: str, blocks: list[str], name: str, comments: Sequence[str]) -> str:
    # Two hyphens end a comment.
    remarks = "".join(f"<!-- {escape(' '.join(each.split()).replace('--', '- -'))} -->\n" for each in comments)
    return f"""<?xml version="1.0" encoding="UTF-8"?>
{remarks}<WindowElement xmlns="http://windows.lbl.gov" xmlns:xsi="http://www.w3.org/2001/XMLSchema-instance"
 xsi:schemaLocation="http://windows.lbl.gov/BSDF-v1.4.xsd">
<WindowElementType>System</WindowElementType>
<FileType>BSDF</FileType>
<Optical>
<Layer>
<Material>
<Name>{escape(name)}</Name>
<Manufacturer>homofact</Manufacturer>
<DeviceType>Other</DeviceType>
</Material>
<DataDefinition>
<IncidentDataStructure>{structure}</IncidentDataStructure>
{basis}</DataDefinition>
{"".join(blocks)}</Layer>
</Optical>
</WindowElement>
"""


def _basis(basis: KlemsBasis) -> str:
    parts = ["<AngleBasis>", f"<AngleBasisName>{basis.name}</AngleBasisName>"]
    for low, high, count in zip(basis.bounds[:-1], basis.bounds[1:], basis.counts, strict=True):
        theta = 0 if count == 1 else (low + high) / 2
        bounds = f"<LowerTheta>{low:g}</LowerTheta><UpperTheta>{high:g}</UpperTheta>"
        parts.append(f"<AngleBasisBlock><Theta>{theta:g}</Theta><nPhis>{count}</nPhis>")
        parts.append(f"<ThetaBounds>{bounds}</ThetaBounds></AngleBasisBlock>")
    return "\n".join([*parts, "</AngleBasis>", ""])


def _check_colour(reflectance: Reflectance) -> None:
    """Raise BadInput for channels that are no colour, before minutes of work."""
    to_xyz(torch.zeros(1, len(reflectance.channels), dtype=torch.float64), reflectance.channels)


def _block(side: str, band: str, bases: str, text: str) -> str:
    return f"""<WavelengthData>
<LayerNumber>System</LayerNumber>
<Wavelength unit="Integral">{band}</Wavelength>
<SourceSpectrum>CIE Illuminant D65 1nm.ssp</SourceSpectrum>
<DetectorSpectrum>ASTM E308 1931 Y.dsp</DetectorSpectrum>
<WavelengthDataBlock>
<WavelengthDataDirection>Reflection {side}</WavelengthDataDirection>
{bases}
<ScatteringDataType>BRDF</ScatteringDataType>
<ScatteringData>
{text}
</ScatteringData>
</WavelengthDataBlock>
</WavelengthData>
"""
