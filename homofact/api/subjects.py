"""Arguments of the public functions: a fit as an object or a path, and a source in every form that `fit` accepts.

Cheap checks run first, before data and libraries are loaded.
"""

import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from homofact.api.places import check_measurement, check_result
from homofact.api.plan_facts import plan_entry
from homofact.errors import BadInput
from homofact.methods.search import Search
from homofact.methods.table import made
from homofact.sections import SourceSettings

if TYPE_CHECKING:
    from homofact.brdf.source import Source
    from homofact.evaluation.reopening import Reopened
    from homofact.factor.fitted import Fitted
    from homofact.methods.method import Method

Place = str | os.PathLike[str]


@dataclass(frozen=True)
class GivenFit:
    """A fit that was passed to a function: in memory, or at a path that is checked but not yet opened.

    `words` is its name in records. `near` are the folders in which homofact looks for its source.
    """

    words: str
    place: Path | None
    found: Any = None

    @property
    def near(self) -> tuple[Path, ...]:
        """The folder of the fit, if it has one, and the folder of its source, if a plan names it."""
        if self.place is None:
            return ()
        folder = self.place if self.place.is_dir() else self.place.parent
        entry = plan_entry(folder)
        source = None if entry is None else entry.get("source")
        return (folder, Path(source).parent) if isinstance(source, str) else (folder,)

    @property
    def verdict(self) -> dict[str, Any] | None:
        """The verdict from the fit's report, plan or export, as "trusted" and "summary"; None without one.

        The 8-bit textures of a plan have no report, so their verdict comes from plan.json.
        """
        if self.place is None:
            own = getattr(self.found, "verdict", None)
            return None if own is None else {"trusted": own.trusted, "summary": own.summary}

        from homofact.exporting.exported_reader import export_record
        from homofact.exporting.result import read_record

        folder = self.place if self.place.is_dir() else self.place.parent
        for record in (read_record(self.place), plan_entry(folder) or {}, export_record(folder)):
            found = record.get("verdict")
            if isinstance(found, dict) and isinstance(found.get("summary"), str):
                return {"trusted": bool(found.get("trusted")), "summary": found["summary"]}
        return None

    @property
    def exported(self) -> bool:
        """Whether it is an export for an engine."""
        return self.stored_bytes is not None

    @property
    def stored_bytes(self) -> int | None:
        """The stored size of an export's texels in bytes; None for any other fit."""
        if self.place is None:
            return None

        from homofact.exporting.exported_reader import export_record

        folder = self.place if self.place.is_dir() else self.place.parent
        cost = export_record(folder).get("cost")
        found = cost.get("bytes") if isinstance(cost, dict) else None
        return found if isinstance(found, int) else None

    def open(self) -> "Fitted":
        """Return the stored fit. Raises BadInput if there is no fit."""
        if self.place is not None:
            from homofact.exporting.result import open_result

            return open_result(self.place)
        return getattr(self.found, "factorization", self.found)


def given_fit(fit: Any) -> GivenFit:
    """Return the `GivenFit` for an object, a result folder or a saved file.

    Raises BadInput for anything else, and a missing file.
    """
    if isinstance(fit, str | os.PathLike):
        place = Path(fit)
        check_result(place)
        return GivenFit(str(place), place)
    kind = isinstance(fit, type)
    if kind or not callable(getattr(fit, "evaluate", None)) or not callable(getattr(fit, "save", None)):
        raise BadInput(where="fit", found=_kind(fit), expected="a fit, its folder or its .npz file")
    return GivenFit("fit", None, fit)


def given_source(source: Any) -> Any:
    """Check a source without opening it; return a path as text, anything else unchanged. Raises BadInput."""
    if isinstance(source, SourceSettings):
        if source.path is None:
            raise BadInput("none given", where="source", expected="a file or material:NAME")
        check_measurement(source.path)
        return source
    if isinstance(source, str | os.PathLike):
        text = os.fspath(source)
        check_measurement(text)
        return text
    if source is None or isinstance(source, (bool, int, float, bytes, type)):
        raise BadInput(
            where="source", found=_kind(source), expected="a file, material:NAME, a Source, Samples or f(wi, wo)"
        )
    return source


def given_method(method: Any, settings: Mapping[str, Any]) -> "Method":
    """Return the method; without one, `Search` with these settings. Raises BadInput for anything else."""
    if method is None:
        return made(Search.name, settings)
    if isinstance(method, type) or not hasattr(method, "fit"):
        found = f"the class {method.__name__}" if isinstance(method, type) else repr(method)
        raise BadInput(where="method", found=found, expected="one such as homofact.McCool(size=16)")
    if settings:
        as_in = f"{type(method).__name__}({', '.join(f'{name}=...' for name in settings)})"
        found = f"a method and {', '.join(settings)} beside it"
        raise BadInput(where="method", found=found, expected=f"a method with its settings, as in {as_in}")
    return method


def open_given(source: Any, seed: int = 0) -> "Source":
    """Open a source that `given_source` accepted; `seed` draws the samples of a model. Raises BadInput."""
    from homofact.brdf.source import source_of

    if isinstance(source, SourceSettings):
        return source.opening(seed).open()
    return source_of(source, seed=seed)


def check_held_out(part: float) -> None:
    """Raise BadInput if the held-out part is not between 0 and 1, both excluded."""
    if not 0 < part < 1:
        raise BadInput(
            where="held_out",
            found=f"{part:g}",
            expected="between 0 and 1: held-out samples show which fit is better (only factorize takes 0)",
        )


def reopened_or_why(fitted: "Fitted", source: Any, near: tuple[Path, ...]) -> "Reopened | str":
    """Return the fit's source opened again, or why it cannot be.

    Raises BadInput if you give a source that does not exist.
    """
    from homofact.evaluation.reopening import NotReopened, reopen

    try:
        return reopen(fitted, source if source is None or isinstance(source, str) else open_given(source), near)
    except NotReopened as error:
        return str(error)


def subset_of(source: Any) -> int:
    """Return the maximum number of samples for a fit, from the source's settings; 0 means all."""
    return source.subset if isinstance(source, SourceSettings) else 0


def _kind(found: Any) -> str:
    return f"the class {found.__name__}" if isinstance(found, type) else type(found).__name__
