"""Write docs/stability.md: one section per stressor, with its cause, remedy and measured errors."""

import os
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from urllib.parse import quote

from homofact.evaluation.wording import listed
from homofact.files.atomic import write_text
from homofact.files.words import in_markdown
from homofact.stability.atlas import Atlas
from homofact.stability.cells import (
    BAD_LIGHT,
    DEGRADED,
    JUDGING_EPSILON,
    LEAST_EXPLAINED,
    WORTH_AN_ERROR,
    WRONG,
    Cell,
    CellOutcome,
)
from homofact.stability.problem import Stressor
from homofact.stability.solver_atlas import AGREES, AGREES_ILL, SYSTEMS, WELL_POSED, SolverCell, SolverOutcome
from homofact.stability.stressors import stressor

_MANY = 20  # fits: fewer get no percentage
_WORDS = {
    CellOutcome.REFUSED: "refused",
    CellOutcome.CRASHED: "crashed",
    CellOutcome.NONE: "–",
    CellOutcome.ABSENT: "no data",
}


def write_document(
    path: str | os.PathLike[str], atlas: Atlas, solvers: list[SolverCell], pictures: Path, where: str
) -> None:
    """Write the document; `pictures` is the folder of atlas.png and solvers.png, `where` describes the machine."""
    target = Path(path)
    target.parent.mkdir(parents=True, exist_ok=True)
    link = quote(os.fsencode(Path(os.path.relpath(pictures, target.parent)).as_posix()))
    write_text(target, document(atlas, solvers, link, where))


def document(atlas: Atlas, solvers: list[SolverCell], link: str, where: str) -> str:
    """Return the whole document in Markdown, pictures linked from the folder `link`."""
    sections = (_section(atlas, stressor(name)) for name in atlas.plan.stressors)
    return "\n\n".join([_head(atlas, link), *sections, _solvers(solvers, link), _measuring(atlas, where)]) + "\n"


def _head(atlas: Atlas, link: str) -> str:
    counts = atlas.counts()
    del counts[CellOutcome.SILENT.value]
    tally = listed([f"{count} are {name}" for name, count in counts.items() if count])
    methods = atlas.plan.methods
    warned = [name for name in methods if name in atlas.unstressed and atlas.unstressed[name].said]
    warned_words = (
        f" The verdicts of {listed(warned)} warn even without a stressor, so their fits have no \\*." if warned else ""
    )
    rows = "\n".join(_summary(atlas, stressor(name)) for name in atlas.plan.stressors)
    return f"""\
<!-- Made by `make stability`: change the paragraphs in homofact/stability, not here. -->
# Where fits fail

Read this page before you fit difficult data. It shows which properties of a measurement make which fitting method
fail, whether homofact warns, and what you can do. Find your problem in the table and follow its link to the cause
and the remedy.

`homofact research stability` repeats these tests. It can also run only some stressors or methods. The command
writes one row per fit to `atlas.csv` and draws the pictures below.

## Which data damage which method

A stressor is one fault of the data or of the settings, applied to a test problem at several strengths, from harmless
to fatal. There are {len(atlas.plan.stressors)} stressors. Each of {len(methods)} methods fits the data of each
strength. Of the results, {tally}. {_silent(atlas.cells)}

Each cell shows the worst fit over all strengths of a stressor. The number is the error of this fit, divided by the
same method's error without the stressor (the unstressed error). If the unstressed error is below {WORTH_AN_ERROR:g},
the divisor is {WORTH_AN_ERROR:g}. \\*: the verdict warns, while that of the unstressed fit does not. **silent**: the
number is over {WRONG:g}, and the verdict does not warn.{warned_words} [How it is measured](#how-it-is-measured)
defines the terms, such as degraded. {_coverage(atlas.cells)}

| stressor | {" | ".join(methods)} |
|{" --- |" * (len(methods) + 1)}
{rows}

The picture shows every fit. Strengths run from harmless on the left to fatal on the right:

![The atlas]({link}/atlas.png)"""


def _silent(cells: Sequence[Cell]) -> str:
    """How many fits are silently wrong, and for how many of them the error bar is right."""
    silent = [cell for cell in cells if cell.outcome is CellOutcome.SILENT]
    if not silent:
        return "No fits are silently wrong."
    held = sum(cell.held is True for cell in silent)
    fits = "1 fit is" if len(silent) == 1 else f"{len(silent)} fits are"
    return f"{fits} silently wrong; the error bar of total reflected light covers the true error of {held} of them."


def _coverage(cells: Sequence[Cell]) -> str:
    """How often the error bars of total reflected light cover the true error, and how often none is stated."""
    fits = [cell for cell in cells if cell.factor is not None and cell.outcome is not CellOutcome.CRASHED]
    stated = [cell for cell in fits if cell.held is not None]
    if not fits:
        return ""
    if not stated:
        return "No fit states an error bar of total reflected light, so there is nothing to compare."
    held, none = sum(cell.held is True for cell in stated), len(fits) - len(stated)
    silent = f"; {none} more fits state no error bar" if none else ""
    share = f" ({held / len(stated):.0%})" if len(stated) >= _MANY else ""
    return (
        f"The error bar of total reflected light covers the true error in {held} of {len(stated)} fits{share}{silent}."
    )


def _summary(atlas: Atlas, stress: Stressor) -> str:
    """A stressor's row: of every method the fit that is farthest off, and a note where stronger stress is refused."""
    cells = []
    for name in atlas.plan.methods:
        own = atlas.of(stress.name, name)
        fits = [cell for cell in own if cell.factor is not None]
        # What is silent comes first, whatever its factor.
        worst = max(fits, key=lambda cell: (cell.outcome is CellOutcome.SILENT, cell.factor or 0), default=own[-1])
        refused = any(cell.outcome is CellOutcome.REFUSED for cell in own)
        cells.append(_words(worst) + (", then refused" if fits and refused else ""))
    return f"| [{_title(stress)}](#{_anchor(_title(stress))}) | {' | '.join(cells)} |"


def _title(stress: Stressor) -> str:
    return stress.title[0].upper() + stress.title[1:]


def _anchor(title: str) -> str:
    """What a Markdown heading is linked by: small letters, hyphens for spaces, no punctuation."""
    return "".join(letter for letter in title.lower().replace(" ", "-") if letter.isalnum() or letter in "-_")


def _measuring(atlas: Atlas, where: str) -> str:
    settings, scale = atlas.plan.settings, atlas.plan.scale
    shared = (
        f"{settings['textures']} textures of {settings['size']}² texels, ε = {settings['epsilon']:g},"
        f" and searches of {settings['effort']:g} evaluations"
    )
    base = "\n".join(
        f"| {name} | {judged.error:.2g} | {judged.row.held_out.log_mse:.2g} |"
        f" {in_markdown('; '.join(judged.said.values())) or 'none'} |"
        for name, judged in atlas.unstressed.items()
    )
    absent, really = "".join(f"\n\n{in_markdown(note)}." for note in atlas.notes), _really_bad(atlas)
    silent = atlas.counts()[CellOutcome.SILENT.value]
    names = [name for name, judged in atlas.unstressed.items() if judged.error < WORTH_AN_ERROR]
    small = (
        f" For {listed(names)}, the unstressed error is below {WORTH_AN_ERROR:g}, so the divisor is"
        f" {WORTH_AN_ERROR:g} and even harmless strengths give numbers below 1."
        if names
        else ""
    )
    return f"""\
## How it is measured

Every cell of a section's table is one fit of stressed samples. Unless the stressor changes them, all fits use the
same settings: {shared}. Unless the stressor has a material of its
own, the test problem has {scale.samples} samples of a Blinn-Phong material with a broad highlight. A fifth of them is
held out. The error of each fit is then measured on {scale.clean} clean samples that were not fitted: the Cole error
with ε = {JUDGING_EPSILON:g}. The tables divide it by the unstressed error, which is the same method's error without
the stressor, or by {WORTH_AN_ERROR:g} (an RMS of 5%) if that is larger.

homofact compares the error bar of total reflected light with the clean samples in bands of incidence angle, within
the range of angles for which the fit states the bar. The comparison adds a margin for the statistical scatter of
these few samples.

If a verdict begins “the fit has errors typical of bad fits”, homofact bases it on measured errors of the fit: the
error on held-out samples, the difference from an interpolation of the nearest samples, and others. The line `Why
it warns` in the output of `factorize` lists the decisive ones. In the calibration of the verdict, most fits with
such errors were bad, many because of faulty samples. homofact therefore states the wider error bars that it uses
for faulty samples. Check the data (`homofact info`), then follow the line `Try next`. The verdicts quoted on this page
are those of the build that made it. After a later calibration, verdicts may state other limits and another share than
“nine of ten”, and may warn from another probability on ([How accurate the verdict is](verdict.md)).

On this page, the verdict “warns” if it does not trust the fit, or if the solver reports a fallback or an interruption.
Findings alone are no warning. The results are:

* **ok**: the number in the cell is at most {DEGRADED:g}, and the verdict has no new warning. A warning is new if the
  unstressed fit does not have it.
* **degraded**: the number is larger, or the verdict has a new warning (\\*).{really}
* **refused**: homofact makes no fit and prints one line that names the problem.
* **silently wrong**: the number is over {WRONG:g}, and the verdict does not warn. These tests exist to find such fits;
  they found {silent or "none"}.

A number below 1 is no mistake. Some stressors make the problem easier, for example if only a region with constant
values remains.{small}

This table shows the fits without a stressor:

| method | error, clean | error, own held-out | warning of its verdict |
| --- | --- | --- | --- |
{base}

All numbers were measured with seed {atlas.plan.seed} on {in_markdown(where)}.{absent}"""


def _really_bad(atlas: Atlas) -> str:
    """How many of the cells are bad by their light, of those that are degraded and of those that are called ok."""
    cells = [cell for cell in atlas.cells if cell.factor is not None]
    degraded, fine = (
        [cell for cell in cells if cell.outcome is outcome] for outcome in (CellOutcome.DEGRADED, CellOutcome.OK)
    )
    warned = [cell for cell in degraded if cell.new]
    if not cells:
        return ""
    bad = Counter(cell.method for cell in fine if cell.bad)
    methods = ", ".join(f"{bad[name]} by {name}" for name in atlas.plan.methods)
    known = {name for name, judged in atlas.unstressed.items() if judged.said}
    usual = sum(cell.bad and cell.method in known for cell in degraded if not cell.new)
    poor = [
        name
        for name, judged in atlas.unstressed.items()
        if not (abs(judged.off - 1) <= BAD_LIGHT and judged.explained >= LEAST_EXPLAINED)
    ]
    poor_words = f" Without a stressor, the fits of {listed(poor)} are bad as well." if poor else ""
    bad_warned, all_bad = (sum(cell.bad for cell in those) for those in (warned, degraded))
    return (
        f" {all_bad} of these {len(degraded)}\n  fits are bad: their total reflected light is off by over"
        f" {BAD_LIGHT:.0%} in a band of angles, or they explain less than\n  {LEAST_EXPLAINED:.0%} of the variance of"
        " the clean logarithms. (The page on the [accuracy of the verdict](verdict.md#the-warning)\n  calls other fits"
        f" bad: it compares albedo and pictures.) {len(warned)} of the {len(degraded)} fits have a new warning,\n  and"
        f" {bad_warned} of these are bad. Of the {len(degraded) - len(warned)} fits without a new warning,"
        f" {all_bad - bad_warned} are bad; {usual} of these are\n  by methods whose verdict warns even without a"
        f" stressor. {bad.total()} of the {len(fine)} fits called ok are bad\n  ({methods}).{poor_words}"
    )


def _section(atlas: Atlas, stress: Stressor) -> str:
    strengths = [stress.label(strength) for strength in atlas.plan.strengths(stress)]
    lines = [
        f"| {stress.unit} | {' | '.join(strengths)} |",
        f"|{' --- |' * (len(strengths) + 1)}",
        *(
            f"| {name} | {' | '.join(map(_words, atlas.of(stress.name, name)))} |"
            for name in atlas.plan.methods
            if any(cell.outcome is not CellOutcome.NONE for cell in atlas.of(stress.name, name))
        ),
    ]
    table = "\n".join(lines)
    return (
        f"## {_title(stress)}\n\n`{stress.name}`: {stress.description}\n\n**Cause.** {stress.mechanism}\n\n"
        f"**Remedy.** {stress.remedy}\n\n**Measured.** {_measured(atlas, stress)}\n\n{table}"
    )


def _words(cell: Cell) -> str:
    if cell.factor is None or cell.outcome is CellOutcome.CRASHED:
        return _WORDS[cell.outcome]
    text = f"{cell.factor:.2g}" if cell.factor < 1000 else f"{cell.factor:.1e}"
    if cell.outcome is CellOutcome.SILENT:
        return f"**{text} silent**"
    return f"{text}\\*" if cell.new else text


def _measured(atlas: Atlas, stress: Stressor) -> str:
    """The section's numbers in sentences: the range over methods at the worst strength, and what is said of it."""
    cells = [cell for cell in atlas.cells if cell.stressor == stress.name]
    worst: dict[str, Cell] = {}
    for cell in cells:
        if cell.factor is not None and (cell.method not in worst or cell.factor > (worst[cell.method].factor or 0)):
            worst[cell.method] = cell
    sentences = []
    if worst:
        ranked = sorted(worst.values(), key=lambda cell: cell.factor or 0)
        low, high = ranked[0], ranked[-1]
        if len(ranked) == 1:
            sentences.append(
                f"The error of the worst fit, divided by its unstressed error (or {WORTH_AN_ERROR:g} if that is"
                f" larger), is {low.factor:.2g} ({low.method})."
            )
        else:
            sentences.append(
                f"The error of each method's worst fit, divided by its unstressed error (or {WORTH_AN_ERROR:g} if that"
                f" is larger), is between {low.factor:.2g} ({low.method}) and {high.factor:.2g} ({high.method})."
            )
        warned = next((cell for cell in reversed(ranked) if cell.new), None)
        if warned is not None and warned.said:
            sentences.append(f"The verdict on the worst fit by {warned.method} is “{in_markdown(warned.said[0])}.”")
    refused = [cell for cell in cells if cell.outcome is CellOutcome.REFUSED]
    if refused:
        labels = list(dict.fromkeys(cell.label for cell in refused))
        sentences.append(
            f"At the strength{'s' * (len(labels) > 1)} {listed(labels)}, homofact refuses the data:"
            f" “{in_markdown(refused[0].message.partition(': ')[2])}.”"
        )
    sentences.append(_coverage(cells))
    silent = [f"{cell.method} at {cell.label}" for cell in cells if cell.outcome is CellOutcome.SILENT]
    if silent:
        sentences.append(f"There is no warning from {', '.join(silent)}.")
    return " ".join(filter(None, sentences))


def _solvers(cells: list[SolverCell], link: str) -> str:
    solvers = list(dict.fromkeys(cell.solver for cell in cells))
    described = {system.name: system.description for system in SYSTEMS}
    rows = []
    for name in dict.fromkeys(cell.system for cell in cells):
        own = [cell for cell in cells if cell.system == name]
        answers = " | ".join(_answer(cell) for cell in own)
        rows.append(f"| {name} | {described[name]} | {own[0].unknowns} | {own[0].condition:.1e} | {answers} |")
    well = [cell for cell in cells if cell.well_posed and cell.difference is not None]
    furthest = max((cell.difference or 0.0 for cell in well), default=0.0)
    silent = [f"{cell.solver} on “{cell.system}”" for cell in cells if cell.answer is SolverOutcome.SILENT]
    table = "\n".join(rows)
    silence = (
        f"{len(silent)} solutions differ without such a status: {', '.join(silent)}."
        if silent
        else "No solver returns a different solution without such a status."
    )
    return f"""\
## The linear solvers

![The solvers]({link}/solvers.png)

Every solver solves the same linear systems: the stacked rows of samples, smoothing, ridge and gauge. The column
"condition" gives the condition number of the normal matrix, computed from the singular values of the stacked rows.
The reference solution is the minimum-norm solution from these singular values, refined in extended precision. The
columns of the solvers give the difference between each solution and the reference. A system is well posed up to a
condition number of {WELL_POSED:.0e}. For such a system, every solver should agree with the reference to {AGREES:.0e}.
All agree to {furthest:.1e}. For worse conditioned systems, we count a solution as the minimum-norm solution if it
agrees to {AGREES_ILL:.0e}. Any other solution should have the status `fallback` or `budget`. {silence}

The ridge term limits the condition number to about 1e10, even if no sample determines a texel. Only far too much
smoothing raises it further. In smoothed systems, the gauge rows lower the condition number by four to five powers of
ten. A solver can then fail only if the sample weights span a larger range than the ridge allows. In that case the
iterative solvers reach their iteration limit, and the fit reports it.

| system | what it is | texels | condition | {" | ".join(solvers)} |
|{" --- |" * (len(solvers) + 4)}
{table}"""


def _answer(cell: SolverCell) -> str:
    text = "none" if cell.difference is None else f"{cell.difference:.0e}"
    if cell.answer is SolverOutcome.AGREES:
        return text
    return f"{text} ({cell.status})" if cell.answer is SolverOutcome.SAYS_SO else f"**{text} silent**"
