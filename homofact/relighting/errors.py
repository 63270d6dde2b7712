"""The error of relighting, stage by stage: what each approximation alone does to the light a vertex sends to the eye.

The reference is the sum over all texels of a cube map with the reflectance itself, its cosine and the visibility of
each texel, nothing left out, at the vertices: B = Σ_j L_j f(ω_j, ωo) V_j cosθ_j Δω_j. Errors are relative root mean
squares over vertices that the eye sees, all channels together: √(Σ|B̂ − B|²/Σ|B|²).

    terms         K terms of f, their functions asked of f itself wherever they are needed
    maps          the same terms read from maps of M × M texels
    cube          the reference on this cube map against one of `FINE` times as many texels along a face
    truncation    of the wavelets of the transport, all but the kept left out, not rounded
    quantisation  those that are kept as 16-bit numbers
    harmonics     low orders of the light instead of wavelets
    clusters      means and components instead of every vertex's own transport
    interpolation a picture's points between vertices against the vertices' own light mixed over the triangle
    together      everything that is in use against the reference

`below zero` is the light that negative residues take away: Σ max(−B̂, 0)/Σ|B̂|.
"""

import contextlib
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from homofact.errors import BadInput
from homofact.meshes.mesh import Mesh
from homofact.relighting import cube
from homofact.relighting.build import RelightScene, RelitObject, lit_tuples
from homofact.relighting.clusters import Clustered
from homofact.relighting.factoring import factor
from homofact.relighting.factors import InOutFactors, view_values
from homofact.relighting.harmonic import Harmonic
from homofact.relighting.kernels import transport_vectors
from homofact.relighting.precompute import WaveletTransport
from homofact.relighting.relight import Relit, light_coefficients
from homofact.relighting.seen import SeenVertices, seen_vertices
from homofact.relighting.tracer import Tracer
from homofact.rendering.light import EnvironmentMap

FINE = 4
_FINE_MAPS, _TRIANGLES = 128, 200
STAGES = ("terms", "maps", "cube", "truncation", "quantisation", "harmonics", "clusters", "interpolation", "together")


@dataclass(frozen=True)
class RelightErrors:
    """Relative root mean square errors by stage, and the share of light below zero; over `vertices` that were seen."""

    errors: dict[str, float]
    below_zero: float
    vertices: int

    def record(self) -> dict[str, float]:
        """The JSON form."""
        return {**self.errors, "below_zero": self.below_zero, "vertices": self.vertices}


def dense_colours(scene: RelightScene, light: np.ndarray) -> list[np.ndarray]:
    """Each object's light (V, 3) towards the first camera by the dense sum; NaN where the camera does not see it well.

    `light` is a cube map of radiance (6, n, n, 3).
    """
    found = []
    for placed in scene.objects:
        colours = np.full(placed.mesh.positions.shape, np.nan)
        eye = scene.file.cameras[0].eye
        # An object may be out of the camera's sight as a whole.
        with contextlib.suppress(BadInput):
            seen = seen_vertices(placed.mesh, placed.material.reflectance, scene.occluder, eye, len(colours))
            colours[seen.which] = seen.dense(light.astype(np.float64), light.shape[1])
        found.append(colours)
    return found


def scene_errors(
    scene: RelightScene, objects: Sequence[RelitObject], vertices: int, stages: Sequence[str]
) -> list[RelightErrors | None]:
    """The error of each object at so many vertices that the first camera sees; None where it sees none of it."""
    found: list[RelightErrors | None] = []
    eye = scene.file.cameras[0].eye
    for placed, relit in zip(scene.objects, objects, strict=True):
        try:
            reflectance = placed.material.reflectance
            seen = seen_vertices(relit.mesh, reflectance, scene.occluder, eye, vertices, scene.file.seed)
        except BadInput:
            found.append(None)
            continue
        found.append(measured_errors(seen, relit.transport, scene.file.light, relit.compact, stages))
    return found


def measured_errors(
    seen: SeenVertices,
    transport: WaveletTransport,
    light: EnvironmentMap,
    compact: Clustered | Harmonic | None = None,
    stages: Sequence[str] = STAGES,
) -> RelightErrors:
    """Every stage of `stages` by itself, under one light and from one eye. Raises BadInput for an unknown stage."""
    unknown = [each for each in stages if each not in STAGES]
    if unknown:
        raise BadInput(where="stage", found=repr(unknown[0]), expected=f"one of {', '.join(STAGES)}")
    size = transport.settings.cube
    radiance = cube.environment_cube(light, size)
    truth = seen.dense(radiance, size)
    if not (truth != 0).any():
        raise BadInput("none reaches the vertices that are seen", where="light", expected="some")
    errors: dict[str, float] = {}
    factors = transport.factors
    if {"terms", "maps"} & {*stages}:
        fine = factor(seen.reflectance, terms=factors.terms, map_size=_FINE_MAPS)
        exact = seen.dense(radiance, size, fine)
        if "terms" in stages:
            errors["terms"] = relative(exact, truth)
        if "maps" in stages:
            errors["maps"] = relative(seen.dense(radiance, size, factors), exact)
    if "cube" in stages:
        much = seen.dense(cube.environment_cube(light, FINE * size), FINE * size)
        errors["cube"] = relative(truth, much)
    if {"truncation", "quantisation"} & {*stages}:
        whole, cut, stored = _vectors(seen, transport, radiance)
        if "truncation" in stages:
            errors["truncation"] = relative(cut, whole)
        if "quantisation" in stages:
            errors["quantisation"] = relative(stored, cut)
    relit = Relit(transport)
    relit.relight(radiance)
    used = relit.tuples
    stage = "harmonics" if isinstance(compact, Harmonic) else "clusters"
    if compact is not None and {stage, "together"} & {*stages}:
        used = lit_tuples(transport, compact, radiance)
        if stage in stages:
            errors[stage] = relative(_seen_of(seen, factors, used), _seen_of(seen, factors, relit.tuples))
    shown = _seen_of(seen, factors, used)
    if "interpolation" in stages:
        errors["interpolation"] = _interpolation(seen, radiance, size)
    if "together" in stages:
        errors["together"] = relative(shown, truth)
    below = float(np.maximum(-shown, 0).sum() / np.abs(shown).sum())
    return RelightErrors({name: errors[name] for name in STAGES if name in errors}, below, len(seen.which))


def relative(found: np.ndarray, truth: np.ndarray) -> float:
    """√(Σ|found − truth|²/Σ|truth|²)."""
    return float(np.sqrt(((found - truth) ** 2).sum() / (truth**2).sum()))


def _seen_of(seen: SeenVertices, factors: InOutFactors, tuples: np.ndarray) -> np.ndarray:
    """Light (S, 3) towards the eye of K-tuples (V, K, 3) of all vertices."""
    h = view_values(factors, seen.wo)
    return np.einsum("skc,skc->sc", h, tuples[seen.which])


def _vectors(
    seen: SeenVertices, transport: WaveletTransport, radiance: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Light (S, 3) each by whole transport vectors, by those that are kept, and by these as they are stored."""
    factors, settings = transport.factors, transport.settings
    size, terms = settings.cube, factors.terms
    tracer = Tracer(seen.mesh, seen.occluder, size, settings.rays)
    light = light_coefficients(radiance, size)
    vectors = np.empty((terms, cube.FACES * size * size), np.float32)
    scratch = np.empty((size, size), np.float32)
    maps = np.ascontiguousarray(factors.light.transpose(1, 2, 0))
    tuples = np.zeros((3, len(seen.which), terms, 3))
    for s, v in enumerate(seen.which.tolist()):
        transport_vectors(
            transport.frames[v], tracer.visible(v), tracer.directions, tracer.angles, maps, vectors, scratch
        )
        for k in range(terms):
            r = v * terms + k
            place = transport.index[transport.start[r] : transport.start[r + 1]]
            tuples[0, s, k] = vectors[k].astype(np.float64) @ light
            tuples[1, s, k] = vectors[k][place].astype(np.float64) @ light[place]
            tuples[2, s, k] = transport.vector(v, k)[place] @ light[place]
    h = view_values(factors, seen.wo)
    whole, cut, stored = (np.einsum("skc,skc->sc", h, each) for each in tuples)
    return whole, cut, stored


def _interpolation(seen: SeenVertices, radiance: np.ndarray, size: int) -> float:
    """Of points in the middle of triangles: light mixed from the corners against the light of the point itself."""
    mesh = seen.mesh
    shown = np.zeros(len(mesh.positions), bool)
    shown[seen.which] = True
    # Triangles at a vertex that is seen; their corners are summed too.
    triangles = mesh.triangles[shown[mesh.triangles].any(1)]
    triangles = triangles[np.random.default_rng(1).permutation(len(triangles))[:_TRIANGLES]]
    middle = mesh.positions[triangles].mean(1)
    normal = mesh.normals[triangles].mean(1)
    length = np.linalg.norm(normal, axis=1)
    triangles, middle, normal = (each[length > 0.1] for each in (triangles, middle, normal))
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    points = Mesh(middle, normal, np.arange(len(middle) // 3 * 3).reshape(-1, 3), f"{mesh.name}, between vertices")
    own = SeenVertices(points, seen.reflectance, seen.occluder, seen.eye, np.arange(len(middle)))
    corners, place = np.unique(triangles, return_inverse=True)
    around = SeenVertices(mesh, seen.reflectance, seen.occluder, seen.eye, corners)
    mixed = around.dense(radiance, size)[place.reshape(triangles.shape)].mean(1)
    facing = own.wo[:, 2] > 0.1
    return relative(mixed[facing], own.dense(radiance, size)[facing])
