"""The configuration of a run: strict TOML and command line options into frozen dataclasses.

Precedence is command line over file over default, key by key; an explicit 0, 0.0 or false wins like any
other value, since only a missing key falls through. The sections:

    seed = 0             # of sampling, split and fit
    [source]             # what is read or sampled: `SourceSettings`
    [fit]                # `factor.settings.FitSettings`, all but its seed
    [evaluate]           # `EvaluateSettings`
    [compare]            # `CompareSettings`
    [chart]              # `ChartSettings`
    [output]             # `OutputSettings`
    [render]             # `RenderSettings`

Paths in a file are relative to the working folder, as they are on the command line. An unknown key or a
value of the wrong type is `BadInput` naming file, key and the nearest known key or the expected type.
"""

import math
import typing
from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

from homofact.errors import BadInput
from homofact.files.reading import read_toml
from homofact.files.tables import described, kinds_of, nearest_key, plain_value
from homofact.methods.settings import FitSettings


@dataclass(frozen=True)
class SourceSettings:
    """What is read: a file's path or `material:NAME`, its channels, and how a model is sampled.

    `channels` is rgb, luminance, spectral or one channel's name; `count` (pairs of directions) and
    `scheme` count for analytic models only. `subset` above 0 is the most samples that a fit is given, drawn by
    cells (`brdf.stratified`).
    """

    path: str | None = None
    channels: str = "rgb"
    count: int = 45_000
    scheme: str = "discs"
    subset: int = 0

    def __post_init__(self) -> None:
        """Refuse a count that leaves nothing to fit."""
        if self.subset < 0:
            raise BadInput(f"subset: found {self.subset}, expected at least 1, or 0 for all samples")
        if self.count < 1:
            raise BadInput(f"count: found {self.count}, expected at least 1")


@dataclass(frozen=True)
class EvaluateSettings:
    """`held_out`: the part of the measured samples kept from the fit, drawn by the seed."""

    held_out: float = 0.2

    def __post_init__(self) -> None:
        """Refuse a part that leaves nothing to fit or nothing to test."""
        if not 0 < self.held_out < 1:
            raise BadInput(f"held_out: found {self.held_out}, expected between 0 and 1")


@dataclass(frozen=True)
class CompareSettings:
    """`methods` are fitted side by side; `plot` is the figure's file, where one is wanted.

    `metrics` names what they are measured by: six, all, or single metrics.

    A method is a name, or `mccool:` and fixed projections joined with "+" (`mccool:theta_h-theta_d+wi`).
    """

    methods: tuple[str, ...] = ("mccool", "cole", "search")
    plot: str | None = None
    metrics: tuple[str, ...] = ("six",)

    def __post_init__(self) -> None:
        """Refuse an empty list and a method named twice."""
        if not self.methods or len(set(self.methods)) < len(self.methods):
            found = ", ".join(self.methods) if self.methods else "none"
            raise BadInput(f"methods: found {found}, expected at least one, none twice")


@dataclass(frozen=True)
class ChartSettings:
    """What a chart runs on each of `sources`: methods × counts of textures × sizes × searches.

    A method is named as for a comparison; McCool's fixed lists take neither counts nor searches, and only
    `search` takes searches. No sources means the one of [source].
    """

    sources: tuple[str, ...] = ()
    methods: tuple[str, ...] = ("mccool", "cole", "search")
    textures: tuple[int, ...] = (1, 2, 3)
    sizes: tuple[int, ...] = (8, 16, 32)
    searches: tuple[str, ...] = ("gradient",)

    def __post_init__(self) -> None:
        """Refuse an empty list and an entry named twice."""
        for field in fields(self):
            found = getattr(self, field.name)
            if (not found and field.name != "sources") or len(set(found)) < len(found):
                listed = ", ".join(map(str, found)) if found else "none"
                raise BadInput(f"{field.name}: found {listed}, expected at least one, none twice")


@dataclass(frozen=True)
class OutputSettings:
    """Where the result goes (`folder`), and whether a result already there is replaced (`force`)."""

    folder: str | None = None
    force: bool = False


@dataclass(frozen=True)
class RenderSettings:
    """How a sphere is drawn.

    `light` points to a directional light (any length; x right, y up, z to the viewer), None is the light of
    the comparison pictures; `environment` is a lat-long .hdr or .exr file that takes its place, `size` the
    picture's pixels on a side, `file` where it goes.
    """

    light: tuple[float, float, float] | None = None
    environment: str | None = None
    size: int = 384
    file: str | None = None

    def __post_init__(self) -> None:
        """Refuse a light without direction and a picture too small to hold a sphere."""
        if self.light is not None and not 0 < math.hypot(*self.light) < math.inf:
            raise BadInput(f"light: found {self.light}, expected a direction x,y,z that is not zero")
        if self.light is not None and self.environment is not None:
            raise BadInput("light: found beside an environment, expected one of the two")
        if not 16 <= self.size <= 8192:
            raise BadInput(f"size: found {self.size}, expected 16 to 8192 pixels")


@dataclass(frozen=True)
class Config:
    """A whole run's settings; every command uses its part."""

    seed: int
    source: SourceSettings
    fit: FitSettings
    evaluate: EvaluateSettings
    compare: CompareSettings
    chart: ChartSettings
    output: OutputSettings
    render: RenderSettings


_SECTIONS: dict[str, Any] = {
    "source": SourceSettings,
    "fit": FitSettings,
    "evaluate": EvaluateSettings,
    "compare": CompareSettings,
    "chart": ChartSettings,
    "output": OutputSettings,
    "render": RenderSettings,
}
# The run's one seed is a key of its own, so [fit] has none.
_TYPES: dict[str, Any] = {"seed": int} | {
    f"{section}.{field.name}": typing.get_type_hints(cls)[field.name]
    for section, cls in _SECTIONS.items()
    for field in fields(cls)
    if (section, field.name) != ("fit", "seed")
}


def load_config(path: str | Path | None = None, given: Mapping[str, Any] | None = None) -> Config:
    """The settings of a run from a TOML file (or none) and the command line's own.

    `given` maps dotted keys ("fit.size", "seed") to values, None where the option was not used. Raises
    BadInput for a file that cannot be read, an unknown key, a wrong type or a value out of range.
    """
    file = {} if path is None else _read(Path(path))
    mine = {key: value for key, value in (given or {}).items() if value is not None}
    values = {**file, **mine}
    seed = values.get("seed", 0)

    def build(section: str) -> Any:
        own = {key.partition(".")[2]: v for key, v in values.items() if key.startswith(f"{section}.")}
        if section == "fit":
            own["seed"] = seed
        try:
            return _SECTIONS[section](**own)
        except BadInput as error:
            name = str(error).partition(":")[0]
            key = name if name == "seed" else f"{section}.{name}"
            if key in file and key not in mine:
                raise BadInput(f"{path}: {key}{str(error)[len(name) :]}") from error
            raise

    return Config(seed=seed, **{section: build(section) for section in _SECTIONS})


def _read(path: Path) -> dict[str, Any]:
    """Dotted keys and checked values of a TOML file."""
    values: dict[str, Any] = {}
    for name, entry in read_toml(path, "a TOML configuration").items():
        if name in _SECTIONS:
            if not isinstance(entry, dict):
                raise BadInput(f"{path}: {name}: found {described(entry)}, expected a section [{name}]")
            values |= {f"{name}.{key}": value for key, value in entry.items()}
        elif isinstance(entry, dict):
            nearest = nearest_key(name, list(_SECTIONS))
            raise BadInput(f"{path}: unknown section [{name}], the nearest known one is [{nearest}]")
        else:
            values[name] = entry
    for key, value in values.items():
        if key not in _TYPES:
            raise BadInput(f"{path}: unknown key {key}, the nearest known one is {nearest_key(key, list(_TYPES))}")
        values[key] = plain_value(value, kinds_of(_TYPES[key]), f"{path}: {key}")
    return values
