"""What a measurement is opened with: gains of the instrument divided out, clipped values marked as bounds."""

from collections.abc import Sequence
from typing import Any

from homofact.brdf.quality.clipping import marked
from homofact.brdf.quality.gains import calibrated
from homofact.brdf.samples import Samples


def mended(samples: Samples, calibrate: Sequence[str], clipped: float | str | None) -> Samples:
    """`samples` as `clipping.marked` and `gains.calibrated` make them: the level is one of the values as they stand.

    Raises BadInput as these do.
    """
    if clipped is not None:
        samples = marked(samples, clipped)
    return calibrated(samples, calibrate)


def mending_lines(provenance: dict[str, Any]) -> list[str]:
    """What was done to samples of this provenance, a line each, for people."""
    lines = [facts["words"] for facts in provenance.get("gains", {}).values()]
    for name, facts in provenance.get("clipped", {}).items():
        lines.append(f"clipped: {facts['samples']} values of {name} at {facts['level']:.4g} sr⁻¹ are taken as bounds")
    return lines
