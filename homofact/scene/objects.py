"""The objects of a scene: their tables in the file, and placed objects with opened materials.

The tables are read by `settings.tables`; sources and meshes are relative to the scene's file.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Self, TypeVar

import numpy as np
import torch

from homofact.brdf.reflectance import Reflectance
from homofact.errors import BadInput
from homofact.files.embedded import located
from homofact.files.reading import split_member
from homofact.meshes.gltf_parts import gltf_parts, is_gltf
from homofact.meshes.mesh import Mesh
from homofact.meshes.prepare import open_edges, prepared, two_sided
from homofact.meshes.shapes import ground
from homofact.rendering.light import EnvironmentMap
from homofact.scene.cameras import Camera, check_point
from homofact.scene.file_fits import FileFits
from homofact.scene.materials import MaterialTable, OpenedMaterial, Stage, found_source, open_materials
from homofact.scene.meshes import SHAPE_PREFIX, MeshGroup, lowest, open_mesh, shape
from homofact.scene.normal_map import SurfaceNormals
from homofact.scene.tint import SurfaceTint
from homofact.scene.visibility import seen_from_behind
from homofact.settings.options import option

# The share of an open mesh's pixels that see its inside, above which it is shown.
_BEHIND = 0.01
# The albedo of a ground from which on its light is missed.
_REFLECTS = 0.05
# Half the width of a ground that reaches the horizon but for a degree, and the part of a map's mean radiance that is
# bright.
_WIDE, _BRIGHT_BELOW = 100.0, 0.25


@dataclass(frozen=True)
class ObjectTable(MaterialTable):
    """One object of a scene, as its table in the file says: `size` is the radius of the sphere round it, y is up.

    `turn` is in degrees about y.
    """

    mesh: str
    size: float = option(1.0, "Radius of the sphere round it", above=0)
    at: tuple[float, ...] = (0.0, 0.0, 0.0)
    turn: float = option(0.0, "Degrees about y")

    def __post_init__(self) -> None:
        """Refuse what is no point, and no or two materials; a glTF scene has its own. Raises BadInput."""
        check_point("at", self.at)
        if not (is_gltf(self.mesh) and self.material is None and self.albedo is None):
            super().__post_init__()

    def part(self, mesh: str, several: bool) -> Self:
        """Return the table of a part of its glTF file, with the part's own material; `several` if it is one of them."""
        return replace(self, mesh=mesh, material=mesh)


@dataclass(frozen=True)
class GroundTable(MaterialTable):
    """The plane under the objects, at the height of their lowest vertex: half of its width, squares along a side."""

    half: float = option(2.5, "Half of its width", above=0)
    steps: int = option(64, "Squares along a side", least=1, most=1024)


@dataclass(frozen=True)
class SceneObject:
    """A placed object: its mesh in world coordinates and its opened material."""

    mesh: Mesh
    material: OpenedMaterial

    @cached_property
    def tint(self) -> SurfaceTint | None:
        """Return the tint by its material's base-colour texture; None without a texture."""
        picture, uv = self.material.picture, self.mesh.uv
        return None if picture is None or uv is None else SurfaceTint.of(picture, uv)

    @cached_property
    def bumps(self) -> SurfaceNormals | None:
        """Return its material's normal map on the mesh; None without a normal map."""
        given, mesh = self.material.normals, self.mesh
        if given is None or mesh.uv is None or mesh.tangents is None:
            return None
        return SurfaceNormals(given, mesh.uv, mesh.tangents)

    @cached_property
    def reflectance(self) -> Reflectance:
        """Its material, in two parts where it has a texture."""
        tinted = None if self.tint is None else self.material.tinted
        return self.material.reflectance if tinted is None else tinted


ObjectKind = TypeVar("ObjectKind", bound=ObjectTable)
GroundKind = TypeVar("GroundKind", bound=GroundTable)


def found_tables(
    objects: Sequence[ObjectKind], plane: GroundKind | None, folder: Path
) -> tuple[tuple[ObjectKind, ...], GroundKind | None]:
    """Return the objects and the ground with paths relative to `folder` converted to the working folder.

    A glTF scene without a material becomes an object for each of its parts, with the parts' own materials. Raises
    BadInput, beginning with the table's place in the file, for those that are not there.
    """
    found: list[ObjectKind] = []
    for number, table in enumerate(objects):
        mesh = _found_mesh(table.mesh, folder, f"object[{number}].mesh")
        if table.material is None and table.albedo is None:
            names = (
                [mesh] if split_member(mesh)[1] is not None else [f"{mesh}#{part.name}" for part in gltf_parts(mesh)]
            )
            found += [table.part(name, len(names) > 1) for name in names]
            continue
        material = _found_material(table.material, folder, f"object[{number}].material")
        found.append(replace(table, mesh=mesh, material=material))
    if plane is not None:
        plane = replace(plane, material=_found_material(plane.material, folder, "ground.material"))
    return tuple(found), plane


def place_objects(
    objects: Sequence[ObjectTable],
    plane: GroundTable | None,
    cameras: Sequence[Camera],
    stage: Stage | None = None,
    fits: FileFits | None = None,
    check: Callable[[Sequence[Mesh], Mesh | None], None] | None = None,
    normal_maps: bool = False,
) -> tuple[tuple[SceneObject, ...], tuple[str, ...]]:
    """Return (placed objects, with the ground last; one line for each remark).

    An open mesh that a camera sees from behind gets a back side. `stage` is called with the name of each file that is
    read, and `fits` has the fits that replace files of measurements. `check` is called with the objects' meshes and the
    ground, before materials are opened. A line remarks on normal maps unless the caller uses them. Raises BadInput if a
    file cannot be read.
    """
    meshes, notes = [], []
    for table in objects:
        if stage is not None:
            stage(f"reading {Path(table.mesh).name}")
        mesh, remarks = prepared(placed_mesh(table))
        mesh = mesh if table.called is None else replace(mesh, name=table.called)
        meshes.append(mesh)
        notes += remarks
    for number, share in enumerate(seen_from_behind(MeshGroup(meshes), cameras).tolist()):
        if share > _BEHIND and open_edges(meshes[number]):
            meshes[number] = two_sided(meshes[number])
            notes.append(f"{meshes[number].name}: {share:.0%} of its pixels see it from behind; it is given a back")
    tables: list[MaterialTable] = list(objects)
    level = None if plane is None else ground(plane.half, lowest(meshes), plane.steps)
    if plane is not None and level is not None and plane.called is not None:
        level = replace(level, name=plane.called)
    if check is not None:
        check(meshes, level)
    if plane is not None and level is not None:
        meshes.append(level)
        tables.append(plane)
    materials = open_materials(tables, stage, fits)
    stand = {each.words: each.fit for each in materials if each.fit is not None}
    notes += [fit.sentence(words) for words, fit in stand.items()]
    parts = {each.words: _left_out(each, normal_maps) for each in materials if _left_out(each, normal_maps)}
    notes += [f"{Path(words).name}: {', '.join(left)} is left out" for words, left in parts.items()]
    return tuple(map(SceneObject, meshes, materials)), tuple(notes)


def _left_out(material: OpenedMaterial, normal_maps: bool) -> tuple[str, ...]:
    unused = () if normal_maps or material.normals is None else ("its normal map",)
    return (*unused, *material.left_out)


def bounce_note(plane: GroundTable | None, bounces: int, section: str) -> tuple[str, ...]:
    """Return a line about light from the ground to the objects, if the scene neglects such light.

    `section` is the section of the scene's file with the key `bounces`.
    """
    if plane is None or bounces or max(plane.albedo or (1.0,)) < _REFLECTS:
        return ()
    return (
        "bounces = 0: the light that the ground reflects does not reach the objects, so parts that face the ground are"
        f" dark or black; bounces = 1 in [{section}] adds it",
    )


def edge_note(plane: GroundTable | None, light: EnvironmentMap) -> tuple[str, ...]:
    """Return a line on a map that shines on the objects from below, past the edge of a ground that is not wide."""
    if plane is None or plane.half >= _WIDE:
        return ()
    rows = light.radiance.shape[0]
    polar = (torch.arange(rows, dtype=torch.float64) + 0.5) * (math.pi / rows)
    by_row = light.radiance.double().mean((1, 2))
    below = (polar > math.pi / 2) & (polar < math.pi / 2 + math.atan(2 / plane.half))
    if not bool(below.any()):
        return ()
    size = polar.sin()
    mean = float((by_row * size).sum() / size.sum())
    if float((by_row * size)[below].sum() / size[below].sum()) < _BRIGHT_BELOW * mean:
        return ()
    return (
        f"{light.name} is bright below its horizon too. This light passes the edge of the ground"
        f" (half = {plane.half:g}) and lights the objects from below, which can show as a horizontal line on them."
        f" half = {_WIDE:g} in [ground] keeps it out",
    )


def placed_mesh(table: ObjectTable) -> Mesh:
    """The object's mesh, turned about y, scaled and moved. Raises BadInput for a file that is no mesh."""
    mesh = open_mesh(table.mesh)
    angle = math.radians(table.turn)
    turn = np.array([[math.cos(angle), 0, math.sin(angle)], [0, 1, 0], [-math.sin(angle), 0, math.cos(angle)]])
    tangents = None
    if mesh.tangents is not None:
        tangents = np.concatenate((mesh.tangents[:, :3] @ turn.T, mesh.tangents[:, 3:]), 1)
    positions = mesh.positions @ turn.T * table.size + np.array(table.at)
    return replace(mesh, positions=positions, normals=mesh.normals @ turn.T, tangents=tangents)


def _found_mesh(text: str, folder: Path, where: str) -> str:
    if text.startswith(SHAPE_PREFIX):
        shape(text, where)
        return text
    file, part = split_member(folder / text)
    if not located(file).is_file():
        raise BadInput(f"no file {file}", where=where, expected=f"a mesh or {SHAPE_PREFIX}NAME")
    return str(located(file)) if part is None else f"{located(file)}#{part}"


def _found_material(material: str | None, folder: Path, where: str) -> str | None:
    return None if material is None else found_source(material, folder, where)
