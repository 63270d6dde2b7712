"""The fits of a sweep, read from strict TOML: sources × methods × bytes × seeds.

name = "paints"                    # Default: the name of the file
sources = ["material:*", "paints/*.brdf", "merl_nbrdf.npz#*"]  # named materials, files relative to this one, one
                                   # file's materials; * ? and [ab] match
seeds = [0]                        # of sampling, split and fit
bytes = [3276, 12288]              # optional: one fit for each, with every method that has a size
held_out = 0.2                     # share of held-out samples
[source]                           # optional, as in a configuration: channels, count, scheme, subset …
[[method]]                         # one or more
method = "search"                  # as for a comparison: mccool:wi+h, ggx:2
label = "quick search"             # its name in tables. Default: the method, with settings if it appears twice
effort = "quick"                   # and its settings
[svbrdf]                           # only for an SVBRDF: the sources are the clusters of one material
labels = "labels.png"              # cluster of each texel, from 0; .png or .npy, relative to this file
format = "exr"                     # of the texture arrays

`bytes` sets the setting of the same name if a method has it. McCool's and Cole's textures get the largest size within
the bytes. Other methods are fitted once, unchanged.
"""

import glob
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from fnmatch import fnmatchcase
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from homofact.brdf.formats.nbrdf import material_names
from homofact.brdf.materials import MATERIALS
from homofact.brdf.source_names import HELD_OUT, MATERIAL_PREFIX
from homofact.containers.format_names import FORMAT_NAMES
from homofact.errors import BadInput
from homofact.files.reading import read_toml, split_member
from homofact.methods.table import made, with_bytes
from homofact.sections import EvaluateSettings, SourceSettings
from homofact.settings.kinds import SWEEP, check_kind
from homofact.settings.options import MOST_SEED, none_twice, option, required
from homofact.settings.tables import read_table

if TYPE_CHECKING:
    from homofact.methods.method import Method

_PATTERN = set("*?[")


@dataclass(frozen=True)
class SvbrdfSection:
    """[svbrdf]: the label map's place, and the format of the texture arrays."""

    labels: Path
    format: str


@dataclass(frozen=True)
class _SvbrdfTable:
    labels: str = required("Which of the sources each texel is made of, from 0; .png or .npy")
    format: str = option(FORMAT_NAMES[0], "Format of the texture arrays", choices=FORMAT_NAMES)


@dataclass(frozen=True)
class SweepMethodTable:
    """One [[method]]: its name, its label in tables, and its settings."""

    method: str = required("How it is fitted, as for a comparison")
    label: str | None = option(None, "What tables call it")
    settings: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Refuse settings that stand above all sections. Raises BadInput."""
        for name, above in (("seed", "seeds"), ("bytes", "bytes")):
            if name in self.settings:
                expected = f"{above} = [...] above all sections"
                raise BadInput(where=name, found=self.settings[name], expected=expected)


@dataclass(frozen=True, kw_only=True)
class SweepTable(EvaluateSettings):
    """The whole file."""

    held_out: float = option(HELD_OUT, "Share of the samples held out from each fit", above=0, below=1)
    name: str | None = option(None, "The sweep's name", none="the file's")
    sources: tuple[str, ...] = required("Files, or material:NAME; * ? and [ab] match")
    seeds: tuple[int, ...] = option(
        (0,), "Of sampling, split and fit", least=0, most=MOST_SEED, expected_instead=none_twice
    )
    bytes: tuple[int, ...] = option(
        (), "A fit each of every method that has a size", least=1, most=2**40, expected_instead=none_twice
    )
    source: SourceSettings = field(default_factory=SourceSettings)
    method: tuple[SweepMethodTable, ...]
    svbrdf: _SvbrdfTable | None = None

    # No annotation, which would make it a key of the file.
    INSTEAD = MappingProxyType({"epsilon": "it is a setting of each [[method]]"})

    def __post_init__(self) -> None:
        """Refuse what names nothing to fit. Raises BadInput."""
        super().__post_init__()
        if self.name is not None and not self.name.strip():
            raise BadInput(where="name", found="an empty one", expected="a name")
        if self.source.path is not None:
            raise BadInput(where="source.path", found=repr(self.source.path), expected="sources = [...]")
        for name in ("sources", "seeds", "method"):
            if not getattr(self, name):
                raise BadInput(where=name, found="none", expected="at least one")


@dataclass(frozen=True)
class AskedSweep:
    """The requested fits: sources as absolute paths or material:NAME; methods by label, without bytes and seeds.

    `svbrdf` is set if the sources are the clusters of one material.
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
        """Return (label, method with seed) of all fits of one source; a label contains the bytes, if given."""
        found: list[tuple[str, Method]] = []
        for label, method in self.methods:
            sized = [(f"{label}, {count} B", each) for count in self.budgets if (each := with_bytes(method, count))]
            found += sized or [(label, method)]
        return [(label, replace(method, seed=seed)) for label, method in found for seed in self.seeds]


def read_sweep(path: str | Path) -> AskedSweep:
    """Return the sweep in a TOML file.

    Raises BadInput for a file that cannot be read, unknown keys, wrong types and values, missing sources, patterns that
    match nothing, and a label that two methods have. A source that is given twice is fitted once.
    """
    file = Path(path)
    given = read_toml(file, "a sweep in TOML")
    check_kind(given, SWEEP, file)
    table = read_table(SweepTable, given, f"{file}: ")
    try:
        asked = AskedSweep(
            file.stem if table.name is None else table.name,
            _sources(table.sources, file.parent),
            table.source,
            _methods(table.method),
            table.bytes,
            table.seeds,
            table.held_out,
            None if table.svbrdf is None else SvbrdfSection(file.parent / table.svbrdf.labels, table.svbrdf.format),
        )
        asked.fits()
    except BadInput as error:
        raise error.at(file) from error
    return asked


def _methods(tables: tuple[SweepMethodTable, ...]) -> "tuple[tuple[str, Method], ...]":
    found: dict[str, Method] = {}
    for number, table in enumerate(tables):
        where = f"method[{number}]"
        label = table.method if table.label is None else table.label
        if label in found and table.label is None:
            label = ", ".join((label, *(f"{key} {value}" for key, value in table.settings.items())))
        if label in found:
            raise BadInput(where=where, found=f"{label!r} twice", expected='another label = "..."')
        try:
            found[label] = made(table.method, table.settings)
        except BadInput as error:
            several = isinstance(table.settings.get(error.where), list | tuple)
            known = error.with_hint("for several values, write one [[method]] each") if several else error
            raise known.at(where, ".") from error
    return tuple(found.items())


def _sources(given: tuple[str, ...], folder: Path) -> tuple[str, ...]:
    found: dict[str, None] = {}
    for number, words in enumerate(given):
        some = _matching(words, folder)
        if not some:
            what = "a material" if words.startswith(MATERIAL_PREFIX) else f"a file under {folder}"
            raise BadInput(where=f"sources[{number}]", found=f"{words!r}, which matches nothing", expected=what)
        found |= dict.fromkeys(some)
    return tuple(found)


def _matching(words: str, folder: Path) -> list[str]:
    """Return the sources that match `words`, which may be a pattern, sorted by name."""
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
    return [str((folder / path).resolve()) for path in sorted(glob.glob(words, root_dir=folder, recursive=True))]


def settings_record(settings: SourceSettings) -> dict[str, Any]:
    """Return the settings for opening sources, JSON-able."""
    return {key: value for key, value in asdict(settings).items() if key != "path"}
