"""Guess the split of a fit that was saved without one (by version 0.1.0, or from samples without a source).

The provenance of such a fit has the name of the source, the sampling of a model, the seed and the number of samples. A
is the mean of the training samples. So a split whose training part has this mean in every channel is taken as the split
of the fit.
"""

import os
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from homofact.brdf.log_transform import LogTransform
from homofact.brdf.source import MATERIAL_PREFIX, Source, open_source
from homofact.brdf.source_names import HELD_OUT
from homofact.errors import BadInput
from homofact.evaluation.split import Split
from homofact.files.reading import split_member

if TYPE_CHECKING:
    from homofact.factor.fitted import Fitted

SAME_MEAN = 1e-6
USUAL_SAMPLES = 45_000


def has_mean_of(fitted: "Fitted", source: Source, split: Split) -> bool:
    """Return whether the fit's A is the mean of the split's training samples.

    Azimuth copies share the weight of their sample, so they do not change the mean.
    """
    try:
        mean = LogTransform.of(split.parts(source)[0], fitted.transform.epsilon).mean
    except BadInput:  # too few samples to split
        return False
    expected = fitted.transform.mean
    return mean.shape == expected.shape and bool((abs(mean - expected) <= SAME_MEAN * expected).all())


def source_named_by(fitted: "Fitted", near: Sequence[str | os.PathLike[str]]) -> str:
    """Return the argument of `open_source` for a fit without a split. Raises BadInput if no source is found."""
    facts = mapping(fitted.provenance.get("source"))
    material, file = facts.get("material"), facts.get("file")
    if facts.get("format") == "analytic model" and isinstance(material, str):
        return f"{MATERIAL_PREFIX}{material}"
    if not isinstance(file, str):
        raise BadInput("the result does not say what it was made from")
    # A name alone, as fits have it: a result may name no other place.
    file = Path(file).name
    for folder in (Path(), *(Path(os.path.abspath(place)) for place in near)):
        for place in (folder / file, folder.parent / file):
            if Path(split_member(place)[0]).is_file():
                return str(place)
    raise BadInput(f"its source, {file}, is neither in the working folder nor beside the result")


def guess_split(fitted: "Fitted", path: str) -> tuple[Source, Split, bool]:
    """Return the source at `path` in the fit's channels, its most likely split, and whether A confirms this split.

    Raises BadInput as `open_source`.
    """
    facts = mapping(fitted.provenance.get("source"))
    sampling = mapping(facts.get("sampling"))
    scheme, drawn = sampling.get("scheme"), sampling.get("seed")
    seed, subset = fitted.provenance.get("seed"), mapping(facts.get("subset")).get("samples")
    seed = seed if isinstance(seed, int) and seed >= 0 else 0
    subset = subset if isinstance(subset, int) and subset > 0 else 0
    first: tuple[Source, Split, bool] | None = None
    for count in _counts(fitted):
        source = open_source(
            path,
            channels=_channels(fitted),
            count=count,
            scheme=scheme if isinstance(scheme, str) else "discs",
            seed=drawn if isinstance(drawn, int) else 0,
        )
        for held_out in _parts(fitted, len(source.samples), subset):
            split = Split.of(source, held_out, seed, subset)
            if has_mean_of(fitted, source, split):
                return source, split, True
        first = first or (source, Split.of(source, HELD_OUT, seed, subset), False)
        if source.kind == "measurement":
            break
    assert first is not None  # there is at least one count
    return first


def _channels(fitted: "Fitted") -> str:
    names = fitted.channels
    if len(names) == 1:
        return {"Y": "luminance"}.get(names[0], names[0])
    return "spectral" if names[0].endswith("nm") else "rgb"


def _counts(fitted: "Fitted") -> list[int]:
    """How many samples a model may have been drawn with, the likeliest first."""
    trained = fitted.provenance.get("samples")
    if not isinstance(trained, int) or trained < 1:
        return [USUAL_SAMPLES]
    return list(dict.fromkeys((round(trained / (1 - HELD_OUT)), USUAL_SAMPLES, trained)))


def _parts(fitted: "Fitted", total: int, subset: int) -> Iterator[float]:
    """Parts that may have been held out: the usual one, none, and those that leave as many as the fit was given."""
    yield HELD_OUT
    yield 0.0
    trained, copies = fitted.provenance.get("samples"), mapping(fitted.provenance.get("settings")).get("copies")
    if subset or not isinstance(trained, int):
        return
    # A fit of version 0.1.0 counts its azimuth copies.
    copies = copies if isinstance(copies, int) else 1
    for factor in (1, copies, 2 * copies):
        if factor > 0 and trained % factor == 0 and 0 < trained // factor < total:
            yield (total - trained // factor) / total


def mapping(value: Any) -> Mapping[str, Any]:
    """Return a mapping unchanged, and an empty one for anything else."""
    return value if isinstance(value, Mapping) else {}
