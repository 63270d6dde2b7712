"""Choose the form, terms, map size and coefficients of an object's transport from a light tolerance.

A candidate has a number of terms K, a map size from `SIZES` and a form. K is such that the expected error of the terms
alone (`factoring`, under the scene's light) uses a part of the tolerance. The form is either wavelets of all
frequencies, with as many coefficients as the rest of the tolerance needs, or harmonics of low order, if their error is
within the rest. The squares of the errors add up. All errors except that of the terms are measured at `SPOTS` vertices
that the first camera sees (`probe`). The error times `MARGIN` must be within the tolerance, because errors at other
vertices differ. The candidate with the fewest bytes is chosen.
"""

import math
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from homofact.brdf.reflectance import Reflectance
from homofact.errors import BadInput
from homofact.meshes.mesh import Mesh
from homofact.meshes.occlusion import Occluder
from homofact.relighting.cube import environment_cube
from homofact.relighting.factored_material import AUTO, MOST_SHARED, SEPARATE, FactoredMaterial, separated
from homofact.relighting.factoring import factors_of_sizes, terms_for
from homofact.relighting.factors import InOutFactors
from homofact.relighting.harmonic import MOST_ORDER
from homofact.relighting.precompute import TransportSettings
from homofact.relighting.probe import ProbedErrors, ProbedVertices, lobe_beside, measured
from homofact.relighting.seen import seen_vertices
from homofact.relighting.sight import most_sight_bytes
from homofact.rendering.light import EnvironmentMap

SIZES = (16, 32, 64)
SPOTS, MARGIN = 40, 1.25
# What the maps are held against, and the parts of the tolerance that numbers of terms may take.
_FINE = 128
_PARTS = (0.95, 0.85, 0.75, 0.6, 0.45, 0.3)
# The page mixes the harmonics of every term by weights a vertex: as many as a cluster's components at most.
_MOST_WEIGHTS = 64


@dataclass(frozen=True)
class PlannedTransport:
    """One way to store an object's transport, with its bytes and its expected error.

    `order` is the order of the harmonics, None for wavelets of all frequencies. `tolerance` is the share of a vertex's
    root sum square that is left out, and `coefficients` the mean number of coefficients per vector. `error` is the root
    sum square of `of_terms`, `of_maps`, `of_transport` and, for a separate lobe, `of_lobe`.
    """

    terms: int
    map_size: int
    order: int | None
    tolerance: float
    coefficients: float
    bytes: int
    of_terms: float
    of_maps: float
    of_transport: float
    of_lobe: float | None = None

    @property
    def error(self) -> float:
        """Relative RMS of the light."""
        return math.hypot(self.of_terms, self.of_maps, self.of_transport, self.of_lobe or 0.0)

    @property
    def form(self) -> str:
        """For tables."""
        held = "all frequencies" if self.order is None else f"harmonics to order {self.order}"
        return held if self.of_lobe is None else f"{held}, separate lobe"

    def record(self) -> dict[str, Any]:
        """The JSON form."""
        return {"form": self.form, **asdict(self), "error": self.error}


@dataclass(frozen=True)
class ObjectPlan:
    """The candidates for an object, cheapest first, with the chosen one and its factors."""

    name: str
    material: str
    reflected: float
    choices: tuple[PlannedTransport, ...]
    chosen: PlannedTransport
    factored: FactoredMaterial

    @property
    def met(self) -> bool:
        """Whether the error that is expected is within the tolerance, with the margin."""
        return self.chosen.error * MARGIN <= self.reflected * (1 + 1e-9)

    @property
    def warning(self) -> str | None:
        """Return a warning line if the tolerance is not met, else None."""
        if self.met:
            return None
        return (
            f"{self.name}: reflected {self.reflected:g} cannot be met; the best reachable is"
            f" {self.chosen.error * MARGIN:.3g}, with the margin of {MARGIN:g} and {self.chosen.terms} terms"
        )

    def settings(self, scene: TransportSettings) -> TransportSettings:
        """Return the settings for the object's transport."""
        return TransportSettings(scene.cube, scene.rays, scene.kept, self.chosen.tolerance)

    def record(self) -> dict[str, Any]:
        """The JSON form."""
        return {
            "mesh": self.name,
            "material": self.material,
            "met": self.met,
            "chosen": self.chosen.record(),
            "choices": [each.record() for each in self.choices],
        }


def plan_object(
    mesh: Mesh,
    material: str,
    reflectance: Reflectance,
    occluder: Occluder,
    light: EnvironmentMap,
    eye: tuple[float, ...],
    reflected: float,
    settings: TransportSettings,
    terms: int | None = None,
    seed: int = 0,
    lobe: str = AUTO,
) -> ObjectPlan:
    """Choose the transport of one object; `terms` fixes K. `reflected` is the tolerance.

    Of `settings`, only `cube` matters. If `lobe` is "auto", the lobe is separate if more than `MOST_SHARED` terms would
    be needed. Raises BadInput as `factored_material.factored` and where no light reaches the vertices drawn.
    """
    allowed = reflected / MARGIN
    error = _PARTS[-1] * allowed if terms is None else None
    probed = _probed(mesh, reflectance, occluder, eye, seed)
    under = _Considered(probed, light, settings.cube, allowed, terms is not None)
    sizes = (*SIZES, _FINE)
    found: list[tuple[PlannedTransport, list[FactoredMaterial]]] = []
    if lobe == AUTO and terms is None and terms_for(reflectance, _PARTS[0] * allowed, light) > MOST_SHARED:
        lobe = SEPARATE
    if lobe != SEPARATE:
        made = [
            FactoredMaterial(each) for each in factors_of_sizes(reflectance, sizes, terms, error=error, light=light)
        ]
        found += [(each, made) for each in under.choices(made)]
    if lobe == SEPARATE:
        made = separated(reflectance, sizes, terms, error, light)
        found += [(each, made) for each in under.choices(made)]
    enough = [each for each in found if each[0].error <= allowed * (1 + 1e-9)]
    # Where nothing is within the tolerance, what errs least.
    chosen, made = min(enough, key=lambda each: each[0].bytes) if enough else min(found, key=lambda each: each[0].error)
    shown = _best_of_each([each for each, _ in enough] or [chosen])
    own = made[SIZES.index(chosen.map_size)]
    held = FactoredMaterial(own.factors.first(chosen.terms), own.lobe)
    return ObjectPlan(mesh.name, material, reflected, shown, chosen, held)


@dataclass(frozen=True)
class _Considered:
    """Candidate forms of an object with errors up to `allowed` at `probed` vertices; `fixed`: the user has set K."""

    probed: ProbedVertices
    light: EnvironmentMap
    cube: int
    allowed: float
    fixed: bool

    def choices(self, made: list[FactoredMaterial]) -> list[PlannedTransport]:
        """Return the choices within the error for maps of every size, or else the most terms and largest maps."""
        first = made[0].factors
        counts = [first.terms] if self.fixed else candidate_terms(first, self.allowed)
        whole = [each.factors.first(counts[-1]) for each in made]
        groups = np.searchsorted(counts, np.arange(counts[-1]), side="right")
        orders = tuple(range(1, MOST_ORDER + 1))
        found = measured(self.probed, whole, len(SIZES) - 1, groups, self.light, self.cube, orders)
        table, of_lobe, stored = made[0].lobe, None, 0
        if table is not None:
            radiance = environment_cube(self.light, self.cube)
            share, of_lobe = lobe_beside(self.probed, table, radiance, found.sent[:, -1].sum(1)[:, :3])
            found = found.beside(share)
            stored = table.nbytes + most_sight_bytes(self.cube) * len(self.probed.mesh.positions)
        errors = [whole[0].first(each).expected_error for each in counts]
        vertices, channels = len(self.probed.mesh.positions), whole[0].view.shape[3]
        allowed = math.sqrt(max(self.allowed**2 - (of_lobe or 0.0) ** 2, 0.0))
        ways = [
            way
            for g, count in enumerate(counts)
            for m in range(len(SIZES))
            for way in _choices(found, g, m, count, errors[g], allowed, vertices, channels)
        ]
        if not ways:
            least = 0.3 * math.hypot(errors[-1], found.maps[-1, len(SIZES) - 1], of_lobe or 0.0)
            last = len(counts) - 1, len(SIZES) - 1
            ways = [_wavelets(found, *last, least, counts[-1], errors[-1], vertices, channels)]
        return [replace(each, of_lobe=of_lobe, bytes=each.bytes + stored) for each in ways]


def candidate_terms(factors: InOutFactors, allowed: float) -> list[int]:
    """Return ascending numbers of terms whose error is one of several parts of `allowed`; else all terms."""
    left = 1 - (factors.beside + factors.strength.astype(np.float64).cumsum()) / factors.energy
    # A pair is kept whole: its two strengths are the same number.
    whole = np.append(factors.strength[1:] != factors.strength[:-1], True)
    found = set()
    for part in _PARTS:
        enough = np.flatnonzero(whole & (left <= (part * allowed) ** 2))
        if len(enough):
            found.add(int(enough[0]) + 1)
    return sorted(found) or [factors.terms]


def _choices(
    found: ProbedErrors, g: int, m: int, terms: int, error: float, allowed: float, vertices: int, channels: int
) -> list[PlannedTransport]:
    """Return the choices for a number of terms and a map size: wavelets, and sufficient harmonics."""
    size, maps = SIZES[m], float(found.maps[g, m])
    square = allowed**2 - error**2 - maps**2
    if square <= 0:
        return []
    choices = [_wavelets(found, g, m, math.sqrt(square), terms, error, vertices, channels)]
    fine = found.truncated(g, math.sqrt(square) / 5)[0]
    for order, low in zip(found.orders, found.harmonics(g), strict=True):
        count = (order + 1) ** 2
        if low**2 <= square and terms * count <= _MOST_WEIGHTS:
            stored = vertices * terms * (2 * count + 4) + terms * size**2 * channels * 4
            choices.append(PlannedTransport(terms, size, order, fine, count, stored, error, maps, float(low)))
            break
    return choices


def _wavelets(
    found: ProbedErrors, g: int, m: int, allowed: float, terms: int, error: float, vertices: int, channels: int
) -> PlannedTransport:
    """Return the choice of all frequencies that keeps the fewest coefficients within the allowed error."""
    size = SIZES[m]
    tolerance, lost, kept = found.truncated(g, allowed)
    stored = vertices * (6 * terms + 4 * round(kept)) + terms * size**2 * channels * 4
    return PlannedTransport(terms, size, None, tolerance, kept / terms, stored, error, float(found.maps[g, m]), lost)


def _best_of_each(choices: list[PlannedTransport]) -> tuple[PlannedTransport, ...]:
    """Return the cheapest map for each form and number of terms, cheapest first."""
    best: dict[tuple[int, int | None, bool], PlannedTransport] = {}
    for each in choices:
        key = (each.terms, each.order, each.of_lobe is None)
        if key not in best or each.bytes < best[key].bytes:
            best[key] = each
    return tuple(sorted(best.values(), key=lambda each: (each.bytes, each.error)))


def _probed(
    mesh: Mesh, reflectance: Reflectance, occluder: Occluder, eye: tuple[float, ...], seed: int
) -> ProbedVertices:
    """Return vertices visible from the eye, or if there are none, random vertices, each viewed at 45°."""
    try:
        seen = seen_vertices(mesh, reflectance, occluder, eye, SPOTS, seed)
    except BadInput:
        drawn = np.sort(np.random.default_rng(seed).permutation(len(mesh.positions))[:SPOTS])
        return ProbedVertices(mesh, occluder, drawn, np.tile([math.sqrt(0.5), 0.0, math.sqrt(0.5)], (len(drawn), 1)))
    return ProbedVertices(mesh, occluder, seen.which, seen.wo)
