"""Count how often error bars and warnings are right, for each kind of fault, layout of samples, material and
method.

A bar covers a fit where the true error is within it. "Stated" is the bar that a user sees, for right data or widened
or withdrawn as the verdict has it; a withdrawn bar promises nothing, and is counted apart. Intervals are of 95%:
bootstrapped over cases where fits are counted, since the fits of a case are alike, else Wilson's.
"""

import math
import random
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from statistics import median

from homofact.evaluation.bar.error_bar import BarKind, ErrorBar, ErrorBars
from homofact.evaluation.bar.stating import stated_bars
from homofact.evaluation.bar.table import QUANTITIES, Table
from homofact.evaluation.energy import ALBEDO_DEGREES
from homofact.evaluation.verdict.judge import doubt_of
from homofact.evaluation.verdict.verdict import Alarm
from scripts.shared.harness import markdown
from scripts.verdict.calibrating import SimulatedFit
from scripts.verdict.regression import wilson

_DRAWS = 400
HEAD = Path(__file__).with_name("verdict_head.md")
_MANY = 1e9
_COVERAGE = """\
"Albedo" is the bar of total reflected light. The columns "albedo", "highlight" and "sky" give the share of fits
whose true error is within the bar; they leave out bars that the verdict withdraws. "Widened" counts the fits whose
albedo bar is that of fits to faulty samples. "Withdrawn" counts the fits whose albedo bar is wider than a factor of
ten, so that the verdict prints "unknown". "Right data" are samples without a fault; some are few or slightly noisy.
"Can be known" leaves out the faults that samples cannot show. "Searched" are fits by `search`; the other fits have
fixed projections."""
_ANGLES = """\
"Bars" is the number of bars at this incidence angle, "covered" the share of bars that contain the true error, and
"median bar" the median width:"""
_WIDTHS = """\
Each cell gives the median bar that the verdict prints. In brackets are three more medians: the bar that these fits
would get if homofact treated all samples as right, the bar if it treated all samples as faulty, and the true error:"""
_MISSED = """\
"Bad without a warning" is the share of bad fits for which the verdict does not warn. "Good with a warning" is the
share of good fits for which it warns:"""
_FAULTS = """\
Faults with their strength n: `sparse` (only every n-th sample), `precision` (directions and values rounded to n
bits), `not-grazing` (no samples beyond n°), `highlight-shifted` (the detector is n° off), `azimuth` (the azimuth of
the view is n° off), `spikes` (values in a patch times n), `cosine-of-light` (values times cosⁿ θi),
`drift-with-angle` (the gain falls by the share n from the normal to θi = 90°), `stray-light` (n times the median,
divided by cosθo, is added), `late-rows` (one channel of the last share n of the rows is a row late), `scaled`
(values times n), `offset` (n times the mean is added) and `gamma` (values to the power 1/n). `sparse` and
`precision` count as right data. Samples cannot show `scaled`, `offset` and `gamma`:"""
_LAYOUTS = """\
`discs` are random pairs of directions, uniform in the parabolic discs. `lobe` are random pairs around the
highlight. `rings` are the rings of a goniometer:"""
_METHODS = """\
`mccool 2 × 20²` are McCool's projections with two textures of 20². `search 2 × 12²` is a search with two textures
of 12²:"""
_LISTED = """\
Each row is a fit. The list contains only fits whose samples determine whether the fit is good ("can be known").
"Samples" gives the fault, its strength and the layout. "Albedo off" is the true error of total
reflected light. "Explained" is the share of the variance of the clean logarithms that the fit explains; it is
negative if the fit is worse than a constant. "Score" is the estimated probability that the fit is bad. The verdict
warns if it is above {threshold:.2f}. "Suspected" lists the suspicions of `homofact info`. A fit with a small
"albedo off" is bad because of a picture, under the sky or the lamp:"""


@dataclass(frozen=True)
class JudgedFit:
    """A simulated fit with the bars and the score that a table gives it."""

    fit: SimulatedFit
    table: Table

    @cached_property
    def alarm(self) -> Alarm:
        """The warning."""
        return Alarm(self.table.score(self.fit.features("albedo")), self.table.threshold)

    @cached_property
    def doubt(self) -> str:
        """Why the samples may be wrong."""
        return doubt_of(self.fit.odds, self.alarm)

    @property
    def warned(self) -> bool:
        """Whether the verdict warns."""
        return self.alarm.given

    @cached_property
    def bars(self) -> ErrorBars:
        """The bars that are stated."""
        return stated_bars(self.fit.figures, self.fit.odds, self.table, self.doubt)

    def bar(self, quantity: str, doubt: str | None = None) -> ErrorBar:
        """The bar that is stated, or that of another doubt ("" for right data)."""
        if doubt is None:
            return self.bars.of(quantity)
        return stated_bars(self.fit.figures, self.fit.odds, self.table, doubt).of(quantity)

    def true(self, quantity: str) -> float:
        """The true error as a share."""
        error = self.fit.error(quantity)
        return error if quantity == "sky" else math.expm1(min(error, 20.0))

    def covered(self, quantity: str, doubt: str | None = None) -> bool | None:
        """Whether the true error is within the bar; None where it is withdrawn."""
        bar = self.bar(quantity, doubt)
        return None if bar.error is None else self.true(quantity) <= bar.error


Fits = Sequence[JudgedFit]


def report(fits: Sequence[SimulatedFit], constants: Table) -> list[str]:
    """The paragraphs of a report on fits that the table has not seen."""
    judged = [JudgedFit(fit, constants) for fit in fits]
    known = [each for each in judged if each.fit.knowable]
    right = [each for each in judged if each.fit.right]
    good = [each for each in known if each.fit.good]
    by_fault = _groups(judged, lambda each: each.fit.record["fault"] or "clean")
    return [
        HEAD.read_text(encoding="utf-8").strip(),
        "## Results on unseen cases",
        f"The unseen cases are {len({each.fit.record['number'] for each in judged})} simulated measurements with"
        f" {len(judged)} fits; {sum(each.fit.searched for each in judged)} of the fits are made by a search. For"
        f" {len(known)} fits, the samples determine whether the fit is good; {len(good)} of these are good. The error"
        f" bars and the threshold come from {constants.made['fits']} other fits (hash {constants.made['hash']}).",
        "### Coverage of the stated bars",
        _COVERAGE,
        _coverage_table(
            {
                "all that can be known": known,
                "right data": right,
                "faulty data, can be known": [each for each in known if not each.fit.right],
                "cannot be known": [each for each in judged if not each.fit.knowable],
                "searched, can be known": [each for each in known if each.fit.searched],
            }
        ),
        "### Coverage of the bars of single angles",
        _ANGLES,
        _angle_table({"right data": right, "all that can be known": known}),
        "### Width of the bars of good fits",
        _WIDTHS,
        _bounds_table({"right data": [each for each in right if each.fit.good], "all that can be known": good}),
        "### Missed bad fits and false warnings",
        _MISSED,
        _alarm_table(
            {
                "all": judged,
                "can be known": known,
                "searched, can be known": [each for each in known if each.fit.searched],
                "not searched, can be known": [each for each in known if not each.fit.searched],
                "off by over twice a limit": [each for each in known if each.fit.badness > math.log(2)],
            }
        ),
        "### Coverage by kind of fault",
        _FAULTS,
        _coverage_table(by_fault),
        "### Coverage by measurement layout",
        _LAYOUTS,
        _coverage_table(_groups(known, lambda each: each.fit.record["layout"])),
        "### Coverage by kind of material",
        _coverage_table(_groups(known, lambda each: kind_of_material(each.fit.record["material"]))),
        "### Coverage by fitting method",
        _METHODS,
        _coverage_table(_groups(known, lambda each: each.fit.record["settings"])),
        "### Bad fits without a warning",
        _LISTED.format(threshold=constants.threshold),
        _listed([each for each in known if not each.fit.good and not each.warned]),
        "### Good fits with a warning",
        _listed([each for each in good if each.warned]),
    ]


def kind_of_material(name: str) -> str:
    """An analytic model, a mixture or a surrogate."""
    if name.startswith(("blinn-phong ", "ward ", "cook-torrance ")):
        return "analytic"
    return "mixture" if " + " in name else "surrogate"


def _groups(fits: Fits, key: Callable[[JudgedFit], str]) -> dict[str, Fits]:
    names = sorted({key(each) for each in fits})
    return {name: [each for each in fits if key(each) == name] for name in names}


def _coverage_table(groups: dict[str, Fits]) -> str:
    lines = []
    for name, fits in groups.items():
        cells: list[object] = [name, len(fits)]
        for quantity in QUANTITIES:
            found = [(each.fit.record["number"], each.covered(quantity)) for each in fits]
            stated = [(number, hit) for number, hit in found if hit is not None]
            cells.append(_rate(stated) if stated else "–")
        withdrawn = sum(each.bar("albedo").error is None for each in fits)
        widened = sum(each.bar("albedo").kind is BarKind.FAULT for each in fits)
        lines.append((*cells, widened, withdrawn))
    return markdown(("fits", "number", *QUANTITIES, "widened", "withdrawn"), lines)


def _angle_table(groups: dict[str, Fits]) -> str:
    """Per incidence angle: how often the error of the albedo there is within its bar, and the median bar."""
    lines = []
    for k, degrees in enumerate(ALBEDO_DEGREES):
        cells: list[object] = [f"{degrees:g}°"]
        for fits in groups.values():
            found = [(each, bar) for each in fits for bar in each.bars.by_angle if bar.degrees[0] == degrees]
            stated = [(each, bar.error) for each, bar in found if bar.error is not None]
            true = [math.expm1(min(each.fit.error("albedo", k), 20.0)) for each, _ in stated]
            hits = [(each.fit.record["number"], off <= error) for (each, error), off in zip(stated, true, strict=True)]
            cells += [len(hits), _rate(hits), _median([error for _, error in stated])]
        lines.append(tuple(cells))
    head = [f"{name}{column}" for name in groups for column in (": bars", ", covered", ", median bar")]
    return markdown(("θ", *head), lines)


def _bounds_table(groups: dict[str, Fits]) -> str:
    lines = []
    for name, fits in groups.items():
        cells: list[object] = [name, len(fits)]
        for quantity in QUANTITIES:
            stated, if_right, fault = (
                _median([_error(each.bar(quantity, doubt)) for each in fits]) for doubt in (None, "", "any")
            )
            true = _median([each.true(quantity) for each in fits])
            cells.append(f"{stated} ({if_right} if right, {fault} if faulty; true {true})")
        lines.append(tuple(cells))
    return markdown(("good fits", "number", *(f"{quantity}, median bar" for quantity in QUANTITIES)), lines)


def _alarm_table(groups: dict[str, Fits]) -> str:
    lines = []
    for name, fits in groups.items():
        bad, good = ([each for each in fits if each.fit.good is which] for which in (False, True))
        silent = [(each.fit.record["number"], not each.warned) for each in bad]
        alarms = [(each.fit.record["number"], each.warned) for each in good]
        lines.append((name, len(bad), _rate(silent), len(good), _rate(alarms)))
    return markdown(("fits", "bad", "bad without a warning", "good", "good with a warning"), lines)


def _listed(fits: Fits) -> str:
    lines = [
        (
            each.fit.record["material"],
            f"{each.fit.record['fault'] or 'clean'} {each.fit.record['strength']:g}, {each.fit.record['layout']}",
            each.fit.record["settings"],
            f"{each.true('albedo'):.0%}",
            f"{each.fit.record['truth']['explained']:.2f}",
            f"{each.alarm.score:.2f}",
            ", ".join(each.fit.odds) or "–",
        )
        for each in fits
    ]
    if not lines:
        return "None."
    head = ("material", "samples", "method", "albedo off", "explained", "score", "suspected")
    return markdown(head, lines, 3)


def _rate(hits: Sequence[tuple[int, bool]]) -> str:
    """ "91% [87–94]": the share of hits with its interval, cases (numbered) drawn again and again."""
    if not hits:
        return "–"
    cases: dict[int, list[bool]] = {}
    for number, hit in hits:
        cases.setdefault(number, []).append(hit)
    chance, groups = random.Random(0), list(cases.values())
    shares = []
    for _ in range(_DRAWS):
        drawn = [hit for _ in groups for hit in chance.choice(groups)]
        shares.append(sum(drawn) / len(drawn))
    shares.sort()
    low, high = shares[int(0.025 * _DRAWS)], shares[int(0.975 * _DRAWS) - 1]
    if low == high:
        low, high = wilson(round(low * len(groups)), len(groups))
    return f"{sum(hit for _, hit in hits) / len(hits):.0%} [{100 * low:.0f}–{100 * high:.0f}]"


def _error(bar: ErrorBar) -> float:
    return _MANY if bar.error is None else bar.error


def _median(values: Sequence[float]) -> str:
    if not values:
        return "–"
    middle = median(values)
    return "none" if middle >= _MANY else f"{middle:.1%}"
