"""The scene of a plan, read from strict TOML: materials with their shares, the lighting, a tolerance, a budget.

seed = 0
[[material]]                       # one or more; shares add up to 1
source = "material:phong-30"       # or a file, relative to the scene's
share = 0.6
[lighting]                         # one of
named = "overcast"                 # `scene.lighting.NAMED`
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

import math
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

from homofact.brdf.materials import material
from homofact.brdf.names import MATERIAL_PREFIX
from homofact.errors import BadInput
from homofact.files.reading import read_toml, split_member
from homofact.files.tables import limits, read_table
from homofact.options import MOST_SEED
from homofact.render.environment import read_environment
from homofact.render.light import DirectionalLight
from homofact.scene.lighting import Lighting, named_lighting

SHARE_SLACK = 1e-6


@dataclass(frozen=True)
class SceneMaterial:
    """`source` as `brdf.source.open_source` takes it, `share` of the picture in (0, 1]."""

    source: str
    share: float = field(metadata=limits(above=0, most=1))


@dataclass(frozen=True)
class Tolerance:
    """`kind` is one of `plan.measure.KINDS`, `value` what its error may be at most."""

    kind: str
    value: float


@dataclass(frozen=True)
class Budget:
    """`bytes` of all materials together and `fetches` of one evaluation; None is no limit."""

    # One colour is 4 bytes at least and 0 fetches.
    bytes: int | None = field(default=None, metadata=limits(least=4))
    fetches: int | None = field(default=None, metadata=limits(least=0))


@dataclass(frozen=True)
class Scene:
    """What is planned for."""

    name: str
    materials: tuple[SceneMaterial, ...]
    lighting: Lighting
    tolerance: Tolerance
    budget: Budget = Budget()
    seed: int = 0


@dataclass(frozen=True)
class _LightingTable:
    """[lighting] as it stands in the file."""

    environment: str | None = None
    lights: tuple[DirectionalLight, ...] | None = None
    named: str | None = None

    def __post_init__(self) -> None:
        _the_one(self)
        for place, light in enumerate(self.lights or ()):
            if len(light.levels()) not in (1, 3):
                found = f"found {len(light.levels())} numbers"
                raise BadInput(f"lights[{place}].radiance: {found}, expected 1 or 3 numbers")


@dataclass(frozen=True)
class _ToleranceTable:
    """[tolerance] as it stands in the file; its keys are `plan.measure.KINDS`."""

    cole: float | None = field(default=None, metadata=limits(above=0))
    delta_e: float | None = field(default=None, metadata=limits(above=0))
    reflected: float | None = field(default=None, metadata=limits(above=0))

    def __post_init__(self) -> None:
        _the_one(self)


@dataclass(frozen=True)
class _SceneTable:
    """The whole file."""

    material: tuple[SceneMaterial, ...]
    lighting: _LightingTable
    tolerance: _ToleranceTable
    budget: Budget = Budget()
    seed: int = field(default=0, metadata=limits(least=0, most=MOST_SEED))

    def __post_init__(self) -> None:
        total = math.fsum(each.share for each in self.material)
        if abs(total - 1) > SHARE_SLACK:
            raise BadInput(f"material: the shares add up to {total:.6g}, expected 1")


def read_scene(path: str | Path) -> Scene:
    """The scene in a TOML file.

    Raises BadInput for a file that cannot be read, unknown keys, wrong types and values, shares that do not add up to
    1, sources and environments that are not there, and for an environment or lights that are not light.
    """
    file = Path(path)
    found = read_table(_SceneTable, read_toml(file, "a scene in TOML"), f"{file}: ")
    try:
        return Scene(
            file.stem,
            tuple(
                SceneMaterial(_source(each.source, file.parent, f"material[{place}].source"), each.share)
                for place, each in enumerate(found.material)
            ),
            _lighting(found.lighting, file.parent),
            Tolerance(*_the_one(found.tolerance)),
            found.budget,
            found.seed,
        )
    except BadInput as error:
        raise BadInput(f"{file}: {error}") from error


def _source(text: str, folder: Path, where: str) -> str:
    """The source with its file made findable; a file that is not there is refused before anything is fitted."""
    if text.startswith(MATERIAL_PREFIX):
        material(text.removeprefix(MATERIAL_PREFIX))
        return text
    path = split_member(folder / text)[0]
    if not Path(path).exists():
        raise BadInput(f"{where}: no file {path}, expected a measurement or {MATERIAL_PREFIX}NAME")
    return str(folder / text)


def _lighting(table: _LightingTable, folder: Path) -> Lighting:
    if table.lights is not None:
        words = "; ".join(each.describe() for each in table.lights)
        return Lighting(f"{len(table.lights)} lights", table.lights, words)
    if table.named is not None:
        return named_lighting(table.named)
    found = read_environment(folder / str(table.environment))
    return Lighting(found.name, (found,), found.describe())


def _the_one(table: "_LightingTable | _ToleranceTable") -> tuple[str, Any]:
    """Name and value of the only key that is given. Raises BadInput where there is none, or several."""
    names = [each.name for each in fields(table)]
    given = [name for name in names if getattr(table, name) is not None]
    if len(given) != 1:
        raise BadInput(f"found {' and '.join(given) or 'none'}, expected exactly one of {', '.join(names)}")
    return given[0], getattr(table, given[0])
