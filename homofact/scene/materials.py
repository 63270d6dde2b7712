"""The materials of a scene: their tables in the file, their paths, and their opened reflectances."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from homofact.brdf.analytic.lambert import Lambert
from homofact.brdf.analytic.metallic_roughness import MetallicRoughness
from homofact.brdf.materials import material
from homofact.brdf.reflectance import Reflectance
from homofact.brdf.source import open_source
from homofact.brdf.source_names import MATERIAL_PREFIX
from homofact.brdf.tinted import Tinted
from homofact.containers.srgb import decode_srgb
from homofact.errors import BadInput
from homofact.exporting.as_source import is_fit
from homofact.exporting.result import open_result
from homofact.files.reading import split_member
from homofact.meshes.gltf_parts import gltf_part, is_gltf
from homofact.scene.file_fits import FileFit, FileFits

MATT, FIT, SOURCE, PART = "matt", "fit", "source", "part"
Stage = Callable[[str], object]


@dataclass(frozen=True, kw_only=True)
class MaterialTable:
    """The keys that objects and the ground share: exactly one of `material` and `albedo`.

    Each kind of scene declares its further keys in a subclass, which is a base class of its object and its ground
    tables.
    """

    material: str | None = None
    albedo: tuple[float, ...] | None = None

    def __post_init__(self) -> None:
        """Refuse no or two materials, and an albedo that is none. Raises BadInput."""
        if (self.material is None) is (self.albedo is None):
            raise BadInput(found="none or both", expected="exactly one of material, albedo")
        if self.albedo is not None and (len(self.albedo) not in (1, 3) or not all(0 <= a <= 1 for a in self.albedo)):
            raise BadInput(where="albedo", found=list(self.albedo), expected="1 or 3 numbers from 0 to 1")

    @property
    def called(self) -> str | None:
        """What tables and pages call the object; None for the name of its mesh."""
        return None

    @property
    def words(self) -> str:
        """The material as tables and reports name it."""
        if self.material is not None:
            return self.material
        return f"albedo {', '.join(f'{x:g}' for x in self.albedo or ())}"


@dataclass(frozen=True)
class OpenedMaterial:
    """A material of a scene: `words` are its name in the file, and `reflectance` is the BRDF.

    `kind` is "fit" (a result of `factorize` or the `fit` that replaces a file), "source" (a named material), "matt" (an
    albedo) or "part" (the material of a glTF part). The mean of its `picture` (H, W, 3), in linear light, is in its
    base colour. `normals` (H, W, 3) are those of its normal map in tangent space.
    """

    words: str
    kind: str
    reflectance: Reflectance
    fit: FileFit | None = None
    picture: np.ndarray | None = None
    normals: np.ndarray | None = None
    left_out: tuple[str, ...] = ()

    @property
    def tinted(self) -> Tinted | None:
        """Return the material in two parts: the one that its colour multiplies, and the rest; else None."""
        model = self.reflectance
        if self.picture is None or not isinstance(model, MetallicRoughness) or not any(model.base_colour):
            return None
        return Tinted.of(model)


def open_materials(
    tables: Iterable[MaterialTable], stage: Stage | None = None, fits: FileFits | None = None
) -> tuple[OpenedMaterial, ...]:
    """Return the materials of tables, each opened once; files by way of `fits`.

    Raises BadInput for what cannot be read.
    """
    opened: dict[str, OpenedMaterial] = {}
    fits = fits or FileFits()
    materials = []
    for table in tables:
        words = table.words
        if words not in opened:
            if stage is not None:
                stage(f"opening {Path(words).name}")
            opened[words] = _matt(words, table.albedo) if table.albedo else open_material(words, fits)
        materials.append(opened[words])
    return tuple(materials)


def open_material(words: str, fits: FileFits) -> OpenedMaterial:
    """Open a material by its name, a fit (folder or file of `factorize`), or a file that a fit replaces.

    "FILE.glb#PART" is the material of a part of a glTF scene.

    Raises BadInput for what cannot be read.
    """
    if words.startswith(MATERIAL_PREFIX):
        return OpenedMaterial(words, SOURCE, open_source(words).reflectance)
    if is_gltf(words):
        return _of_part(words)
    if is_fit(words):
        return OpenedMaterial(words, FIT, open_result(Path(words)))
    found = fits.of(words)
    return OpenedMaterial(words, FIT, found.fit, found)


def _of_part(words: str) -> OpenedMaterial:
    """The metallic-roughness model of a part; grey of .8 where it names no material."""
    given = gltf_part(words).material
    if given is None:
        return OpenedMaterial(words, PART, Lambert((0.8, 0.8, 0.8)))
    picture = None if given.picture is None else decode_srgb(given.picture)
    mean = np.ones(3) if picture is None else picture.mean((0, 1))
    colour = tuple(float(value) for value in np.clip(np.array(given.base_colour) * mean, 0, 1))
    model = MetallicRoughness(colour, min(max(given.metallic, 0.0), 1.0), min(max(given.roughness, 0.0), 1.0))
    picture = picture if given.placed else None
    return OpenedMaterial(words, PART, model, picture=picture, normals=given.normals, left_out=given.left_out)


def _matt(words: str, albedo: tuple[float, ...]) -> OpenedMaterial:
    return OpenedMaterial(words, MATT, Lambert(albedo * 3 if len(albedo) == 1 else albedo))


def found_source(text: str, folder: Path, where: str) -> str:
    """Return the source with its path, given relative to `folder`, converted to the working folder.

    Raises BadInput, beginning with `where`, for a file that is not there and an unknown material.
    """
    if text.startswith(MATERIAL_PREFIX):
        material(text.removeprefix(MATERIAL_PREFIX))
        return text
    path = split_member(folder / text)[0]
    if not Path(path).exists():
        raise BadInput(f"no file {path}", where=where, expected=f"a measurement or {MATERIAL_PREFIX}NAME")
    return str(folder / text)
