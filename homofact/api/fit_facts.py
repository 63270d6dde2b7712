"""Facts and error bars of a saved fit: a result folder, an export, or a file that `Fit.save` wrote."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

from homofact.api.loading import load
from homofact.api.subjects import GivenFit
from homofact.brdf.source_names import DISMISSED
from homofact.errors import BadInput
from homofact.evaluation.wording import figure, light_by_incidence
from homofact.exporting.result import read_record
from homofact.factor.edited import edits_in_words
from homofact.factor.fixed_projections import EDITS
from homofact.files.kinds import EXPORT, FACTORIZATION

if TYPE_CHECKING:
    from homofact.api.result import Fit

_PARTS = {"held_out": "held out", "train": "training", "test": "all samples"}
_LARGEST = 75.0  # θi in degrees up to which albedos are stated


def fit_facts(place: Path) -> tuple[str, dict[str, Any], dict[str, Any]] | None:
    """Return (title, readable rows, JSON form) of a saved fit; None for anything else.

    Raises BadInput for a damaged fit.
    """
    if place.is_dir():
        if not any((place / mark).is_file() for mark in (FACTORIZATION, EXPORT.mark)):
            return None
    elif place.suffix.lower() != ".npz" or not place.is_file():
        return None

    from homofact.exporting.as_source import is_fit

    try:
        saved = is_fit(place)
    except BadInput:  # a damaged archive: what reads samples says so
        return None
    if not saved:
        return None
    fit = load(place)
    source = fit.provenance.get("source")
    made_of = (source.get("file") or source.get("material")) if isinstance(source, dict) else None
    facts: dict[str, Any] = {
        "file": str(place),
        "kind": "fit",
        "source": made_of,
        "method": fit.provenance.get("method"),
        "channels": list(fit.channels),
        "bytes": fit.nbytes,
        "fetches": fit.fetches,
    }
    rows = {name: value for name, value in facts.items() if value is not None}
    if fit.provenance.get(EDITS):
        facts["edits"] = fit.provenance[EDITS]
    edits = edits_in_words(fit.provenance)
    if edits:
        rows["edits"] = edits
    source = source if isinstance(source, dict) else {}
    checked = list(source.get(DISMISSED) or ())
    if checked:
        facts[DISMISSED] = checked
        rows["not suspected"] = f"{', '.join(checked)}: dismissed when the fit was made"
    mended = _mended(source)
    if mended:
        facts["mended"] = mended
        rows["measurement"] = "\n".join(mended)
    said, verdict = GivenFit(str(place), place).verdict, fit.verdict
    if said is not None:
        facts["verdict"] = said
        rows["verdict"] = said["summary"]
    errors = read_record(place).get("error")
    if isinstance(errors, dict):
        facts["error"] = errors
        rows |= {f"error, {_PARTS[part]}": _errors_in_words(errors[part]) for part in _PARTS if part in errors}
    light = _light_over_samples(verdict)
    if light:
        facts["light_over_samples"] = light
        rows["light over that of the samples, by θi"] = light_by_incidence(light)
    facts["albedo"] = _albedo(fit)
    rows["albedo"] = "\n".join(
        f"{angle}°: " + ", ".join(f"{name} {value:.3g}" for name, value in own.items())
        for angle, own in facts["albedo"].items()
    )
    bars = None if verdict is None else verdict.bars
    if bars is not None:
        facts["bars"] = bars.record()
        for bar in bars.by_angle:
            if bar.ratio is not None:
                stated = f"{bar.ratio:.3g} times that of the source, measured"
            elif bar.error is None:
                stated = f"unknown: {bar.reason}"
            else:
                stated = f"the source's is {bar.between()} times that of the fit"
            if bar.rests_on_extrapolation:
                stated += f"; {bar.unmeasured:.0%} of it leaves in directions without measurements"
            rows[f"total reflected light at {bar.degrees[0]:.0f}°"] = stated
    return place.name, rows, facts


def _errors_in_words(errors: dict[str, Any]) -> str:
    """Return the mean errors on a part of the samples: log mse, log mae and mae."""
    names = {"log_mse": "log mse", "log_mae": "log mae", "mae": "mae"}
    units = {"mae": " sr⁻¹"}
    found = (f"{words} {figure(errors[name])}{units.get(name, '')}" for name, words in names.items() if name in errors)
    return ", ".join(found)


def _mended(source: dict[str, Any]) -> list[str]:
    """Return the descriptions of tilt and gains from the provenance of a fit's samples."""
    gains = source.get("gains")
    tilt = source.get("tilt")
    facts = [tilt] if isinstance(tilt, dict) and (tilt.get("undone") or tilt.get("left_in")) else []
    facts += list(gains.values()) if isinstance(gains, dict) else []
    words = (each.get("words") for each in facts if isinstance(each, dict))
    return [each for each in words if isinstance(each, str)]


def _light_over_samples(verdict: Any) -> list[list[float]]:
    """Return the verdict's rows (from, to, light of the fit / light of its samples); empty if it has none."""
    rows = {} if verdict is None else verdict.record()
    found = rows.get("by_incidence")
    return found if isinstance(found, list) and all(_three_numbers(row) for row in found) else []


def _three_numbers(row: Any) -> bool:
    return isinstance(row, list) and len(row) == 3 and all(isinstance(each, int | float) for each in row)


def _albedo(fit: "Fit") -> dict[str, dict[str, float]]:
    """Return the albedo ∫ f cosθo dωo by angle of incidence and channel, with the luminance Y of RGB.

    For an anisotropic fit, it is the mean over light in the xz and yz planes.
    """
    from homofact.brdf.spectral import LUMINANCE
    from homofact.evaluation.verdict.flux import ALBEDO_DEGREES, albedos

    found = albedos(fit.factorization, fit.isotropic).mean(1)
    answer = {}
    for degrees, values in zip(ALBEDO_DEGREES, found.tolist(), strict=True):
        if degrees <= _LARGEST:
            own = dict(zip(fit.channels, values, strict=True))
            if tuple(name.upper() for name in fit.channels) == ("R", "G", "B"):
                own["Y"] = sum(weight * value for weight, value in zip(LUMINANCE, values, strict=True))
            answer[f"{degrees:g}"] = own
    return answer
