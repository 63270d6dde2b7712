"""Reporting: a sweep's results as a static site."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from homofact.api.progress import Progress, ProgressSteps
from homofact.api.subjects import Place


@dataclass(frozen=True)
class ReportResult:
    """A site that was written.

    Attributes
    ----------
    sweep : Path
        The sweep's folder.
    folder : Path
        The folder of the site.
    files, size : int
        How many files it has, and their bytes.
    left_out : str
        What was not written because a library is missing; otherwise empty.
    facts : dict
        The rest of the JSON form.
    """

    sweep: Path
    folder: Path
    files: int
    size: int
    left_out: str
    facts: dict[str, Any] = field(repr=False)

    @property
    def index(self) -> Path:
        """The page to open."""
        return self.folder / "index.html"

    def record(self) -> dict[str, Any]:
        """Return the JSON form."""
        about = {"folder": str(self.sweep), "site": str(self.folder), "files": self.files, "bytes": self.size}
        return about | self.facts


def report(
    sweep: Place,
    to: Place,
    *,
    against: Place | None = None,
    viewers: bool = True,
    force: bool = False,
    progress: Progress | None = None,
) -> ReportResult:
    """Write the report of a sweep: a site that opens without network.

    Parameters
    ----------
    sweep : path
        The folder of a sweep.
    to : path
        The folder of the site, which must be new (unless `force`).
    against : path, optional
        An earlier sweep: what got better or worse since.
    viewers : bool, optional
        Write a page like `view`'s for every fit with textures.
    force : bool, optional
        Replace a report that is there.
    progress : callable, optional
        Called with a `ProgressStep` on the way.

    Returns
    -------
    ReportResult
        The page to open, and how large the site is.

    Raises
    ------
    BadInput
        For a folder without a sweep, results that were modified, and a site folder that already contains files.

    Examples
    --------
    >>> lines = ['sources = ["material:phong-10"]', '[source]', 'count = 500', '[[method]]', 'method = "mccool"']
    >>> _ = Path("sweep.toml").write_text("\\n".join([*lines, "size = 4"]))
    >>> found = homofact.sweep("sweep.toml", "swept", workers=1)
    >>> homofact.report("swept", "site", viewers=False).index.name
    'index.html'
    """
    from homofact.files.folder import check_new_folder
    from homofact.files.kinds import SITE

    folder = Path(to)
    check_new_folder(folder, SITE, force)

    from homofact.sweeps.report.site import write_site
    from homofact.sweeps.report.tables import NO_PARQUET, parquet_there

    steps = ProgressSteps(progress)
    steps.stage("reading the results")
    earlier = None if against is None else Path(against)
    site = write_site(Path(sweep), folder, earlier, viewers=viewers, force=force, notify=steps.run)
    return ReportResult(Path(sweep), folder, site.files, site.size, "" if parquet_there() else NO_PARQUET, site.record)
