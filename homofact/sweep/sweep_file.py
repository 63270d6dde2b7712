"""What a sweep fits, read from strict TOML: sources × methods × bytes × seeds.

name = "paints"                    # the file's name unless given
sources = ["material:*", "paints/*.brdf", "merl_nbrdf.npz#*"]  # named materials, files relative to this one, one
                                   # file's materials; * ? and [ab] match
seeds = [0]                        # of sampling, split and fit
bytes = [3276, 12288]              # optional: a fit each of every method that can be given a size
held_out = 0.2                     # part of the samples kept from the fits
[source]                           # optional, as in a configuration: channels, count, scheme, subset …
[[method]]                         # one or more
method = "search"                  # as for a comparison: mccool:wi+h, ggx:2
label = "quick search"             # what tables call it: the method, and its settings where it stands twice
effort = "quick"                   # and its settings
[svbrdf]                           # for --svbrdf alone: the sources are the clusters of one material
labels = "labels.png"              # which of them, from 0, each texel is made of; .png or .npy, relative to this file
format = "exr"                     # of the texture arrays

`bytes` are the setting of a method that has it. McCool's and Cole's textures get the largest size that they pay for.
Other methods are fitted once, as they are.
"""

import glob
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from fnmatch import fnmatchcase
from pathlib import Path
from typing import TYPE_CHECKING, Any

from homofact.brdf.formats.nbrdf import material_names
from homofact.brdf.materials import MATERIALS
from homofact.brdf.names import MATERIAL_PREFIX
from homofact.containers.names import FORMAT_NAMES
from homofact.errors import BadInput
from homofact.files.reading import read_toml, split_member
from homofact.files.tables import described, nearest_key, plain_value
from homofact.methods.cole import Cole
from homofact.methods.mccool import McCool
from homofact.methods.search import Search
from homofact.methods.table import made, textures_of
from homofact.options import MOST_SEED, options_of
from homofact.sections import EvaluateSettings, SourceSettings

if TYPE_CHECKING:
    from homofact.methods.fitting import Method

_KEYS = ("name", "sources", "seeds", "bytes", "held_out", "source", "method", "svbrdf")
_SVBRDF_KEYS = ("labels", "format")
_RGB_TEXEL = 12
_PATTERN = set("*?[")


@dataclass(frozen=True)
class SvbrdfSection:
    """[svbrdf]: the label map's place, and the format of the texture arrays."""

    labels: Path
    format: str


@dataclass(frozen=True)
class AskedSweep:
    """What is fitted: the sources' words, absolute or material:NAME; methods by label, before bytes and seeds.

    `svbrdf` is there where the sources are the clusters of one material.
    """

    name: str
    sources: tuple[str, ...]
    source: SourceSettings
    methods: "tuple[tuple[str, Method], ...]"
    budgets: tuple[int, ...]
    seeds: tuple[int, ...]
    held_out: float
    svbrdf: SvbrdfSection | None = None

    def fits(self) -> "list[tuple[str, Method]]":
        """(label, method) of all fits of one source, the seed set; a label names the bytes where there are several."""
        found: list[tuple[str, Method]] = []
        for label, method in self.methods:
            sized = [(f"{label}, {count} B", each) for count in self.budgets if (each := with_bytes(method, count))]
            found += sized or [(label, method)]
        return [(label, replace(method, seed=seed)) for label, method in found for seed in self.seeds]


def with_bytes(method: "Method", count: int) -> "Method | None":
    """The method with so many bytes of textures to spend, None for one that cannot be given any.

    Raises BadInput where they are too few.
    """
    if isinstance(method, Search):
        return replace(method, bytes=count)
    if not isinstance(method, McCool | Cole):
        return None
    size = math.isqrt(count // (_RGB_TEXEL * textures_of(method)))
    if size < 2:
        raise BadInput(f"bytes: found {count}, expected enough for {textures_of(method)} textures of 2 x 2 texels")
    return replace(method, size=size)


def read_sweep(path: str | Path) -> AskedSweep:
    """The sweep in a TOML file.

    Raises BadInput for a file that cannot be read, unknown keys, wrong types and values, sources that are not there and
    patterns that match nothing, and a method or source named twice.
    """
    file = Path(path)
    table = read_toml(file, "a sweep in TOML")
    place = f"{file}: "
    for key in table:
        if key not in _KEYS:
            raise BadInput(f"{place}unknown key {key}, the nearest known one is {nearest_key(key, _KEYS)}")
    name = plain_value(table.get("name", file.stem), (str,), f"{place}name")
    if not name.strip():
        raise BadInput(f"{place}name: found an empty one, expected a name")
    try:
        methods = _methods(table.get("method"))
        source = _section("source", SourceSettings, table.get("source", {}))
        if source.path is not None:
            raise BadInput("source.path: found one, expected sources = [...]")
        held_out = _section("", EvaluateSettings, {"held_out": table.get("held_out", EvaluateSettings().held_out)})
    except BadInput as error:
        raise BadInput(f"{place}{error}") from error
    asked = AskedSweep(
        name,
        _sources(table.get("sources"), file.parent, place),
        source,
        methods,
        _numbers(table, "bytes", (), 1, 2**40, place),
        _numbers(table, "seeds", (0,), 0, MOST_SEED, place),
        held_out.held_out,
        None if "svbrdf" not in table else _svbrdf(table["svbrdf"], file.parent, place),
    )
    try:
        asked.fits()
    except BadInput as error:
        raise BadInput(f"{place}{error}") from error
    return asked


def _section(name: str, kind: type[Any], table: Any) -> Any:
    if not isinstance(table, Mapping):
        raise BadInput(f"{name}: found {described(table)}, expected a section [{name}]")
    known = list(options_of(kind))
    for key in table:
        if key not in known:
            raise BadInput(f"unknown key {name}.{key}, the nearest known one is {name}.{nearest_key(key, known)}")
    try:
        return kind(**table)
    except BadInput as error:
        raise BadInput(f"{name}.{error}" if name else str(error)) from error


def _svbrdf(table: Any, folder: Path, place: str) -> SvbrdfSection:
    if not isinstance(table, Mapping):
        raise BadInput(f"{place}svbrdf: found {described(table)}, expected a section [svbrdf]")
    for key in table:
        if key not in _SVBRDF_KEYS:
            nearest = nearest_key(key, _SVBRDF_KEYS)
            raise BadInput(f"{place}unknown key svbrdf.{key}, the nearest known one is svbrdf.{nearest}")
    if "labels" not in table:
        raise BadInput(f'{place}svbrdf.labels: found none, expected labels = "FILE"')
    labels, form = (
        plain_value(table.get(key, usual), (str,), f"{place}svbrdf.{key}")
        for key, usual in (("labels", ""), ("format", FORMAT_NAMES[0]))
    )
    if form not in FORMAT_NAMES:
        raise BadInput(f"{place}svbrdf.format: found {form!r}, expected one of {', '.join(FORMAT_NAMES)}")
    return SvbrdfSection(folder / labels, form)


def _methods(tables: Any) -> "tuple[tuple[str, Method], ...]":
    if not isinstance(tables, list) or not tables:
        words = "none" if tables in (None, []) else described(tables)
        raise BadInput(f"method: found {words}, expected one or more sections [[method]]")
    found: dict[str, Method] = {}
    for number, table in enumerate(tables):
        where = f"method[{number}]"
        if not isinstance(table, Mapping):
            raise BadInput(f"{where}: found {described(table)}, expected a section [[method]]")
        settings = dict(table)
        label = settings.pop("method", None)
        if not isinstance(label, str):
            found_words = "none" if label is None else described(label)
            raise BadInput(f"{where}.method: found {found_words}, expected a method's name")
        for key in ("seed", "bytes"):
            if key in settings:
                instead = "seeds = [...]" if key == "seed" else "bytes = [...]"
                raise BadInput(f"{where}.{key}: found {settings[key]}, expected {instead} above all sections")
        words = plain_value(settings.pop("label", label), (str,), f"{where}.label")
        if words in found and "label" not in table:
            words = ", ".join((label, *(f"{key} {value}" for key, value in settings.items())))
        if words in found:
            raise BadInput(f'{where}: found {words!r} twice, expected another label = "..."')
        try:
            found[words] = made(label, settings)
        except BadInput as error:
            raise BadInput(f"{where}.{error}") from error
    return tuple(found.items())


def _sources(given: Any, folder: Path, place: str) -> tuple[str, ...]:
    if not isinstance(given, list) or not given or not all(isinstance(each, str) for each in given):
        words = "none" if given in (None, []) else described(given)
        raise BadInput(f"{place}sources: found {words}, expected an array of files and material:NAME")
    found: dict[str, None] = {}
    for number, words in enumerate(given):
        some = _matching(words, folder)
        if not some:
            what = "a material" if words.startswith(MATERIAL_PREFIX) else f"a file under {folder}"
            raise BadInput(f"{place}sources[{number}]: found {words!r}, which matches nothing; expected {what}")
        found |= dict.fromkeys(some)
    return tuple(found)


def _matching(words: str, folder: Path) -> list[str]:
    """The sources that words, perhaps a pattern, stand for, in the order of their names."""
    if words.startswith(MATERIAL_PREFIX):
        wanted = words.removeprefix(MATERIAL_PREFIX)
        return [MATERIAL_PREFIX + name for name in sorted(MATERIALS) if fnmatchcase(name, wanted)]
    file, _, member = words.rpartition("#")
    # Folders and files may have a "#" in their own names.
    if set(member) & _PATTERN and file and (folder / file).is_file():
        whole = (folder / file).resolve()
        return [f"{whole}#{name}" for name in material_names(whole) if fnmatchcase(name, member)]
    if not set(words) & _PATTERN:
        return [str((folder / words).resolve())] if Path(split_member(folder / words)[0]).exists() else []
    return [str((folder / each).resolve()) for each in sorted(glob.glob(words, root_dir=folder, recursive=True))]


def _numbers(
    table: Mapping[str, Any], key: str, usual: Sequence[int], least: int, most: int, place: str
) -> tuple[int, ...]:
    found = table.get(key, list(usual))
    right = isinstance(found, list) and all(type(each) is int and least <= each <= most for each in found)
    if not right or len(set(found)) != len(found) or (key == "seeds" and not found):
        few = "one or more whole numbers" if key == "seeds" else "whole numbers"
        raise BadInput(f"{place}{key}: found {found}, expected {few} of at least {least}, none twice")
    return tuple(found)


def settings_record(settings: SourceSettings) -> dict[str, Any]:
    """How sources are opened, JSON-able."""
    return {key: value for key, value in asdict(settings).items() if key != "path"}
