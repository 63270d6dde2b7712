"""What an engine adds to an export: files that are made from the fit, and the reflectances that they show."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from importlib.resources import files

import numpy as np

from homofact.brdf.reflectance import Reflectance
from homofact.errors import BadInput
from homofact.exporting.engine_light import UnderSkies
from homofact.exporting.exported import Exported
from homofact.factor.edited import edits_in_words
from homofact.files.template import AT, filled
from homofact.files.words import in_markdown
from homofact.shading.encoding import Encoded


@dataclass(frozen=True)
class Added:
    """`files` maps names to text or bytes; `looks` maps names to the reflectances, except the fit, that they show.

    `light` describes how the fit itself reflects the engine's own sky; it is None if a look-alike does. If an engine
    needs only a few of the files, `shipped` lists their names.
    """

    files: Mapping[str, str | bytes]
    looks: Mapping[str, Reflectance] = field(default_factory=dict)
    light: UnderSkies | None = None
    shipped: tuple[str, ...] = ()


@dataclass(frozen=True)
class Engine:
    """An engine: its `name` on the command line, and the texture `formats` that it supports, the default first.

    `add` makes its files; it raises BadInput for a fit that the engine cannot show. `work` names the slow step for the
    progress display.
    """

    name: str
    formats: tuple[str, ...]
    add: Callable[[Exported], Added]
    work: str


def check_colour(made: Exported, engine: str) -> None:
    """Raise BadInput unless the fit has one or three channels."""
    channels = made.stored.channels
    if len(channels) not in (1, 3):
        raise BadInput(where=engine, found=f"channels {', '.join(channels)}", expected="R, G, B or one alone")


def fit_notes(made: Exported) -> str:
    """Return paragraphs of Markdown with the edits of a fit and its verdict, each after an empty line; "" for none."""
    edits = edits_in_words(made.stored.provenance)
    notes = []
    if edits:
        notes.append(f"The fit was edited: {in_markdown(edits)}. The errors that it had before the edit come on top.")
    if made.verdict is not None:
        notes.append(f"homofact's verdict on the fit: {in_markdown(made.verdict['summary'])}.")
    return "".join(f"\n\n{note}" for note in notes)


def template_text(name: str) -> str:
    """Return a template file of this package, with its marks unfilled."""
    return (files("homofact.exporting.engines") / name).read_text(encoding="utf-8")


def template(name: str, **values: str) -> str:
    """Return a template with every @NAME@ replaced, in one pass. Raises KeyError for a mark without a value."""
    text = template_text(name)
    unused = [key for key in values if f"@{key}@" not in text]
    assert not unused, f"{name}: no @{'@, @'.join(unused)}@"
    return filled(text, AT, values)


def rgba(texture: Encoded) -> np.ndarray:
    """Return the stored texels (rows, columns, 4): one channel is copied to R, G and B; alpha is 1 (or 255)."""
    stored = texture.stored
    rows, columns, channels = stored.shape
    colour = np.repeat(stored, 3, 2) if channels == 1 else stored[..., :3]
    opaque = np.full((rows, columns, 1), np.iinfo(stored.dtype).max if stored.dtype.kind == "u" else 1, stored.dtype)
    return np.concatenate((colour, opaque), 2)
