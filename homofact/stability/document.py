"""The atlas in words: docs/stability.md, one section a stressor with its mechanism, remedy and measured numbers."""

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

_MANY = 20  # fits: of fewer no percentage is said
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
    """The whole document in Markdown, pictures linked from the folder `link`."""
    sections = (_section(atlas, stressor(name)) for name in atlas.plan.stressors)
    return "\n\n".join([_head(atlas, link), *sections, _solvers(solvers, link), _measuring(atlas, where)]) + "\n"


def _head(atlas: Atlas, link: str) -> str:
    tally = ", ".join(f"{count} {name}" for name, count in atlas.counts().items() if count)
    methods = atlas.plan.methods
    rows = "\n".join(_summary(atlas, stressor(name)) for name in atlas.plan.stressors)
    return f"""\
<!-- Made by `make stability`: change the paragraphs in homofact/stability, not here. -->
# Where fits fail

{len(atlas.plan.stressors)} stressors, each swept from harmless to fatal, on {len(methods)} methods: {tally}.

{_coverage(atlas.cells)}

The error of the worst fit of each sweep, as a factor of the same method's error without the stress. \\*: the fit's own
verdict warns of it; **silent**: it is over {WRONG:g} times and nothing is said.

| stressor | {" | ".join(methods)} |
|{" --- |" * (len(methods) + 1)}
{rows}

Every fit, from harmless on the left to fatal on the right:

![The atlas]({link}/atlas.png)

How this was measured is said [at the end](#how-it-is-measured). The whole table is `atlas.csv`; a part of it is run by
`homofact stability`."""


def _coverage(cells: Sequence[Cell]) -> str:
    """How often the error bars of total reflected light hold, and how often none is stated."""
    fits = [cell for cell in cells if cell.factor is not None and cell.outcome is not CellOutcome.CRASHED]
    stated = [cell for cell in fits if cell.held is not None]
    if not fits:
        return ""
    if not stated:
        return "No fit states an error bar of total reflected light that could be compared with the clean samples."
    held, none = sum(cell.held is True for cell in stated), len(fits) - len(stated)
    silent = f"; {none} state none" if none else ""
    share = f" ({held / len(stated):.0%})" if len(stated) >= _MANY else ""
    return f"The error bar of total reflected light holds in {held} of {len(stated)} fits{share}{silent}."


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
        f"{settings['textures']} textures of\n{settings['size']}² texels, ε = {settings['epsilon']:g},"
        f" searches of {settings['effort']:g} inner evaluations"
    )
    base = "\n".join(
        f"| {name} | {judged.error:.2g} | {judged.row.held_out.log_mse:.2g} |"
        f" {in_markdown('; '.join(judged.said.values())) or 'nothing'} |"
        for name, judged in atlas.unstressed.items()
    )
    absent, really = "".join(f"\n\n{in_markdown(note)}." for note in atlas.notes), _really_bad(atlas)
    return f"""\
## How it is measured

Every cell is one fit of stressed samples, with the settings that all share ({shared}; {scale.samples} samples of a
Blinn-Phong material with a broad highlight, a fifth of them held out). It is judged on {scale.clean} clean samples that
the fit never saw, by the mean squared error in log space with ε = {JUDGING_EPSILON:g}, as a factor of the same method's
error without stress (or of {WORTH_AN_ERROR:g}, an RMS of 5%, where that is smaller).

A fit's error bar of total reflected light is compared with the clean samples in bands of incidence, within the range of
angles for which it is stated; what chance may do to so few samples is taken off.

* **ok**: at most {DEGRADED:g} times the unstressed error, and the verdict finds nothing that the unstressed fit's does
  not.
* **degraded**: a larger factor, or a verdict that warns (\\*). Most warnings come before the damage.{really}
* **refused**: no fit, but one line that names what is wrong.
* **silently wrong**: over {WRONG:g} times the unstressed error, and no word of it. The atlas exists to find these.

A factor below 1 is not a mistake: some stresses leave an easier problem (a region where the material is constant).

The unstressed fits themselves:

| method | error, clean | error, own held-out | its verdict finds |
| --- | --- | --- | --- |
{base}

All numbers are of seed {atlas.plan.seed} and homofact {__version__} on {in_markdown(where)}.{absent}"""


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
    return (
        f" By their light\n  {sum(cell.bad for cell in degraded)} of these {len(degraded)} are really bad (off by over"
        f" {BAD_LIGHT:.0%} in a band of angles, or under\n  {LEAST_EXPLAINED:.0%} of the clean logarithms explained):"
        f" {sum(cell.bad for cell in warned)} of the {len(warned)} that the verdict warns of, and"
        f"\n  {sum(cell.bad for cell in degraded if not cell.new)} of the others; of the {len(fine)} called ok,"
        f"\n  {sum(cell.bad for cell in fine)}, whose method is about as bad without the stress ({methods})."
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
        f"## {_title(stress)}\n\n`{stress.name}`. {stress.description} {stress.mechanism}"
        f" {_measured(atlas, stress)}\n\n"
        f"**Remedy.** {stress.remedy}\n\n{table}"
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
            sentences.append(f"Measured: at worst {low.factor:.2g} times the unstressed error ({low.method}).")
        else:
            sentences.append(
                f"Measured: at its worst {low.factor:.2g} times the unstressed error for {low.method}"
                f" and {high.factor:.2g} times for {high.method}."
            )
        warned = next((cell for cell in reversed(ranked) if cell.new), None)
        if warned is not None and warned.said:
            sentences.append(f"What {warned.method} then says: “{in_markdown(warned.said[0])}.”")
    refused = next((cell for cell in cells if cell.outcome is CellOutcome.REFUSED), None)
    if refused is not None:
        sentences.append(f"From {refused.label} on it is refused: “{in_markdown(refused.message.partition(': ')[2])}.”")
    sentences.append(_coverage(cells))
    silent = [f"{cell.method} at {cell.label}" for cell in cells if cell.outcome is CellOutcome.SILENT]
    if silent:
        sentences.append(f"Nothing is said by {', '.join(silent)}.")
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
        f"{len(silent)} answers differ without a word: {', '.join(silent)}."
        if silent
        else "No answer differs silently."
    )
    return f"""\
## The linear solvers

![The solvers]({link}/solvers.png)

Every solver on the same inner problems. The system is the stacked rows (samples, smoothing, ridge, gauge), its
condition number that of the normal matrix, from the singular values of the rows; the reference is the minimum-norm
answer by these, refined in extended precision. A system is called well posed up to a condition number of
{WELL_POSED:.0e}, and its answers are to agree to {AGREES:.0e} (they do to {furthest:.1e}); beyond, an answer counts as
the minimum-norm one within {AGREES_ILL:.0e}, and any other is to come with the status `fallback` or `budget`. {silence}

The ridge keeps the condition number near 1e10 even where no sample holds a texel, and the gauge rows take four to five
powers of ten off that of smoothed systems. What is left for a solver to fail on are weights that differ by more than
the ridge: iterations then reach their limit, and the fit reports it.

| system | what it is | texels | condition | {" | ".join(solvers)} |
|{" --- |" * (len(solvers) + 4)}
{table}"""


def _answer(cell: SolverCell) -> str:
    text = "none" if cell.difference is None else f"{cell.difference:.0e}"
    if cell.answer is SolverOutcome.AGREES:
        return text
    return f"{text} ({cell.status})" if cell.answer is SolverOutcome.SAYS_SO else f"**{text} silent**"
