"""One fit of a sweep, and its unique key.

The key is a digest of everything that can change the fit: the bytes of the source, the settings for opening it, the
method with all its settings, the held-out share, and the version of homofact. The key names the result folder, so a
folder with this name contains the same fit on any machine.
"""

import hashlib
import re
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from dataclasses import fields as dataclass_fields
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from homofact.brdf.source_names import MATERIAL_PREFIX
from homofact.errors import BadInput
from homofact.evaluation.grid import content_key
from homofact.files.fields import Fields
from homofact.files.reading import check_readable, split_member
from homofact.methods.table import ALL_METHODS
from homofact.sections import SourceSettings
from homofact.sweeps.sweep_file import AskedSweep, settings_record
from homofact.version import __version__

if TYPE_CHECKING:
    from homofact.methods.method import Method

_PIECE = 1 << 20


@dataclass(frozen=True)
class Task:
    """One fit: the source, its digest and settings, the method's label, name and settings, and the held-out share."""

    source: str
    digest: str
    opening: Mapping[str, Any]
    label: str
    method: str
    settings: Mapping[str, Any]
    held_out: float
    version: str = __version__

    @cached_property
    def key(self) -> str:
        """The unique key of the fit: 32 hexadecimal digits. The folder of the source does not change it."""
        facts = {name: value for name, value in self.record().items() if name not in ("source", "label")}
        return content_key(facts)

    @property
    def name(self) -> str:
        """The source without its folder."""
        if self.source.startswith(MATERIAL_PREFIX):
            return self.source.removeprefix(MATERIAL_PREFIX)
        return Path(self.source).name

    @property
    def words(self) -> str:
        """The source, the method and the seed, for messages."""
        return f"{self.name}, {self.label}, seed {self.settings['seed']}"

    def is_here(self) -> bool:
        """Return whether this machine has the source, unchanged."""
        named = self.source.startswith(MATERIAL_PREFIX)
        return named or (Path(split_member(self.source)[0]).exists() and source_digest(self.source) == self.digest)

    def fit_method(self) -> "Method":
        """Return the method object. Raises BadInput for settings that the method does not have."""
        return ALL_METHODS[self.method](**self.settings)

    def source_settings(self) -> SourceSettings:
        """Return the settings for opening the source."""
        return SourceSettings(**self.opening)

    def record(self) -> dict[str, Any]:
        """Return the JSON form; `task_of` reads it."""
        return {**asdict(self), "opening": _plain(self.opening), "settings": _plain(self.settings)}


def task_of(record: Mapping[str, Any]) -> Task:
    """Check every entry of a record, and return its task. Raises BadInput for an invalid record."""
    fields = Fields("task: ", dict(record))
    unknown = record.keys() - {each.name for each in dataclass_fields(Task)}
    if unknown:
        raise BadInput(where="task", found=f"an entry {min(unknown)!r}", expected="a task's own")
    digest = fields.text("digest")
    if not re.fullmatch(r"[0-9a-f]{64}", digest):
        fields.refuse("digest", "64 hexadecimal digits")
    settings = fields.inner("settings")
    # Seeds are whole numbers of any size below 2⁶³.
    settings.whole("seed", 0, 2**63)
    held_out = fields.number("held_out", above=0)
    if held_out >= 1:
        fields.refuse("held_out", "a number below 1")
    task = Task(
        fields.text("source"), digest, fields.inner("opening").found, fields.text("label"),
        fields.text("method", tuple(ALL_METHODS)), settings.found, held_out, fields.text("version"),
    )  # fmt: skip
    try:
        _ = task.key
    except ValueError as error:
        raise BadInput(where="task", found="a number that is not finite", expected="finite numbers") from error
    return task


def tasks_of(asked: AskedSweep) -> list[Task]:
    """Return all fits of a sweep, source by source. Raises BadInput for a source that cannot be read."""
    opening = settings_record(asked.source)
    fits = [(label, method.name, _plain(asdict(method))) for label, method in asked.fits()]
    tasks = []
    for source in asked.sources:
        digest = source_digest(source)
        tasks += [Task(source, digest, opening, *fit, asked.held_out) for fit in fits]
    return tasks


def source_digest(source: str) -> str:
    """Return the SHA-256 of a source: of a file's bytes, of a folder's files, or of a named material's name.

    Raises BadInput for a file that cannot be read.
    """
    digest = hashlib.sha256()
    if source.startswith(MATERIAL_PREFIX):
        digest.update(source.encode())
        return digest.hexdigest()
    name, member = split_member(source)
    if member is not None:
        digest.update(f"{member}\n".encode())
    place = Path(name)
    files = sorted(path for path in place.rglob("*") if path.is_file()) if place.is_dir() else [place]
    for file in files:
        check_readable(file, "a BRDF file or material:NAME")
        if place.is_dir():
            digest.update(f"{file.relative_to(place)}\n".encode())
        with file.open("rb") as stream:
            while piece := stream.read(_PIECE):
                digest.update(piece)
    return digest.hexdigest()


def _plain(values: Mapping[str, Any]) -> dict[str, Any]:
    return {key: list(value) if isinstance(value, tuple) else value for key, value in values.items()}
