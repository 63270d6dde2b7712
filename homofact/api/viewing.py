"""Viewing: one self-contained HTML file of a fit, a relit scene or a prepared scene."""

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from homofact.api.places import check_file
from homofact.api.progress import Progress, ProgressSteps
from homofact.api.subjects import Place, given_fit, given_source, open_given
from homofact.errors import Advice, BadInput
from homofact.files.kinds import FACTORIZATION, PREPARED, RELIT

if TYPE_CHECKING:
    from homofact.errors import Report

NAME = "view.html"


@dataclass(frozen=True)
class ViewResult:
    """A page that was written.

    Attributes
    ----------
    result : str
        The path of the fit or scene; "fit" for a fit in memory.
    file : Path
        The page.
    size : int
        Its bytes.
    titles : tuple of str
        For a fit, the titles of the pictures. For a scene, its contents in words.
    caution : str
        The reason why the page shows only the fit, or a warning that the fit may have seen the samples of its errors;
        otherwise empty.
    source_found : bool
        Whether the fit's source was found.
    reports : dict of Report
        The reports of the fits that were made for the page, by title.
    facts : dict
        The rest of the JSON form.
    """

    result: str
    file: Path
    size: int
    titles: tuple[str, ...]
    caution: str = ""
    source_found: bool = True
    reports: "Mapping[str, Report]" = field(repr=False, default_factory=dict)
    facts: Mapping[str, Any] = field(repr=False, default_factory=dict)

    def record(self) -> dict[str, Any]:
        """Return the JSON form."""
        return {"result": self.result, **self.facts}


def view(
    fit: Any,
    to: Place | None = None,
    *,
    source: Any = None,
    mesh: Place | None = None,
    skies: Sequence[Place] = (),
    force: bool = False,
    progress: Progress | None = None,
) -> ViewResult:
    """Write a page that shows a fit, or the folder of a scene, in a browser and without network.

    Parameters
    ----------
    fit : Fit or path
        A fit, a result's folder, a saved .npz file, or the folder of a scene that `relight` or `edit` wrote.
    to : path, optional
        The .html file. Default: view.html in the fit's folder.
    source : path or source, optional
        The source of the fit. By default, homofact tries to find it.
    mesh : path, optional
        A mesh (OBJ, PLY, glTF) to show the material on.
    skies : sequence of path, optional
        Additional skies (.hdr, .exr) for a relit scene.
    force : bool, optional
        Replace a page that is there.
    progress : callable, optional
        Called with a `ProgressStep` on the way.

    Returns
    -------
    ViewResult
        The file, its size, and the titles of its pictures.

    Raises
    ------
    BadInput
        For a fit, scene or source that cannot be read, and a file that is there or cannot be written.

    Examples
    --------
    >>> fit = homofact.fit("material:phong-30", homofact.McCool(size=8))
    >>> homofact.view(fit, "phong.html").titles
    ('McCool', 'Source')
    """
    place = Path(fit) if isinstance(fit, str | os.PathLike) else None
    if to is None and place is None:
        raise BadInput("none given for a fit in memory", where="to", expected="a page's file (.html)")
    target = _place_of(place) if place is not None and to is None else Path(str(to))
    check_page(target, force)
    steps = ProgressSteps(progress)
    if place is not None:
        own = {"source": source, "mesh": mesh}
        if RELIT.is_at(place):
            _refuse_given(own, place, "relit scene")
            return view_relit(place, target, skies, force, steps)
        if PREPARED.is_at(place):
            _refuse_given(own | {"skies": skies or None}, place, "prepared scene")
            return view_edit(place, target, force, steps)
    if skies:
        raise BadInput(f"{place or 'the fit'} is no relit scene", where="skies", expected="one that relight wrote")
    given = given_fit(fit)
    source = None if source is None else given_source(source)

    from homofact.exporting.result import read_record
    from homofact.meshes.mesh import read_mesh
    from homofact.web.layers import check_shown
    from homofact.web.page import write_view

    steps.stage("reading")
    fitted = given.open()
    check_shown(fitted.channels)
    shape = None if mesh is None else read_mesh(mesh)
    report: dict[str, Any] = {}
    if place is not None and (place.is_dir() or place.name == FACTORIZATION):
        report = read_record(given.near[0])
    elif (verdict := getattr(fit, "verdict", None)) is not None:
        report = {"verdict": verdict.record()}
    if source is not None and not isinstance(source, str):
        source = open_given(source)
    page = write_view(
        fitted, target, source, near=given.near, report=report, mesh=shape, stage=steps.stage, new=not force
    )
    return ViewResult(
        given.words,
        page.file,
        page.size,
        page.titles,
        page.caution,
        page.record["source"] is not None,
        page.reports,
        page.record,
    )


def check_page(target: Path, force: bool) -> None:
    """Raise BadInput if the page cannot be written, before anything is computed."""
    check_file(target, ".html", ".htm")
    if target.exists() and not force:
        raise BadInput(where=target, found="an existing file", expected=f"a new name or {Advice('force', True)}")


def _refuse_given(options: Mapping[str, object], place: Path, kind: str) -> None:
    for name, value in options.items():
        if value is not None:
            raise BadInput(f"{place} is a {kind}, which has its own", where=name, expected="none")


def _place_of(result: Path) -> Path:
    """Return the default path of a result's page: view.html in its folder, or NAME.html beside NAME.npz."""
    return result / NAME if result.is_dir() else result.with_suffix(".html")


def view_relit(place: Path, target: Path, skies: Sequence[Place], force: bool, steps: ProgressSteps) -> ViewResult:
    """Write the page of a relit scene."""
    from homofact.relighting.page.relit_page import write_relit_page
    from homofact.relighting.result import open_relit
    from homofact.rendering.environment import read_environment

    steps.stage("reading")
    saved = open_relit(place)
    others = [read_environment(sky) for sky in skies]
    steps.stage("writing the page")
    size = write_relit_page(target, saved, others, new=not force)
    facts = {"file": str(target), "bytes": size}
    return ViewResult(str(place), target, size, (f"{len(saved.objects)} objects",), facts=facts)


def view_edit(place: Path, target: Path, force: bool, steps: ProgressSteps) -> ViewResult:
    """Write the page of a scene whose materials are edited."""
    from homofact.editing.page.edit_page import write_saved_page
    from homofact.editing.result import open_edit
    from homofact.evaluation.wording import counted

    steps.stage("reading")
    saved = open_edit(place, steps.stage)
    size = write_saved_page(target, saved, stage=steps.stage, new=not force)
    materials, views = len(saved.prepared.scene.objects), len(saved.prepared.pixels)
    titles = (f"{counted(materials, 'material')}, {counted(views, 'view')}",)
    return ViewResult(str(place), target, size, titles, facts={"file": str(target), "bytes": size})
