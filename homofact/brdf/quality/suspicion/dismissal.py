"""Suspicions that somebody has checked and found to be wrong: the samples keep their names, and they stay unsaid.

A glossy paint without diffuse light can look as if its values held cosines. Only who measured it knows better.
"""

from collections.abc import Sequence
from dataclasses import replace

from homofact.brdf.quality.suspicion.suspects import NAMES
from homofact.brdf.samples import Samples
from homofact.brdf.source_names import ALL_DISMISSED, DISMISSED
from homofact.errors import BadInput


def dismissed(samples: Samples, names: Sequence[str]) -> Samples:
    """Return the samples with these suspicions dismissed: `suspicions` raises them no more.

    `names` are those of the suspicions, or "all" alone. Raises BadInput for others.
    """
    names = (names,) if isinstance(names, str) else tuple(names)
    if names == (ALL_DISMISSED,):
        names = NAMES
    for name in names:
        if name not in NAMES:
            raise BadInput(where="dismiss", found=repr(name), expected=f"some of {', '.join(NAMES)}, or all alone")
    return replace(samples, provenance=samples.provenance | {DISMISSED: list(names)})
