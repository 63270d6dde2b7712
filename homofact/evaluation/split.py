"""Record which samples of a source a fit used for training, and which samples were held out.

A `Split` records how the source was opened, the held-out fraction, the seed, and the maximum number of training
samples. The provenance of the training samples contains the split, so every fit to them saves it. A digest of all
samples reveals whether the source has changed. If it has not, the split gives the same parts again.
"""

import hashlib
import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import torch

from homofact.brdf.kept import Kept
from homofact.brdf.samples import Samples
from homofact.brdf.source import Opening, Source
from homofact.brdf.source_names import CALIBRATIONS, MOST_COUNT
from homofact.brdf.stratified import stratified_subset
from homofact.errors import BadInput
from homofact.files.fields import Fields
from homofact.files.reading import split_member

if TYPE_CHECKING:
    from homofact.factor.fitted import Fitted

_MOST = 2**63 - 1
_MOST_NAMES = 100  # of dismissed suspicions: there are fewer


def without_places(provenance: Mapping[str, Any]) -> dict[str, Any]:
    """Return a fit's provenance for sharing: file names without the folders of the machine that wrote it."""
    source = provenance.get("source")
    split = source.get("split") if isinstance(source, Mapping) else None
    opening = split.get("opening") if isinstance(split, Mapping) else None
    if not isinstance(source, Mapping) or not isinstance(split, Mapping) or not isinstance(opening, Mapping):
        return dict(provenance)
    named = {**opening, "path": Path(str(opening.get("path"))).name, "folder": ""}
    return {**provenance, "source": {**source, "split": {**split, "opening": named}}}


def _name(path: str) -> str:
    """Return a file's name without its folders, since it is written into pages that users share."""
    return Path(path).name


def _clipped(opening: Fields) -> float | str | None:
    """At which level values were said to be clipped: a number, "found", or None, which older results do not state."""
    level = opening.found.get("clipped")
    if level is None:
        return None
    return opening.text("clipped", ("found",)) if isinstance(level, str) else opening.number("clipped", 0)


def samples_digest(samples: Samples) -> str:
    """Return a SHA-256 (16 digits) of all inputs of a fit: directions, values, weights, channels, azimuths.

    Numbers are rounded to float32, since the last bits of a float64 may differ between machines.
    """
    digest = hashlib.sha256(f"{samples.all_azimuths} {samples.isotropic} {samples.channels}".encode())
    for tensor in (samples.wi, samples.wo, samples.values, samples.weights):
        digest.update(str(tuple(tensor.shape)).encode())
        # + 0 makes one zero of two.
        digest.update((tensor.to(torch.float32) + 0).cpu().contiguous().numpy().tobytes())
    if samples.clipped is not None:
        digest.update(samples.clipped.cpu().contiguous().numpy().tobytes())
    return digest.hexdigest()[:16]


@dataclass(frozen=True)
class Split:
    """How a source was opened and split.

    Attributes
    ----------
    opening : how the source was opened; None if it was built in code and cannot be opened again.
    samples : how many samples the source has.
    digest : `samples_digest` of these samples.
    held_out : the held-out fraction of the samples, at least 0 (nothing) and below 1.
    seed : the seed of the held-out samples, of their random azimuths and of the subset.
    subset : the maximum number of training samples; 0 for all.
    """

    opening: Opening | None
    samples: int
    digest: str
    held_out: float
    seed: int
    subset: int = 0

    @property
    def part(self) -> str:
        """The name of the test samples: "held_out", or "source" where nothing is held out and they are all samples."""
        return "held_out" if self.held_out > 0 else "source"

    @classmethod
    def of(cls, source: Source, held_out: float, seed: int, subset: int = 0) -> "Split":
        """Return a split of an open source."""
        digest = samples_digest(source.samples)
        return cls(source.opening, len(source.samples), digest, held_out, seed, subset)

    @classmethod
    def saved_with(cls, fitted: "Fitted") -> "Split | None":
        """Return the split of a saved fit; None for samples without a source and for fits of 0.1.0.

        Raises BadInput if the saved split is damaged.
        """
        source = fitted.provenance.get("source")
        record = source.get("split") if isinstance(source, Mapping) else None
        return None if record is None else cls._read(record)

    @classmethod
    def _read(cls, record: Any) -> "Split":
        fields = Fields("the fit's split: ", record if isinstance(record, dict) else {})
        opening = None
        if fields.found.get("opening") is not None:
            inner = fields.inner("opening")
            opening = Opening(
                inner.text("path"),
                inner.text("channels"),
                inner.whole("count", 1, MOST_COUNT),
                inner.text("scheme"),
                inner.whole("seed", 0, _MOST),
                inner.text("folder"),
                tuple(inner.texts("calibrate", len(CALIBRATIONS))) if inner.found.get("calibrate") else (),
                _clipped(inner),
                tuple(inner.texts("dismiss", _MOST_NAMES)) if inner.found.get("dismiss") else (),
            )
        held_out = fields.number("held_out")
        if not 0 <= held_out < 1:
            fields.refuse("held_out", "a part of at least 0 and below 1")
        return cls(
            opening,
            fields.whole("samples", 1, _MOST),
            fields.text("digest"),
            held_out,
            fields.whole("seed", 0, _MOST),
            fields.whole("subset", 0, _MOST),
        )

    def record(self) -> dict[str, Any]:
        """Return the JSON form, which `saved_with` reads."""
        record = asdict(self)
        if self.opening is not None:
            record["opening"] |= {name: list(record["opening"][name]) for name in ("calibrate", "dismiss")}
        return record

    def matches(self, source: Source) -> bool:
        """Return whether a source has exactly the samples of this split."""
        return samples_digest(source.samples) == self.digest

    def parts(self, source: Source) -> tuple[Samples, Samples | None]:
        """Return (training, held out) samples of a source, as measured; None for the second if none are held out.

        If there is a subset, the training samples are the subset. Their provenance contains the split. The parts of the
        last split of a source are cached with the source. Raises BadInput for an invalid `held_out` and for too few
        samples.
        """
        return self._kept(source).parts

    def test_samples(self, source: Source) -> Samples:
        """Return the test samples at random azimuths: the held-out samples, or all samples if none were held out."""
        return self._kept(source).test

    def _kept(self, source: Source) -> "_Drawn":
        last = _LAST.of(source)
        if not last or last[0].split != self:
            last[:] = [_Drawn(self, self._parts(source), source.samples)]
        return last[0]

    def _parts(self, source: Source) -> tuple[Samples, Samples | None]:
        held: Samples | None = None
        train = source.samples
        if self.held_out != 0:
            train, held = train.split(self.held_out, self.seed)
        if self.subset > 0:
            train = stratified_subset(train, self.subset, self.seed)
        return replace(train, provenance=train.provenance | {"split": self.record()}), held

    def open(self, near: Sequence[str | os.PathLike[str]] = ()) -> Source:
        """Open the source again, with the same samples.

        homofact looks for the file at its old path. Then it tries the same relative path, and the file name alone, in
        the working folder, in the folders `near` and in folders above these. Raises BadInput if the file is not found,
        cannot be read, or now has different samples.
        """
        if self.opening is None:
            raise BadInput("its source was put together by hand and cannot be opened again")
        if self.opening.is_material:
            source = self._opened(self.opening.path)
            if self.matches(source):
                return source
            raise BadInput(
                f"its source, {self.opening.path}, gives other samples in this version than when it was fitted"
            )
        name = _name(self.opening.path)
        changed = False
        for place in self._places(near):
            source = self._opened(place)
            if self.matches(source):
                return source
            changed = True
        if changed:
            raise BadInput(f"its source, {name}, has changed: its samples are not those of the fit")
        raise BadInput(
            f"its source, {name}, is neither where it was nor in the working folder nor beside the result",
            hint="an export keeps the name of the file alone: put the file into one of these folders",
        )

    def _opened(self, path: str) -> Source:
        assert self.opening is not None
        try:
            return self.opening.open(path)
        except BadInput as error:
            # Not the reader's words, which quote the file: a result may name any, and these words are passed on.
            raise BadInput(f"its source, {_name(path)}, cannot be read as what it was") from error

    def _places(self, near: Sequence[str | os.PathLike[str]]) -> Iterator[str]:
        """Where the file is found, each place once."""
        assert self.opening is not None
        path = self.opening.path
        folders = [Path(), *(Path(os.path.abspath(folder)) for folder in near)]
        above = [parent for folder in folders[1:] for parent in folder.parents]
        tried = [Path(self.opening.folder) / path]
        if not os.path.isabs(path):
            tried += [folder / path for folder in (*folders, *above)]
        tried += [folder / Path(path).name for folder in (*folders, *above[:1])]
        there = dict.fromkeys(os.path.abspath(place) for place in tried if Path(split_member(str(place))[0]).is_file())
        yield from there


@dataclass(frozen=True)
class _Drawn:
    """What a split has made of `samples`: the parts, and the tests at random azimuths."""

    split: Split
    parts: tuple[Samples, Samples | None]
    samples: Samples

    @cached_property
    def test(self) -> Samples:
        """The samples that errors are measured on, at random azimuths."""
        held = self.parts[1]
        return (self.samples if held is None else held).rotated_at_random(self.split.seed)


# The last split of a source, in a list of one.
_LAST: Kept[list[_Drawn]] = Kept(lambda source: [])
