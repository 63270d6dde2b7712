"""Build an editing scene from its file: place the objects and give the materials their curves."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from homofact.brdf.reflectance import Reflectance
from homofact.brdf.source_names import MATERIAL_PREFIX
from homofact.editing import models
from homofact.editing.factored import half_and_diffuse, homomorphic
from homofact.editing.material import Editable
from homofact.editing.patterns import PicturePattern, open_pattern
from homofact.editing.scene import EditObject, EditScene, Pattern
from homofact.editing.scene_file import HD, HF, OWN, EditGroundTable, EditObjectTable, EditSceneFile
from homofact.errors import BadInput
from homofact.files.kinds import FACTORIZATION
from homofact.files.reading import split_member
from homofact.meshes.gltf_parts import is_gltf
from homofact.scene.file_fits import FileFits
from homofact.scene.materials import MATT, OpenedMaterial, Stage, open_materials
from homofact.scene.objects import SceneObject, bounce_note, place_objects

GROUND = "ground"
_ANGLES, _BANDS = ("theta_h", "theta_d"), (256, 64)


@dataclass(frozen=True)
class EditMaterial:
    """A material of the scene, in its opened form and its editable form."""

    opened: OpenedMaterial
    material: Editable


def open_edit_materials(
    file: EditSceneFile, stage: Stage | None = None, fits: FileFits | None = None
) -> tuple[EditMaterial, ...]:
    """Return the materials of the objects and of the ground, with their curves.

    Raises BadInput for files that cannot be read, curves that a material cannot have, and repeated names.
    """
    return _with_curves(file, open_materials(_tables(file).values(), stage, fits), stage)


def open_edit_scene(file: EditSceneFile, stage: Stage | None = None, fits: FileFits | None = None) -> EditScene:
    """Read the scene and place its objects; `fits` has the fits that replace files of measurements.

    Raises BadInput if a file cannot be read, and for everything that `EditScene` rejects.
    """
    lighting = file.light()
    placed, notes = place_objects(file.objects, file.ground, file.cameras, stage, fits)
    edited = _with_curves(file, [thing.material for thing in placed], stage)
    remarks = [f"{each.material.name}: {note}" for each in edited for note in each.material.notes]
    dark = bounce_note(file.ground, file.settings.bounces, "edit")
    tables = _tables(file)
    objects = tuple(
        EditObject(thing.mesh, each.material, _patterns(thing, each.material, table, where))
        for (where, table), thing, each in zip(tables.items(), placed, edited, strict=True)
    )
    return EditScene(objects, lighting, file.cameras, (*notes, *dark, *remarks), file.settings.bounces)


def _patterns(
    thing: SceneObject, material: Editable, table: EditObjectTable | EditGroundTable, where: str
) -> dict[str, Pattern]:
    """Return the pattern of the first term: the table's, or else the base-colour texture of a glTF part."""
    first = material.terms[0].name
    if table.pattern is None:
        return {} if thing.material.picture is None else {first: PicturePattern(thing.material.picture)}
    try:
        textured = thing.mesh.uv is not None
        return {first: open_pattern(table.pattern, table.pattern_size, len(material.channels), textured)}
    except BadInput as error:
        raise error.at(where) from error


def _with_curves(
    file: EditSceneFile, opened: Sequence[OpenedMaterial], stage: Stage | None
) -> tuple[EditMaterial, ...]:
    tables = _tables(file)
    names, materials = _names(tables), []
    for (where, table), source in zip(tables.items(), opened, strict=True):
        if stage is not None:
            stage(f"curves of {names[where]}")
        try:
            material = editable(source.reflectance, names[where], table.curves, table.bands)
        except BadInput as error:
            raise error.at(where) from error
        materials.append(EditMaterial(source, material))
    return tuple(materials)


def editable(
    reflectance: Reflectance, name: str, curves: str | tuple[str, ...] = OWN, bands: tuple[int, ...] | None = None
) -> Editable:
    """Return a reflectance with the curves of a scene file. Raises BadInput for a wrong number of bands."""
    own = models.own_curves(reflectance)
    if isinstance(curves, tuple) or (curves == OWN and own is None):
        angles = curves if isinstance(curves, tuple) else _ANGLES
        given = (*_BANDS, *(_BANDS[-1],) * len(angles))[: len(angles)] if bands is None else bands
        if len(given) != len(angles):
            raise BadInput(where="bands", found=f"{len(given)} numbers", expected=f"{len(angles)}, one a curve")
        return models.from_reflectance(reflectance, angles, name, given)
    found: dict[str, Callable[..., Editable]] = {HF: homomorphic, HD: half_and_diffuse}
    make, wanted = (found[curves], 2) if own is None or curves != OWN else own
    if bands is None:
        return make(reflectance, name)
    if not wanted:
        raise BadInput(where="bands", found="some for a matt material, whose curves have 256", expected="none")
    if len(bands) != wanted:
        raise BadInput(where="bands", found=f"{len(bands)} numbers", expected=f"{wanted}, one a curve")
    return make(reflectance, name, bands)


def _tables(file: EditSceneFile) -> dict[str, EditObjectTable | EditGroundTable]:
    """Return the tables of objects and ground by their place in the file, e.g. "object[0]"."""
    found: dict[str, EditObjectTable | EditGroundTable] = {f"object[{k}]": own for k, own in enumerate(file.objects)}
    return found if file.ground is None else found | {"ground": file.ground}


def _names(tables: dict[str, EditObjectTable | EditGroundTable]) -> dict[str, str]:
    """Return a unique name per table, numbering default names. Raises BadInput for a repeated given name."""
    given: dict[str, str] = {}
    for where, table in tables.items():
        if table.name is not None:
            if table.name in given.values():
                raise BadInput(where=f"{where}: name", found=f"{table.name!r} twice", expected="different names")
            given[where] = table.name
    found: dict[str, str] = {}
    for where, table in tables.items():
        taken = {*given.values(), *found.values()}
        first = given.get(where) or _own_name(table)
        name, number = first, 1
        while where not in given and name in taken:
            number += 1
            name = f"{first} {number}"
        found[where] = name
    return found


def _own_name(table: EditObjectTable | EditGroundTable) -> str:
    if table.material is None:
        return GROUND if isinstance(table, EditGroundTable) else MATT
    if table.material.startswith(MATERIAL_PREFIX):
        return table.material.removeprefix(MATERIAL_PREFIX)
    if is_gltf(table.material) and (part := split_member(table.material)[1]) is not None:
        return part
    place = Path(table.material)
    return place.resolve().parent.name if place.name == FACTORIZATION else place.stem
