"""The scene of a plan, read from strict TOML: materials with their shares, the lighting, a tolerance, a budget.

seed = 0
[[material]]                       # one or more; shares add up to 1
source = "material:phong-30"       # or a file, relative to the scene's
share = 0.6
[lighting]                         # one of
named = "overcast"                 # `plan_lighting.NAMED`
environment = "sky.hdr"            # lat-long .hdr or .exr, relative to the scene's file
lights = [{ direction = [0, 1, 1], radiance = [3.1, 3.1, 3.1] }]
[tolerance]                        # one of
cole = 0.05                        # mean squared error of logs; the lighting does not matter to it
delta_e = 2.0                      # mean CIEDE2000 of the lit sphere
reflected = 0.02                   # relative error of the reflected light
[budget]                           # optional
bytes = 50000                      # of all materials together
fetches = 4                        # of one evaluation, at most
"""

import difflib
import math
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from homofact.brdf.materials import material
from homofact.brdf.names import MATERIAL_PREFIX
from homofact.errors import BadInput
from homofact.render.environment import read_environment
from homofact.render.light import DirectionalLight
from homofact.scene.lighting import Lighting, named_lighting
from homofact.scene.plan.measure import KINDS

SHARE_SLACK = 1e-6
_LIGHTINGS = ("environment", "lights", "named")


@dataclass(frozen=True)
class SceneMaterial:
    """`source` as `brdf.source.open_source` takes it, `share` of the picture in (0, 1]."""

    source: str
    share: float


@dataclass(frozen=True)
class Tolerance:
    """`kind` is one of `plan_measure.KINDS`, `value` what its error may be at most."""

    kind: str
    value: float


@dataclass(frozen=True)
class Budget:
    """`bytes` of all materials together and `fetches` of one evaluation; None is no limit."""

    bytes: int | None = None
    fetches: int | None = None


@dataclass(frozen=True)
class Scene:
    """What is planned for."""

    name: str
    materials: tuple[SceneMaterial, ...]
    lighting: Lighting
    tolerance: Tolerance
    budget: Budget = Budget()
    seed: int = 0


def read_scene(path: str | Path) -> Scene:
    """The scene in a TOML file.

    Raises BadInput for a file that cannot be read, unknown keys, wrong types and values, shares that do not add up to
    1, sources and environments that are not there, and for an environment or lights that are not light.
    """
    file = Path(path)
    try:
        table = tomllib.loads(file.read_text(encoding="utf-8"))
    except FileNotFoundError as error:
        raise BadInput(f"{file}: no such file, expected a scene in TOML") from error
    except OSError as error:
        raise BadInput(f"{file}: cannot be read ({error.strerror}), expected a scene in TOML") from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise BadInput(f"{file}: not TOML: {error}") from error
    try:
        _known(table, ("seed", "material", "lighting", "tolerance", "budget"), "")
        return Scene(
            file.stem,
            _materials(table.get("material"), file.parent),
            _lighting(_section(table, "lighting"), file.parent),
            _tolerance(_section(table, "tolerance")),
            _budget(_section(table, "budget") if "budget" in table else {}),
            _whole(table.get("seed", 0), "seed", 0),
        )
    except BadInput as error:
        raise BadInput(f"{file}: {error}") from error


def _materials(found: Any, folder: Path) -> tuple[SceneMaterial, ...]:
    if not isinstance(found, list) or not found or not all(isinstance(each, dict) for each in found):
        raise BadInput("material: found none, expected one [[material]] or more")
    materials = []
    for place, entry in enumerate(found, 1):
        where = f"material {place}: "
        _known(entry, ("source", "share"), where)
        source, share = entry.get("source"), _number(entry.get("share"), f"{where}share")
        if not isinstance(source, str):
            raise BadInput(f"{where}source: found {_words(source)}, expected a file or {MATERIAL_PREFIX}NAME")
        if not 0 < share <= 1:
            raise BadInput(f"{where}share: found {share:g}, expected above 0 and at most 1")
        materials.append(SceneMaterial(_source(source, folder, where), share))
    total = math.fsum(each.share for each in materials)
    if abs(total - 1) > SHARE_SLACK:
        raise BadInput(f"material: the shares add up to {total:.6g}, expected 1")
    return tuple(materials)


def _source(text: str, folder: Path, where: str) -> str:
    """The source with its file made findable; a file that is not there is refused before anything is fitted."""
    if text.startswith(MATERIAL_PREFIX):
        material(text.removeprefix(MATERIAL_PREFIX))
        return text
    path, hash_sign, inner = str(folder / text).partition("#")
    if not Path(path).exists():
        raise BadInput(f"{where}source: no file {path}, expected a measurement or {MATERIAL_PREFIX}NAME")
    return f"{path}{hash_sign}{inner}"


def _lighting(section: Mapping[str, Any], folder: Path) -> Lighting:
    key = _one_of(section, _LIGHTINGS, "lighting")
    value = section[key]
    if key == "lights":
        if not isinstance(value, list) or not all(isinstance(each, dict) for each in value):
            raise BadInput(f"lighting.lights: found {_words(value)}, expected an array of {{ direction, radiance }}")
        lights = tuple(_light(each, f"lighting.lights[{place}]: ") for place, each in enumerate(value))
        return Lighting(f"{len(lights)} lights", lights, "; ".join(each.describe() for each in lights))
    if not isinstance(value, str):
        raise BadInput(f"lighting.{key}: found {_words(value)}, expected a string")
    if key == "named":
        return named_lighting(value)
    found = read_environment(folder / value)
    return Lighting(found.name, (found,), found.describe())


def _light(entry: Mapping[str, Any], where: str) -> DirectionalLight:
    _known(entry, ("direction", "radiance"), where)
    direction = _numbers(entry.get("direction"), f"{where}direction", (3,))
    radiance = entry.get("radiance", math.pi)
    levels = _numbers(radiance, f"{where}radiance", (1, 3)) if isinstance(radiance, list) else _number(radiance, where)
    x, y, z = direction
    try:
        return DirectionalLight((x, y, z), levels)
    except BadInput as error:
        raise BadInput(f"{where}{error}") from error


def _tolerance(section: Mapping[str, Any]) -> Tolerance:
    kind = _one_of(section, KINDS, "tolerance")
    value = _number(section[kind], f"tolerance.{kind}")
    if not 0 < value < math.inf:
        raise BadInput(f"tolerance.{kind}: found {value:g}, expected a number above 0")
    return Tolerance(kind, value)


def _budget(section: Mapping[str, Any]) -> Budget:
    _known(section, ("bytes", "fetches"), "budget.")
    values = {key: _whole(value, f"budget.{key}", least) for (key, value), least in _least(section)}
    return Budget(values.get("bytes"), values.get("fetches"))


def _least(section: Mapping[str, Any]) -> list[tuple[tuple[str, Any], int]]:
    # One colour is 4 bytes at least and 0 fetches.
    return [(item, 4 if item[0] == "bytes" else 0) for item in section.items()]


def _section(table: Mapping[str, Any], name: str) -> Mapping[str, Any]:
    found = table.get(name)
    if not isinstance(found, dict):
        raise BadInput(f"{name}: found {_words(found)}, expected a section [{name}]")
    return found


def _one_of(section: Mapping[str, Any], keys: Sequence[str], name: str) -> str:
    _known(section, keys, f"{name}.")
    if len(section) != 1:
        found = " and ".join(section) if section else "none"
        raise BadInput(f"{name}: found {found}, expected exactly one of {', '.join(keys)}")
    return next(iter(section))


def _known(table: Mapping[str, Any], keys: Sequence[str], where: str) -> None:
    for key in table:
        if key not in keys:
            nearest = difflib.get_close_matches(key, keys, n=1, cutoff=0.0)[0]
            raise BadInput(f"{where}unknown key {key}, the nearest known one is {nearest}")


def _number(value: Any, where: str) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise BadInput(f"{where.rstrip(': ')}: found {_words(value)}, expected a number")
    return float(value)


def _numbers(value: Any, where: str, counts: Sequence[int]) -> tuple[float, ...]:
    if not isinstance(value, list) or len(value) not in counts:
        raise BadInput(f"{where}: found {_words(value)}, expected {' or '.join(map(str, counts))} numbers")
    return tuple(_number(each, where) for each in value)


def _whole(value: Any, where: str, least: int) -> int:
    if type(value) is not int or value < least:
        raise BadInput(f"{where}: found {_words(value)}, expected a whole number of at least {least}")
    return value


def _words(value: Any) -> str:
    if value is None:
        return "none"
    return f"an array of {len(value)}" if isinstance(value, list) else repr(value)
