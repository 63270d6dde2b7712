"""The error of relighting by stage: the error in a vertex's radiance that each approximation causes alone.

The reference at a vertex is the exact sum over all texels of a cube map, with the reflectance itself, the cosine and
the visibility of each texel: B = Σ_j L_j f(ω_j, ωo) V_j cosθ_j Δω_j. Errors are relative RMS errors over the vertices
that the eye sees, weighted by their area in the picture, over all channels: √(Σ|B̂ − B|²/Σ|B|²).

    terms         K terms of f on maps of 128 × 128 texels, against f
    lobe          the separate lobe, as it is summed, against the sum over every texel
    suns          the light of suns by tables, against the reflectance at 64 directions of each disc
    lamps         the light of lamps, likewise
    bounce        light between surfaces as if they were matt, against that of the reflectances themselves
    maps          the same terms read from maps of M × M texels
    normals       with a normal map, instead of `terms` and `maps`: terms under tilted normals against the reflectance
    cube          the reference on this cube map against one of `FINE` times as many texels along a face
    truncation    only the kept wavelet coefficients of the transport, not rounded
    quantisation  the kept coefficients as 16-bit numbers
    harmonics     low orders of the light instead of wavelets
    clusters      means and components instead of every vertex's own transport
    interpolation a picture's points between vertices against the vertices' own light mixed over the triangle
    together      all approximations in use against the reference
    rim           the same where cosθo is below `seen.RIM`
    picture       the same at pixels of the camera, whose light is mixed between vertices: the whole error

If a lobe is separate, the stages terms, maps, truncation and so on measure the rest of f, relative to the light of all
of f. This light includes that of suns, lamps and a bounce, if there are any. `psnr`, in dB, compares the pixels of
`picture` as 8-bit sRGB, tone-mapped by the filmic curve at the automatic exposure. `below_zero` is the share of light
that negative values of B̂ subtract: Σ max(−B̂, 0)/Σ|B̂|.
"""

import contextlib
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
import torch

from homofact.brdf.reflectance import Reflectance
from homofact.brdf.tinted import Tinted
from homofact.errors import BadInput
from homofact.evaluation.image_metrics import psnr as psnr_of
from homofact.meshes.mesh import Mesh
from homofact.relighting import cube
from homofact.relighting.build import RelightScene, RelitObject
from homofact.relighting.factored_material import FactoredMaterial
from homofact.relighting.factoring import factor
from homofact.relighting.factors import InOutFactors, view_values
from homofact.relighting.harmonic import Harmonic
from homofact.relighting.kernels import transport_vectors
from homofact.relighting.lit import LitObject
from homofact.relighting.lobe import SurfacePoints
from homofact.relighting.picture import displayed_picture
from homofact.relighting.precompute import WaveletTransport
from homofact.relighting.relight import light_coefficients
from homofact.relighting.seen import SeenPixels, SeenVertices, seen_pixels, seen_vertices
from homofact.relighting.sending_surfaces import FEW_NODES, SendingSurfaces
from homofact.relighting.sunlight import SAMPLES, summed
from homofact.relighting.tracer import Tracer
from homofact.rendering.light import EnvironmentMap
from homofact.rendering.sphere import SphereImage
from homofact.rendering.tonemap import automatic_exposure

FINE, _RIM_PART = 4, 4
_FINE_MAPS, _TRIANGLES = 128, 200
STAGES = (
    "terms", "maps", "normals", "lobe", "suns", "lamps", "bounce", "cube", "truncation", "quantisation", "harmonics",
    "clusters", "interpolation", "together", "rim", "picture",
)  # fmt: skip


@dataclass(frozen=True)
class RelightErrors:
    """Relative root mean square errors by stage, and the share of light below zero; over `vertices` that were seen."""

    errors: dict[str, float]
    below_zero: float
    vertices: int
    psnr: float | None = None

    def record(self) -> dict[str, float]:
        """The JSON form."""
        psnr = {} if self.psnr is None or not math.isfinite(self.psnr) else {"psnr": self.psnr}
        return {**self.errors, **psnr, "below_zero": self.below_zero, "vertices": self.vertices}


def dense_colours(scene: RelightScene, light: np.ndarray) -> list[np.ndarray]:
    """Return each object's radiance (V, 3) towards the first camera, summed over all texels; NaN if not visible.

    `light` is a cube map of radiance (6, n, n, 3).
    """
    found, around = [], sending_surfaces(scene)
    for placed in scene.objects:
        colours = np.full(placed.mesh.positions.shape, np.nan)
        eye = scene.file.cameras[0].eye
        # An object may be out of the camera's sight as a whole.
        with contextlib.suppress(BadInput):
            given = (placed.mesh, placed.reflectance, scene.occluder, eye, None)
            seen = seen_vertices(*given, tint=placed.tint, bumps=placed.bumps)
            colours[seen.which] = seen.dense(light.astype(np.float64), light.shape[1]) + seen.sunlit(scene.file.lights)
            if around is not None:
                colours[seen.which] += around.bounced(seen, scene.file.light, FEW_NODES)
        found.append(colours)
    return found


def sending_surfaces(scene: RelightScene) -> SendingSurfaces | None:
    """Return the surfaces of a scene that reflect light onto each other; None if the scene has no bounces."""
    if scene.bounces is None:
        return None
    meshes, reflectances, tints, bumps = zip(
        *((each.mesh, each.reflectance, each.tint, each.bumps) for each in scene.objects), strict=True
    )
    return SendingSurfaces(meshes, reflectances, scene.occluder, scene.file.lights, tints, bumps)


def scene_errors(
    scene: RelightScene,
    objects: Sequence[RelitObject],
    vertices: int,
    stages: Sequence[str],
    begin: Callable[[int], object] = lambda number: None,
) -> list[RelightErrors | None]:
    """Return each object's error at `vertices` vertices and as many pixels; None for invisible objects.

    `begin` is called with the number of each object before its turn.
    """
    found: list[RelightErrors | None] = []
    camera, seed, meshes = scene.file.cameras[0], scene.file.seed, [relit.mesh for relit in objects]
    around = sending_surfaces(scene)
    for number, (placed, relit) in enumerate(zip(scene.objects, objects, strict=True)):
        begin(number)
        given = (relit.mesh, placed.reflectance, scene.occluder, camera.eye)
        pixels, rim, tint, bumps = None, None, placed.tint, placed.bumps
        try:
            seen = seen_vertices(*given, vertices, seed, tint=tint, bumps=bumps)
        except BadInput:
            found.append(None)
            continue
        # What turns no rim to the camera has none; what stands beside the picture has no pixels.
        if "rim" in stages:
            with contextlib.suppress(BadInput):
                rim = seen_vertices(*given, max(vertices // _RIM_PART, 1), seed, True, tint=tint, bumps=bumps)
        if "picture" in stages:
            with contextlib.suppress(BadInput):
                pixels = seen_pixels(meshes, number, *given[1:3], camera, vertices, seed, tint=tint, bumps=bumps)
        light = scene.file.light
        found.append(measured_errors(seen, relit, light, stages, pixels, rim, around))
    return found


def measured_errors(
    seen: SeenVertices,
    relit: RelitObject,
    light: EnvironmentMap,
    stages: Sequence[str] = STAGES,
    pixels: SeenPixels | None = None,
    rim: SeenVertices | None = None,
    around: SendingSurfaces | None = None,
) -> RelightErrors:
    """Measure each stage of `stages` alone, under one light and from one eye.

    The stage picture needs `pixels`, and the stage rim needs `rim`. `around` are the surfaces that reflect light onto
    each other, if the scene has bounces. Raises BadInput for an unknown stage and where no light reaches the vertices.
    """
    unknown = [each for each in stages if each not in STAGES]
    if unknown:
        raise BadInput(where="stage", found=repr(unknown[0]), expected=f"one of {', '.join(STAGES)}")
    transport, compact, lobe = relit.transport, relit.compact, relit.lobe
    suns = () if relit.sunlight is None else relit.sunlight.suns
    lamps = () if relit.sunlight is None else relit.sunlight.lamps
    lights = (*suns, *lamps)
    size = transport.settings.cube
    radiance = cube.environment_cube(light, size)
    under_sky, under_suns, under_lamps = seen.dense(radiance, size), seen.sunlit(suns), seen.sunlit(lamps)
    of_bounce = np.zeros_like(under_sky) if around is None else around.bounced(seen, light)
    truth = under_sky + under_suns + under_lamps + of_bounce
    if not (truth != 0).any():
        raise BadInput("none reaches the vertices that are seen", where="light", expected="some")
    errors: dict[str, float] = {}
    factors = transport.factors
    part = FactoredMaterial(factors, None if lobe is None else lobe.table).part(seen.reflectance)
    # What a part errs by counts against the light of all.
    apart = partial(
        relative, weights=seen.weights, of=None if lobe is None and not lights and around is None else truth
    )
    whole = LitObject.of(
        transport, None, lobe, radiance, relit.sunlight, relit.tint, relit.bumps, relit.tilted
    )  # fmt: skip
    if {"terms", "maps"} & {*stages} and relit.tilted is None:
        exact = seen.dense(radiance, size, _fine(part, factors))
        if "terms" in stages:
            errors["terms"] = apart(exact, under_sky if lobe is None else seen.dense(radiance, size, part))
        if "maps" in stages:
            errors["maps"] = apart(seen.dense(radiance, size, factors.in_parts), exact)
    if "cube" in stages:
        much = seen.dense(cube.environment_cube(light, FINE * size), FINE * size)
        errors["cube"] = apart(under_sky, much)
    if {"truncation", "quantisation", *(["normals"] if relit.tilted is not None else [])} & {*stages}:
        every, cut, stored = (_by_terms(seen, whole, each) for each in _vectors(seen, transport, radiance))
        if "normals" in stages and relit.tilted is not None:
            errors["normals"] = apart(every, under_sky if lobe is None else seen.dense(radiance, size, part))
        if "truncation" in stages:
            errors["truncation"] = apart(cut, every)
        if "quantisation" in stages:
            errors["quantisation"] = apart(stored, cut)
    used = whole if compact is None else relit.lit(radiance)
    stage = "harmonics" if isinstance(compact, Harmonic) else "clusters"
    shown = _seen_of(seen, used)
    if compact is not None and stage in stages:
        errors[stage] = apart(shown, _seen_of(seen, whole))
    own = used.lobe_at(seen.points)
    if lobe is not None and "lobe" in stages:
        errors["lobe"] = apart(own, seen.dense(radiance, size, lobe.table.in_parts))
    by_suns, by_lamps = (used.only_beside(*kind).suns_at(seen.points) for kind in ((True, False), (False, True)))
    for stage, kind, by_these, exact in (("suns", suns, by_suns, under_suns), ("lamps", lamps, by_lamps, under_lamps)):
        if kind and stage in stages:
            errors[stage] = apart(by_these, exact)
    if around is not None and "bounce" in stages:
        errors["bounce"] = apart(_seen_of(seen, used, slice(factors.direct, None)), of_bounce)
    shown = shown + own + by_suns + by_lamps
    if "interpolation" in stages:
        errors["interpolation"] = _interpolation(seen, part, radiance, size)
    if "together" in stages:
        errors["together"] = apart(shown, truth)
    if rim is not None:
        at_rim = _seen_of(rim, used) + used.lobe_at(rim.points) + used.suns_at(rim.points)
        at_all = rim.dense(radiance, size) + rim.sunlit(lights)
        at_all += 0.0 if around is None else around.bounced(rim, light)
        errors["rim"] = relative(at_rim, at_all)
    psnr = None
    if pixels is not None:
        points = pixels.lit_points(relit.mesh)
        seen_suns, sight = points.seen(lights, seen.occluder, SAMPLES), points.sight(seen.occluder)
        mixed = used.between(pixels.mixture, seen.eye, seen_suns, sight)
        exact = pixels.points.dense(radiance, size)
        exact += summed(seen.reflectance, lights, points, pixels.points.wo, seen.occluder, pixels.points.tint)
        exact += 0.0 if around is None else around.bounced(pixels.points, light)
        errors["picture"], psnr = relative(mixed, exact), _psnr(mixed, exact)
    below = float(np.maximum(-shown, 0).sum() / np.abs(shown).sum())
    return RelightErrors({name: errors[name] for name in STAGES if name in errors}, below, len(seen.which), psnr)


def relative(
    found: np.ndarray, truth: np.ndarray, weights: np.ndarray | None = None, of: np.ndarray | None = None
) -> float:
    """Return √(Σw|found − truth|²/Σw|of|²) of rows of numbers. Default: w is 1 and `of` is the truth."""
    w = 1.0 if weights is None else weights[:, None]
    whole = truth if of is None else of
    return float(np.sqrt((w * (found - truth) ** 2).sum() / (w * whole**2).sum()))


def _psnr(found: np.ndarray, truth: np.ndarray) -> float:
    """Return the PSNR of displayed 8-bit pixels (S, 3): filmic curve, automatic exposure of the truth."""
    cover = np.ones((len(truth), 1))
    exposure = automatic_exposure(SphereImage(torch.from_numpy(truth[:, None]), torch.from_numpy(cover)))
    shown, wanted = (displayed_picture(each[:, None], cover, exposure) / 255.0 for each in (found, truth))
    return psnr_of(torch.from_numpy(shown), torch.from_numpy(wanted), torch.from_numpy(cover > 0))


def _seen_of(seen: SeenVertices, lit: LitObject, terms: slice = slice(None)) -> np.ndarray:
    """Return the light (S, 3) towards the eye from an object's K-tuples at the vertices, using some terms."""
    tuples = np.zeros_like(lit.tuples[seen.which])
    tuples[:, terms] = lit.tuples[seen.which][:, terms]
    return _by_terms(seen, lit, tuples)


def _by_terms(seen: SeenVertices, lit: LitObject, tuples: np.ndarray) -> np.ndarray:
    """Return the light (S, 3) towards the eye from given K-tuples (S, K, 3), which may lack the last terms."""
    factors = lit.transport.factors
    if lit.tilted is None:
        h = view_values(factors, seen.wo)[:, : tuples.shape[1]]
        tinted = factors.tinted_terms[: tuples.shape[1], None]
        h = h if seen.tint is None else np.where(tinted, h * seen.tint[:, None], h)
        return np.einsum("skc,skc->sc", h, tuples)
    whole = np.zeros((len(tuples), factors.terms, 3))
    whole[:, : tuples.shape[1]] = tuples
    places = SurfacePoints.at_vertices(seen.rows, seen.wo, np.arange(len(tuples)))
    given = (lit.transport.frames[seen.which], places.corners, places.shares, seen.rows[:, 2], places.views)
    plain, tinted = lit.tilted.light(whole, *given, factors.tinted_terms)
    return plain + tinted * (1.0 if seen.tint is None else seen.tint)


def _fine(part: Reflectance, factors: InOutFactors) -> Reflectance:
    """Factor a part into the same number of terms on fine maps, a textured material's two parts separately."""
    if not isinstance(part, Tinted):
        return factor(part, terms=factors.direct, map_size=_FINE_MAPS)
    counts = (factors.tinted, factors.direct - factors.tinted)
    halves = zip((part.tinted, part.plain), counts, strict=True)
    return Tinted(*(factor(half, terms=count, map_size=_FINE_MAPS) for half, count in halves))


def _vectors(
    seen: SeenVertices, transport: WaveletTransport, radiance: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return K-tuples (S, K, 3) under the sky from full, from truncated, and from stored transport vectors."""
    factors, settings = transport.factors, transport.settings
    size, terms = settings.cube, factors.direct
    tracer = Tracer(seen.mesh, seen.occluder, size, settings.rays)
    light = light_coefficients(radiance, size)
    vectors = np.empty((terms, cube.FACES * size * size), np.float32)
    scratch = np.empty((size, size), np.float32)
    maps = np.ascontiguousarray(factors.light[:terms].transpose(1, 2, 0))
    tuples = np.zeros((3, len(seen.which), terms, 3))
    for s, v in enumerate(seen.which.tolist()):
        transport_vectors(
            transport.frames[v],
            tracer.visible(v),
            tracer.directions,
            tracer.angles,
            maps,
            factors.cosine,
            vectors,
            scratch,
        )
        for k in range(terms):
            r = v * factors.terms + k
            place = transport.index[transport.start[r] : transport.start[r + 1]]
            tuples[0, s, k] = vectors[k].astype(np.float64) @ light
            tuples[1, s, k] = vectors[k][place].astype(np.float64) @ light[place]
            tuples[2, s, k] = transport.vector(v, k)[place] @ light[place]
    return tuples[0], tuples[1], tuples[2]


def _interpolation(seen: SeenVertices, part: Reflectance, radiance: np.ndarray, size: int) -> float:
    """Return the error of a part's light at triangle centres when interpolated from the corners."""
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
    mixed = around.dense(radiance, size, part)[place.reshape(triangles.shape)].mean(1)
    facing = own.wo[:, 2] > 0
    exact = own.dense(radiance, size, part)[facing]
    return relative(mixed[facing], exact, of=own.dense(radiance, size)[facing])
