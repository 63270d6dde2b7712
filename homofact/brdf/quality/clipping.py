"""Clipped samples: where the detector saturated, the recorded value is only a lower bound.

`marked` finds the clipped samples: those at a given level, or those at the largest value of their channel if this value
recurs at least `FEWEST` times (and in fewer than most samples, to exclude a constant BRDF). A fit uses these samples as
one-sided constraints: they raise the fit where it is too low and never lower it. Above the bound, smoothing
extrapolates the flank of the highlight.
"""

from dataclasses import replace

import torch

from homofact.brdf.samples import Samples
from homofact.errors import BadInput

FEWEST = 3
_LARGEST_SHARE = 0.5
_AT_THE_LEVEL = 1e-6  # relative: files round


def marked(samples: Samples, level: float | str) -> Samples:
    """The samples with `clipped` set: values of at least `level` in sr⁻¹, or, "found", at each channel's own level.

    provenance["clipped"] says at which level and how many, channel by channel. Raises BadInput where there are none.
    """
    levels = [_level(values) if isinstance(level, str) else float(level) for values in samples.values.T]
    clipped = torch.stack(
        [values >= at * (1 - _AT_THE_LEVEL) for values, at in zip(samples.values.T, levels, strict=True)], 1
    )
    if not bool(clipped.any()):
        if isinstance(level, str):
            raise BadInput(
                f"no channel has its largest value {FEWEST} times",
                where="clipped",
                expected="some that do; state the level",
            )
        raise BadInput(f"no value is {level:g} or more", where="clipped", expected="a level that some samples reach")
    if bool(clipped.all(0).any()):
        name = samples.channels[int(clipped.all(0).nonzero()[0])]
        raise BadInput(
            f"all values of {name} are {level} or more", where="clipped", expected="a level that most are under"
        )
    counts = clipped.sum(0).tolist()
    facts = {
        name: {"level": at, "samples": count}
        for name, at, count in zip(samples.channels, levels, counts, strict=True)
        if count > 0
    }
    return replace(samples, clipped=clipped, provenance=samples.provenance | {"clipped": facts})


def _level(values: torch.Tensor) -> float:
    """The largest of values (N,) where it is shared, else infinite."""
    largest = float(values.max())
    tied = int((values == largest).sum())
    return largest if largest > 0 and FEWEST <= tied < _LARGEST_SHARE * len(values) else float("inf")
