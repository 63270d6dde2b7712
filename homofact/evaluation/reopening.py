"""Open the source of a fit again, with the samples that the fit used and its held-out samples.

    reopened = reopen(homofact.load("out/paint"))
    reopened.source.samples, reopened.parts["held_out"]

A saved fit contains its split (`evaluation.split`). If the fit was saved without a split, homofact guesses it
(`evaluation.guessed_split`).
"""

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from homofact.brdf.source import Source
from homofact.brdf.source_names import HELD_OUT
from homofact.errors import BadInput
from homofact.evaluation.guessed_split import guess_split, has_mean_of, mapping, source_named_by
from homofact.evaluation.split import Split
from homofact.factor.fixed_projections import EDITED, EDITS

if TYPE_CHECKING:
    from homofact.brdf.samples import Samples
    from homofact.factor.fitted import Fitted
    from homofact.methods.method import Method


class NotReopened(BadInput):
    """The source of a fit cannot be opened; the message states the reason, as a clause that can follow other text."""


@dataclass(frozen=True)
class Reopened:
    """A source and its split; `known` is True if the fit certainly used the split's training samples."""

    source: Source
    split: Split
    known: bool

    @property
    def held_out(self) -> bool:
        """Whether the split's test samples are known to be held out from the fit."""
        return self.part == "held_out"

    @property
    def part(self) -> str:
        """The name of the test samples in `parts`: "held_out", or "source" where the fit may have seen them."""
        return self.split.part if self.known else "source"

    @property
    def training(self) -> "Samples":
        """The training samples of the fit, as measured (not rotated to other azimuths)."""
        return self.split.parts(self.source)[0]

    @property
    def parts(self) -> "dict[str, Samples]":
        """The samples for measuring errors, at random azimuths: "train", and the test samples under the name `part`."""
        turned = self.training.rotated_at_random(self.split.seed)
        return {"train": turned, self.part: self.split.test_samples(self.source)}


def reopen(
    fitted: "Fitted", source: str | Source | None = None, near: Sequence[str | os.PathLike[str]] = ()
) -> Reopened:
    """Return the source of a fit, or the given `source`, with the fit's split.

    If the file has moved, homofact looks for it in the working folder, in the folders `near`, and in their parent
    folders. If a given `source` has other samples than the fit, the split is not `known`. Raises NotReopened if no
    `source` is given and the fit's own source cannot be opened. Raises BadInput if a given `source` cannot be read or
    its channels differ from the fit's.
    """
    if source is None:
        try:
            reopened = _own(fitted, near)
            _check_channels(reopened.source, fitted)
        except BadInput as error:
            raise NotReopened(str(error)) from error
        return reopened
    reopened = _given(fitted, source)
    _check_channels(reopened.source, fitted)
    return reopened


def settings_of(fitted: "Fitted") -> "Method":
    """Return the settings of the fit from its provenance; ε comes from the fit itself.

    Missing or invalid settings have their default values; the default size is that of the largest texture.
    """
    from homofact.methods.table import ALL_METHODS, settings_of_class

    kept = mapping(fitted.provenance.get("settings"))
    name = fitted.provenance.get("method", kept.get("method"))
    method = ALL_METHODS.get(name if isinstance(name, str) else "", ALL_METHODS["search"])
    # A fit of version 0.1.0 has all methods' settings in one, the method's name among them.
    kept = _renamed(kept, method.name) if "method" in kept else kept
    known = {setting: value for setting, value in kept.items() if setting in settings_of_class(method)}
    own: dict[str, Any] = {"epsilon": fitted.transform.epsilon}
    side: dict[str, Any] = {"size": _largest_side(fitted)} if "size" in settings_of_class(method) else {}
    # A size that no texture of the fit has would ask for any amount of memory.
    if isinstance(known.get("size"), int) and known["size"] > side.get("size", 0):
        del known["size"]
    try:
        return method(**(side | known | own))
    except BadInput:
        return method(**(side | own))


def _own(fitted: "Fitted", near: Sequence[str | os.PathLike[str]]) -> Reopened:
    """The source that the fit names. Raises BadInput."""
    if fitted.provenance.get(EDITS) or EDITED in mapping(fitted.provenance.get("source")):
        raise BadInput("the fit is of an edited material, of which there are no samples")
    split = Split.saved_with(fitted)
    if split is None:
        path = source_named_by(fitted, near)
        try:
            return Reopened(*guess_split(fitted, path))
        except BadInput as error:
            # Not the reader's words, which quote the file.
            raise BadInput(f"its source, {Path(path).name}, cannot be opened again") from error
    source = split.open(near)
    return Reopened(source, split, has_mean_of(fitted, source, split))


def _given(fitted: "Fitted", given: str | Source) -> Reopened:
    """A source that is given, with the fit's split where it has the same samples, else with the usual one."""
    split = Split.saved_with(fitted)
    if split is None and isinstance(given, str):
        return Reopened(*guess_split(fitted, given))
    if isinstance(given, Source):
        source = given
    else:
        assert split is not None
        opening = split.opening
        source = guess_split(fitted, given)[0] if opening is None else opening.open(given)
    if split is not None and split.matches(source):
        return Reopened(source, split, has_mean_of(fitted, source, split))
    seed = settings_of(fitted).seed if split is None else split.seed
    return Reopened(source, Split.of(source, HELD_OUT, seed), False)


def _check_channels(source: Source, fitted: "Fitted") -> None:
    found, expected = tuple(source.samples.channels), tuple(fitted.channels)
    if found != expected:
        raise BadInput(
            where=source.name,
            found=f"the channels {', '.join(found)}",
            expected=f"{', '.join(expected)}, which the fit has",
        )


def _renamed(kept: Mapping[str, Any], method: str) -> dict[str, Any]:
    """The settings of version 0.1.0 by their names of today; what took a method's usual value is left to it."""
    pinned = kept.get("parameterization")
    renamed = {name: value for name, value in kept.items() if value is not None and value != []}
    renamed |= {"joint_terms": kept.get("together", 2)}
    if method == "search":
        # Logs alone were made small then, and their fits were reciprocal unless told otherwise.
        renamed |= {"objective": "log", "reciprocal": kept.get("reciprocal", True)}
        renamed |= {"projections": pinned.split("+") if isinstance(pinned, str) else None}
    else:
        # Every file has it, search alone obeyed it.
        renamed.pop("budget", None)
        if isinstance(pinned, str):
            renamed |= {"coordinates": pinned}
    return renamed


def _largest_side(fitted: "Fitted") -> int:
    # Of a product's terms, whose textures are larger by a line where they go round.
    of_terms = [side for term in fitted.terms for side in getattr(term, "size", ())]
    return max([*(of_terms or [side for texture in fitted.textures for side in texture.size]), 2])
