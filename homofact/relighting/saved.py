"""The schema of a relit scene's archive, which is validated completely before anything uses it.

Compiled loops and the page use these arrays without further checks. This module therefore checks that indices are in
range, that vectors are contiguous, and that numbers are finite and of plausible size.
"""

import math
from typing import Any

import numpy as np

from homofact.errors import BadInput
from homofact.files.arrays import ANY, MOST_VALUE, Arrays
from homofact.files.fields import Fields
from homofact.meshes.mesh import Mesh
from homofact.relighting import cube
from homofact.relighting.build import RelitObject
from homofact.relighting.clusters import Clustered
from homofact.relighting.factors import InOutFactors
from homofact.relighting.harmonic import MOST_ORDER, Harmonic
from homofact.relighting.lamps import MOST_RADIUS, Lamp
from homofact.relighting.lobe import SeparateLobe
from homofact.relighting.lobe_table import LobeTable
from homofact.relighting.page.skies import PageSky
from homofact.relighting.precompute import TransportSettings, WaveletTransport
from homofact.relighting.sight import VertexSight, sight_words
from homofact.relighting.sunlight import MOST_LIGHTS, Sun, Sunlight
from homofact.relighting.tilted_view import MOST_REACH, TILTS, TiltedView
from homofact.rendering.light import LEAST_LIGHT, MOST_LIGHT
from homofact.scene.cameras import Camera
from homofact.scene.normal_map import SurfaceNormals
from homofact.scene.tint import SurfaceTint

VECTORS = ("start", "index", "number", "scale")
FACTORS = ("light", "view", "strength")
# Objects, cameras; lengths, scales and maps of which products of four stay finite in float32.
_MOST_OBJECTS, _MOST_CAMERAS, _MOST_TABLES, _MOST = 10_000, 1000, 3, 1e9
_UNIT = 1.0 + 1e-3
_MOST_ENTRIES = 100_000


class Part:
    """The arrays of an archive under a prefix: of one object, or of an object's basis."""

    def __init__(self, arrays: Arrays, prefix: str) -> None:
        """Select the arrays whose names begin with `prefix`."""
        self._arrays, self._prefix = arrays, prefix

    def floats(
        self, name: str, shape: tuple[int | None, ...], most: float = _MOST, least: float | None = None,
        dtype: Any = np.float32,
    ) -> np.ndarray:  # fmt: skip
        """Return floats of a type between `least` (default: −`most`) and `most`."""
        low = -most if least is None else least
        return self._arrays.stored(self._prefix + name, dtype, shape, low, most)

    def wholes(self, name: str, dtype: Any, shape: tuple[int | None, ...], below: int | None = None) -> np.ndarray:
        """Whole numbers of a type, from 0 to less than `below` where that is given."""
        bounds = np.iinfo(dtype)
        least, most = (bounds.min, bounds.max) if below is None else (0, below - 1)
        return self._arrays.stored(self._prefix + name, dtype, shape, least, most)

    def rotations(self, name: str, count: int) -> np.ndarray:
        """Return `count` rotations."""
        return self._arrays.rotations(self._prefix + name, np.float32, count)

    def inner(self, prefix: str) -> "Part":
        """Return the arrays under a longer prefix."""
        return Part(self._arrays, self._prefix + prefix)

    def refuse(self, name: str, found: str, expected: str) -> BadInput:
        """Return the BadInput that describes what is wrong with an array."""
        return BadInput(f"{self._prefix}{name} {found}", where=self._arrays.path, expected=expected)


def read_object(
    arrays: Arrays, number: int, entry: Fields, suns: tuple[Sun, ...] = (), lamps: tuple[Lamp, ...] = ()
) -> RelitObject:
    """An object with its transport, its compact form where it has one, the scene's suns and lamps. Raises BadInput."""
    part = Part(arrays, f"object_{number}_")
    settings = _settings(entry.inner("settings"))
    channels = tuple(entry.texts("channels", 3))
    if len(channels) not in (1, 3):
        entry.refuse("channels", "one or three")
    light = part.floats("factors_light", (None, None, None))
    terms, side = light.shape[:2]
    if light.shape[2] != side:
        raise part.refuse("factors_light", f"is of shape {light.shape}", "square maps")
    view = part.floats("factors_view", (terms, None, None, len(channels)))
    if view.shape[1] != view.shape[2]:
        raise part.refuse("factors_view", f"is of shape {view.shape}", "square maps")
    strength = part.floats("factors_strength", (terms,), least=0.0, dtype=np.float64)
    energy, beside = entry.number("energy", above=0), entry.number("beside")
    bounced = entry.whole("bounced", 0, terms)
    tinted = entry.whole("tinted", 0, terms - bounced)
    reach = entry.number("reach", above=0) if entry.found.get("reach") is not None else None
    if reach is not None and reach > MOST_REACH:
        entry.refuse("reach", f"at most {MOST_REACH:g}")
    factors = InOutFactors(light, view, strength, energy, channels, beside, bounced, tinted, reach is not None)
    mesh = _mesh(part, entry.text("name"))
    count = len(mesh.positions)
    positions, rows = mesh.positions.astype(np.float32), part.rotations("frames", count)
    made = WaveletTransport(positions, rows, factors, settings, *_vectors(part, count * terms, settings))
    lobe = _lobe(part, entry, made) if entry.found.get("lobe") is not None else None
    lit = _sunlight(part, entry, suns, lamps, made) if suns or lamps else None
    tint = None
    if tinted:
        texture = part.floats("tints", (None, None, 3), least=0.0)
        tint = SurfaceTint(texture, part.floats("uv", (count, 2), MOST_VALUE, dtype=np.float64))
    bumps, tilted = (None, None) if reach is None else _normal_map(part, factors, count, reach)
    compact = _compact(part, entry, made)
    return RelitObject(
        mesh, entry.text("material"), made, compact, lobe=lobe, sunlight=lit, tint=tint, bumps=bumps, tilted=tilted
    )


def read_suns(fields: Fields) -> tuple[Sun, ...]:
    """The suns beside the sky. Raises BadInput."""
    found: list[Sun] = []
    if not fields.found.get("suns"):
        return ()
    for entry in fields.inners("suns", MOST_LIGHTS):
        towards, light = np.array(entry.numbers("direction", 3)), _levels(entry, "irradiance")
        if abs(np.linalg.norm(towards) - 1) > 1e-3:
            entry.refuse("direction", "a unit vector")
        radius = entry.number("radius", above=0)
        if radius > math.pi / 4:
            entry.refuse("radius", "at most π/4")
        found.append(Sun(towards, light, radius))
    return tuple(found)


def read_lamps(fields: Fields, suns: int) -> tuple[Lamp, ...]:
    """The lamps beside so many suns. Raises BadInput."""
    found: list[Lamp] = []
    if not fields.found.get("lamps"):
        return ()
    for entry in fields.inners("lamps", MOST_LIGHTS - suns):
        position = np.array(entry.numbers("position", 3))
        if not (np.abs(position) < MOST_VALUE).all():
            entry.refuse("position", f"numbers below {MOST_VALUE:g}")
        radius = entry.number("radius", above=0)
        if radius > MOST_RADIUS:
            entry.refuse("radius", f"at most {MOST_RADIUS:g}")
        found.append(Lamp(position, radius, _levels(entry, "intensity")))
    return tuple(found)


def _levels(entry: Fields, name: str) -> np.ndarray:
    """Read red, green and blue of a light (3,). Raises BadInput."""
    light = np.array(entry.numbers(name, 3))
    if not (light >= 0).all() or not light.any() or float(light.max()) > MOST_LIGHT:
        entry.refuse(name, f"three numbers from 0 to {MOST_LIGHT:g}, some above 0")
    return light


def read_sky(arrays: Arrays, name: str) -> PageSky:
    """The light of the scene. Raises BadInput."""
    sky = Part(arrays, "sky_")
    found = sky.floats("cube", (cube.FACES, None, None, 3), MOST_LIGHT, 0.0)
    picture = sky.floats("picture", (None, None, 3), MOST_LIGHT, 0.0)
    cube.check_size(found.shape[1])
    if found.shape[2] != found.shape[1]:
        raise sky.refuse("cube", f"is of shape {found.shape}", "square faces")
    for what, values in (("cube", found), ("picture", picture)):
        if float(values.max()) < LEAST_LIGHT:
            raise sky.refuse(what, "is dark", "some light")
    return PageSky(name, found, picture)


def read_cameras(fields: Fields) -> tuple[Camera, ...]:
    """The cameras that the pictures are of. Raises BadInput."""
    found = []
    for entry in fields.inners("cameras", _MOST_CAMERAS):
        name = entry.text("name") if "name" in entry.found else None
        eye, target = (tuple(entry.numbers(each, 3)) for each in ("eye", "target"))
        pixels = tuple(map(int, entry.numbers("pixels", 2)))
        try:
            found.append(Camera(eye, target, entry.number("field"), pixels, name))
        except BadInput as error:
            raise error.at(entry.place, "") from error
    return tuple(found)


def read_references(arrays: Arrays, objects: tuple[RelitObject, ...]) -> tuple[np.ndarray, ...] | None:
    """Return each object's exact radiance, NaN at invisible vertices; None if not stored. Raises BadInput."""
    if "reference_0" not in arrays:
        return None
    return tuple(
        arrays.stored(f"reference_{k}", np.float32, (len(each.mesh.positions), 3), gaps=True)
        for k, each in enumerate(objects)
    )


def read_report(fields: Fields) -> dict[str, Any]:
    """The report, its objects' figures as the page shows them. Raises BadInput."""
    report = fields.inner("report")
    if "objects" in report.found:
        for entry in report.inners("objects", _MOST_OBJECTS):
            for name in ("mesh", "material"):
                entry.text(name)
            for name in ("vertices", "terms", "bytes"):
                entry.whole(name, 0, 2**53)
            entry.number("coefficients_per_vector")
            if entry.found.get("error", "") is not None:
                errors = entry.inner("error")
                for name in errors.found:
                    errors.number(name)
    return report.found


def read_objects(arrays: Arrays, fields: Fields) -> tuple[RelitObject, ...]:
    """All objects. Raises BadInput."""
    entries = fields.inners("objects", _MOST_OBJECTS)
    suns = read_suns(fields)
    lamps = read_lamps(fields, len(suns))
    return tuple(read_object(arrays, number, entry, suns, lamps) for number, entry in enumerate(entries))


def _settings(entry: Fields) -> TransportSettings:
    tolerance = None if entry.found.get("tolerance") is None else entry.number("tolerance")
    size, rays, kept = (entry.whole(name, 1, 10**6) for name in ("cube", "rays", "kept"))
    try:
        return TransportSettings(size, rays, kept, tolerance)
    except BadInput as error:
        raise error.at(entry.place, "") from error


def _mesh(part: Part, name: str) -> Mesh:
    positions = part.floats("positions", (None, 3), MOST_VALUE, dtype=np.float64)
    normals = part.floats("normals", (len(positions), 3), _UNIT, dtype=np.float64)
    if not (np.linalg.norm(normals, axis=1) > 0.5).all():
        raise part.refuse("normals", "holds one without length", "unit vectors")
    return Mesh(positions, normals, part.wholes("triangles", np.int64, (None, 3), len(positions)), name)


def _vectors(part: Part, count: int, settings: TransportSettings) -> tuple[np.ndarray, ...]:
    """Read start, index, number and scale of `count` sparse vectors."""
    start = part.wholes("start", np.int64, (count + 1,))
    if start[0] != 0 or (np.diff(start) < 0).any():
        raise part.refuse("start", "holds vectors that overlap", "places that grow from 0")
    total = int(start[-1])
    index = part.wholes("index", np.uint16, (ANY,), cube.FACES * settings.cube**2)
    if len(index) != total:
        raise part.refuse("index", f"holds {len(index)} places", f"{total}")
    return start, index, part.wholes("number", np.int16, (total,)), part.floats("scale", (count,), least=0.0)


def _normal_map(part: Part, factors: InOutFactors, count: int, reach: float) -> tuple[SurfaceNormals, TiltedView]:
    """Read the normal map of an object with `count` vertices, and its terms' data for tilted normals."""
    vectors = part.floats("normal_map", (None, None, 3), _UNIT)
    if vectors[..., 2].min() < -1e-6 or not (np.linalg.norm(vectors, axis=2) > 0.5).all():
        raise part.refuse("normal_map", "holds one that is no normal", "unit vectors with z of 0 or more")
    uv = part.floats("uv", (count, 2), MOST_VALUE, dtype=np.float64)
    tangents = part.floats("tangents", (count, 4), _UNIT, dtype=np.float64)
    view = part.floats("tilt_view", (None, *factors.view.shape[1:]))
    tilts = part.floats("tilts", (TILTS, TILTS, None))
    entries = part.wholes("tilt_entries", np.int32, (None, 3), _MOST_ENTRIES)
    limits = (factors.terms, len(view), tilts.shape[2])
    if len(entries) and (entries.max(0) >= limits).any():
        raise part.refuse("tilt_entries", f"names {entries.max(0).tolist()}", f"numbers below {limits}")
    return SurfaceNormals(vectors, uv, tangents), TiltedView(view, tilts, entries, reach)


def _lobe(part: Part, entry: Fields, made: WaveletTransport) -> SeparateLobe:
    sight = part.wholes("lobe_sight", np.uint64, (made.vertices, sight_words(made.settings.cube)))
    return SeparateLobe(_table(part, "lobe_values", entry.inner("lobe")), VertexSight.of(sight))


def _table(part: Part, name: str, numbers: Fields) -> LobeTable:
    values = part.floats(name, (None, None, None, None, 3))
    levels, turns, along, around, _ = values.shape
    if min(levels, along, around) < 2 or turns < 1:
        raise part.refuse(name, f"is of shape {values.shape}", "grids of two nodes or more each way")
    width, period = numbers.number("width", above=0), numbers.number("period", above=0)
    whole, cosine = numbers.flag("whole"), numbers.flag("cosine")
    tinted = None
    if numbers.found.get("tinted") is not None:
        tinted = np.array(numbers.rows("tinted", levels, 3), np.float32)
        if tinted.min() < 0 or tinted.max() > 1:
            numbers.refuse("tinted", "numbers from 0 to 1")
    return LobeTable(values, width, period, whole, cosine=cosine, tinted=tinted)


def _sunlight(
    part: Part, entry: Fields, suns: tuple[Sun, ...], lamps: tuple[Lamp, ...], made: WaveletTransport
) -> Sunlight:
    numbers = entry.inners("sun_tables", _MOST_TABLES)
    tables = tuple(_table(part, f"sun_values_{k}", each) for k, each in enumerate(numbers))
    seen = part.floats("sun_seen", (made.vertices, len(suns) + len(lamps)), 1.0, 0.0)
    bounced = None
    if lamps and made.factors.bounced:
        bounced = part.floats("lamp_bounced", (made.vertices, made.factors.bounced, len(lamps)))
    return Sunlight(suns, tables, seen, lamps, bounced)


def _compact(part: Part, entry: Fields, made: WaveletTransport) -> Harmonic | Clustered | None:
    factors, count = made.factors, len(made.positions)
    kind = entry.found.get("compact")
    if kind == "harmonic":
        step = part.floats("harmonic_step", (count, factors.terms), least=0.0)
        numbers = part.wholes("harmonic_number", np.int16, (count, factors.terms, None))
        order = round(numbers.shape[2] ** 0.5) - 1
        if (order + 1) ** 2 != numbers.shape[2] or order > MOST_ORDER:
            raise part.refuse("harmonic_number", f"holds {numbers.shape[2]} a vector", "those of whole orders")
        return Harmonic(made, numbers, step)
    if kind is not True:
        if kind is not False:
            entry.refuse("compact", 'true, false or "harmonic"')
        return None
    steps = part.floats("steps", (None, ANY), least=0.0)
    clusters, components = steps.shape
    size = clusters * (components + 1)
    blank, turned = np.zeros((size, 3), np.float32), np.zeros((size, 3, 3), np.float32)
    vectors = _vectors(part.inner("basis_"), size * factors.terms, made.settings)
    return Clustered(
        made.positions, made.frames, factors, WaveletTransport(blank, turned, factors, made.settings, *vectors),
        part.wholes("cluster", np.uint16, (count,), clusters), part.wholes("weights", np.int16, (count, components)),
        steps,
    )  # fmt: skip
