"""The CSV of a chart: one line per finished run, and the rules that match a line with a run.

A line matches a run only if everything that could change the result agrees: the samples (by hash), every setting that
the method uses, the held-out fraction and, since times are compared too, the machine and the version.
"""

import csv
import os
import typing
from collections.abc import Callable
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

from homofact.errors import Advice, BadInput
from homofact.evaluation.appearance import Figures
from homofact.evaluation.grid import content_key
from homofact.evaluation.metric_table import LIGHT, SIX
from homofact.evaluation.metrics import SixErrors
from homofact.files.atomic import write_text
from homofact.files.reading import read_bytes
from homofact.files.tables import csv_rows, csv_text
from homofact.methods.search import Search
from homofact.version import __version__


def series_name(label: str, search: str) -> str:
    """Return the name of a series: the method, and how it refines projections if that is not the default.

    Examples
    --------
    >>> series_name("search", "gradient"), series_name("search", "powell"), series_name("ggx", "")
    ('search', 'search (powell)', 'ggx')
    """
    return label if search in ("", Search.search) else f"{label} ({search})"


def run_name(series: str, textures: int, size: int) -> str:
    """Return the name of a run: "cole, 2 × 16²", or "ggx" for a model without textures, whose `size` is 0."""
    return f"{series}, {textures} × {size}²" if size else series


@dataclass(frozen=True)
class Identity:
    """The values that decide whether a line of a CSV matches a run."""

    samples_sha256: str
    settings: str
    machine: str
    version: str

    @property
    def key(self) -> str:
        """The key that identifies the run."""
        return content_key(asdict(self))


@dataclass(frozen=True)
class ChartRow:
    """A finished run, as a line of the CSV.

    `textures_asked` exceeds `textures` if the search found that another texture does not reduce the error. Times are in
    seconds, and `bytes` counts float32 texels. `held_out_part` is the held-out fraction of the samples. `seed` is the
    seed of the fit and `split_seed` that of the held-out samples. `samples_sha256` and `settings` (all that the method
    uses) identify the run. The errors have the units of `metrics`. Without an `appearance`, its cells are empty.
    """

    source: str
    label: str
    search: str
    textures_asked: int
    size: int
    textures: int
    bytes: int
    fetches: int
    evaluations: int
    status: str
    seconds_read: float
    seconds_fit: float
    seconds_total: float
    held_out: SixErrors
    train: SixErrors
    appearance: Figures
    epsilon: float
    seed: int
    split_seed: int
    samples: int
    channels: str
    held_out_part: float
    notes: str
    settings: str
    samples_sha256: str
    machine: str
    version: str

    @property
    def series(self) -> str:
        """What it shares with its like in a chart: the method, and the search where the method takes one."""
        return series_name(self.label, self.search)

    @property
    def name(self) -> str:
        """The name of the run for messages, with the number of textures that the fit has."""
        return run_name(self.series, self.textures, self.size)

    @property
    def is_reference(self) -> bool:
        """Whether this is McCool's own factorization, with which charts compare other methods."""
        return self.label == "mccool"

    def record(self) -> dict[str, Any]:
        """Return the JSON form: that of a comparison's row, plus the other columns of the CSV."""
        plain = {field.name: getattr(self, field.name) for field in fields(self) if field.name not in _GROUPS}
        seconds = {name: plain.pop(f"seconds_{name}") for name in ("read", "fit", "total")}
        return {
            **plain,
            "method": self.label.partition(":")[0],
            "channels": self.channels.split(),
            "seconds": seconds,
            "error": {"train": self.train.record(), "held_out": self.held_out.record()},
            "appearance": dict(self.appearance),
        }


def _maybe(cell: str) -> float | None:
    """A number that may be missing."""
    return float(cell) if cell else None


# The fields of `ChartRow` that hold several metrics: their columns' prefix, the metrics, and how a cell is read.
_GROUPS: dict[str, tuple[str, tuple[str, ...], Callable[[str], Any]]] = {
    "held_out": ("held_out_", SIX, float),
    "train": ("train_", SIX, float),
    "appearance": ("", LIGHT, _maybe),
}


def _columns() -> dict[str, tuple[str, str, Callable[[str], Any]]]:
    """Of the CSV: each column's field of `ChartRow`, its metric (empty for a plain field) and how its cell is read."""
    types = typing.get_type_hints(ChartRow)
    columns: dict[str, tuple[str, str, Callable[[str], Any]]] = {}
    for name in types:
        prefix, metrics, kind = _GROUPS.get(name, (name, ("",), types[name]))
        columns |= {f"{prefix}{metric}": (name, metric, kind) for metric in metrics}
    return columns


_COLUMNS = _columns()


class ChartLedger:
    """The CSV file of a chart: its existing lines, plus one line for every run that finishes.

    Lines with other settings stay in the file and never match a run.
    """

    def __init__(self, path: str | os.PathLike[str], fresh: bool = False) -> None:
        """Read what `path` holds, or with `fresh` begin anew (the file is replaced with the first line).

        A last line that was cut is left out. Raises BadInput for a file that is none of ours, is damaged otherwise, or
        was written by another version.
        """
        self.path = Path(path)
        self._lines: dict[str, ChartRow] = {}
        if not fresh and self.path.exists():
            self._lines = {_key_of(row): row for row in _read(self.path)}

    def __len__(self) -> int:
        """How many lines there are."""
        return len(self._lines)

    def find(self, wanted: Identity) -> ChartRow | None:
        """Return the line that matches this run, or None."""
        return self._lines.get(wanted.key)

    def append(self, row: ChartRow) -> None:
        """Append a line and write it to the file at once. Raises BadInput if the file cannot be written."""
        self._lines[_key_of(row)] = row
        text = csv_text([list(_COLUMNS), *(_cells(line) for line in self._lines.values())])
        self.path.parent.mkdir(parents=True, exist_ok=True)
        write_text(self.path, text)


def _key_of(row: ChartRow) -> str:
    return Identity(**{field.name: getattr(row, field.name) for field in fields(Identity)}).key


def _cells(row: ChartRow) -> list[Any]:
    plain = {name: getattr(row, name) for name in ChartRow.__dataclass_fields__}
    groups = {"held_out": row.held_out.record(), "train": row.train.record(), "appearance": row.appearance}
    return [groups[name][metric] if metric else plain[name] for name, metric, _ in _COLUMNS.values()]


def _read(path: Path) -> list[ChartRow]:
    """The whole lines of a chart's CSV; floats are written in full, so they come back as they were."""
    remedy = f"a new folder, or {Advice('force', True)} to begin anew"
    data = read_bytes(path, "a chart's CSV", may_be_empty=True)
    try:
        text = data.decode("utf-8")
        lines = csv_rows(text)
        if text and not text.endswith("\n"):
            # A line without its end was cut: its run is done again, the others stand.
            lines.pop()
    except (ValueError, csv.Error) as error:
        raise BadInput(f"cannot be read as a chart's CSV ({error})", where=path, expected=remedy) from error
    if not lines or lines[0] != list(_COLUMNS):
        raise BadInput(where=path, found=f"other columns than those of homofact {__version__}", expected=remedy)
    rows = []
    for number, cells in enumerate(lines[1:], 2):
        if len(cells) != len(_COLUMNS):
            found = f"{len(cells)} cells of {len(_COLUMNS)}"
            raise BadInput(where=f"{path}, line {number}", found=found, expected=remedy)
        plain: dict[str, Any] = {}
        for (column, (name, metric, kind)), cell in zip(_COLUMNS.items(), cells, strict=True):
            try:
                value = kind(cell)
            except ValueError as error:
                raise BadInput(f"{column} is {cell!r}", where=f"{path}, line {number}", expected=remedy) from error
            if metric:
                plain.setdefault(name, {})[metric] = value
            else:
                plain[name] = value
        for part in ("held_out", "train"):
            plain[part] = SixErrors(**plain[part])
        row = ChartRow(**plain)
        if row.version != __version__:
            found = f"a result of homofact {row.version}"
            raise BadInput(where=f"{path}, line {number}", found=found, expected=remedy)
        rows.append(row)
    return rows
