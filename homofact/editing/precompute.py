"""Precompute T and U of every term for a fixed light and fixed views (Ben-Artzi et al. 2006, section 5).

For each pixel, homofact finds the lights that are above its horizon and not blocked, with one ray to each light's
centre, shared by all terms of the object. For each of these lights it computes L' = L V ρ_q cosθi Ω (`quotient`) and
distributes it over the bands (`overlap`). Several threads can process blocks of pixels; the results are bit-identical
for any number of threads. Light from other surfaces (`interreflection`) is processed in the same way, with one row for
each sender that a pixel sees. An uncompressed block is (pixels, C, J·K). "low-rank" stores only its coefficients, so
that the matrices of two curves are never complete in memory.

For low rank, some of the pixels are processed twice: first for the basis, which the projection of all pixels needs.
"""

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field

import numba
import numpy as np

from homofact.editing.angles import ANGLES
from homofact.editing.basis import TOLERANCE, Basis, basis_of
from homofact.editing.block_floats import BlockFloats
from homofact.editing.interreflection import LitSurfaces
from homofact.editing.lights import triangle_lights
from homofact.editing.lowrank import CurveTransport, LowRank
from homofact.editing.material import EditableTerm, Quotient
from homofact.editing.overlap import VisibleLights, transport
from homofact.editing.quotient import LightPoints, enough_points, lit
from homofact.editing.reaching import DirectLight, Light
from homofact.editing.scene import EditObject, EditScene, PreparedScene, PreparedTerm
from homofact.editing.transport import FullTransport
from homofact.errors import BadInput
from homofact.linear.threads import one_thread
from homofact.scene.meshes import MeshGroup
from homofact.scene.visibility import VisiblePixels, visible_pixels

FORMS = ("low-rank", "full")
MOST_BYTES = 1 << 30
# Light of surfaces is a fifth of a picture or less: as many times the tolerance is allowed, relative to this light.
BOUNCED, MOST_TOLERANCE = 5, 0.5
_BLOCK_NUMBERS, _PAIRS = 1 << 22, 1 << 18
_BASIS_PIXELS, _PROBES, _ASKED_PIXELS = (600, 1500), 64, 24
# What is kept of the block of these rows.
Kept = Callable[[np.ndarray, np.ndarray], np.ndarray]


@one_thread
def prepare(
    scene: EditScene,
    triangles: int = 4000,
    form: str = FORMS[0],
    tolerance: float = TOLERANCE,
    threads: int | None = None,
    progress: Callable[[float], None] | None = None,
    divided: int | None = None,
) -> PreparedScene:
    """Precompute a scene with about `triangles` lights, in a form of `FORMS`.

    `threads` defaults to the threads of numba; results are bit-identical for any number. `progress` is called with the
    share of finished pixels. `divided` is the number of times that a triangle is divided to evaluate a quotient at more
    points than its centre. Default: the number that `quotient` finds sufficient. `tolerance` is the allowed error of
    the low rank. `tolerance` is the allowed error of the low rank. Raises BadInput for another form, and for a full
    form of more than 1 GiB.
    """
    if form not in FORMS:
        raise BadInput(where="form", found=repr(form), expected=f"one of {', '.join(FORMS)}")
    lights = triangle_lights(scene.lighting, triangles, len(scene.channels))
    meshes = MeshGroup([edited.mesh for edited in scene.objects])
    threads = threads or numba.get_num_threads()
    pixels = tuple(visible_pixels(meshes, camera) for camera in scene.cameras)
    if not any(len(each) for each in pixels):
        raise BadInput(where="views", found="no object in any of them", expected="one that sees something")
    if form == "full":
        _check_size(scene, pixels)
    surfaces = LitSurfaces.of(scene, meshes, threads) if scene.bounces else None
    work = _Work(threads, (1 + scene.bounces) * sum(len(each) for each in pixels), progress)
    parts: list[PreparedTerm] = []

    def add(light: Light, view: int, rows: np.ndarray, share: float, senders: np.ndarray | None = None) -> None:
        which = int(pixels[view].objects[rows[0]])
        edited = scene.objects[which]
        work.ask(light, edited, divided)
        own = tolerance if senders is None else min(BOUNCED * tolerance, MOST_TOLERANCE)
        made = _full(work, light, edited, share) if form == "full" else _low_rank(work, light, edited, own, share)
        for term, found in zip(edited.material.terms, made, strict=True):
            parts.append(PreparedTerm.of(scene, pixels[view], view, which, term.name, rows, found, senders))

    for view, seen in enumerate(pixels):
        for which in range(len(scene.objects)):
            rows = np.flatnonzero(seen.objects == which)
            if not len(rows):
                continue
            own = seen.some(rows)
            add(DirectLight(own, lights, meshes), view, rows, 1)
            if surfaces is not None:
                some, senders, light = surfaces.received(own)
                if len(some):
                    add(light, view, rows[some], len(rows) / len(some), senders)
                else:
                    work.done += len(rows)
    return PreparedScene(scene, lights, pixels, tuple(parts))


def _check_size(scene: EditScene, pixels: Sequence[VisiblePixels]) -> None:
    total = 0
    for seen in pixels:
        for which, edited in enumerate(scene.objects):
            numbers = sum(int(np.prod(_bands(term))) for term in edited.material.terms) * (1 + len(scene.senders))
            total += 4 * len(scene.channels) * numbers * int((seen.objects == which).sum())
    if total > MOST_BYTES:
        expected = f"at most {MOST_BYTES}"
        what = f"full would be {total} bytes"
        raise BadInput(what, where="form", expected=expected, hint="fewer pixels, or low-rank")


def _bands(term: EditableTerm) -> tuple[int, int]:
    """Return the numbers of bands (J, K) of a term; K = 1 for a single curve."""
    counts = [slot.bands for slot in term.summed]
    return counts[0], counts[1] if len(counts) == 2 else 1


@dataclass
class _Work:
    """The state that all blocks share."""

    threads: int
    total: int
    progress: Callable[[float], None] | None
    done: float = 0
    points: dict[tuple[type, Quotient], LightPoints] = field(default_factory=dict)

    def ask(self, light: Light, edited: EditObject, divided: int | None) -> None:
        """Choose the points per triangle for quotients by a test on some pixels, unless `divided` is given."""
        count = len(light.pixels)
        order = np.random.default_rng(1).permutation(count)
        some = light.some(np.sort(order[:_ASKED_PIXELS]))
        reaching = some.reaching()
        for term in edited.material.terms:
            key = type(light), term.quotient
            if divided is not None:
                self.points[key] = LightPoints.of(light.lights, divided)
            elif key not in self.points:
                least = light.least_divided
                self.points[key] = enough_points(some.pixels, light.lights, reaching, edited.material, term, least)

    def fill(
        self, tables: Sequence[np.ndarray], light: Light, edited: EditObject, kept: Sequence[Kept], share: float = 0
    ) -> None:
        """Fill every term's table, applying its function in `kept` to each block (B, C, J·K) and the block's rows.

        For the progress, each row counts as `share` of a pixel.
        """
        count = len(light.pixels)
        widest = max(int(np.prod(_bands(term))) for term in edited.material.terms) * len(edited.material.channels)
        step = max(1, min(_BLOCK_NUMBERS // widest, _PAIRS // light.lights.count))

        def one(start: int) -> tuple[np.ndarray, list[np.ndarray]]:
            rows = np.arange(start, min(start + step, count))
            found = self.block(light.some(rows), edited)
            return rows, [keep(block, rows) for keep, block in zip(kept, found, strict=True)]

        with ThreadPoolExecutor(self.threads) as pool:
            for rows, found in pool.map(one, range(0, count, step)):
                for table, part in zip(tables, found, strict=True):
                    table[rows] = part.reshape(len(rows), *table.shape[1:])
                self.done += share * len(rows)
                if self.progress is not None:
                    self.progress(min(1.0, self.done / self.total))

    def block(self, light: Light, edited: EditObject) -> list[np.ndarray]:
        """Return every term's block (P, C, J·K) float64."""
        pixels, reaching = light.pixels, light.reaching()
        found, known = [], {}
        for term in edited.material.terms:
            # The terms of HD have one quotient.
            if term.quotient not in known:
                points = self.points[type(light), term.quotient]
                known[term.quotient] = lit(pixels, light.lights, points, reaching, edited.material, term)
            each = known[term.quotient]
            kinds = [ANGLES.index(slot.angle) for slot in term.summed]
            bands = _bands(term)
            block = np.zeros((len(pixels), each.shape[1], bands[0] * bands[1]))
            second = kinds[1] if len(kinds) == 2 else -1
            seen = VisibleLights(reaching.begins, reaching.numbers, each)
            transport(light.lights, pixels, (kinds[0], second), bands, seen, block)
            found.append(block)
        return found


def _full(work: _Work, light: Light, edited: EditObject, share: float) -> list[CurveTransport]:
    terms, channels = edited.material.terms, len(edited.material.channels)
    tables = [np.empty((len(light.pixels), channels, *_bands(term)), np.float32) for term in terms]
    work.fill(tables, light, edited, [lambda block, _: block] * len(terms), share)
    return [FullTransport(table, len(term.summed)) for table, term in zip(tables, terms, strict=True)]


def _low_rank(work: _Work, light: Light, edited: EditObject, tolerance: float, share: float) -> list[CurveTransport]:
    terms, channels, count = edited.material.terms, len(edited.material.channels), len(light.pixels)
    generator = np.random.default_rng(0)
    order = generator.permutation(count)
    chosen = np.sort(order[: _basis_pixels(terms, count)])
    which = np.arange(channels)[None].repeat(len(chosen), 0)
    if which.size > _BASIS_PIXELS[1]:
        which = generator.integers(0, channels, (len(chosen), 1))
    bases = _bases(work, light.some(chosen), edited, which, tolerance)
    found = [np.empty((count, channels, basis.rank), np.float32) for basis in bases]
    keep: list[Kept] = [lambda block, _, basis=basis: basis.coefficients(block) for basis in bases]
    work.fill(found, light, edited, keep, share)
    # Probes apart from the basis's pixels where there are enough of them.
    others = np.setdiff1d(np.arange(count), chosen)
    probes = np.sort(generator.permutation(others if len(others) >= _PROBES else count)[:_PROBES])
    blocks = work.block(light.some(probes), edited)
    made: list[CurveTransport] = []
    for table, term, basis, block in zip(found, terms, bases, blocks, strict=True):
        full = FullTransport(block.reshape(len(probes), channels, *_bands(term)).astype(np.float32), len(term.summed))
        sizes = tuple(slot.bands for slot in term.summed)
        outward = BlockFloats.of(basis.outward[:, None])
        made.append(LowRank(BlockFloats.of(table), outward, basis.scale, sizes, probes, full))
    return made


def _basis_pixels(terms: Sequence[EditableTerm], count: int) -> int:
    """Return how many of `count` pixels to compute the bases from; these pixels are computed twice."""
    least, most = _BASIS_PIXELS
    return max(least, min(most, count // 4)) if any(len(term.summed) == 2 for term in terms) else least


def _bases(work: _Work, light: Light, edited: EditObject, which: np.ndarray, tolerance: float) -> list[Basis]:
    """Return every term's basis, from the channels `which` (S, n) of each of these pixels."""
    terms = edited.material.terms
    first = [np.empty((*which.shape, int(np.prod(_bands(term)))), np.float32) for term in terms]
    work.fill(
        first, light, edited, [lambda block, rows: block[np.arange(len(rows))[:, None], which[rows]]] * len(terms)
    )
    starts = [[slot.banded(slot.start).values for slot in term.summed] for term in terms]
    with ThreadPoolExecutor(work.threads) as pool:
        rows = [table.reshape(which.size, -1) for table in first]
        return list(pool.map(lambda own, curves: basis_of(own, which.ravel(), curves, tolerance), rows, starts))
