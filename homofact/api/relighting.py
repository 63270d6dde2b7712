"""Relighting: precompute a scene, or one mesh with one material, for any environment lighting."""

import os
import shutil
import time
from collections.abc import Sequence
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, overload

from homofact.api.places import check_place
from homofact.api.planning import transport_record
from homofact.api.progress import Progress, ProgressSteps
from homofact.api.viewing import NAME, view_relit
from homofact.errors import BadInput, Interrupted
from homofact.files.folder import check_new_folder
from homofact.files.kinds import RELIT
from homofact.files.lock import claimed

if TYPE_CHECKING:
    import numpy as np

    from homofact.brdf.reflectance import Reflectance
    from homofact.evaluation.estimate import TimeEstimate
    from homofact.meshes.mesh import Mesh
    from homofact.relighting.build import RelightScene, RelitObject
    from homofact.relighting.errors import RelightErrors
    from homofact.relighting.relit_mesh import RelitMesh
    from homofact.relighting.result import RelightResult
    from homofact.rendering.light import EnvironmentMap

Place = str | os.PathLike[str]
# Stages of the error that take seconds; the others take minutes.
QUICK_STAGES = ("normals", "truncation", "bounce", "harmonics", "clusters", "together", "rim", "picture")


@overload
def relight(
    scene: Place,
    *,
    to: Place | None = None,
    vertices: int = 64,
    every_stage: bool = False,
    reference: bool = False,
    page: bool = False,
    force: bool = False,
    progress: Progress | None = None,
) -> "RelightResult":
    """Relight a scene's file."""
    ...


@overload
def relight(
    scene: "Mesh | Place", material: "Reflectance | Place", *, progress: Progress | None = None, **transport: Any
) -> "RelitMesh":
    """Relight a mesh of one material."""
    ...


def relight(
    scene: "Mesh | Place",
    material: "Reflectance | Place | None" = None,
    *,
    to: Place | None = None,
    vertices: int = 64,
    every_stage: bool = False,
    reference: bool = False,
    page: bool = False,
    force: bool = False,
    progress: Progress | None = None,
    **transport: Any,
) -> "RelightResult | RelitMesh":
    """Precompute the light transport of a scene, or of one mesh of one material, so that any sky relights it.

    Parameters
    ----------
    scene : path or Mesh
        A scene's file in TOML. With `material` a mesh: a `Mesh`, an OBJ, PLY or glTF file, or "shape:sphere" or
        "shape:knot".
    material : Reflectance or path, optional
        The mesh's material: a fit, a model, "material:NAME", or a measurement file, which is fitted first.
    to : path, optional
        The folder of the relit scene, which `homofact view` shows. Nothing is written unless it is given. If a run was
        stopped, the same call resumes it.
    vertices : int, optional
        Number of vertices, and number of pixels, of each object at which the error is measured; 0 measures no error.
    every_stage : bool, optional
        Measure every stage of the error by itself. This takes minutes.
    reference : bool, optional
        For comparison, compute the full sum over the light at every vertex that the first camera sees.
    page : bool, optional
        Also write the page view.html to the folder, on which you can rotate the sky in a browser.
    force : bool, optional
        Replace a relit scene that is in the folder.
    progress : callable, optional
        Called with a `ProgressStep` on the way.
    **transport
        Settings for a mesh: `terms`, `error` or `share` (they determine the number of in-out factors), `lobe` ("auto",
        "separate" or "factored": whether a sharp lobe is summed separately), `light` (the lighting for `error`),
        `map_size`, `cube`, `rays`, `kept`, `tolerance` (as in `relighting.precompute.TransportSettings`), `among`
        (other meshes, which cast shadows on it), and `folder` (where finished blocks are stored for a later run).

    Returns
    -------
    RelightResult or RelitMesh
        For a scene: its objects, pictures, errors and report. For a mesh: the mesh without light. Its method `relight`
        sets the light, and `shade` returns the radiance of its vertices towards a point.

    Raises
    ------
    BadInput
        For files that cannot be read, a folder that already contains files, and settings that cannot be used.
    MissingDependency
        Without Embree (the extra `relight`).

    Examples
    --------
    >>> ball = homofact.relight("shape:sphere", "material:phong-10", terms=4, cube=8)
    >>> ball.relight("studio")
    >>> ball.shade((0.6, 0.9, 3.6)).shape == ball.mesh.positions.shape
    True
    """
    if material is not None:
        given = {"to": to, "every_stage": every_stage, "reference": reference, "page": page, "force": force}
        for name, value in given.items():
            if value:
                raise BadInput(where=name, found=f"{value} with a mesh and its material", expected="it with a scene")
        return _relit_mesh(scene, material, progress, **transport)
    if transport:
        name = next(iter(transport))
        raise BadInput(where=name, found="it with a scene's file", expected="it in the file, or a mesh and a material")
    if not isinstance(scene, str | os.PathLike):
        raise BadInput(where="scene", found=type(scene).__name__, expected="a scene in TOML, or a mesh and a material")
    if vertices < 0:
        raise BadInput(where="vertices", found=vertices, expected="0 or more")
    folder = None if to is None else Path(to)
    if page and folder is None:
        raise BadInput("given without a folder", where="page", expected="`to`, the folder that it is part of")
    if folder is not None:
        check_new_folder(folder, RELIT, force)
        check_place(folder)

    from homofact.relighting.errors import STAGES
    from homofact.relighting.scene_file import read_relight_scene

    file = read_relight_scene(Path(scene))
    blocks = None if folder is None else folder.with_name(f"{folder.name}.blocks")
    steps = ProgressSteps(progress)
    with nullcontext() if folder is None else claimed(folder):
        stages = STAGES if every_stage else QUICK_STAGES
        try:
            result = _relit_scene(file, blocks, vertices, stages, reference, steps)
        except KeyboardInterrupt as error:
            kept = f"the transport so far is kept in {blocks}: the same command goes on there"
            raise Interrupted(kept) if blocks is not None and blocks.exists() else error from error
        if folder is not None:
            steps.stage("writing")
            result.save(folder, force)
            shutil.rmtree(str(blocks), ignore_errors=True)
            if page:
                view_relit(folder, folder / NAME, (), True, steps)
    return result


def _relit_scene(
    file: Any, blocks: Path | None, vertices: int, stages: Sequence[str], reference: bool, steps: ProgressSteps
) -> "RelightResult":
    """Open, precompute and render a scene, and measure its errors."""
    from homofact.relighting.build import open_relight_scene, relit_objects
    from homofact.relighting.error_notes import error_notes
    from homofact.relighting.errors import dense_colours, scene_errors
    from homofact.relighting.result import RelightResult
    from homofact.relighting.room import check_room
    from homofact.relighting.whole_picture import picture_likeness
    from homofact.scene.file_fits import FileFits

    begun = time.perf_counter()
    fits = FileFits(blocks, blocks is not None, steps)
    scene = open_relight_scene(file, steps.stage, fits)
    check_room(scene, blocks)
    for line in (*scene.notes, *(plan.warning for plan in scene.plans if plan.warning)):
        steps.note(line)
    steps.note(scene.cost.describe())
    opened = time.perf_counter()
    objects = relit_objects(scene, blocks, lambda name, done, count: steps.run(name, min(done, count - 1), count))
    traced = time.perf_counter()
    result = RelightResult.of(file, objects, {})
    whole_picture = vertices > 0 and len(stages) > len(QUICK_STAGES)
    estimate = _estimate(scene, vertices, whole_picture, reference)
    pictures = _pictures(scene, result, estimate, steps)
    errors: list[RelightErrors | None] = []
    notes = list(scene.notes)
    if vertices:

        def begin(number: int) -> None:
            estimate.begin()
            words = f"measuring the error of {objects[number].mesh.name}"
            steps.run(words, number, len(objects), estimate.time_left())

        errors = scene_errors(scene, objects, vertices, stages, begin)
        for relit, error in zip(objects, errors, strict=True):
            for line in error_notes(relit.mesh.name, error, relit.lobe is not None):
                steps.note(line)
                notes.append(line)
    likeness = None
    if whole_picture:
        estimate.begin()
        likeness = picture_likeness(
            scene,
            objects,
            progress=lambda done, count: steps.run(
                "summing a picture in full", min(done, count - 1), count, estimate.time_left()
            ),
        )
    sums = None
    if reference:
        estimate.begin()
        steps.stage("summing every vertex in full", estimate.time_left())
        sums = tuple(dense_colours(scene, result.sky.cube.astype(float)))
    report = _report(scene, objects, errors)
    report["seconds"] = {
        "materials": opened - begun, "transport": traced - opened, "pictures and errors": time.perf_counter() - traced,
    }  # fmt: skip
    report["picture"] = None if likeness is None else likeness.record()
    report["notes"] = notes
    report["plan"] = transport_record(scene.plans) if scene.plans else None
    return replace(
        result, report=report, reference=sums, pictures=tuple(pictures), plans=scene.plans, notes=tuple(notes)
    )


def _estimate(scene: "RelightScene", vertices: int, whole_picture: bool, reference: bool) -> "TimeEstimate":
    """Return the time of what follows the transport: pictures, errors at `vertices`, a whole picture, every vertex."""
    from homofact.evaluation.estimate import TimeEstimate
    from homofact.relighting.expected import error_seconds, picture_seconds, reference_seconds, whole_picture_seconds
    from homofact.relighting.whole_picture import ROWS

    cube, lights, cameras = scene.file.settings.cube, len(scene.file.lights), scene.file.cameras
    estimate = TimeEstimate([("picture", picture_seconds(camera.pixels, lights)) for camera in cameras])
    reflectances = [placed.reflectance for placed in scene.objects]
    if vertices:
        for reflectance in reflectances:
            estimate.add("sum", error_seconds(reflectance, vertices, cube, whole_picture))
    if whole_picture:
        width, height = cameras[0].pixels
        estimate.add("sum", whole_picture_seconds(reflectances, ROWS**2 * width / height, cube))
    if reference:
        placed = [(each.reflectance, each.mesh) for each in scene.objects]
        estimate.add("sum", reference_seconds(placed, cameras[0].eye, cube))
    return estimate


def _pictures(
    scene: "RelightScene", result: "RelightResult", estimate: "TimeEstimate", steps: ProgressSteps
) -> "list[np.ndarray]":
    """Render 8-bit pictures from all cameras under the scene's light."""
    from homofact.relighting.picture import displayed_picture

    steps.stage("lighting the objects")
    cameras = scene.file.cameras
    lit = replace(result.lit(), occluder=scene.occluder)
    pictures = []
    for number, camera in enumerate(cameras):
        name = "rendering" if len(cameras) == 1 else f"rendering picture {number + 1} of {len(cameras)}"
        estimate.begin()
        steps.stage(name, estimate.time_left())
        pictures.append(displayed_picture(*lit.radiance(camera)))
    estimate.end()
    return pictures


def _relit_mesh(
    mesh: "Mesh | Place",
    material: "Reflectance | Place",
    progress: Progress | None,
    *,
    terms: int | None = None,
    error: float | None = None,
    share: float | None = None,
    lobe: str = "auto",
    light: "EnvironmentMap | Place | None" = None,
    map_size: int | None = None,
    among: "Sequence[Mesh]" = (),
    folder: Place | None = None,
    **settings: Any,
) -> "RelitMesh":
    """Compute the transport of one mesh among other meshes."""
    from homofact.meshes.mesh import Mesh
    from homofact.meshes.prepare import prepared
    from homofact.relighting.factored_material import factored
    from homofact.relighting.factoring import MAP_SIZE
    from homofact.relighting.lobe import SeparateLobe
    from homofact.relighting.precompute import TransportSettings, transport
    from homofact.relighting.relit_mesh import RelitMesh
    from homofact.scene.file_fits import FileFits
    from homofact.scene.lighting import open_environment
    from homofact.scene.materials import open_material
    from homofact.scene.meshes import MeshGroup, open_mesh

    unknown = settings.keys() - {"cube", "rays", "kept", "tolerance"}
    if unknown:
        known = "terms, error, share, lobe, light, map_size, cube, rays, kept, tolerance, among, folder"
        raise BadInput(f"no such setting {min(unknown)!r}", where="relight", expected=f"one of {known}")
    kept = TransportSettings(**settings)
    given, notes = prepared(mesh if isinstance(mesh, Mesh) else open_mesh(os.fspath(mesh)))
    given_material: Any = getattr(material, "factorization", material)
    reflectance: Any = given_material
    steps = ProgressSteps(progress)
    place = None if folder is None else Path(folder)
    if isinstance(material, str | os.PathLike):
        reflectance = open_material(os.fspath(material), FileFits(place, True, steps)).reflectance
    under = open_environment(os.fspath(light)) if isinstance(light, str | os.PathLike) else light
    size = MAP_SIZE if map_size is None else map_size
    made = factored(reflectance, lobe, terms, share, error, size, under)
    occluder = MeshGroup([given, *among]).occluder

    def traced_shadows(done: int, count: int) -> None:
        steps.run(f"shadows on {given.name}", min(done, count - 1), count)

    def traced_block(done: int, count: int) -> None:
        steps.run(f"transport of {given.name}", min(done, count - 1), count)

    separate = SeparateLobe.traced(made.lobe, given, occluder, kept.cube, place, traced_shadows)
    sight = None if separate is None else separate.sight
    moved = transport(given, made.factors, kept, occluder, place, traced_block, sight=sight)
    return RelitMesh(given, moved, notes, separate, alone=not among)


def _report(
    scene: "RelightScene", objects: "Sequence[RelitObject]", errors: "Sequence[RelightErrors | None]"
) -> dict[str, Any]:
    """Return the report of a scene, as in relight.json."""
    from homofact.relighting.result import distinct_names

    file, settings = scene.file, scene.file.settings
    entries = []
    for number, relit in enumerate(objects):
        made, error = relit.transport, errors[number] if errors else None
        entries.append(
            {
                "mesh": relit.mesh.name,
                "material": relit.material,
                "fit": None if relit.fit is None else relit.fit.record(),
                "vertices": made.vertices,
                "terms": made.factors.terms,
                "form": relit.form,
                "map_size": made.factors.view.shape[1],
                "share_of_energy": made.factors.share,
                "expected_error_of_terms": made.factors.expected_error,
                "coefficients_per_vector": made.mean_kept,
                "bytes": relit.nbytes,
                "error": None if error is None else error.record(),
            }
        )
    return {
        "scene": file.name,
        "light": file.light.describe(),
        "suns": [sun.record() for sun in file.suns],
        "lamps": [lamp.record() for lamp in file.lamps],
        "cube": settings.cube,
        "rays": settings.rays,
        "kept": settings.kept if settings.tolerance is None and file.reflected is None else None,
        "reflected": file.reflected,
        "tolerance": settings.tolerance,
        "seed": file.seed,
        "objects": entries,
        "bytes": sum(relit.nbytes for relit in objects),
        "error": dict(
            zip(distinct_names([each["mesh"] for each in entries]), (each["error"] for each in entries), strict=True)
        ),
    }
