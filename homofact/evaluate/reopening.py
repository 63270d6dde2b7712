"""The source of a saved fit, opened again, with the very samples that the fit had not seen.

A saved fit tells its source's name, how a model was sampled, its seed and how many samples it was given. Which part of
the source these were follows from its A, the mean of the training samples: a split whose training part has that mean,
channel by channel, is the fit's own. Where none has, the source may be another one than the fit was made from, or the
fit had all of it, and what is measured on it is not called held out.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from homofact.errors import BadInput

if TYPE_CHECKING:
    from torch import Tensor

    from homofact.brdf.samples import Samples
    from homofact.brdf.source import Source
    from homofact.factor.fitted import Fitted
    from homofact.methods.fitting import Method

SAME_MEAN = 1e-6
USUAL_SAMPLES, USUAL_HELD_OUT = 45_000, 0.2


@dataclass(frozen=True)
class Reopened:
    """A source and its split.

    `held_out` is the part of the samples that fits of `seed` leave out, `subset` how many of the others a fit is given
    at most (0: all). `known` says that the saved fit was made from the same split.
    """

    source: "Source"
    held_out: float
    seed: int
    subset: int
    known: bool


def reopen(
    fitted: "Fitted", given: str | None, near: Sequence[Path], report: Mapping[str, Any] | None = None
) -> Reopened | str:
    """The source `given`, or the one that the fit was made from; words on what is missing where that is gone.

    `report` is the result's report.json: it says how the source was named then, and how many samples it had. A file is
    looked for under that name, in the working folder, and in the folders `near`. Raises BadInput for a `given` source
    that cannot be read or has other channels than the fit.
    """
    report = report or {}
    total, opened = report.get("samples"), report.get("opened")
    facts = _mapping(fitted.provenance.get("source"))
    named = given or _named(facts, [Path(opened)] if isinstance(opened, str) else [], near)
    if named is None:
        if isinstance(facts.get("file"), str):
            return (
                f"its source, {facts['file']}, is neither where it was nor in the working folder nor beside the result"
            )
        return "the result does not say what it was made from"
    counts = [total] if isinstance(total, int) and total > 0 else []
    counts += [count for count in _counts(fitted) if count not in counts]
    first: Reopened | None = None
    for count in counts:
        try:
            source = _opened(named, fitted, _mapping(facts.get("sampling")), count)
        except BadInput as error:
            if given is not None:
                raise
            return f"its source cannot be opened again ({error})"
        if tuple(source.samples.channels) != tuple(fitted.channels):
            found = f"{', '.join(source.samples.channels)}, expected {', '.join(fitted.channels)}, which the fit has"
            if given is not None:
                raise BadInput(f"{given}: found the channels {found}")
            return f"its source, {named}, has the channels {found}"
        here = _split(source, fitted)
        if here.known:
            return here
        first = first or here
        if source.kind == "measurement":
            break
    assert first is not None  # there is at least one count
    return first


def settings_of(fitted: "Fitted") -> "Method":
    """The settings that the fit was made with, as its provenance has them; ε is the fit's own.

    What is missing or cannot be meant takes its default; the size is then that of the largest texture.
    """
    from homofact.methods.table import METHODS, settings_of_class

    kept = _mapping(fitted.provenance.get("settings"))
    name = fitted.provenance.get("method", kept.get("method"))
    method = METHODS.get(name if isinstance(name, str) else "", METHODS["search"])
    # A fit of version 0.1.0 has all methods' settings in one, the method's name among them.
    kept = _renamed(kept, method.name) if "method" in kept else kept
    known = {setting: value for setting, value in kept.items() if setting in settings_of_class(method)}
    own: dict[str, Any] = {"epsilon": fitted.transform.epsilon}
    side: dict[str, Any] = {"size": _largest_side(fitted)}
    try:
        return method(**(side | known | own))
    except BadInput:
        return method(**(side | own))


def _renamed(kept: Mapping[str, Any], method: str) -> dict[str, Any]:
    """The settings of version 0.1.0 by their names of today; what took a method's usual value is left to it."""
    pinned = kept.get("parameterization")
    renamed = {name: value for name, value in kept.items() if value is not None and value != []}
    renamed |= {"joint_terms": kept.get("together", 2), "refine": "linear" if kept.get("refine") == "looks" else "none"}
    if method == "search":
        renamed |= {"projections": pinned.split("+") if isinstance(pinned, str) else None}
    elif isinstance(pinned, str):
        renamed |= {"coordinates": pinned}
    return renamed


def training_part(source: Reopened) -> "Samples":
    """What of the source the fit was given, as measured."""
    from homofact.brdf.stratified import stratified_subset

    train = source.source.samples.split(source.held_out, source.seed)[0]
    return stratified_subset(train, source.subset, source.seed) if source.subset else train


def parts(fitted: "Fitted", source: Reopened) -> "dict[str, Samples]":
    """ "train", what the fit was given, and "held_out", what it was not, both turned at random."""
    from homofact.evaluate.compare import held_out_samples

    held = held_out_samples(source.source, source.held_out, source.seed)
    return {"train": training_part(source).rotated_at_random(source.seed), "held_out": held}


def _largest_side(fitted: "Fitted") -> int:
    sides = [side for term in fitted.terms for side in getattr(term, "size", ())]
    return max([*sides, 2])


def _named(facts: Mapping[str, Any], places: Sequence[Path], near: Sequence[Path]) -> str | None:
    """What `open_source` is to be given, or None where nothing is there."""
    material, file = facts.get("material"), facts.get("file")
    if isinstance(material, str):
        return f"material:{material}"
    if not isinstance(file, str):
        return None
    # FILE#NAME is one material of a file that holds several.
    tried = [*places, *(folder / file for folder in (Path(), *near))]
    return next((str(p) for p in tried if p.is_file() or Path(str(p).rpartition("#")[0]).is_file()), None)


def _counts(fitted: "Fitted") -> list[int]:
    """How many samples a model may have been drawn with, the likeliest first."""
    trained = fitted.provenance.get("samples")
    if not isinstance(trained, int) or trained < 1:
        return [USUAL_SAMPLES]
    return list(dict.fromkeys((round(trained / (1 - USUAL_HELD_OUT)), USUAL_SAMPLES, trained)))


def _opened(named: str, fitted: "Fitted", sampling: Mapping[str, Any], count: int) -> "Source":
    """The source in the fit's channels. Raises BadInput."""
    from homofact.brdf.channels import OneChannel
    from homofact.brdf.source import open_source

    single = fitted.channels[0] if len(fitted.channels) == 1 else ""
    kind = "luminance" if single == "Y" else "spectral" if single.endswith("nm") else "rgb"
    scheme, seed = sampling.get("scheme", "discs"), sampling.get("seed", 0)
    drawn = {"scheme": scheme if isinstance(scheme, str) else "discs", "seed": seed if isinstance(seed, int) else 0}
    source = open_source(named, channels=kind, count=count, **drawn)
    if single in source.samples.channels and len(source.samples.channels) > 1:
        reflectance = OneChannel(source.reflectance, single)
        return replace(source, samples=source.samples.channel(single), reflectance=reflectance)
    return source


def _split(source: "Source", fitted: "Fitted") -> Reopened:
    """The split of the source by which the fit was made, or the usual one."""
    seed = settings_of(fitted).seed
    subset = _mapping(_mapping(fitted.provenance.get("source")).get("subset")).get("samples")
    subset = subset if isinstance(subset, int) else 0
    for part in _parts(fitted, len(source.samples), subset):
        known = _same(_mean(source, fitted, part, seed, subset), fitted.transform.mean)
        if known:
            return Reopened(source, part, seed, subset, True)
    return Reopened(source, USUAL_HELD_OUT, seed, subset, False)


def _parts(fitted: "Fitted", total: int, subset: int) -> Iterator[float]:
    """Parts that may have been held out: the usual one, and those that leave as many samples as the fit was given."""
    yield USUAL_HELD_OUT
    trained, settings = fitted.provenance.get("samples"), settings_of(fitted)
    # A fit of version 0.1.0 counts its azimuth copies.
    copied = getattr(settings, "copies", 1)
    if subset or not isinstance(trained, int):
        return
    for copies in (1, copied, 2 * copied):
        if trained % copies == 0 and 0 < trained // copies < total:
            yield (total - trained // copies) / total


def _mean(source: "Source", fitted: "Fitted", part: float, seed: int, subset: int) -> "Tensor | None":
    """A (C,) of the training samples of a split, as a fit takes it; None where there are too few to split.

    Azimuth copies share their sample's weight and leave it as it is.
    """
    from homofact.brdf.log_transform import LogTransform
    from homofact.brdf.stratified import stratified_subset

    try:
        train = source.samples.split(part, seed)[0]
        train = stratified_subset(train, subset, seed) if subset else train
        return LogTransform.of(train, fitted.transform.epsilon).mean
    except BadInput:
        return None


def _same(found: "Tensor | None", expected: "Tensor") -> bool:
    return found is not None and bool(((found - expected).abs() <= SAME_MEAN * expected).all())


def _mapping(value: Any) -> Mapping[str, Any]:
    return value if isinstance(value, Mapping) else {}
