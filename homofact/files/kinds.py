"""The folders that homofact makes, by kind, and which files in them are homofact's own.

Only those are ever deleted. What else lies in such a folder is its owner's, and stays when the folder is made anew.
"""

import re
from dataclasses import dataclass
from pathlib import Path

FACTORIZATION = "factorization.npz"


@dataclass(frozen=True)
class FolderKind:
    """What a folder is called ("result"), and the file that it is known by."""

    what: str
    mark: str


RESULT = FolderKind("result", FACTORIZATION)
EXPORT = FolderKind("export", "brdf.glsl")
PLAN = FolderKind("plan", "plan.json")
RELIT = FolderKind("relit scene", "relight.npz")
PREPARED = FolderKind("prepared scene", "edit.npz")
_OURS = re.compile(
    r"factorization\.npz|manifest\.json|report\.json|compare\.png|view\.html|brdf\.(glsl|hlsl|wgsl|c)"
    r"|(relight|edit)\.(npz|json)|picture_\d+\.png"
    r"|(texture_\d+|term_\d+_(first|second))(_deviation)?(\.[a-z0-9]+)+"
)


def is_ours(entry: Path) -> bool:
    """Whether something in a result's or an export's folder is a file that homofact puts there."""
    return _OURS.fullmatch(entry.name) is not None and (entry.is_symlink() or not entry.is_dir())
