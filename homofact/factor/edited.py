"""Describe the edits in a fit's provenance as text: the name of the edited material, and each edit."""

from collections.abc import Mapping
from typing import Any

from homofact.factor.fixed_projections import EDITED, EDITED_NAME, EDITS
from homofact.files.words import on_one_line

# The angles that curves are over, as people write them.
LETTERS = {
    "theta_h": "θh", "theta_d": "θd", "theta_i": "θi", "theta_o": "θo", "gamma_alpha": "γα", "gamma_beta": "γβ",
    "theta_r": "θr", "theta_x": "θx", "theta_y": "θy",
}  # fmt: skip
_WAYS = {"texels": "in the texels", "solve": "by texels solved again", "texture": "as a texture of its own"}


def edits_in_words(provenance: Mapping[str, Any]) -> str:
    """Return a description of each edit with its error; "" for a fit that was not edited.

    Examples
    --------
    >>> edits_in_words({"edits": [{"angle": "theta_h", "way": "texels", "rms": 0.0123}]})
    'over θh, in the texels, relative RMS 1.23% against the exact edit of the fit'
    >>> edits_in_words({})
    ''
    """
    edits = provenance.get(EDITS)
    if edits:
        return "; ".join(_words(each) for each in edits) if isinstance(edits, list | tuple) else "edited"
    return "fitted to a material that was edited before" if EDITED in _source(provenance) else ""


def edited_name(provenance: Mapping[str, Any]) -> str:
    """Return the name of the edited material in its scene; "" if it is unknown."""
    return on_one_line(str(provenance.get(EDITED_NAME) or _source(provenance).get(EDITED_NAME) or ""))


def _source(provenance: Mapping[str, Any]) -> Mapping[str, Any]:
    source = provenance.get("source")
    return source if isinstance(source, Mapping) else {}


def _words(record: Any) -> str:
    """Describe an edit: its angle, how it was applied, and its error; fits of earlier builds contain no error."""
    if not isinstance(record, Mapping):
        return "edited"
    angle, way, rms = str(record.get("angle")), str(record.get("way")), record.get("rms")
    words = f"over {LETTERS.get(angle, angle)}, {_WAYS.get(way, way)}"
    return (
        f"{words}, relative RMS {rms:.2%} against the exact edit of the fit" if isinstance(rms, int | float) else words
    )
