"""Dismiss suspicions that the user has checked and found wrong: samples record their names, to not repeat them.

For example, the values of a glossy paint without diffuse reflection can look as if they contained cosines. Only the
person who measured it can know.
"""

from collections.abc import Sequence
from dataclasses import replace

from homofact.brdf.quality.suspicion.suspects import NAMES
from homofact.brdf.samples import Samples
from homofact.brdf.source_names import ALL_DISMISSED, DISMISSED
from homofact.errors import BadInput


def dismissed(samples: Samples, names: Sequence[str]) -> Samples:
    """Return the samples with these suspicions dismissed; `suspicions` then no longer reports them.

    `names` are those of the suspicions, or "all" alone. Raises BadInput for others.
    """
    names = (names,) if isinstance(names, str) else tuple(names)
    if names == (ALL_DISMISSED,):
        names = NAMES
    for name in names:
        if name not in NAMES:
            raise BadInput(where="dismiss", found=repr(name), expected=f"some of {', '.join(NAMES)}, or all alone")
    return replace(samples, provenance=samples.provenance | {DISMISSED: list(names)})
