"""Write docs/stability.md: one section per stressor, with its cause, remedy and measured errors."""

import os
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from urllib.parse import quote

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
from homofact.version import __version__

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
    """Write the document; `pictures` is the folder of atlas.png and solvers.png, `where` the machine's line."""
    target = Path(path)
    target.parent.mkdir(parents=True, exist_ok=True)
    link = quote(os.fsencode(Path(os.path.relpath(pictures, target.parent)).as_posix()))
    write_text(target, document(atlas, solvers, link, where))


def document(atlas: Atlas, solvers: list[SolverCell], link: str, where: str) -> str:
    """Return the whole document in Markdown, pictures linked from the folder `link`."""
    sections = (_section(atlas, stressor(name)) for name in atlas.plan.stressors)
    return "\n\n".join([_head(atlas, link), *sections, _solvers(solvers, link), _measuring(atlas, where)]) + "\n"


def _head(atlas: Atlas, link: str) -> str:
    tally = ", ".join(f"{count} {name}" for name, count in atlas.counts().items() if count)
    methods = atlas.plan.methods
    rows = "\n".join(_summary(atlas, stressor(name)) for name in atlas.plan.stressors)
    return f"""\
<!-- Made by `make stability`: change the paragraphs in homofact/stability, not here. -->
# Where fits fail

Read this page before you fit difficult data. It shows which properties of a measurement make which fitting method
fail, whether homofact warns, and what you can do. Find your problem in the table and follow its link to the cause
and the remedy.

`homofact research stability` repeats these tests. `--stressors` and `--methods` select some of them. The command
writes one row per fit to `atlas.csv` and draws the pictures below.

## Which data damage which method

Each of {len(atlas.plan.stressors)} stressors changes the data of a test problem step by step, from harmless to fatal.
{len(methods)} methods fit every step: {tally}.

Each cell shows the worst fit over all strengths of a stressor: its error, divided by the same method's error
without the stressor or by 0.0025 if that is larger.
\\*: the fit's own verdict warns. **silent**: the error is over {WRONG:g} times as large, and nothing warns.
[How it is measured](#how-it-is-measured) defines the terms, such as degraded and unstressed. {_coverage(atlas.cells)}

| stressor | {" | ".join(methods)} |
|{" --- |" * (len(methods) + 1)}
{rows}

The picture shows every fit. Strengths run from harmless on the left to fatal on the right:

![The atlas]({link}/atlas.png)"""


def _coverage(cells: Sequence[Cell]) -> str:
    """How often the error bars of total reflected light cover the true error, and how often none is stated."""
    fits = [cell for cell in cells if cell.factor is not None and cell.outcome is not CellOutcome.CRASHED]
    stated = [cell for cell in fits if cell.held is not None]
    if not fits:
        return ""
    if not stated:
        return "No fit states an error bar of total reflected light, so there is nothing to compare."
    held, none = sum(cell.held is True for cell in stated), len(fits) - len(stated)
    silent = f"; {none} more state none" if none else ""
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
        f" {in_markdown('; '.join(judged.said.values())) or 'nothing'} |"
        for name, judged in atlas.unstressed.items()
    )
    absent, really = "".join(f"\n\n{in_markdown(note)}." for note in atlas.notes), _really_bad(atlas)
    return f"""\
## How it is measured

Every cell of a table is one fit of stressed samples. All fits share their settings: {shared}.
There are {scale.samples} samples of a Blinn-Phong material with a broad highlight, and a fifth of them is held out.
Each fit is then judged on {scale.clean} clean samples that it never saw. The error is the mean squared error in log
space with ε = {JUDGING_EPSILON:g}. Tables show it as a multiple of the same method's error without the stressor, or of
{WORTH_AN_ERROR:g} (an RMS of 5%) if that is larger.

homofact compares the error bar of total reflected light with the clean samples in bands of incidence angle, within
the range of angles for which the fit states the bar. The comparison adds a margin for the statistical scatter of
these few samples.

If a verdict begins “the fit has errors typical of bad fits”, homofact bases it on measured errors of the fit: the
error on held-out samples, the difference from an interpolation of the nearest samples, and others. The line `Why
it warns` in the output of `factorize` lists the decisive ones. In the calibration of the verdict, most fits with
such errors were bad, many because of faulty samples. homofact therefore states the wider error bars that it uses
for faulty samples. Check the data (`homofact info`), then
follow the line `Try next`.

* **ok**: the error is at most {DEGRADED:g} times the unstressed error, and the verdict finds nothing that it does not
  find in the unstressed fit.
* **degraded**: the error is larger, or the verdict warns (\\*). Most warnings come before the damage.{really}
* **refused**: homofact makes no fit and prints one line that names the problem.
* **silently wrong**: the error is over {WRONG:g} times the unstressed error, and nothing warns. These tests exist to
  find such fits.

A multiple below 1 is no mistake. Some stressors make the problem easier, for example if only a region with constant
values remains. For search and mccool, the divisor 0.0025 is larger than the unstressed error.

This table shows the fits without a stressor:

| method | error, clean | error, own held-out | its verdict finds |
| --- | --- | --- | --- |
{base}

All numbers were measured with seed {atlas.plan.seed} and homofact {__version__} on {in_markdown(where)}.{absent}"""


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
    methods = ", ".join(f"{bad[name]} {name}" for name in atlas.plan.methods)
    bad_warned, all_bad = (sum(cell.bad for cell in those) for those in (warned, degraded))
    return (
        f" Judged by total\n  reflected light, {all_bad} of these {len(degraded)} fits are bad: they are off by over"
        f" {BAD_LIGHT:.0%} in a band of angles, or explain under\n  {LEAST_EXPLAINED:.0%} of the clean logarithms. The"
        f" verdict warns of {len(warned)} fits, of which {bad_warned} are bad; of the others, {all_bad - bad_warned}"
        f" are.\n  Of the {len(fine)} fits called ok, {bad.total()} are bad, but without the stressor their method is"
        f" about as bad\n  ({methods})."
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
            sentences.append(f"The worst fit has {low.factor:.2g} times the unstressed error ({low.method}).")
        else:
            sentences.append(
                f"The worst fit of a method has between {low.factor:.2g} ({low.method}) and {high.factor:.2g}"
                f" ({high.method}) times its unstressed error."
            )
        warned = next((cell for cell in reversed(ranked) if cell.new), None)
        if warned is not None and warned.said:
            sentences.append(f"The verdict on the fit by {warned.method} is then “{in_markdown(warned.said[0])}.”")
    refused = next((cell for cell in cells if cell.outcome is CellOutcome.REFUSED), None)
    if refused is not None:
        sentences.append(
            f"From {refused.label} onwards the data are refused: “{in_markdown(refused.message.partition(': ')[2])}.”"
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
        f"{len(silent)} answers differ without a warning: {', '.join(silent)}."
        if silent
        else "No answer differs silently."
    )
    return f"""\
## The linear solvers

![The solvers]({link}/solvers.png)

Every solver solves the same linear systems: the stacked rows of samples, smoothing, ridge and gauge. The table
gives the condition number of the normal matrix, computed from the singular values of the stacked rows. The
reference solution is the minimum-norm solution from these singular values, refined in extended precision. A system
is well posed up to a condition number of
{WELL_POSED:.0e}. There, every answer should agree with the reference to {AGREES:.0e}, and all do to {furthest:.1e}.
Beyond, an answer counts as the minimum-norm solution within {AGREES_ILL:.0e}, and any other should have the status
`fallback` or `budget`. {silence}

The ridge term keeps the condition number near 1e10, even if no sample determines a texel. In smoothed systems, the
gauge rows lower the condition number by four to five powers of ten. A solver can then fail only if the sample
weights span a larger range than the ridge allows. In that case the iterative solvers reach their iteration limit,
and the fit reports it.

| system | what it is | texels | condition | {" | ".join(solvers)} |
|{" --- |" * (len(solvers) + 4)}
{table}"""


def _answer(cell: SolverCell) -> str:
    text = "none" if cell.difference is None else f"{cell.difference:.0e}"
    if cell.answer is SolverOutcome.AGREES:
        return text
    return f"{text} ({cell.status})" if cell.answer is SolverOutcome.SAYS_SO else f"**{text} silent**"
