"""What a measurement is opened with: the sample's tilt and gains of the instrument undone, clipped values marked."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from homofact.brdf.quality.clipping import marked
from homofact.brdf.quality.gains import calibrated
from homofact.brdf.quality.tilt import find_tilt
from homofact.brdf.reflectance import Reflectance, innermost
from homofact.brdf.rgl import AdaptiveTable
from homofact.brdf.samples import Samples
from homofact.brdf.source_names import AUTOMATIC, CALIBRATIONS, DISMISSED, NOTHING, TILT
from homofact.brdf.table import AngleTable
from homofact.brdf.tilt import Straightened
from homofact.errors import BadInput


def wanted(calibrate: Sequence[str]) -> tuple[str, ...]:
    """Return the kinds of `CALIBRATIONS` that are asked for, without "auto" and "none".

    Raises BadInput for unknown ones.
    """
    for kind in calibrate:
        if kind not in CALIBRATIONS:
            raise BadInput(where="calibrate", found=repr(kind), expected=f"some of {', '.join(CALIBRATIONS)}")
    if len(calibrate) > 1 and NOTHING in calibrate:
        raise BadInput(where="calibrate", found=f"{NOTHING!r} beside others", expected="it alone")
    return tuple(kind for kind in calibrate if kind not in (AUTOMATIC, NOTHING))


def straightened(
    name: str, reflectance: Reflectance, samples: Samples, calibrate: Sequence[str]
) -> tuple[Reflectance, Samples]:
    """Return a measured table and the samples drawn from it with the tilt of the sample undone, where there is one.

    `calibrate` as `open_source` takes it: "auto" passes over what no tilt can be found of, "tilt" raises BadInput.
    provenance["tilt"] has what was found (`TiltFinding.record`).
    """
    if not {AUTOMATIC, TILT} & set(calibrate) or "tilt" in samples.provenance:
        return reflectance, samples
    table = innermost(reflectance)
    measured = isinstance(table, AdaptiveTable | AngleTable)
    if not measured or not samples.isotropic:
        if TILT in calibrate:
            what = "which is no measured table" if not measured else "which is anisotropic"
            expected = "a measured table of an isotropic material with it"
            raise BadInput(where="calibrate", found=f"{TILT!r} for {name}, {what}", expected=expected)
        return reflectance, samples
    found = find_tilt(table)
    provenance = samples.provenance | {"tilt": found.record()}
    if found.tilt is None:
        return reflectance, replace(samples, provenance=provenance)
    if isinstance(reflectance, AdaptiveTable):
        # What was counted are values of other pairs: those that the tilted sample reported.
        faults = reflectance.faults_at(*found.tilt.measured(samples.wi, samples.wo))
        provenance["faults"] = provenance.get("faults", {}) | faults
    reflectance = Straightened(reflectance, found.tilt)
    values = reflectance.evaluate(samples.wi, samples.wo)
    return reflectance, replace(samples, values=values, provenance=provenance)


def mended(samples: Samples, gains: Sequence[str], clipped: float | str | None) -> Samples:
    """`samples` as `clipping.marked` and `gains.calibrated` make them: the level is one of the values as they stand.

    Raises BadInput as these do.
    """
    if clipped is not None:
        samples = marked(samples, clipped)
    return calibrated(samples, gains)


def mending_lines(provenance: dict[str, Any], looked_for: bool = False) -> list[str]:
    """What was done to samples of this provenance, a line each, for people; a tilt `looked_for` in vain as well."""
    tilt = provenance.get("tilt", {})
    lines = [tilt["words"]] if tilt.get("undone") or (tilt and looked_for) else []
    lines += [facts["words"] for facts in provenance.get("gains", {}).values()]
    for name, facts in provenance.get("clipped", {}).items():
        lines.append(f"clipped: {facts['samples']} values of {name} at {facts['level']:.4g} sr⁻¹ are taken as bounds")
    if provenance.get(DISMISSED):
        lines.append(f"not suspected, as you have checked it: {', '.join(provenance[DISMISSED])}")
    return lines
