"""The scene of a plan, read from strict TOML: materials with their shares, lightings, tolerances, a budget.

name = "showroom"                  # optional: of the scene. Default: the file's
seed = 0
[[material]]                       # one or more
source = "material:phong-30"       # or a file, relative to the scene's
name = "case"                      # optional: in tables, pictures and folders. Default: the name of the source
share = 0.6                        # optional: of the picture. Default: what the other materials leave, in equal parts
pixels = 40                        # optional: how many the object is across, each of which averages what it covers
tolerance = { delta_e = 0.5 }      # optional: of this material, instead of [tolerance]
[lighting]                         # one, or [[lighting]] several times: the tolerance then holds under each; one key of
named = "overcast"                 # `scene.lighting.NAMED`
environment = "sky.hdr"            # lat-long .hdr or .exr, relative to the scene's file
lights = [{ direction = [0, 1, 1], radiance = [3.1, 3.1, 3.1] }]
[tolerance]                        # of materials without their own: one or more of `plan.tolerance.KINDS`; all hold
cole = 0.05                        # mean squared error of logs; the lighting does not matter to it
delta_e = 2.0                      # mean CIEDE2000 of the lit sphere, of the view where it is largest
delta_e_p95 = 5.0                  # its 95th percentile
delta_e_peak = 10.0                # its greatest value
reflected = 0.02                   # relative error of the reflected light
delta_e_study = 0.9                # mean CIEDE2000 under the light of the study of opinions, whatever the lighting
trusted = true                     # optional, beside a limit: the verdict must trust the choice. Default: false
[budget]                           # optional
bytes = 50000                      # of all materials together
fetches = 4                        # of one evaluation, at most
"""

import math
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

from homofact.brdf.source_names import MATERIAL_PREFIX
from homofact.errors import BadInput
from homofact.files.kinds import check_no_fit
from homofact.files.reading import read_toml
from homofact.planning.tolerance import KINDS, Tolerance
from homofact.rendering.environment import read_environment
from homofact.rendering.light import DirectionalLight
from homofact.scene.lighting import Lighting, check_file, named_lighting
from homofact.scene.materials import found_source
from homofact.settings.kinds import PLANNING, check_kind
from homofact.settings.options import MOST_SEED, a_name, option, required
from homofact.settings.tables import read_table

SHARE_SLACK = 1e-6
LEAST_PIXELS, MOST_PIXELS = 2, 16384
_THE_REST = "what the other materials leave, in equal parts"


@dataclass(frozen=True)
class _MaterialKeys:
    """The keys of a material, both in the file and in memory."""

    source: str
    share: float | None = option(None, f"Part of the picture. Default: {_THE_REST}", above=0, most=1)
    pixels: int | None = option(None, "How many the object is across", least=LEAST_PIXELS, most=MOST_PIXELS)
    name: str | None = option(None, "Its name in tables. Default: the name of the source", expected_instead=a_name)


@dataclass(frozen=True)
class SceneMaterial(_MaterialKeys):
    """`source` as for `brdf.source.open_source`, and `share` of the picture in (0, 1].

    `pixels` is the width of the object in pixels, None for a camera so close that pixels do not blur. `name` is what
    tables, pictures and folders call it, None for the source's own name. `tolerance` is its own, None for the scene's.
    """

    share: float = required("Part of the picture", above=0, most=1)
    tolerance: Tolerance | None = None

    @property
    def key(self) -> tuple[str, int | None, Tolerance | None]:
        """Equal for materials that one choice serves."""
        return self.source, self.pixels, self.tolerance


@dataclass(frozen=True)
class Budget:
    """`bytes` of all materials together and `fetches` of one evaluation; None is no limit."""

    # One colour is 4 bytes at least and 0 fetches.
    bytes: int | None = option(None, "Of all materials together", least=4)
    fetches: int | None = option(None, "Of one evaluation, at most", least=0)

    def allows(self, nbytes: int, fetches: int) -> bool:
        """Return whether a representation of so many bytes and fetches is within both."""
        return (self.bytes is None or nbytes <= self.bytes) and (self.fetches is None or fetches <= self.fetches)


NO_BUDGET = Budget()


@dataclass(frozen=True)
class Scene:
    """The scene to plan; the tolerance, or a material's own, must be met under each of the `lightings`.

    `tolerance` may be None where every material has its own.
    """

    name: str
    materials: tuple[SceneMaterial, ...]
    lightings: tuple[Lighting, ...]
    tolerance: Tolerance | None
    budget: Budget = Budget()
    seed: int = 0

    def tolerance_of(self, material: SceneMaterial) -> Tolerance:
        """Return the tolerance that holds for one of the materials."""
        own = self.tolerance if material.tolerance is None else material.tolerance
        assert own is not None, "a material without a tolerance in a scene without one"
        return own


@dataclass(frozen=True)
class _LightingTable:
    """[lighting], or one [[lighting]], as written in the file."""

    environment: str | None = None
    lights: tuple[DirectionalLight, ...] | None = None
    named: str | None = None

    def __post_init__(self) -> None:
        given = _given(self)
        if len(given) != 1:
            names = ", ".join(key.name for key in fields(self))
            raise BadInput(found=" and ".join(given) or "none", expected=f"exactly one of {names}")
        check_file(self.environment)
        for place, light in enumerate(self.lights or ()):
            if len(light.levels()) not in (1, 3):
                found = f"found {len(light.levels())} numbers"
                raise BadInput(found, where=f"lights[{place}].radiance", expected="1 or 3 numbers")


@dataclass(frozen=True)
class _ToleranceTable:
    """[tolerance] as written in the file; its keys are `plan.tolerance.KINDS`, and `trusted`."""

    cole: float | None = option(None, "Mean squared error of logarithms", above=0)
    delta_e: float | None = option(None, "Mean CIEDE2000 of the lit sphere", above=0)
    delta_e_p95: float | None = option(None, "Its 95th percentile", above=0)
    delta_e_peak: float | None = option(None, "Its greatest value", above=0)
    reflected: float | None = option(None, "Relative error of the reflected light", above=0)
    delta_e_study: float | None = option(None, "Mean CIEDE2000 under the light of the study of opinions", above=0)

    trusted: bool = option(False, "Whether the verdict must trust the choice")

    def __post_init__(self) -> None:
        if not self.limits:
            raise BadInput(found="no limit", expected=f"at least one of {', '.join(KINDS)}")

    @property
    def limits(self) -> dict[str, float]:
        """The given limits, by kind."""
        return {kind: limit for kind, limit in _given(self).items() if kind in KINDS}

    def tolerance(self) -> Tolerance:
        """Return the tolerance for the planner."""
        return Tolerance.of(**self.limits, trusted=self.trusted)


@dataclass(frozen=True)
class _MaterialTable(_MaterialKeys):
    """[[material]] as written in the file."""

    tolerance: _ToleranceTable | None = None

    def material(self, folder: Path, place: str, share: float) -> SceneMaterial:
        """Return the material, looking for its file in `folder`; `place` names it in messages. Raises BadInput."""
        own = None if self.tolerance is None else self.tolerance.tolerance()
        source = found_source(self.source, folder, f"{place}.source")
        check_no_fit(Path(source), f"{place}.source", f"a measurement or {MATERIAL_PREFIX}NAME")
        return SceneMaterial(source, share, self.pixels, self.name, own)


@dataclass(frozen=True)
class PlanSceneTable:
    """The whole file."""

    material: tuple[_MaterialTable, ...]
    lighting: _LightingTable | tuple[_LightingTable, ...]
    tolerance: _ToleranceTable | None = None
    budget: Budget = Budget()
    seed: int = option(0, "Of the views and the fits", least=0, most=MOST_SEED)
    name: str | None = option(None, "Name of the scene. Default: that of the file", expected_instead=a_name)

    def __post_init__(self) -> None:
        """Reject shares that do not sum to 1, repeated names, and a missing lighting. Raises BadInput."""
        given = [each.share for each in self.material if each.share is not None]
        total = math.fsum(given)
        if len(given) < len(self.material):
            if total > 1 - SHARE_SLACK:
                expected = "less than 1: a material without a share takes what the others leave"
                raise BadInput(f"the shares add up to {total:.6g}", where="material", expected=expected)
        elif abs(total - 1) > SHARE_SLACK:
            raise BadInput(f"the shares add up to {total:.6g}", where="material", expected="1")
        seen: dict[tuple[str, int | None, str | None], _ToleranceTable | None] = {}
        for place, each in enumerate(self.material):
            if seen.setdefault((each.source, each.pixels, each.name), each.tolerance) != each.tolerance:
                expected = "a name of its own: the same source is listed with another tolerance"
                raise BadInput(where=f"material[{place}].name", found=str(each.name or "none"), expected=expected)
        without = [place for place, each in enumerate(self.material) if each.tolerance is None]
        if self.tolerance is None and without:
            expected = "a section [tolerance], or one of each material's own"
            raise BadInput(where=f"material[{without[0]}].tolerance", found="none", expected=expected)
        if self.lighting == ():
            raise BadInput(where="lighting", found="none", expected="at least one")

    @property
    def shares(self) -> list[float]:
        """The materials' shares: those without one have equal parts of what the others leave."""
        given = [each.share for each in self.material if each.share is not None]
        rest = (1 - math.fsum(given)) / max(len(self.material) - len(given), 1)
        return [rest if each.share is None else each.share for each in self.material]


def read_scene(path: str | Path) -> Scene:
    """Return the scene in a TOML file.

    Raises BadInput for a file that cannot be read, unknown keys, wrong types and values, shares that do not add up to
    1, sources and environments that are not there, and for an environment or lights that are not light.
    """
    file = Path(path)
    given = read_toml(file, "a scene in TOML")
    check_kind(given, PLANNING, file)
    scene = read_table(PlanSceneTable, given, f"{file}: ")
    tables = scene.lighting if isinstance(scene.lighting, tuple) else (scene.lighting,)
    try:
        return Scene(
            scene.name or file.stem,
            tuple(
                each.material(file.parent, f"material[{place}]", share)
                for place, (each, share) in enumerate(zip(scene.material, scene.shares, strict=True))
            ),
            tuple(_lighting(table, file.parent) for table in tables),
            None if scene.tolerance is None else scene.tolerance.tolerance(),
            scene.budget,
            scene.seed,
        )
    except BadInput as error:
        raise error.at(file) from error


def _lighting(table: _LightingTable, folder: Path) -> Lighting:
    if table.lights is not None:
        words = "; ".join(light.describe() for light in table.lights)
        return Lighting(f"{len(table.lights)} lights", table.lights, words)
    if table.named is not None:
        return named_lighting(table.named)
    environment = read_environment(folder / str(table.environment))
    return Lighting(environment.name, (environment,), environment.describe())


def _given(table: "_LightingTable | _ToleranceTable") -> dict[str, Any]:
    """Return names and values of the given keys."""
    return {key.name: getattr(table, key.name) for key in fields(table) if getattr(table, key.name) is not None}
