"""Read an export's folder back as a fit, with the values that an engine gets from its textures.

The manifest may have been edited by hand, so every entry is checked, and every texture is compared with its entry.
"""

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from homofact.brdf.analytic.ggx import GgxBrdf, GgxLobe
from homofact.brdf.log_transform import LogTransform
from homofact.containers.exr import exr_channel_names
from homofact.containers.formats import FORMATS, MOST_SIDE
from homofact.errors import BadInput
from homofact.factor.factorization import Factorization, Term
from homofact.factor.fitted import QuantizationGrid
from homofact.factor.projection import WARPED_AXES, Projection, Warp
from homofact.files.arrays import MOST_VALUE
from homofact.files.fields import Fields
from homofact.geometry.coordinates import COORDINATES, CoordinateSystem
from homofact.parametric.model_fit import ModelFit
from homofact.separable.decomposition_names import MAP_NAMES, SIDES
from homofact.separable.separable import Separable, SeparableTerm
from homofact.shading.encoded import LEVELS, Encoded

FORMAT = "homofact export"
FORMAT_VERSION = 1
MANIFEST = "manifest.json"
_MOST_TERMS = 1000
_MOST_LOBES = 4


@dataclass(frozen=True)
class _Texels:
    """The decoded texels (rows, columns, C) of a texture, and the grid that they are on if they are whole numbers."""

    values: np.ndarray
    grid: QuantizationGrid | None


def is_export(folder: str | os.PathLike[str]) -> bool:
    """Return whether a folder has the manifest of an export. Raises BadInput if the manifest is not JSON."""
    path = Path(folder) / MANIFEST
    return path.is_file() and Fields.read(path, f"{FORMAT!r}").found.get("format") == FORMAT


def export_record(folder: str | os.PathLike[str]) -> dict[str, Any]:
    """Return the contents of an export's manifest; empty for any other folder. Raises BadInput as `is_export`."""
    return Fields.read(Path(folder) / MANIFEST, f"{FORMAT!r}").found if is_export(folder) else {}


def whole_format(folder: str | os.PathLike[str]) -> str | None:
    """Return "png8" or "png16" for an export with integer texels; None for any other folder or file.

    Raises BadInput for a manifest that is not JSON.
    """
    name = export_record(folder).get("texture_format")
    return name if isinstance(name, str) and name in FORMATS and FORMATS[name].storage in LEVELS else None


def open_exported(folder: str | os.PathLike[str]) -> Factorization | Separable | ModelFit:
    """Return the fit given by an export's textures, or by the parameters of its model.

    Integer texels keep their quantization grid, so exporting the fit again in the same format gives the same integers.
    Raises BadInput for a folder without a manifest, a manifest of another format or a newer version, an invalid entry,
    and textures that are missing, damaged, or do not match the manifest.
    """
    place = Path(folder)
    fields = Fields.read(place / MANIFEST, f"the manifest of a {FORMAT!r}")
    fields.text("format", (FORMAT,))
    fields.version("format_version", FORMAT_VERSION)
    channels = tuple(fields.texts("channels", 4))
    mean = fields.inner("A").numbers("values", len(channels), above=0)
    transform = LogTransform(fields.number("epsilon", above=0), np.array(mean))
    provenance = fields.inner("provenance").found
    kind = fields.text("kind", ("product", "sum of products", "ggx"))
    if kind == "ggx":
        return ModelFit(_ggx(fields.inner("model"), channels), transform, provenance)
    textures = _textures(place, fields, channels)
    if kind == "product":
        terms = tuple(_term(inner, textures) for inner in fields.inners("terms", _MOST_TERMS))
        return Factorization(terms, transform, channels, provenance)
    return _sum(fields, textures, transform, channels, provenance)


def _textures(place: Path, fields: Fields, channels: tuple[str, ...]) -> list[_Texels]:
    """Every texture."""
    form = FORMATS[fields.text("texture_format", FORMATS)]
    decoded = []
    for entry in fields.inners("textures", 2 * _MOST_TERMS):
        name = entry.text("file")
        if Path(name).name != name:
            entry.refuse("file", "a file's name in the same folder")
        shape = (entry.whole("rows", 1, MOST_SIDE), entry.whole("columns", 1, MOST_SIDE), len(channels))
        entry.text("storage", (form.storage,))
        scale = np.array(entry.numbers("scale", len(channels), above=0))
        bias = np.array(entry.numbers("bias", len(channels)))
        stored = form.read(place / name, len(channels), exr_channel_names(channels))
        if stored.shape != shape:
            found, expected = f"{stored.shape[1]} x {stored.shape[0]}", f"{shape[1]} x {shape[0]}"
            raise BadInput(where=place / name, found=f"{found} texels", expected=f"{expected} as in {MANIFEST}")
        # Without the warning of a signalling NaN.
        with np.errstate(invalid="ignore"):
            finite = np.isfinite(stored.astype(np.float64)).all()
        if not finite:
            raise BadInput("a texel is not finite", where=place / name, expected="finite texels")
        # A reader gives blocks as the half floats that a sampler finds.
        storage = "float16" if form.storage == "bc6h" else form.storage
        with np.errstate(over="ignore"):
            texels = Encoded(storage, stored, scale, bias).values
        largest = float(np.abs(texels).max())
        if not largest <= MOST_VALUE:
            made = f"{place / name}: scale and bias in {MANIFEST} make a texel {largest:g}"
            raise BadInput(made, expected=f"at most {MOST_VALUE:g}")
        levels = LEVELS.get(form.storage)
        decoded.append(_Texels(texels, None if levels is None else QuantizationGrid(bias, scale / levels, levels)))
    return decoded


def _ggx(fields: Fields, channels: tuple[str, ...]) -> GgxBrdf:
    """The model whose numbers a manifest has."""
    listed = fields.found.get("specular")
    count = len(listed) if isinstance(listed, list) and 0 < len(listed) <= _MOST_LOBES else 1
    specular = fields.rows("specular", count, len(channels))
    shapes = [fields.numbers(name, count) for name in ("roughness", "reflectance")]
    lobes = tuple(GgxLobe(tuple(colour), *rest) for colour, *rest in zip(specular, *shapes, strict=True))
    try:
        return GgxBrdf(tuple(fields.numbers("diffuse", len(channels))), lobes, channels=channels)
    except BadInput as error:
        raise error.at(str(fields.place)) from error


def _term(fields: Fields, textures: list[_Texels]) -> Term[np.ndarray]:
    texture = textures[fields.whole("texture", 0, len(textures) - 1)]
    mask = np.array(fields.bits("mask", *texture.values.shape[:2]))
    return Term(_projection(fields.inner("projection")), texture.values, mask, grid=texture.grid).round()


def _projection(fields: Fields) -> Projection:
    name = fields.text("coordinates", COORDINATES)
    rows = fields.rows("matrix", 2, COORDINATES[name].dimension)
    warp = None
    if fields.found.get("warp") is not None:
        if not set(WARPED_AXES) & set(COORDINATES[name].axes):
            fields.refuse("warp", f"null on {name}, which has no half vector")
        warp = Warp(fields.inner("warp").number("width", above=0))
    reciprocal, called = fields.flag("reciprocal"), fields.text("name")
    quaternions = _quaternions(fields, COORDINATES[name])
    try:
        return Projection(name, np.array(rows), reciprocal, called, quaternions, warp)
    except BadInput as error:
        fields.refuse("matrix", f"one that {name} has ({error})")


def _quaternions(fields: Fields, system: CoordinateSystem) -> np.ndarray | None:
    if fields.found.get("rotation") is None:
        return None
    if system.periodic:
        fields.refuse("rotation", f"null on {system.name}, which has fixed projections only")
    inner = fields.inner("rotation")
    sides = ("left", "right") if system.dimension == 4 else ("quaternion",)
    inner.text("kind", ("pair",) if system.dimension == 4 else ("single",))
    return np.array([inner.numbers(side, 4) for side in sides])


def _sum(
    fields: Fields,
    textures: list[_Texels],
    transform: LogTransform,
    channels: tuple[str, ...],
    provenance: dict[str, Any],
) -> Separable:
    terms = []
    rows, columns = textures[0].values.shape[:2]
    if any(texture.values.shape != textures[0].values.shape for texture in textures):
        fields.refuse("textures", "textures of one size in a sum of products")
    for entry in fields.inners("terms", _MOST_TERMS):
        numbers = entry.found.get("textures")
        listed = isinstance(numbers, list) and len(numbers) in (1, 2)
        if not isinstance(numbers, list) or not listed or not all(_is_number_of(k, textures) for k in numbers):
            entry.refuse("textures", f"one or two numbers from 0 to {len(textures) - 1}")
        signs = entry.numbers("signs", len(channels))
        if not set(signs) <= {1.0, -1.0}:
            entry.refuse("signs", "1 or -1 a channel")
        first, *second = (textures[k].values for k in numbers)
        grids = tuple(grid for k in numbers if (grid := textures[k].grid) is not None)
        terms.append(SeparableTerm(first, second[0] if second else None, np.array(signs), grids))
    if len({term.second is None for term in terms}) > 1:
        fields.refuse("terms", "the same number of textures in every term")
    read = np.array(fields.bits("read", rows, columns))
    name, kind = fields.text("map", MAP_NAMES), fields.text("parameterization", SIDES)
    return Separable(tuple(terms), name, kind, read, transform, channels, provenance)


def _is_number_of(value: Any, textures: list[_Texels]) -> bool:
    return type(value) is int and value in range(len(textures))
