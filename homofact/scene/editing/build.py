"""From a scene file to what is edited: meshes placed, materials opened and given their curves, light and views."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from homofact.brdf.analytic.ashikhmin_shirley import AshikhminShirley
from homofact.brdf.analytic.cook_torrance import CookTorrance
from homofact.brdf.analytic.lambert import Lambert
from homofact.brdf.names import MATERIAL_PREFIX
from homofact.brdf.reflectance import Reflectance
from homofact.errors import BadInput
from homofact.files.kinds import FACTORIZATION
from homofact.meshes.prepare import prepared
from homofact.meshes.shapes import ground
from homofact.render.environment import read_environment
from homofact.render.light import EnvironmentMap
from homofact.scene.editing import models
from homofact.scene.editing.factored import half_and_diffuse, homomorphic
from homofact.scene.editing.material import Editable
from homofact.scene.editing.precompute import EditScene, Thing
from homofact.scene.editing.scene_file import HD, HF, OWN, AskedEdit, EditedGround, EditedObject
from homofact.scene.editing.view import View
from homofact.scene.lighting import Lighting, named_lighting
from homofact.scene.placed import LightTable, is_fit, lowest, material_words, open_reflectance, placed_mesh, three

Stage = Callable[[str], object]
GROUND, MATT, FIT, SOURCE = "ground", "matt", "fit", "source"
_ANGLES, _BANDS = ("theta_h", "theta_d"), (256, 64)


@dataclass(frozen=True)
class Subject:
    """A material of the scene: as `words` name it, as it was opened, and as it is edited.

    `kind` is "fit", a result of `factorize`, "source", what `brdf.source.open_source` takes, or "matt", an albedo.
    """

    words: str
    kind: str
    reflectance: Reflectance
    material: Editable


@dataclass(frozen=True)
class Built:
    """The scene, its materials in the order of its objects, and what was found on the way, one line each."""

    scene: EditScene
    subjects: tuple[Subject, ...]
    notes: tuple[str, ...]


def subjects_of(asked: AskedEdit, stage: Stage | None = None) -> tuple[Subject, ...]:
    """The materials of the objects and of the ground, opened.

    Raises BadInput for what cannot be read, curves that a material cannot have, and a name that stands twice.
    """
    told = stage or (lambda _: None)
    tables = _tables(asked)
    opened: dict[str, Reflectance] = {}
    names = _names(tables)
    found = []
    for where, table in tables.items():
        words = material_words(table)
        if words not in opened:
            told(f"opening {Path(words).name}")
            opened[words] = Lambert(three(table.albedo)) if table.albedo else open_reflectance(words)
        told(f"curves of {names[where]}")
        try:
            material = editable(opened[words], names[where], table.curves, table.bands)
        except BadInput as error:
            raise BadInput(f"{where}: {error}") from error
        kind = MATT if table.albedo else FIT if is_fit(words) else SOURCE
        found.append(Subject(words, kind, opened[words], material))
    return tuple(found)


def edit_scene(asked: AskedEdit, stage: Stage | None = None) -> Built:
    """Read and place everything. Raises BadInput for what cannot be read, and what `EditScene` refuses."""
    told = stage or (lambda _: None)
    views = []
    for number, each in enumerate(asked.cameras):
        eye, target = ((x, y, z) for x, y, z in (each.eye, each.target))
        try:
            width, height = each.pixels
            views.append(View(each.name or f"view {number + 1}", eye, target, width, height, each.field))
        except BadInput as error:
            raise BadInput(f"camera[{number}]: {error}") from error
    lighting = _lighting(asked.lighting)
    meshes, notes = [], []
    for each in asked.objects:
        told(f"reading {Path(each.mesh).name}")
        mesh, found = prepared(placed_mesh(each))
        meshes.append(mesh)
        notes += found
    if asked.ground is not None:
        meshes.append(ground(asked.ground.half, lowest(meshes), asked.ground.steps))
    subjects = subjects_of(asked, stage)
    for subject in subjects:
        notes += [f"{subject.material.name}: {note}" for note in subject.material.notes]
    things = tuple(Thing(mesh, subject.material) for mesh, subject in zip(meshes, subjects, strict=True))
    return Built(EditScene(things, lighting, tuple(views)), subjects, tuple(notes))


def editable(
    reflectance: Reflectance, name: str, curves: str | tuple[str, ...] = OWN, bands: tuple[int, ...] | None = None
) -> Editable:
    """A reflectance with curves as a scene file asks for them. Raises BadInput for a wrong number of bands."""
    if isinstance(curves, tuple) or (
        curves == OWN and not isinstance(reflectance, CookTorrance | AshikhminShirley | Lambert)
    ):
        angles = curves if isinstance(curves, tuple) else _ANGLES
        return models.from_reflectance(reflectance, angles, name, _bands(bands, len(angles), _BANDS[: len(angles)]))
    if isinstance(reflectance, Lambert) and curves == OWN:
        if bands is not None:
            raise BadInput("bands: found some for a matt material, whose curves have 256; expected none")
        return models.light_view(reflectance, name)
    pair = None if bands is None else _pair(bands)
    more = () if pair is None else (pair,)
    if curves == HF:
        return homomorphic(reflectance, name, *more)
    if curves == HD:
        return half_and_diffuse(reflectance, name, *more)
    if isinstance(reflectance, CookTorrance):
        return models.cook_torrance(reflectance, name, *more)
    assert isinstance(reflectance, AshikhminShirley)
    return models.ashikhmin_shirley(reflectance, name, *more)


def _bands(given: tuple[int, ...] | None, count: int, usual: tuple[int, ...]) -> tuple[int, ...]:
    if given is None:
        return (*usual, *(_BANDS[-1],) * (count - len(usual)))
    if len(given) != count:
        raise BadInput(f"bands: found {len(given)} numbers, expected {count}, one a curve")
    return given


def _pair(bands: tuple[int, ...]) -> tuple[int, int]:
    if len(bands) != 2:
        raise BadInput(f"bands: found {len(bands)} numbers, expected 2, one a curve")
    return bands[0], bands[1]


def _tables(asked: AskedEdit) -> dict[str, EditedObject | EditedGround]:
    """The objects' tables and the ground's, by where they stand."""
    found: dict[str, EditedObject | EditedGround] = {f"object[{k}]": each for k, each in enumerate(asked.objects)}
    return found if asked.ground is None else found | {"ground": asked.ground}


def _names(tables: dict[str, EditedObject | EditedGround]) -> dict[str, str]:
    """A name for each, numbered where a name that was not given is taken. Raises BadInput for a given one twice."""
    given: dict[str, str] = {}
    for where, table in tables.items():
        if table.name is not None:
            if table.name in given.values():
                raise BadInput(f"{where}: name: found {table.name!r} twice, expected different names")
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


def _own_name(table: EditedObject | EditedGround) -> str:
    if table.material is None:
        return GROUND if isinstance(table, EditedGround) else MATT
    if table.material.startswith(MATERIAL_PREFIX):
        return table.material.removeprefix(MATERIAL_PREFIX)
    place = Path(table.material)
    return place.resolve().parent.name if place.name == FACTORIZATION else place.stem


def _lighting(table: LightTable) -> Lighting:
    turn = math.radians(table.turn)
    if table.environment is not None:
        found = read_environment(table.environment, turn)
        return Lighting(found.name, (found,), found.describe())
    named = named_lighting(str(table.named))
    if not turn:
        return named
    lights = [each.turned(turn) for each in named.lights if isinstance(each, EnvironmentMap)]
    if len(lights) < len(named.lights):
        raise BadInput(f"lighting.turn: {table.named} is no environment map, expected one, or no turn")
    return Lighting(named.name, tuple(lights), named.words)
