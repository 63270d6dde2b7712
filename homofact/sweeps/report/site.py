"""A sweep's results as a static site, which is written whole or not at all and works without a network.

index.html               charts, the table of all fits, the worst fits, changes, failed tasks
materials/DIGEST.html    a page per material
fits/KEY.png …           the pictures of a fit, its textures, and its viewer KEY.html
fits.csv, fits.parquet   every figure of every fit; aside.* and comparison.* likewise, where there are any
site.json                the inputs of the site
"""

import os
import shutil
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from homofact.errors import BadInput
from homofact.evaluation.compare import FitWithErrors
from homofact.evaluation.reopening import NotReopened, Reopened, reopen
from homofact.exporting.images import write_texture_png
from homofact.exporting.manifest import write_json
from homofact.exporting.result import open_result, read_record
from homofact.factor.fitted import Fitted
from homofact.files.atomic import write_text
from homofact.files.folder import check_new_folder, write_folder
from homofact.files.kinds import SITE
from homofact.sweeps.report.comparison import SweepComparison, compared, comparison_rows
from homofact.sweeps.report.index_page import index_html
from homofact.sweeps.report.material_page import FitFiles, material_html
from homofact.sweeps.report.reading import ReadSweep, ReportedFit, read_results
from homofact.sweeps.report.tables import aside_rows, fit_rows, write_table
from homofact.sweeps.work import PICTURE
from homofact.version import __version__
from homofact.web.layers import check_shown
from homofact.web.page import shown_source, write_view
from homofact.web.viewer import Layer

FORMAT, FORMAT_VERSION = "homofact report", 1
MATERIALS, FITS = "materials", "fits"


@dataclass(frozen=True)
class Site:
    """A site that was written: where, its size in bytes and files, and its record for JSON."""

    folder: Path
    size: int
    files: int
    record: dict[str, Any]


def write_site(
    folder: Path,
    out: Path,
    against: Path | None = None,
    *,
    viewers: bool = True,
    force: bool = False,
    notify: Callable[[str, int, int], object] = lambda words, done, all: None,
) -> Site:
    """Write the report of the sweep in `folder`, compared with an earlier one `against`, to the folder `out`.

    `notify(fit, done, total)` is called before each fit. If `viewers` is false, the site has no viewers. Raises
    BadInput as `reading.read_results` for either sweep, and as `files.folder.write_folder`.
    """
    check_new_folder(out, SITE, force)
    if against is not None and os.path.realpath(against) == os.path.realpath(folder):
        raise BadInput(where="against", found=f"{against}, which is the sweep itself", expected="another one")
    sweep = read_results(folder)
    comparison = None if against is None else compared(sweep, read_results(against))
    record = _record(sweep, comparison)

    def fill(place: Path) -> None:
        for name in (MATERIALS, FITS):
            (place / name).mkdir()
        shown: dict[str, FitFiles] = {}
        names = sweep.names()
        for page, fits in sweep.materials().items():
            sources = _Sources()
            for fit in fits:
                notify(fit.task.words, len(shown), len(sweep.fits))
                shown[fit.row.key] = _shown(fit, place / FITS, sources if viewers else None)
            aside = [entry for entry in sweep.aside if entry.task.digest == fits[0].task.digest]
            text = material_html(names[page], fits, shown, aside, sweep.name)
            write_text(place / MATERIALS / f"{page}.html", text)
        files = write_table(place, "fits", fit_rows(sweep.fits))
        if sweep.aside:
            files += write_table(place, "aside", aside_rows(sweep.aside))
        if comparison is not None and (rows := comparison_rows(comparison)):
            files += write_table(place, "comparison", rows)
        write_text(place / "index.html", index_html(sweep, shown, comparison, files))
        write_json(place / SITE.mark, record | {"tables": files})

    write_folder(out, SITE, fill, force)
    sizes = [path.stat().st_size for path in out.rglob("*") if path.is_file()]
    return Site(out, sum(sizes), len(sizes), record)


class _Sources:
    """The sources of one material's fits, opened and tabulated once, and McCool's fits that several pages show."""

    def __init__(self) -> None:
        self._opened: dict[str, tuple[Reopened | NotReopened, Layer | None]] = {}
        self._baselines: dict[str, dict[Any, FitWithErrors]] = {}

    def baselines(self, fitted: Fitted) -> dict[Any, FitWithErrors]:
        """Return McCool's fits of the same split, by their settings."""
        return self._baselines.setdefault(repr(fitted.provenance.get("split")), {})

    def of(self, fitted: Fitted, folder: Path) -> tuple[Reopened | None, Layer | None]:
        """Return the source and its layer; None where it is gone."""
        split = repr(fitted.provenance.get("split"))
        if split not in self._opened:
            try:
                source = reopen(fitted, near=(folder,))
                self._opened[split] = source, shown_source(source)
            except NotReopened as error:
                self._opened[split] = error, None
        source_again, layer = self._opened[split]
        return (None if isinstance(source_again, NotReopened) else source_again), layer


def _shown(fit: ReportedFit, place: Path, sources: _Sources | None) -> FitFiles:
    """Put the files of a fit into `place`. Raises BadInput for a saved fit that cannot be read."""
    key = fit.row.key
    picture = None
    if (fit.folder / PICTURE).is_file():
        picture = f"{key}.png"
        shutil.copyfile(fit.folder / PICTURE, place / picture)
    if not fit.row.textures:
        return FitFiles(picture, (), None, "A model without textures: there is no viewer.")
    fitted = open_result(fit.folder)
    textures = []
    for texture in fitted.textures:
        rows, columns = texture.size
        name = f"{key}_{texture.name}.png"
        write_texture_png(place / name, texture, fitted.channels)
        unread = "" if texture.mask.all() else "; yellow: texels that no pair of directions reads"
        textures.append((name, f"{texture.caption}, {columns} × {rows}{unread}"))
    if sources is None:
        return FitFiles(picture, tuple(textures), None, "")
    try:
        check_shown(fitted.channels)
        source, layer = sources.of(fitted, fit.folder)
    except BadInput as error:
        return FitFiles(picture, tuple(textures), None, f"No viewer: {error}")
    page = write_view(
        fitted,
        place / f"{key}.html",
        source,
        near=(fit.folder,),
        report=read_record(fit.folder),
        shown=layer,
        baselines=sources.baselines(fitted),
    )
    return FitFiles(picture, tuple(textures), f"{key}.html", page.caution and f"In the viewer {page.caution}.")


def _record(sweep: ReadSweep, comparison: SweepComparison | None) -> dict[str, Any]:
    record: dict[str, Any] = {
        "format": FORMAT,
        "format_version": FORMAT_VERSION,
        "version": __version__,
        "sweep": sweep.name,
        "versions": list(sweep.versions),
        "fits": len(sweep.fits),
        "materials": len(sweep.materials()),
        "set_aside": len(sweep.aside),
        "left": sweep.left,
    }
    if comparison is not None:
        record["against"] = {"sweep": comparison.before.name} | comparison.record()
    return record
