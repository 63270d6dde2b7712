"""Run all checks on samples; certain faults are undone before the next checks.

A wrong direction or an extra cosine looks like many faults at once: rings seem off, the lamp seems to drift, and
nothing is reciprocal. So the order of the checks matters. Encodings and channels are checked first, on the samples as
read. Then come directions, and then cosines and π in the values; the likeliest suspicion of each is undone. The
instrument is checked last, on the corrected samples. Only a bad ring among few lights is undone before all of them:
swapped pairs show it whatever the material, and such a ring can look like a wrong direction.
"""

from collections.abc import Collection, Iterable, Sequence

import numpy as np

from homofact.brdf.quality.suspicion import conventions, encodings, geometry, instrument
from homofact.brdf.quality.suspicion.calibration import SAID
from homofact.brdf.quality.suspicion.check import Check, Suspicion
from homofact.brdf.quality.suspicion.evidence import LEAST_SAMPLES, Evidence
from homofact.brdf.quality.suspicion.ring_steps import lone_ring
from homofact.brdf.quality.suspicion.undo import UNDO
from homofact.brdf.samples import Samples
from homofact.brdf.source_names import DISMISSED

CHECKS: dict[str, Check] = {
    check.name: check
    for check in (*geometry.CHECKS, *encodings.CHECKS, *conventions.CHECKS, *instrument.CHECKS)
}  # fmt: skip
NAMES = tuple(CHECKS)
_COUNTED = ("quantised", "clipped", "zeros")
_COLOURS = ("channels", "channel-late")
_COSINES = tuple(conventions.POWERS)
_VALUES = (*_COSINES, "pi")
_REST = ("drift-with-angle", "gains", "drift-in-time", "ring", "shadow")


def suspicions(samples: Samples, seed: int = 0) -> list[Suspicion]:
    """Return the suspicions, likeliest first; none for fewer than `LEAST_SAMPLES` samples.

    The checks use a few thousand samples, drawn by `seed`. The odds compare the fault with unchanged samples, at prior
    odds of 1. Suspicions with odds below `SAID` to 1 are left out, and so are those that `dismissal` has dismissed.
    """
    if len(samples) < LEAST_SAMPLES or not bool((samples.values > 0).any()):
        return []
    evidence = Evidence.of(samples, seed)
    # Where a spectrum left the gamut of sRGB the reader has cut it at zero itself, and says so.
    cut = any((samples.provenance.get("colour") or {}).get("clipped", {}).values())
    dismissed = {*samples.provenance.get(DISMISSED, ()), *(("zeros",) if cut else ())}
    suspicions = _said(_without(dismissed, _COUNTED), evidence)
    suspicions += _said(_without(dismissed, _COLOURS), evidence)[:1]
    lone = None if "ring" in dismissed else lone_ring(evidence)
    if lone is not None and (ring := CHECKS["ring"].of_figures(lone.figures)).odds >= SAID:
        evidence = lone.divided_out(evidence)
        suspicions.append(ring)
        dismissed.add("ring")
    turned = _said(_without(dismissed, [check.name for check in geometry.CHECKS]), evidence)[:1]
    for suspicion in turned:
        evidence = undone_evidence(evidence, suspicion.name)
    values: list[Suspicion] = []
    for _ in range(2):
        # A second convention is looked for among the other kind alone: two cosines are one of the checks already.
        names = [
            name
            for name in _without(dismissed, _VALUES)
            if not any((suspicion.name in _COSINES) == (name in _COSINES) for suspicion in values)
        ]
        best = _said(names, evidence)[:1]
        values += best
        for suspicion in best:
            evidence = undone_evidence(evidence, suspicion.name)
    suspicions += turned + values + _said(_without(dismissed, _REST), evidence)
    return sorted(suspicions, key=lambda suspicion: -suspicion.odds)


def undone_evidence(evidence: Evidence, name: str) -> Evidence:
    """Return the evidence with the fault `name` of `undo.UNDO` undone; unchanged if there is no such name."""
    if name not in UNDO:
        return evidence
    samples = UNDO[name].apply(evidence.samples())
    arrays = (samples.wi, samples.wo, samples.values, samples.weights - 2)
    return Evidence(*(tensor.numpy() for tensor in arrays))


def _without(dismissed: Collection[str], names: Iterable[str]) -> list[str]:
    """The names that nobody has dismissed."""
    return [name for name in names if name not in dismissed]


def _said(names: Sequence[str], evidence: Evidence) -> list[Suspicion]:
    """What these checks suspect by more than `SAID` to 1, likeliest first."""
    with np.errstate(all="ignore"):
        all_of = [CHECKS[name].suspicion(evidence) for name in names]
    likely = [suspicion for suspicion in all_of if suspicion is not None and suspicion.odds >= SAID]
    return sorted(likely, key=lambda suspicion: -suspicion.odds)
