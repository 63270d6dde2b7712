"""Direct illumination of a mesh by Mitsuba 3 (the extra `mitsuba`), the reference for relighting.

The scene is the mesh with one material under an environment map, in the frame of `rendering.light`. Light arrives only
from the map; `scene_picture` can add bounces. Each vertex has its own surface frame, with the given normal and, for an
anisotropic material, the given tangent.

The conventions are those of `relighting`: light counts if it is above the horizon of the vertex normal and if a ray
from the vertex, moved `offset` along that normal, leaves the mesh. The horizon of the triangles matters only through
the hits of this ray. A vertex is visible if the camera is above the horizon of its normal and nothing lies between
them. Values of other vertices are not computed and are returned as 0.

Estimates are Mitsuba's: emitter and material are both sampled and weighted by the power heuristic (Veach 1995), as its
`direct` integrator does; `picture` runs that integrator itself.
"""

import math
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from homofact.brdf.reflectance import Reflectance
from homofact.errors import BadInput
from homofact.files import extras
from homofact.meshes.occlusion import OFFSET
from homofact.meshes.tangents import frames
from homofact.relighting.lamps import Lamp
from homofact.rendering.light import EnvironmentMap
from homofact.rendering.mitsuba_bsdf import load_bsdf, measured_bsdf, open_mitsuba
from homofact.rendering.mitsuba_environment import environment_emitter
from homofact.rendering.mitsuba_frames import TANGENT, framed
from homofact.rendering.mitsuba_reflectance import evaluated_calls, reflectance_bsdf
from homofact.scene.cameras import Camera

_LANES = 1 << 20

Material = Reflectance | str | Path


@dataclass(frozen=True)
class Estimate:
    """`radiance` and its standard error `error`, both (V, 3) or (H, W, 3) linear, and what is `seen`, (V,) or (H, W).

    Both are 0 where `seen` is false.
    """

    radiance: np.ndarray
    error: np.ndarray
    seen: np.ndarray

    @property
    def noise(self) -> float:
        """The relative RMS of the error: √(Σ error²/Σ radiance²)."""
        return math.sqrt(float((self.error**2).sum()) / max(float((self.radiance**2).sum()), 1e-300))


@dataclass(frozen=True)
class Geometry:
    """Plain arrays of a mesh: `positions`, unit `normals` (V, 3), `triangles` (T, 3), `tangents` (V, 3) or None.

    Without tangents, those of Wang et al. are used (`meshes.tangents`). Raises BadInput if the arrays do not form a
    mesh.
    """

    positions: np.ndarray
    normals: np.ndarray
    triangles: np.ndarray
    tangents: np.ndarray | None = None

    def __post_init__(self) -> None:
        """Reject invalid arrays of a mesh."""
        vertices = len(self.positions)
        for name in ("positions", "normals", "tangents"):
            values = getattr(self, name)
            if values is None:
                continue
            if values.shape != (vertices, 3) or not vertices:
                raise BadInput(where=name, found=f"shape {values.shape}", expected=f"({vertices or 'V'}, 3)")
            if not np.isfinite(values).all():
                row = int(np.argwhere(~np.isfinite(values))[0, 0])
                raise BadInput(f"row {row} is not finite", where=name, expected="finite numbers")
        lengths = np.linalg.norm(self.normals, axis=1)
        if not np.allclose(lengths, 1, atol=1e-4):
            row = int(np.abs(lengths - 1).argmax())
            raise BadInput(f"row {row} has the length {lengths[row]:.4g}", where="normals", expected="unit vectors")
        if self.triangles.ndim != 2 or self.triangles.shape[1] != 3 or not len(self.triangles):
            raise BadInput(where="triangles", found=f"shape {self.triangles.shape}", expected="(T, 3)")
        _check_rows("triangles", self.triangles, vertices)

    @property
    def axes(self) -> np.ndarray:
        """Rows tangent, binormal, normal (V, 3, 3)."""
        if self.tangents is None:
            return frames(self.normals)
        along = (self.tangents * self.normals).sum(1, keepdims=True)
        tangents = self.tangents - along * self.normals
        tangents /= np.linalg.norm(tangents, axis=1, keepdims=True)
        return np.stack((tangents, np.cross(self.normals, tangents), self.normals), 1)


def vertex_radiance(
    geometry: Geometry,
    material: Material,
    environment: EnvironmentMap,
    place: tuple[float, float, float],
    samples: int = 256,
    repeats: int = 8,
    seed: int = 0,
    offset: float | None = None,
    which: np.ndarray | None = None,
) -> Estimate:
    """Estimate the radiance of vertices towards a camera at `place`, by `repeats` independent runs of `samples` each.

    These are all vertices, or those in `which` (S,), in that order. The standard error is that of the runs' mean.
    `material` is a `Reflectance` of R, G, B or one channel, or the path of an RGL file (`.bsdf`, by Mitsuba's
    `measured`, which takes the viewer for the file's ωi) or of a saved fit (by homofact's own material). `offset`
    defaults to that of `meshes.occlusion`. Raises MissingDependency without Mitsuba, BadInput for bad numbers and for
    everything that the material rejects.
    """
    _check_counts(samples, repeats)
    wanted = np.arange(len(geometry.positions)) if which is None else np.asarray(which)
    _check_rows("which", wanted, len(geometry.positions))
    mi = open_mitsuba()
    with _bsdf(material) as bsdf:
        scene = mi.load_dict(
            {"type": "scene", "mesh": _mesh(mi, geometry, None), "sky": environment_emitter(environment)}
        )
        size = np.linalg.norm(np.ptp(geometry.positions[np.unique(geometry.triangles)], axis=0))
        axes = geometry.axes[wanted]
        normals = axes[:, 2]
        points = geometry.positions[wanted] + (OFFSET * size if offset is None else offset) * normals
        toward = np.asarray(place, np.float64) - points
        distance = np.linalg.norm(toward, axis=1, keepdims=True)
        toward /= distance
        seen = (toward * normals).sum(1) > 0
        ray = mi.Ray3f(_vector(mi, points), _vector(mi, toward), mi.Float(distance[:, 0] * (1 - 1e-4)), 0.0, [])
        seen &= ~np.array(scene.ray_test(ray)).astype(bool)
        rows = np.nonzero(seen)[0]
        # Mitsuba moves the beginning of every ray along the normal itself: that much is taken off before.
        starts = points - (1 + np.abs(points).max(1, keepdims=True)) * mi.math.RayEpsilon * normals
        runs = np.zeros((repeats, len(points), 3))
        sampler = mi.load_dict({"type": "multijitter", "sample_count": samples})
        count = sampler.sample_count()
        for run in range(repeats):
            for number, part in enumerate(_parts(rows, max(1, _LANES // count))):
                stream = int(np.random.SeedSequence((seed, run, number)).generate_state(1)[0])
                place_of = np.repeat(part, count)
                sampler.set_samples_per_wavefront(count)
                sampler.seed(stream, len(place_of))
                si = _interaction(mi, starts[place_of], axes[place_of], toward[place_of])
                found = np.array(_direct(mi, scene, bsdf, si, sampler))
                runs[run, part] = found.reshape(3, len(part), count).mean(2).T
    return _estimate(runs, seen)


def picture(
    geometry: Geometry,
    material: Material,
    environment: EnvironmentMap,
    camera: Camera,
    samples: int = 64,
    repeats: int = 2,
    seed: int = 0,
) -> Estimate:
    """Render the mesh in front of the map by Mitsuba's `direct` integrator: (H, W, 3), box filter.

    As `scene_picture` of one object with no bounce.
    """
    return scene_picture([(geometry, material)], environment, camera, samples, repeats, seed)


def scene_picture(
    objects: Sequence[tuple[Geometry, Material]],
    environment: EnvironmentMap,
    camera: Camera,
    samples: int = 64,
    repeats: int = 2,
    seed: int = 0,
    bounces: int = 0,
    lamps: Sequence[Lamp] = (),
) -> Estimate:
    """Render objects in front of the map: (H, W, 3), box filter; with `bounces`, by the `path` integrator.

    `lamps` are spheres that emit light; here they also block it.

    Normals, and the tangents of anisotropic materials, are interpolated over the triangles. `seen` are the pixels that
    the objects cover wholly. The standard error is that of the mean of `repeats` runs with different seeds. Raises as
    `vertex_radiance`.
    """
    _check_counts(samples, repeats)
    mi = open_mitsuba()
    at = mi.ScalarTransform4f()
    sensor = {
        "type": "perspective",
        "fov": camera.field,
        "fov_axis": "y",
        "to_world": at.look_at(list(camera.eye), list(camera.target), [0, 1, 0]),
        "film": {
            "type": "hdrfilm",
            "width": camera.pixels[0],
            "height": camera.pixels[1],
            "rfilter": {"type": "box"},
            "pixel_format": "rgba",
        },
        "sampler": {"type": "multijitter", "sample_count": samples},
    }
    # Mitsuba counts the segments of a path: one to the surface, one on to the light.
    paths = {"type": "path", "max_depth": 2 + bounces, "rr_depth": 100} if bounces else {"type": "direct"}
    with ExitStack() as opened:
        made: dict[str, Any] = {"type": "scene", "sensor": sensor}
        for number, (geometry, material) in enumerate(objects):
            made[f"mesh_{number}"] = _mesh(mi, geometry, opened.enter_context(_bsdf(material)))
        shining = {f"lamp_{number}": _lamp(lamp) for number, lamp in enumerate(lamps)}
        scene = mi.load_dict(made | shining | {"integrator": paths, "sky": environment_emitter(environment)})
        seeds = np.random.SeedSequence(seed).generate_state(repeats)
        runs = np.stack([np.array(mi.render(scene, seed=int(each)))[..., :3] for each in seeds]).astype(np.float64)
        cover = mi.load_dict(made | {"integrator": {"type": "depth"}})
        alpha = np.array(mi.render(cover, spp=64))[..., 3]
    return _estimate(runs, alpha > 0.999)


def _lamp(lamp: Lamp) -> dict[str, Any]:
    """Return a lamp as a Mitsuba sphere with an area emitter."""
    radiance = {"type": "rgb", "value": lamp.radiance().tolist()}
    emitter = {"type": "area", "radiance": radiance}
    return {"type": "sphere", "center": lamp.position.tolist(), "radius": lamp.radius, "emitter": emitter}


def _check_rows(name: str, rows: np.ndarray, vertices: int) -> None:
    wrong = rows[(rows < 0) | (rows >= vertices)]
    if len(wrong):
        raise BadInput(where=name, found=f"vertex {wrong[0]}", expected=f"0 to {vertices - 1}")


def _check_counts(samples: int, repeats: int) -> None:
    for name, value, least in (("samples", samples, 1), ("repeats", repeats, 2)):
        if value < least:
            raise BadInput(where=name, found=value, expected=f"at least {least}")


@contextmanager
def _bsdf(material: Material) -> Iterator[Any]:
    """Yield the material as a BSDF of Mitsuba's current variant, inside the call mode that it needs."""
    if isinstance(material, str | Path):
        yield measured_bsdf(material) if str(material).endswith(".bsdf") else load_bsdf(material)
        return
    with evaluated_calls():
        yield reflectance_bsdf(material)


def _mesh(mi: Any, geometry: Geometry, bsdf: Any) -> Any:
    """Return a Mitsuba mesh with the geometry's normals, and its tangents for anisotropic materials."""
    properties = mi.Properties()
    turned = bsdf is not None and mi.has_flag(bsdf.flags(), mi.BSDFFlags.Anisotropic)
    if bsdf is not None:
        properties["bsdf"] = framed(bsdf) if turned else bsdf
    counts = len(geometry.positions), len(geometry.triangles)
    mesh = mi.Mesh("mesh", *counts, props=properties, has_vertex_normals=True)
    if turned:
        tangents = np.ascontiguousarray(geometry.axes[:, 0], np.float32)
        mesh.add_attribute(TANGENT, 3, tangents.ravel())
    parameters = mi.traverse(mesh)
    parameters["vertex_positions"] = np.ascontiguousarray(geometry.positions, np.float32).ravel()
    parameters["vertex_normals"] = np.ascontiguousarray(geometry.normals, np.float32).ravel()
    parameters["faces"] = np.ascontiguousarray(geometry.triangles, np.uint32).ravel()
    parameters.update()
    return mesh


def _parts(rows: np.ndarray, size: int) -> Iterator[np.ndarray]:
    return (rows[k : k + size] for k in range(0, len(rows), size))


def _estimate(runs: np.ndarray, seen: np.ndarray) -> Estimate:
    """Return the mean and standard error over the runs (R, …, 3)."""
    error = runs.std(0, ddof=1) / math.sqrt(len(runs))
    return Estimate(runs.mean(0), error, seen)


def _vector(mi: Any, values: np.ndarray) -> Any:
    return mi.Vector3f(np.ascontiguousarray(values.T, np.float32))


def _interaction(mi: Any, points: np.ndarray, axes: np.ndarray, toward: np.ndarray) -> Any:
    """Return Mitsuba's surface interactions at given points and frames, viewed along `toward` (N, 3)."""
    si = extras.library("drjit", "mitsuba").zeros(mi.SurfaceInteraction3f, len(points))
    tangent, binormal, normal = (_vector(mi, axes[:, k]) for k in range(3))
    si.t, si.p, si.n = mi.Float(0), mi.Point3f(_vector(mi, points)), mi.Normal3f(normal)
    si.sh_frame = mi.Frame3f(tangent, binormal, normal)
    si.wi = si.to_local(_vector(mi, toward))
    return si


def _direct(mi: Any, scene: Any, bsdf: Any, si: Any, sampler: Any) -> Any:
    """Return one estimate of reflected radiance per lane: emitter and BSDF sampling, power heuristic."""
    dr = extras.library("drjit", "mitsuba")
    context = mi.BSDFContext()
    light, weight = scene.sample_emitter_direction(si, sampler.next_2d(), True)
    wo = si.to_local(light.d)
    value, density = bsdf.eval_pdf(context, si, wo, light.pdf > 0)
    total = dr.select(light.pdf > 0, value * weight * _power(dr, light.pdf, density), 0)
    drawn, weight = bsdf.sample(context, si, sampler.next_1d(), sampler.next_2d())
    active = (drawn.pdf > 0) & (drawn.wo.z > 0)
    ray = si.spawn_ray(si.to_world(drawn.wo))
    active &= ~scene.ray_test(ray, active)
    beyond = dr.zeros(mi.SurfaceInteraction3f, dr.width(ray))
    beyond.wi = -ray.d
    sky = scene.environment()
    away = dr.zeros(mi.DirectionSample3f, dr.width(ray))
    away.d = ray.d
    radiance = sky.eval(beyond, active)
    density = sky.pdf_direction(si, away, active)
    return total + dr.select(active, radiance * weight * _power(dr, drawn.pdf, density), 0)


def _power(dr: Any, own: Any, other: Any) -> Any:
    """Return the MIS weight of a sample with density `own` against a strategy with density `other`."""
    return dr.select(own > 0, own * own / (own * own + other * other), 0)
