"""Corrections when a measurement is opened: undo the specimen's tilt, divide out gains, mark clipped values."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from homofact.brdf.quality.clipping import marked
from homofact.brdf.quality.gains import calibrated
from homofact.brdf.quality.tilt import find_tilt
from homofact.brdf.quality.tilt_of_samples import find_tilt_of_samples, straightened_samples
from homofact.brdf.reflectance import Reflectance, innermost
from homofact.brdf.rgl import AdaptiveTable
from homofact.brdf.samples import Samples
from homofact.brdf.scattered import made_of_samples
from homofact.brdf.source_names import AUTOMATIC, CALIBRATIONS, DISMISSED, GAINS, NOTHING, TILT
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
    """Return a measured table and its samples with the tilt of the specimen undone, if one is found.

    `calibrate` is that of `open_source`. If a tilt cannot be determined for this kind of source, "auto" returns it
    unchanged and "tilt" raises BadInput. provenance["tilt"] contains the result (`TiltFinding.record`). Lists of
    samples are returned unchanged; `mended` corrects them.
    """
    if not {AUTOMATIC, TILT} & set(calibrate) or "tilt" in samples.provenance:
        return reflectance, samples
    table = innermost(reflectance)
    measured, listed = isinstance(table, AdaptiveTable | AngleTable), made_of_samples(reflectance)
    if not (measured or (listed and TILT in calibrate)) or not samples.isotropic:
        if TILT in calibrate:
            what = "which is no measurement" if not (measured or listed) else "which is anisotropic"
            raise BadInput(
                where="calibrate",
                found=f"{TILT!r} for {name}, {what}",
                expected="a measurement of an isotropic material with it",
            )
        return reflectance, samples
    if listed:
        return reflectance, samples
    found = find_tilt(table)
    provenance = samples.provenance | {"tilt": found.record() | {"asked": TILT in calibrate}}
    if found.tilt is None:
        return reflectance, replace(samples, provenance=provenance)
    if isinstance(reflectance, AdaptiveTable):
        # What was counted are values of other pairs: those that the tilted sample reported.
        faults = reflectance.faults_at(*found.tilt.measured(samples.wi, samples.wo))
        provenance["faults"] = provenance.get("faults", {}) | faults
    reflectance = Straightened(reflectance, found.tilt)
    values = reflectance.evaluate(samples.wi, samples.wo)
    return reflectance, replace(samples, values=values, provenance=provenance)


def mended(samples: Samples, calibrate: Sequence[str], clipped: float | str | None) -> Samples:
    """Return samples with clipped values marked, and with the gains and tilt that `calibrate` names undone.

    Clipped values and the rings of the gains must be found in the samples as measured, so the tilt is undone last.
    Raises BadInput as `clipping.marked` and `gains.calibrated` do.
    """
    if clipped is not None:
        samples = marked(samples, clipped)
    samples = calibrated(samples, [kind for kind in calibrate if kind in GAINS])
    if TILT not in calibrate or (samples.provenance.get("tilt") or {}).get("undone"):
        return samples
    found = find_tilt_of_samples(samples)
    straight = samples if found.tilt is None else straightened_samples(samples, found.tilt)
    record = found.record() | {"asked": True, "left_out": len(samples) - len(straight)}
    return replace(straight, provenance=samples.provenance | {"tilt": record})


def looked_at(samples: Samples) -> Samples:
    """Return isotropic samples with the tilt found in them recorded in their provenance, but not undone."""
    if not samples.isotropic or "tilt" in samples.provenance:
        return samples
    record = find_tilt_of_samples(samples).record(undone=False)
    return replace(samples, provenance=samples.provenance | {"tilt": record})


def mending_lines(provenance: dict[str, Any], looked_for: bool = False, left_in: bool = True) -> list[str]:
    """Return one line of text per correction in the provenance of samples.

    If `looked_for`, a line also reports that no tilt was found. A tilt that was found and not undone has a line unless
    `left_in` is False.
    """
    tilt = provenance.get("tilt") or {}
    told = ("undone", "asked", *(["left_in"] if left_in else []))
    lines = [tilt["words"]] if tilt and (looked_for or any(map(tilt.get, told))) else []
    if tilt.get("left_out"):
        lines.append(f"samples left out, below the horizon of the straightened sample: {tilt['left_out']}")
    lines += [facts["words"] for facts in provenance.get("gains", {}).values()]
    for name, facts in provenance.get("clipped", {}).items():
        lines.append(f"clipped: {facts['samples']} values of {name} at {facts['level']:.4g} sr⁻¹ are taken as bounds")
    if provenance.get(DISMISSED):
        lines.append(f"not suspected, as you have checked it: {', '.join(provenance[DISMISSED])}")
    return lines
