"""XML of WINDOW and Radiance (schema windows.lbl.gov/BSDF): a Klems matrix or a tensor tree.

    WindowElement/Optical/Layer
        Material/Name, Manufacturer
        DataDefinition/IncidentDataStructure    Columns or Rows (a matrix), TensorTree3 or TensorTree4
        DataDefinition/AngleBasis               a basis of its own, or one of the three of Klems by name
        WavelengthData/Wavelength               Visible; CIE-X and CIE-Z (matrix) or CIE-u and CIE-v (tree) for colour
        WavelengthData/WavelengthDataBlock      WavelengthDataDirection, ColumnAngleBasis (light), RowAngleBasis (view),
                                                ScatteringData: numbers, or a tree in braces

Values are f in sr⁻¹ without the cosine. FILE#front selects the block Reflection Front and FILE#back the block
Reflection Back. You can omit the side if both blocks are equal or only one exists. WINDOW's front is Radiance's back,
the side away from the normal of a surface. The axes are Radiance's: x right and y up, seen from the selected side.
Transmission is rejected. As in Radiance, values are not interpolated between patches. The samples of a matrix are the
middles of its patches, weighted by solid angle. They are isotropic if entries of equal θi, θo and |Δφ| differ by less
than 3% in the mean. A tree is sampled like a model. XYZ is converted to linear sRGB. Negative values are set to 0; for
a matrix they are counted.
"""

import os
from dataclasses import dataclass, replace
from typing import Any
from xml.etree import ElementTree

import numpy as np
import torch

from homofact.brdf.channels import check_channels
from homofact.brdf.formats.reading import Drawing, Reading
from homofact.brdf.formats.tensor_tree import parsed_tree
from homofact.brdf.klems import BASES, KlemsBasis, KlemsTable
from homofact.brdf.samples import Samples
from homofact.brdf.sampling import sample_model
from homofact.brdf.tensor_tree import TensorTree
from homofact.brdf.tristimulus import from_xyz
from homofact.errors import BadInput
from homofact.files.reading import read_bytes, split_member
from homofact.files.text import short

NAME = "window"
DESCRIPTION = "WINDOW or Radiance XML (Klems matrix or tensor tree; FILE#front or FILE#back)"
SIDES = ("front", "back")
_MATRIX, _TREES = ("Columns", "Rows"), {"TensorTree3": 3, "TensorTree4": 4}
_Y = "Visible"
_COLOURS = {False: ("CIE-X", "CIE-Z"), True: ("CIE-u", "CIE-v")}
_MARK = b"<WindowElement"
_KNOWN = "front or back: homofact reads and fits reflection alone"


@dataclass(frozen=True)
class _Layer:
    """What a file holds: kind of structure, bases, (direction, wavelength) → block, and comments."""

    kind: str
    bases: dict[str, KlemsBasis]
    blocks: dict[tuple[str, str], ElementTree.Element]
    comments: list[str]

    def bands(self, side: str) -> list[str]:
        """Return the wavelengths that hold the reflection of a side."""
        return [band for direction, band in self.blocks if direction == f"reflection {side}"]


def sniff(head: bytes) -> bool:
    """Return whether a file that begins with `head` is of this format."""
    return head.lstrip(b"\xef\xbb\xbf \r\n\t").startswith(b"<") and _MARK in head


def material_names(path: str | os.PathLike[str]) -> list[str]:
    """Return the sides ("front", "back") with reflection in a file. Raises BadInput for a damaged file."""
    file = split_member(path)[0]
    layer = _layer(file, read_bytes(file, DESCRIPTION))
    return [side for side in SIDES if layer.bands(side)]


def open_file(path: str | os.PathLike[str], channels: str = "rgb", drawing: Drawing | None = None) -> Reading:
    """Return the reflection of the side FILE#front or FILE#back, and samples of it.

    Raises BadInput that names the file, and the block if one is at fault, for damaged or truncated XML, a missing
    layer, an unknown structure or basis, files with only transmission, a missing wavelength, a wrong number of values,
    and words that are not numbers. Also raised if front and back differ and no side is selected.
    """
    check_channels(channels)
    file, member = split_member(path)
    layer = _layer(file, read_bytes(file, DESCRIPTION))
    side = _side(file, layer, member)
    bands = _bands(file, layer, side)
    is_tree = layer.kind in _TREES
    facts: dict[str, Any] = {
        "format": NAME,
        "structure": layer.kind,
        "side": side,
        "comments": layer.comments,
        "units": "1/sr, no cosine",
    }
    if is_tree:
        trees = [_tree(file, layer, side, band) for band in bands]
        table = TensorTree(tuple(trees), flipped=side == "front")
        draw = drawing or Drawing()
        samples = sample_model(table, draw.count, draw.scheme, draw.seed, noise_free=False)
        facts["faults"] = {"exact_zeros": int((samples.values == 0).sum())}
        finest = max(tree.depth for tree in trees)
        facts["tree"] = {"leaves": [tree.leaves for tree in trees], "finest_side": 2**finest}
        provenance = samples.provenance | facts
        return Reading.of(path, replace(samples, provenance=provenance), table, channels)
    matrices, bases = zip(*(_matrix(file, layer, side, band) for band in bands), strict=True)
    light, view = bases[0]
    if any(pair != bases[0] for pair in bases):
        raise BadInput(f"Reflection {side} with other bases by wavelength", where=file, expected="the same")
    values = torch.from_numpy(np.stack(matrices, -1))
    negative = int((values < 0).sum())
    values, outside = values.clamp_min(0), 0
    if len(bands) == 3:
        values = from_xyz(values[..., [1, 0, 2]])
        outside = int((values < 0).sum())
        values = values.clamp_min(0)
    names = ("R", "G", "B") if len(bands) == 3 else ("Y",)
    table = KlemsTable(light, view, values, names, flipped=side == "front")
    wi, wo, flat, weights = table.nodes()
    facts["bases"] = [light.name, view.name]
    facts["anisotropy"] = float(f"{table.anisotropy:.3g}")
    facts["weights"] = "solid angle of the patches, mean 1"
    facts["faults"] = {"negative": negative, "out_of_gamut": outside, "exact_zeros": int((flat == 0).sum())}
    samples = Samples(wi, wo, flat, channels=names, isotropic=table.isotropic, weights=weights, provenance=facts)
    return Reading.of(path, samples, table, channels)


def _layer(file: object, raw: bytes) -> _Layer:
    """The first layer. Raises BadInput."""
    if b"<!DOCTYPE" in raw or b"<!ENTITY" in raw:
        raise BadInput("XML with a document type or entities", where=file, expected="plain XML as WINDOW writes it")
    try:
        root = ElementTree.fromstring(raw)
    except (ElementTree.ParseError, ValueError, LookupError) as error:
        raise BadInput(f"damaged or cut XML ({error})", where=file, expected="a whole file") from error
    for element in root.iter():
        element.tag = element.tag.rpartition("}")[2] if isinstance(element.tag, str) else ""
    layer = root.find("Optical/Layer")
    if root.tag != "WindowElement" or layer is None:
        raise BadInput(f"XML of {short(root.tag)} without a layer", where=file, expected="WindowElement/Optical/Layer")
    kind = _text(layer, "DataDefinition/IncidentDataStructure")
    known = next((name for name in (*_MATRIX, *_TREES) if name.lower() == kind.lower()), None)
    if known is None:
        expected = f"one of {', '.join((*_MATRIX, *_TREES))}"
        raise BadInput(f"IncidentDataStructure is {short(kind)}", where=file, expected=expected)
    blocks = {}
    for data in layer.findall("WavelengthData"):
        for block in data.findall("WavelengthDataBlock"):
            blocks[_text(block, "WavelengthDataDirection").lower(), _text(data, "Wavelength")] = block
    comments = [text for name in ("Name", "Manufacturer") if (text := _text(layer, f"Material/{name}"))]
    return _Layer(known, _bases(file, layer), blocks, [" ".join(text.split())[:200] for text in comments])


def _text(element: ElementTree.Element, place: str) -> str:
    return (element.findtext(place) or "").strip()


def _bases(file: object, layer: ElementTree.Element) -> dict[str, KlemsBasis]:
    """The bases by name in small letters: the three of Klems, and those that the file defines."""
    bases = dict(BASES)
    for each in layer.findall("DataDefinition/AngleBasis"):
        name = _text(each, "AngleBasisName")
        rings = each.findall("AngleBasisBlock")
        if name.lower() in bases or not rings:
            continue
        try:
            lows = [float(_text(ring, "ThetaBounds/LowerTheta")) for ring in rings]
            highs = [float(_text(ring, "ThetaBounds/UpperTheta")) for ring in rings]
            counts = tuple(int(_text(ring, "nPhis")) for ring in rings)
        except ValueError as error:
            raise BadInput(f"AngleBasis {short(name)} ({error})", where=file, expected="numbers") from error
        if any(abs(low - high) > 1e-6 for low, high in zip(lows[1:], highs, strict=False)):
            raise BadInput(f"AngleBasis {short(name)} whose rings leave gaps", where=file, expected="rings that join")
        try:
            bases[name.lower()] = KlemsBasis(name, (lows[0], *highs), counts)
        except BadInput as error:
            raise error.at(file) from error
    return bases


def _side(file: object, layer: _Layer, member: str | None) -> str:
    """Return the requested side, or the only one."""
    held = [side for side in SIDES if layer.bands(side)]
    others = sorted({direction.title() for direction, _ in layer.blocks if not direction.startswith("reflection")})
    if not held:
        found = f"holds {' and '.join(others)} alone" if others else "holds no reflection"
        hint = "genBSDF and WINDOW write reflection beside it" if others else ""
        raise BadInput(found, where=file, expected="Reflection Front or Reflection Back", hint=hint)
    if member is None:
        if len(held) == 2 and not _alike(layer):
            name = os.path.basename(str(file))
            found = "holds Reflection Front and Reflection Back"
            raise BadInput(found, where=file, expected=f"{name}#front or {name}#back")
        return held[0]
    if member.lower() in held:
        return member.lower()
    if member.lower() in SIDES:
        raise BadInput(f"no Reflection {member.title()}", where=file, expected=f"#{held[0]}, which it holds")
    raise BadInput(f"no reading #{member}", where=file, expected=_KNOWN)


def _alike(layer: _Layer) -> bool:
    """Whether both sides have the same numbers."""
    if layer.bands("front") != layer.bands("back"):
        return False
    return all(
        _text(layer.blocks["reflection front", band], "ScatteringData").split()
        == _text(layer.blocks["reflection back", band], "ScatteringData").split()
        for band in layer.bands("front")
    )


def _bands(file: object, layer: _Layer, side: str) -> tuple[str, ...]:
    """Visible alone, or with the two that make colours of it."""
    held, colours = layer.bands(side), _COLOURS[layer.kind in _TREES]
    if _Y not in held:
        found = f"Reflection {side.title()} at {', '.join(map(short, held[:6]))} alone"
        raise BadInput(found, where=file, expected=f"{_Y}, with {' and '.join(colours)} for colour")
    there = [band for band in colours if band in held]
    if len(there) == 1:
        missing = next(band for band in colours if band not in held)
        found = f"Reflection {side.title()} with {_Y} and {there[0]} but no {missing}"
        raise BadInput(found, where=file, expected=f"{_Y} alone, or with {' and '.join(colours)}")
    return (_Y, *there)


def _matrix(file: object, layer: _Layer, side: str, band: str) -> tuple[np.ndarray, tuple[KlemsBasis, KlemsBasis]]:
    """(values (light, view), the bases of both)."""
    block, what = layer.blocks[f"reflection {side}", band], f"Reflection {side.title()}, {band}"
    found = []
    for name in ("ColumnAngleBasis", "RowAngleBasis"):
        basis = layer.bases.get(_text(block, name).lower())
        if basis is None:
            expected = ", ".join(each.name for each in layer.bases.values())
            raise BadInput(f"{what}: {name} is {short(_text(block, name))}", where=file, expected=f"one of {expected}")
        found.append(basis)
    light, view = found
    text = _text(block, "ScatteringData").replace(",", " ")
    words = text.split()
    if len(words) != light.size * view.size:
        expected = f"{light.size * view.size}, {light.size} × {view.size} of {light.name}"
        raise BadInput(f"{what}: {len(words)} values", where=file, expected=expected)
    values = _numbers(file, what, words)
    by_light = values.reshape(light.size, view.size)
    return (by_light if layer.kind == "Rows" else values.reshape(view.size, light.size).T.copy()), (light, view)


def _numbers(file: object, what: str, words: list[str]) -> np.ndarray:
    """Words as finite numbers. Raises BadInput naming the first that is none."""
    try:
        values = np.array(words, dtype=np.float64)
    except ValueError:
        values = np.array([_number(word) for word in words])
    wrong = ~np.isfinite(values) | (np.abs(np.nan_to_num(values)) > 1e30)
    if wrong.any():
        first = int(wrong.argmax())
        raise BadInput(f"{what}: value {first + 1} is {short(words[first])}", where=file, expected="a finite number")
    return values


def _number(word: str) -> float:
    try:
        return float(word)
    except ValueError:
        return float("nan")


def _tree(file: object, layer: _Layer, side: str, band: str) -> Any:
    block, what = layer.blocks[f"reflection {side}", band], f"Reflection {side.title()}, {band}"
    basis = _text(block, "AngleBasis")
    if basis.lower() != "lbnl/shirley-chiu":
        raise BadInput(f"{what}: AngleBasis is {short(basis)}", where=file, expected="LBNL/Shirley-Chiu")
    return parsed_tree(f"{file}: {what}", _text(block, "ScatteringData"), _TREES[layer.kind])
