"""The folders that homofact makes, by kind, and which files in them are homofact's own.

homofact deletes only its own files. Other files in such a folder belong to the user, and stay when homofact writes the
folder again.
"""

import re
from dataclasses import dataclass
from pathlib import Path

from homofact.errors import BadInput

FACTORIZATION = "factorization.npz"


@dataclass(frozen=True)
class FolderKind:
    """The name of a kind of folder ("result"), and the file that identifies such a folder."""

    what: str
    mark: str

    def is_at(self, place: Path) -> bool:
        """Return whether `place` is a folder of this kind, or the file that identifies one."""
        return (place / self.mark).is_file() if place.is_dir() else place.name == self.mark


RESULT = FolderKind("result", FACTORIZATION)
EXPORT = FolderKind("export", "brdf.glsl")
PLAN = FolderKind("plan", "plan.json")
RELIT = FolderKind("relit scene", "relight.npz")
SITE = FolderKind("report", "site.json")
SVBRDF = FolderKind("spatially varying fit", "svbrdf.npz")
BASIS = FolderKind("shared basis", "basis.npz")
PREPARED = FolderKind("prepared scene", "edit.npz")
_OURS = re.compile(
    r"factorization\.npz|manifest\.json|report\.json|compare\.png|view\.html|brdf\.(glsl|hlsl|wgsl|c)|brdf_check\.csv"
    r"|prefiltered(_table|_irradiance)?\.[a-z0-9]+|(relight|edit|svbrdf|basis)\.(npz|json)|labels\.png|picture_\d+\.png"
    r"|fit_[^/]+_[0-9a-f]{16}\.npz"
    r"|(texture_\d+|term_\d+_(first|second))(_deviation)?(\.[a-z0-9]+)+"
)
# Of an export for an engine: names that a person may have given to files of other folders.
ENGINE_MARK = "engine.json"
_ENGINE = re.compile(
    r"engine\.json|package\.json|index\.(js|html)|README\.md|lookalike\.glb|brdf\.(mtlx|gdshader|pbrt|bsdf)"
    r"|brdf_materialx\.glsl|brdf_blender\.py"
)
# Of a scene's folder: pictures with the names of its cameras.
_PICTURE = re.compile(r"picture_[a-z0-9-]+\.png")
# Of a report's site, which has folders: names that a person may have given to files of other folders.
_SITE = re.compile(r"site\.json|index\.html|(fits|aside|comparison)\.(csv|parquet)")
_SITE_FOLDERS = {
    "materials": re.compile(r"[0-9a-f]{16}\.html"),
    "fits": re.compile(r"[0-9a-f]{32}(\.png|\.html|_(texture_\d+|term_\d+_(first|second))\.png)"),
}


def check_no_fit(place: Path, where: object, expected: str) -> None:
    """Raise BadInput with a remedy if `place` is the folder of a fit or an export, and not a measurement."""
    for kind in (RESULT, EXPORT):
        if place.is_dir() and kind.is_at(place):
            hint = "write the values of the fit to a file first: `homofact.convert`"
            raise BadInput(where=where, found=f"the folder of a fit ({kind.what})", expected=expected, hint=hint)


def is_ours(entry: Path) -> bool:
    """Return whether an entry of such a folder is homofact's: a file that it writes, or a folder of such files."""
    place = entry.parent
    if place.name in _SITE_FOLDERS and (place.parent / SITE.mark).is_file():
        return _SITE_FOLDERS[place.name].fullmatch(entry.name) is not None and _is_file(entry)
    names = _OURS
    if _ENGINE.fullmatch(entry.name) and (place / ENGINE_MARK).is_file() and (place / EXPORT.mark).is_file():
        return _is_file(entry)
    if _PICTURE.fullmatch(entry.name) and any((place / kind.mark).is_file() for kind in (RELIT, PREPARED)):
        return _is_file(entry)
    if (place / SITE.mark).is_file():
        if entry.name in _SITE_FOLDERS and not _is_file(entry):
            return all(map(is_ours, entry.iterdir()))
        names = _SITE
    return names.fullmatch(entry.name) is not None and _is_file(entry)


def _is_file(entry: Path) -> bool:
    return entry.is_symlink() or not entry.is_dir()
