"""Judge a fit: bound its error, warn if necessary, and list findings.

If the source can be evaluated everywhere, the error is measured. For samples, the models of `bar.table` estimate it
from figures of the fit and the samples (`measuring`). The models for correct samples are used unless there is a
suspicion or a warning; then those for faulty samples are used.
"""

import math
from collections.abc import Mapping
from dataclasses import replace

from homofact.brdf.pair_density import scheme_of
from homofact.brdf.quality.suspicion.suspects import suspicions
from homofact.brdf.samples import Samples
from homofact.errors import Report
from homofact.evaluation.appearance import Appearance
from homofact.evaluation.artefacts.look import Look
from homofact.evaluation.bar.causes import causes_in_words, lacks_measurements
from homofact.evaluation.bar.error_bar import GOOD, percent
from homofact.evaluation.bar.features import features_of
from homofact.evaluation.bar.stating import measured_bars, stated_bars, withdrawn_bars
from homofact.evaluation.bar.table import QUANTITIES, Table, table
from homofact.evaluation.metrics import SixErrors
from homofact.evaluation.verdict.figures import Figures
from homofact.evaluation.verdict.finding import Finding, ordered
from homofact.evaluation.verdict.measuring import measured_figures
from homofact.evaluation.verdict.noting import NOTERS, Noted
from homofact.evaluation.verdict.verdict import Alarm, Verdict
from homofact.factor.fitted import Fitted
from homofact.methods.method import Method

# What makes a fit a bad one: its albedo at some angle, its picture under a sky, or that under a small lamp.
OFF, OFF_SKY, OFF_LAMP = (GOOD[name] for name in ("albedo", "sky", "lamp"))
_ANISOTROPIC = "error bars were calibrated without anisotropic measurements"


def judge(
    fitted: Fitted,
    report: Report,
    settings: Method,
    train: Samples,
    test: Samples,
    errors: tuple[SixErrors, SixErrors],
    seen: Appearance | None = None,
    look: Look | None = None,
) -> Verdict:
    """Return the verdict on a fit of `train`, given its `errors` on training samples and on `test`.

    `seen` is the appearance of the fit compared with its source, None if the source cannot be evaluated everywhere.
    `look` has the artefacts in pictures of the fit (`artefacts.look`). `train` are the training samples without azimuth
    copies, since copies agree perfectly and would hide scatter in the data.
    """
    figures = measured_figures(fitted, report, train, test, errors, settings.seed, seen)
    suspected = tuple(suspicions(train, settings.seed)) if scheme_of(train) is None else ()
    odds = {each.name: each.odds for each in suspected}
    noted = Noted(fitted, figures, settings, train, report.status, suspected, look)
    findings = [finding for noter in NOTERS for finding in noter(noted)]
    if seen is not None:
        return Verdict(report.status, measured_bars(seen), measured_alarm(seen), figures, ordered(findings), look)
    constants = table()
    features = features_of(figures, odds, "albedo")
    model = constants.warning
    why, lacking = causes_in_words(model, features), lacks_measurements(model, features)
    alarm = Alarm(constants.score(features), constants.threshold, why, lacking)
    doubt = doubt_of(odds, alarm)
    bars = stated_bars(figures, odds, constants, doubt) if train.isotropic else withdrawn_bars(figures, _ANISOTROPIC)
    stated = bars.bars[0].reason != _ANISOTROPIC
    costed = [_costed(each, figures, odds, constants, bool(doubt)) if stated else each for each in findings]
    return Verdict(report.status, bars, alarm, figures, ordered(costed), look)


def measured_alarm(seen: Appearance) -> Alarm:
    """Return the alarm of a fit that was measured against its source; its score is 0 or 1."""
    ratio = seen.energy.albedo_worst
    off = abs(math.log(ratio)) if ratio > 0 and math.isfinite(ratio) else math.inf
    sky, lamp = (0.0 if math.isnan(each) else each for each in (seen.off_sky, seen.off_light))
    parts = (
        (f"total reflected light is too {'dark' if ratio < 1 else 'bright'}", math.expm1(off), OFF),
        ("a sphere under a sky is off", sky, OFF_SKY),
        ("a sphere under a lamp is off", lamp, OFF_LAMP),
    )
    why = [f"{name} by {percent(error)}, over {most:.0%}" for name, error, most in parts if error > most]
    return Alarm(0.0 if is_good(off, sky, lamp) else 1.0, 0.5, "; ".join(why))


def is_good(off: float, sky: float, lamp: float) -> bool:
    """Return whether a fit is good, by limits on its visible errors.

    `off` is |log| of the worst ratio of its albedo to the source's. `sky` and `lamp` are Σ|difference|/Σ of a picture
    of a sphere. The log error does not count, since it is mostly noise for a nearly diffuse material.
    """
    return off <= math.log1p(OFF) and sky <= OFF_SKY and lamp <= OFF_LAMP


def doubt_of(odds: Mapping[str, float], alarm: Alarm) -> str:
    """Return the reason for using the error bars of faulty samples, as a clause; "" if the samples seem correct."""
    if odds:
        return f"the samples look faulty ({', '.join(odds)})"
    if not alarm.given:
        return ""
    return "too little was measured" if alarm.lacking else "the fit has errors typical of bad fits"


def _costed(finding: Finding, figures: Figures, odds: Mapping[str, float], constants: Table, doubted: bool) -> Finding:
    """The finding with what it costs: the factor of the widest bar against one whose feature is a usual one."""
    costs = []
    for name in QUANTITIES:
        model = constants.bars["fault" if doubted else "right"][name].model
        if finding.feature in model.columns:
            usual = model.columns[finding.feature][1]
            features = features_of(figures, odds, name)
            changed = features | {finding.feature: usual}
            costs.append(math.exp(model.value(features) - model.value(changed)))
    return replace(finding, cost=max(costs)) if costs else finding
