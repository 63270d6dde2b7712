"""The scene of an editing session, read from strict TOML: objects with editable materials, a light, cameras.

Objects, ground, light and cameras are those of `scene.scene_file`. A lighting may be any that is named; beside them:

[[object]]
name = "paint"                     # its name in curves. Default: the name of the material
curves = "own"                     # a model's own; "HF" or "HD", fitted to the material; or one or two angles that
                                   # start at 1, as ["theta_h", "theta_d"], which "own" means for what is no such model
pattern = "wood"                   # optional, `editing.patterns`: wood, squares, or a PNG at texture coordinates
pattern_size = 0.25                # between rings, or of a square
bands = [256, 64]                  # of the curves that count in the sum over the light: 256, 128, 64 or 32 each
[ground]                           # name, curves and bands as above
[[sun]]                            # none or more, beside the lighting
direction = [0.3, 0.8, 0.5]        # towards the sun, y up
irradiance = [3.1]                 # on a surface that faces it: one number, or one of red, green and blue
[edit]                             # all optional
triangles = 4000                   # of the light; 400 for a preview
tolerance = 0.003                  # relative RMS that the low rank may leave
bounces = 0                        # 1: light that reaches a surface by way of another one too
"""

import os
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any, TypeVar

from homofact.brdf.source_names import MATERIAL_PREFIX
from homofact.editing.angles import check_angle
from homofact.editing.basis import TOLERANCE
from homofact.editing.curves import BANDS
from homofact.editing.patterns import BUILT_IN
from homofact.errors import BadInput
from homofact.files.reading import read_toml
from homofact.scene.cameras import Camera
from homofact.scene.lighting import Lighting, LightTable
from homofact.scene.materials import MaterialTable
from homofact.scene.meshes import SHAPE_PREFIX
from homofact.scene.objects import GroundTable, ObjectTable, found_tables
from homofact.scene.scene_file import SceneTable
from homofact.scene.suns import SunTable
from homofact.settings.kinds import EDITING, check_kind
from homofact.settings.options import option
from homofact.settings.tables import read_table

OWN, HF, HD = "own", "HF", "HD"
TRIANGLES = 4000


@dataclass(frozen=True, kw_only=True)
class _Edited(MaterialTable):
    """The editing options of a material: its `name` in curves, the `curves`, and the `bands` of curves in the sum.

    `pattern` multiplies the first term by a factor that varies over the surface.
    """

    name: str | None = None
    pattern: str | None = None
    pattern_size: float = option(0.25, "Between rings, or of a square", above=0)
    curves: str | tuple[str, ...] = OWN
    bands: tuple[int, ...] | None = None

    def __post_init__(self) -> None:
        """Reject invalid names, curves and bands. Raises BadInput."""
        super().__post_init__()
        if self.name is not None and not self.name.strip():
            raise BadInput(where="name", found="an empty one", expected="a name")
        if isinstance(self.curves, str):
            if self.curves not in (OWN, HF, HD):
                wanted = f"{OWN}, {HF}, {HD} or a list of angles"
                raise BadInput(where="curves", found=repr(self.curves), expected=wanted)
        elif not 1 <= len(self.curves) <= 3:
            raise BadInput(where="curves", found=f"{len(self.curves)} angles", expected="one, two, or two and theta_o")
        else:
            for each in self.curves:
                try:
                    check_angle(each)
                except BadInput as error:
                    raise error.at("curves") from error
        for count in self.bands or ():
            if count not in BANDS:
                raise BadInput(where="bands", found=count, expected=f"some of {', '.join(map(str, BANDS))}")


@dataclass(frozen=True)
class EditObjectTable(_Edited, ObjectTable):
    """One object and the curves of its material."""


@dataclass(frozen=True)
class EditGroundTable(_Edited, GroundTable):
    """The plane under the objects, edited as one of them."""


@dataclass(frozen=True)
class EditSettings:
    """[edit]: the number of triangles of the light, the tolerance of the low rank, and the bounces of light."""

    triangles: int = option(TRIANGLES, "Of the light", least=8, most=100_000)
    tolerance: float = option(TOLERANCE, "Relative RMS that the low rank may leave", above=0, most=0.5)
    bounces: int = option(0, "Bounces of light between surfaces: none, or one", least=0, most=1)


@dataclass(frozen=True, kw_only=True)
class EditSceneTable(SceneTable):
    """The whole file."""

    # No annotation, which would make it a key of the file.
    INSTEAD = MappingProxyType(
        {
            "seed": "leave it out, nothing here is random; for the seed of a fit, run factorize and name its folder as"
            " the material",
            "transport": "leave it out; bounces and tolerance are in [edit]",
        }
    )
    object: tuple[EditObjectTable, ...]
    ground: EditGroundTable | None = None
    sun: tuple[SunTable, ...] = ()
    edit: EditSettings = EditSettings()


@dataclass(frozen=True)
class EditSceneFile:
    """The scene to edit, as in its file; paths of sources, meshes and map are relative to the working folder."""

    name: str
    objects: tuple[EditObjectTable, ...]
    ground: EditGroundTable | None
    lighting: LightTable
    cameras: tuple[Camera, ...]
    settings: EditSettings
    suns: tuple[SunTable, ...] = ()

    def light(self) -> Lighting:
        """Return the lighting with the suns beside it. Raises BadInput as `LightTable.lighting`."""
        own = self.lighting.lighting(Path())
        if not self.suns:
            return own
        count = len(self.suns)
        words = f"{own.words or own.name} and {'a sun' if count == 1 else f'{count} suns'}"
        return Lighting(own.name, (*own.lights, *(sun.light() for sun in self.suns)), words)

    def record(self, folder: Path) -> dict[str, Any]:
        """Return the file's table again, JSON-able, with paths relative to `folder`: `scene_of_record` reads it."""

        def relative(text: str | None) -> str | None:
            if text is None or text in BUILT_IN or text.startswith((SHAPE_PREFIX, MATERIAL_PREFIX)):
                return text
            return os.path.relpath(Path(text).resolve(), folder.resolve())

        def record_of(table: Any) -> dict[str, Any]:
            found = {key: list(value) if isinstance(value, tuple) else value for key, value in asdict(table).items()}
            found |= {
                key: relative(found[key]) for key in ("mesh", "material", "environment", "pattern") if key in found
            }
            return {key: value for key, value in found.items() if value is not None}

        found: dict[str, Any] = {"object": [record_of(each) for each in self.objects]}
        if self.ground is not None:
            found["ground"] = record_of(self.ground)
        return found | {
            "lighting": record_of(self.lighting),
            "camera": [record_of(each) for each in self.cameras],
            **({"sun": [record_of(each) for each in self.suns]} if self.suns else {}),
            "edit": record_of(self.settings),
        }


def read_edit_scene(path: str | Path) -> EditSceneFile:
    """Return the scene in a TOML file.

    Raises BadInput for a file that cannot be read, unknown keys, wrong types and values, and for meshes, sources and
    environments that are not there.
    """
    file = Path(path)
    given = read_toml(file, "a scene in TOML")
    check_kind(given, EDITING, file)
    return scene_of_record(given, file.stem, file.parent, f"{file}: ")


def scene_of_record(table: dict[str, Any], name: str, folder: Path, place: str) -> EditSceneFile:
    """Return the scene of a table whose paths are relative to `folder`; `place` prefixes every message.

    Raises BadInput.
    """
    found = read_table(EditSceneTable, table, place)
    try:
        objects, ground = found_tables(found.object, found.ground, folder)
        objects = tuple(_with_pattern(each, folder, f"object[{k}].pattern") for k, each in enumerate(objects))
        ground = None if ground is None else _with_pattern(ground, folder, "ground.pattern")
        lighting = found.lighting
        if lighting.environment is not None:
            lighting = replace(lighting, environment=str(folder / lighting.environment))
            if not Path(str(lighting.environment)).is_file():
                what = f"no file {lighting.environment}"
                raise BadInput(what, where="lighting.environment", expected="a .hdr or .exr picture")
    except BadInput as error:
        joint = "." if place.endswith(".") else ": "
        raise error.at(place.removesuffix(joint), joint) from error
    return EditSceneFile(found.name or name, objects, ground, lighting, found.camera, found.edit, found.sun)


Table = TypeVar("Table", bound=_Edited)


def _with_pattern(table: Table, folder: Path, where: str) -> Table:
    """Return the table with the pattern's path resolved in `folder`. Raises BadInput if the file is missing."""
    if table.pattern is None or table.pattern in BUILT_IN:
        return table
    if not (folder / table.pattern).is_file():
        wanted = f"a PNG, or one of {', '.join(BUILT_IN)}"
        raise BadInput(f"no file {folder / table.pattern}", where=where, expected=wanted)
    return replace(table, pattern=str(folder / table.pattern))
