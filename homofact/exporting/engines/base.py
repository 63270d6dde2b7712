"""What an engine's export adds to the folder: files made from what is exported, and reflectances that they show."""

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
    """`files` by name, text or bytes; `looks` are reflectances in them other than the fit, by what they are called.

    `light` is how the fit itself reflects the engine's own sky, where it does. `shipped` are the names of all files
    that the engine needs, where these are only a few of them.
    """

    files: Mapping[str, str | bytes]
    looks: Mapping[str, Reflectance] = field(default_factory=dict)
    light: UnderSkies | None = None
    shipped: tuple[str, ...] = ()


@dataclass(frozen=True)
class Engine:
    """An engine: its `name` on the command line, the texture `formats` that it takes, the first unless told otherwise.

    `add` makes its files; it raises BadInput for a fit that the engine cannot show. `work` says in words what takes its
    time.
    """

    name: str
    formats: tuple[str, ...]
    add: Callable[[Exported], Added]
    work: str


def check_colour(made: Exported, engine: str) -> None:
    """Raise BadInput for a fit that has neither R, G, B nor one channel alone."""
    channels = made.stored.channels
    if len(channels) not in (1, 3):
        raise BadInput(where=engine, found=f"channels {', '.join(channels)}", expected="R, G, B or one alone")


def fit_notes(made: Exported) -> str:
    """Return paragraphs of Markdown with the edits of a fit and its verdict, each after an empty line; "" for none."""
    edits = edits_in_words(made.stored.provenance)
    notes = [f"The fit was edited: {in_markdown(edits)}. Its errors before the edit come on top."] if edits else []
    if made.verdict is not None:
        notes.append(f"homofact's verdict on the fit: {in_markdown(made.verdict['summary'])}.")
    return "".join(f"\n\n{note}" for note in notes)


def template_text(name: str) -> str:
    """A file of this package as it stands, with its marks."""
    return (files("homofact.exporting.engines") / name).read_text(encoding="utf-8")


def template(name: str, **values: str) -> str:
    """A file of this package with every @NAME@ replaced, in one pass. Raises KeyError for one that has no value."""
    text = template_text(name)
    unused = [key for key in values if f"@{key}@" not in text]
    assert not unused, f"{name}: no @{'@, @'.join(unused)}@"
    return filled(text, AT, values)


def rgba(texture: Encoded) -> np.ndarray:
    """The stored texels (rows, columns, 4), one channel in all of R, G, B, alpha 1 (or 255)."""
    stored = texture.stored
    rows, columns, channels = stored.shape
    colour = np.repeat(stored, 3, 2) if channels == 1 else stored[..., :3]
    opaque = np.full((rows, columns, 1), np.iinfo(stored.dtype).max if stored.dtype.kind == "u" else 1, stored.dtype)
    return np.concatenate((colour, opaque), 2)
