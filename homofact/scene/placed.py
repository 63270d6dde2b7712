"""What the scene files of relighting and editing share: objects with materials in their places, a ground, cameras.

The tables are read by `files.tables`; sources and meshes are relative to the scene's file.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TypeVar

import numpy as np

from homofact.brdf.names import MATERIAL_PREFIX
from homofact.brdf.reflectance import Reflectance
from homofact.brdf.source import open_source
from homofact.errors import BadInput
from homofact.export.result import open_result
from homofact.files.embedded import located
from homofact.files.kinds import FACTORIZATION
from homofact.files.tables import limits
from homofact.meshes.mesh import Mesh, read_mesh
from homofact.meshes.shapes import sphere, torus_knot
from homofact.scene.plan.scene import found_source

SHAPE_PREFIX = "shape:"
_SHAPES: dict[str, Callable[[], Mesh]] = {"sphere": sphere, "knot": torus_knot}


@dataclass(frozen=True, kw_only=True)
class MaterialTable:
    """What objects and the ground have alike: exactly one of `material` and `albedo`.

    A kind of scene says in a class of this one what else it asks of both, and mixes it into its object and its ground.
    """

    material: str | None = None
    albedo: tuple[float, ...] | None = None

    def __post_init__(self) -> None:
        """Refuse no or two materials, and an albedo that is none. Raises BadInput."""
        if (self.material is None) is (self.albedo is None):
            raise BadInput("found none or both, expected exactly one of material, albedo")
        if self.albedo is not None and (len(self.albedo) not in (1, 3) or not all(0 <= a <= 1 for a in self.albedo)):
            raise BadInput(f"albedo: found {list(self.albedo)}, expected 1 or 3 numbers from 0 to 1")


@dataclass(frozen=True)
class PlacedObject(MaterialTable):
    """One object of a scene, as its table in the file says: `size` is the radius of the sphere round it, y is up.

    `turn` is in degrees about y.
    """

    mesh: str
    size: float = field(default=1.0, metadata=limits(above=0))
    at: tuple[float, ...] = (0.0, 0.0, 0.0)
    turn: float = field(default=0.0, metadata=limits())

    def __post_init__(self) -> None:
        """Refuse what is no point, and no or two materials. Raises BadInput."""
        check_point("at", self.at)
        super().__post_init__()


@dataclass(frozen=True)
class GroundPlane(MaterialTable):
    """The plane under the objects, at the height of their lowest vertex: half of its width, squares along a side."""

    half: float = field(default=2.5, metadata=limits(above=0))
    steps: int = field(default=64, metadata=limits(least=1, most=1024))


Object = TypeVar("Object", bound=PlacedObject)
Plane = TypeVar("Plane", bound=GroundPlane)


@dataclass(frozen=True)
class Camera:
    """A pinhole at `eye` that looks at `target`, y up: `field` degrees from top to bottom, `pixels` width, height."""

    eye: tuple[float, ...]
    target: tuple[float, ...] = (0.0, 0.0, 0.0)
    field: float = field(default=40.0, metadata=limits(above=0, most=170))
    pixels: tuple[int, ...] = (480, 360)

    def __post_init__(self) -> None:
        """Refuse what is no camera. Raises BadInput."""
        check_point("eye", self.eye)
        check_point("target", self.target)
        if self.eye == self.target:
            raise BadInput("eye: found the target's place, expected another")
        if len(self.pixels) != 2 or not all(8 <= each <= 8192 for each in self.pixels):
            raise BadInput(f"pixels: found {list(self.pixels)}, expected width and height of 8 to 8192")


@dataclass(frozen=True)
class LightTable:
    """[lighting] of one scene: an environment map's file, or a name of `scene.lighting.NAMED`; degrees about y."""

    environment: str | None = None
    named: str | None = None
    turn: float = field(default=0.0, metadata=limits())

    def __post_init__(self) -> None:
        """Refuse none and both. Raises BadInput."""
        if (self.environment is None) is (self.named is None):
            raise BadInput("found none or both, expected exactly one of environment, named")


def check_point(name: str, found: tuple[float, ...]) -> None:
    """Raise BadInput where `found` is no point."""
    if len(found) != 3 or not all(abs(each) < 1e6 for each in found):
        raise BadInput(f"{name}: found {list(found)}, expected three numbers below a million")


def open_mesh(text: str) -> Mesh:
    """A mesh's file, or a shape by its name with `SHAPE_PREFIX`. Raises BadInput for what cannot be read."""
    return _shape(text, "mesh")() if text.startswith(SHAPE_PREFIX) else read_mesh(text)


def found_tables(
    objects: Sequence[Object], ground: Plane | None, folder: Path
) -> tuple[tuple[Object, ...], Plane | None]:
    """Objects and ground with meshes and materials, relative to `folder`, made findable.

    Raises BadInput, beginning with the table's place in the file, for those that are not there.
    """
    found = tuple(
        replace(
            each,
            mesh=_found_mesh(each.mesh, folder, f"object[{number}].mesh"),
            material=_found_material(each.material, folder, f"object[{number}].material"),
        )
        for number, each in enumerate(objects)
    )
    if ground is not None:
        ground = replace(ground, material=_found_material(ground.material, folder, "ground.material"))
    return found, ground


def _found_mesh(text: str, folder: Path, where: str) -> str:
    if text.startswith(SHAPE_PREFIX):
        _shape(text, where)
        return text
    if not located(folder / text).is_file():
        raise BadInput(f"{where}: no file {folder / text}, expected a mesh or {SHAPE_PREFIX}NAME")
    return str(located(folder / text))


def _found_material(material: str | None, folder: Path, where: str) -> str | None:
    return None if material is None else found_source(material, folder, where)


def _shape(text: str, where: str) -> Callable[[], Mesh]:
    """What makes the shape of that name. Raises BadInput, beginning with `where`, for another name."""
    name = text.removeprefix(SHAPE_PREFIX)
    if name not in _SHAPES:
        names = ", ".join(SHAPE_PREFIX + each for each in _SHAPES)
        raise BadInput(f"{where}: found {text!r}, expected a file or one of {names}")
    return _SHAPES[name]


def placed_mesh(each: PlacedObject) -> Mesh:
    """The object's mesh, turned about y, scaled and moved. Raises BadInput for a file that is no mesh."""
    mesh = open_mesh(each.mesh)
    angle = math.radians(each.turn)
    turn = np.array([[math.cos(angle), 0, math.sin(angle)], [0, 1, 0], [-math.sin(angle), 0, math.cos(angle)]])
    return replace(
        mesh, positions=mesh.positions @ turn.T * each.size + np.array(each.at), normals=mesh.normals @ turn.T
    )


def lowest(meshes: list[Mesh]) -> float:
    """The height of the lowest vertex of some meshes that a triangle uses."""
    return min(float(mesh.positions[np.unique(mesh.triangles), 1].min()) for mesh in meshes)


def three(albedo: tuple[float, ...]) -> tuple[float, ...]:
    """An albedo as red, green and blue."""
    return albedo * 3 if len(albedo) == 1 else albedo


def material_words(table: MaterialTable) -> str:
    """The material as tables and reports name it."""
    return table.material if table.material is not None else f"albedo {', '.join(f'{x:g}' for x in table.albedo or ())}"


def open_reflectance(text: str) -> Reflectance:
    """A material's name, a measurement's file, or a fit: the folder or the file that `factorize` wrote."""
    return open_result(Path(text)) if is_fit(text) else open_source(text).reflectance


def is_fit(text: str) -> bool:
    """Whether a material's words name a result of `factorize` rather than a measurement or a named material."""
    place = Path(text)
    return not text.startswith(MATERIAL_PREFIX) and (place.is_dir() or place.name == FACTORIZATION)
