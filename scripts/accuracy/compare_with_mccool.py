"""Repeat the experiment of Cole 2002, chapter 4: searched projections against McCool's, as CSV, table and figure.

    python scripts/accuracy/compare_with_mccool.py [SOURCE ...] [--out FOLDER] [--page FILE.md] [--plot FILE.png]

Each material × both coordinates × reciprocity on and off × 1 to 5 textures: the projections searched
small, the textures solved at 24², all six errors on training and held-out samples beside those of McCool's
projections at the same size, and a verdict on each statement of the thesis's section 4.4. McCool's textures are
solved on the plain grid, as the thesis must have had them, and on one with a texel where the highlight is; the
statements are judged against both. SOURCE adds a material:NAME or a file to the thesis's own. The measurements of
leather and velvet (CUReT) are not here. `--page` and `--plot` write the tables and the figure a second time, for the
documentation.
"""

import csv
import io
import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure
from matplotlib.ticker import FormatStrFormatter, FuncFormatter

from homofact.brdf.source import Source, open_source
from homofact.brdf.source_names import HELD_OUT
from homofact.evaluation.compare import ComparisonRow, fit_and_measure
from homofact.evaluation.machine import machine
from homofact.evaluation.metric_table import SIX
from homofact.files.atomic import replace_file
from homofact.methods.cole import Cole
from homofact.methods.mccool import McCool
from homofact.methods.table import mccool_like

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from scripts.accuracy.ladder import ladder
from scripts.accuracy.thesis_statements import MCCOOL, Errors, Key, judge
from scripts.shared.harness import cornell_files, data_folder, figure, markdown, parser_of, write

MATERIALS = ("material:lafortune-blue-paint", "material:cook-torrance-plastic")
GRIDS = ("plain", "centred")
PAGE = "<!-- Made by `python scripts/accuracy/compare_with_mccool.py`: change the words there, not here. -->\n"
INTRODUCTION = """
Read this page to see whether homofact reproduces the results of Cole's thesis. In the thesis (2002, chapter 4),
Cole searches for the projections that index the textures, and compares the searched projections with the fixed
projections of McCool, Ang and Ahmad (2001). This page repeats the comparison on two analytic material models and on
measurements of three paints by Cornell University. To use the thesis's search on your own file, run

    homofact compare SOURCE --methods mccool,cole,search --plot out/methods.png

homofact fits McCool's textures on two grids. The plain grid is probably the one of the thesis. The centred grid has
a texel at the centre of the highlight.
"""
RESULT = """
homofact's fits agree with 8 of the 12 statements in section 4.4 of the thesis, with both grids, on training and on
held-out samples. Four statements differ. Three of them are about the Lafortune paint. For this paint, the error
falls by less than in the thesis (two statements), and half-diff coordinates have a smaller error than in-out
coordinates (both are defined below). The fourth is about the Cornell paints. With two textures, McCool's
projections have a smaller error than the searched projections on two of the three paints (training samples), or on
all three (held-out samples).
"""
READING = """
The first two tables compare statements of the thesis with errors measured here. The tolerances and ratios in
brackets are homofact's reading of the statement, not Cole's words. "Best" is the smallest error of the four
variants: in-out or half-diff, reciprocal or free. The columns "training" use the training samples, as the thesis
does. The columns "held out" use held-out samples. Statements that do not mention McCool have the same figures in
both tables. The last table shows the Cole error ([glossary](glossary.md)) for each number of textures. Each cell
has the training error, a slash, and the held-out error. If a few bright samples dominate the mean, the held-out
error can be smaller than the training error, as for the Cornell paints. McCool's two textures need three fetches,
because one of them is used for ωi and for ωo. *In-out* and *half-diff* are the coordinates in which the projections
are searched. *In-out* uses the directions (ωi, ωo) themselves. *Half-diff* uses Rusinkiewicz's half and difference
vectors. *Reciprocal* fits enforce f(ωi, ωo) = f(ωo, ωi). *Free* fits do not.
"""
PICTURE = "![Error against textures](pictures/thesis.png)"
VARIANTS = [(name, reciprocal) for name in ("in-out", "half-diff") for reciprocal in (True, False)]
STYLES = {
    ("in-out", True): ("#b2521b", "-", "o"),
    ("in-out", False): ("#b2521b", ":", "s"),
    ("half-diff", True): ("#1f4e79", "-", "o"),
    ("half-diff", False): ("#1f4e79", ":", "s"),
}


def experiment(source: Source, settings: Cole) -> list[ComparisonRow]:
    """McCool's row on each grid, then 1 … n textures of the four variants of the search."""
    rows = [fit_and_measure(source, replace(mccool_like(settings), grid=grid)) for grid in GRIDS]
    for coordinates, reciprocal in VARIANTS:
        began = time.perf_counter()
        rows += ladder(source, replace(settings, coordinates=coordinates, reciprocal=reciprocal))
        print(
            f"{source.name}, {variant(rows[-1])}: {time.perf_counter() - began:.0f} s, Cole error"
            f" {figure(rows[-1].train.log_mse)} at {len(rows[-1].factorization.terms)} textures"
            f" (McCool {' and '.join(figure(row.train.log_mse) for row in rows[: len(GRIDS)])})",
            file=sys.stderr,
        )
    return rows


def variant(row: ComparisonRow) -> str:
    """The name of a row's method: McCool, or coordinates and reciprocity."""
    if isinstance(row.settings, McCool):
        return f"McCool (ωi, h, ωo), {row.settings.grid} grid"
    assert isinstance(row.settings, Cole)
    return f"{row.settings.coordinates}, {'reciprocal' if row.settings.reciprocal else 'free'}"


def reciprocal_of(row: ComparisonRow) -> bool:
    """Whether a row's method enforces reciprocity."""
    assert isinstance(row.settings, Cole | McCool)
    return row.settings.reciprocal


def record(row: ComparisonRow, sampling: str) -> dict[str, Any]:
    """The row of the CSV file."""
    facts = row.record()
    return {
        "source": row.source,
        "method": row.settings.name,
        "coordinates": row.settings.coordinates if isinstance(row.settings, Cole) else "wi,h,wo",
        "grid": row.settings.grid if isinstance(row.settings, McCool) else "plain",
        "reciprocal": int(reciprocal_of(row)),
        "textures": facts["textures"],
        "size": row.settings.size,
        "fetches": facts["fetches"],
        "bytes": facts["bytes"],
        **{f"{part}_{name}": facts["error"][part][name] for part in ("train", "held_out") for name in SIX},
        "status": facts["status"],
        "evaluations": facts["evaluations"],
        "seconds_fit": round(row.seconds_fit, 3),
        "epsilon": facts["epsilon"],
        "samples": facts["samples"],
        "sampling": sampling,
        "seed": row.settings.seed,
        "machine": machine(),
    }


def sampling_of(source: Source, settings: Cole) -> str:
    """In words, where the samples of a source come from and how they were split."""
    facts = source.samples.provenance.get("sampling")
    if facts:
        drawn = ", ".join(f"{name} {value}" for name, value in facts.items() if name != "noise_free")
        return f"{len(source.samples)} pairs ({drawn}), {HELD_OUT:.0%} held out"
    copies, kept = _copies_and_kept(source, settings)
    return (
        f"{len(source.samples)} measured, {HELD_OUT:.0%} held out and turned at random,"
        f" training {kept} × {copies} azimuth copies"
    )


def sampling_in_sentences(source: Source, settings: Cole) -> str:
    """The same in sentences, for the page."""
    facts = source.samples.provenance.get("sampling")
    if facts:
        return (
            f"{len(source.samples)} pairs of directions are drawn uniformly in the parabolic discs (`--scheme"
            f" {facts['scheme']}`, seed {facts['seed']}, squared radius of the discs at most"
            f" {facts['radius_squared']}). {HELD_OUT:.0%} are held out."
        )
    copies, kept = _copies_and_kept(source, settings)
    return (
        f"There are {len(source.samples)} measured samples. {HELD_OUT:.0%} are held out and turned to random azimuths."
        f" The remaining {kept} samples are each copied to {copies} azimuths for training."
    )


def _copies_and_kept(source: Source, settings: Cole) -> tuple[int, int]:
    """(copies of each training sample, how many samples are not held out)."""
    copies = settings.copies * (2 if settings.mirrored else 1)
    return copies, len(source.samples) - round(HELD_OUT * len(source.samples))


def errors_of(rows: Sequence[ComparisonRow], part: str, grid: str) -> Errors:
    """The Cole errors of one part ("train" or "held_out") under the keys of the statements, McCool's on that grid."""
    return {
        Key(
            row.source,
            row.settings.coordinates if isinstance(row.settings, Cole) else MCCOOL,
            reciprocal_of(row),
            len(row.factorization.terms),
        ): getattr(row, part).log_mse
        for row in rows
        if not isinstance(row.settings, McCool) or row.settings.grid == grid
    }


def statements_table(rows: Sequence[ComparisonRow], grid: str) -> str:
    """The thesis's statements with what was found on training samples (as the thesis has it) and held-out ones."""
    pairs = zip(judge(errors_of(rows, "train", grid)), judge(errors_of(rows, "held_out", grid)), strict=True)
    return markdown(
        ("statement (Cole 2002, 4.4)", "training", "verdict", "held out", "verdict"),
        [(t.statement, t.found, t.verdict, h.found, h.verdict) for t, h in pairs],
        5,
    )


def errors_table(rows: Sequence[ComparisonRow]) -> str:
    """All six errors of every row, "training / held out"."""
    lines = []
    for row in rows:
        errors = (f"{figure(getattr(row.train, name))} / {figure(getattr(row.held_out, name))}" for name in SIX)
        lines.append((row.source, variant(row), len(row.factorization.terms), row.factorization.fetches, *errors))
    heads = ("log mse (Cole)", "log mae", "log max", "mse sr⁻²", "mae sr⁻¹", "max sr⁻¹")
    return markdown(("source", "projections", "textures", "fetches", *heads), lines, 2)


def ladder_table(rows: Sequence[ComparisonRow]) -> str:
    """The Cole error by number of textures, "training / held out"."""
    most = max(len(row.factorization.terms) for row in rows)
    lines = []
    for source, name in dict.fromkeys((row.source, variant(row)) for row in rows):
        own = {len(row.factorization.terms): row for row in rows if (row.source, variant(row)) == (source, name)}
        pairs = [
            f"{figure(own[n].train.log_mse)} / {figure(own[n].held_out.log_mse)}" if n in own else "–"
            for n in range(1, most + 1)
        ]
        lines.append((source, name, *pairs))
    return markdown(("source", "projections", *(f"{n} texture{'s' * (n > 1)}" for n in range(1, most + 1))), lines, 2)


def draw(path: Path, records: Sequence[Mapping[str, Any]], title: str) -> None:
    """Error against textures, a panel for each source, training over held out (after the thesis's figure 4.2).

    `records` are those of the CSV file; its strings will do.
    """
    sources = list(dict.fromkeys(row["source"] for row in records))
    chart = Figure(figsize=(3.4 * len(sources) + 0.8, 7.8), layout="constrained")
    panels = chart.subplots(2, len(sources), squeeze=False, sharex=True, sharey="col")
    for column, source in enumerate(sources):
        own = [row for row in records if row["source"] == source]
        for panel, part in zip(panels[:, column], ("train", "held_out"), strict=True):
            for row in own:
                if row["method"] == "mccool":
                    error = float(row[f"{part}_log_mse"])
                    style, label = ("--" if row["grid"] == "plain" else ":"), f"McCool, {row['grid']} grid"
                    panel.axhline(error, color="black", linestyle=style, linewidth=1.2, label=label)
            for name, reciprocal in VARIANTS:
                line = [row for row in own if (row["coordinates"], int(row["reciprocal"])) == (name, reciprocal)]
                colour, style, marker = STYLES[name, reciprocal]
                panel.plot(
                    [int(row["textures"]) for row in line],
                    [float(row[f"{part}_log_mse"]) for row in line],
                    color=colour,
                    linestyle=style,
                    marker=marker,
                    markersize=5,
                    markerfacecolor=colour if reciprocal else "white",
                    label=f"{name}, {'reciprocal' if reciprocal else 'free'}",
                )
            panel.set_yscale("log")
            panel.yaxis.set_major_formatter(FormatStrFormatter("%.3g"))
            panel.yaxis.set_minor_formatter(FuncFormatter(_minor_tick))
            panel.tick_params(axis="y", which="both", labelsize=9)
            facts = f"ε = {float(own[0]['epsilon']):g}, {own[0]['samples']} samples"
            words = "training" if part == "train" else "held out"
            panel.set_title(f"{source.removesuffix('.brdf')}, {words}\n{facts}", fontsize=10)
            panel.set_xticks(sorted({int(row["textures"]) for row in own if row["method"] == "cole"}))
            panel.grid(axis="y", which="both", color="#dddddd", linewidth=0.6)
            panel.spines[["top", "right"]].set_visible(False)
        panels[1, column].set_xlabel("textures")
    for panel in panels[:, 0]:
        panel.set_ylabel("Cole error (log space, mean squared)")
    handles, labels = panels[0, 0].get_legend_handles_labels()
    chart.legend(handles, labels, loc="outside lower center", ncols=3, frameon=False)
    chart.suptitle(f"{title}\n{records[0]['machine']}", fontsize=9)
    replace_file(path, lambda made: chart.savefig(made, dpi=120, format="png"))


def _minor_tick(value: float, _: object) -> str:
    """Labels at 2, 3, 5 and 7 of every decade: enough to read, few enough to fit."""
    return f"{value:.3g}" if f"{value:e}"[0] in "2357" else ""


def main(arguments: list[str] | None = None) -> int:
    """Run the experiment; returns the exit code."""
    parser = parser_of(__doc__, "data")
    parser.add_argument("sources", nargs="*", metavar="SOURCE", help="more sources: a path or material:NAME")
    parser.add_argument("--out", type=Path, default=Path("out/compare_with_mccool"), help="the folder to write")
    parser.add_argument("--page", type=Path, help="a Markdown page of the tables")
    parser.add_argument("--plot", type=Path, help="a PNG of the figure")
    parser.add_argument("--textures", type=int, default=5)
    parser.add_argument("--size", type=int, default=24, help="texels per side, in the end")
    parser.add_argument("--samples", type=int, default=45_000, help="pairs drawn of a material")
    parser.add_argument("--restarts", type=int, default=6)
    parser.add_argument("--seed", type=int, default=0)
    chosen = parser.parse_args(arguments)
    settings = Cole(textures=chosen.textures, size=chosen.size, restarts=chosen.restarts, seed=chosen.seed)
    count = chosen.samples
    if chosen.short:
        settings = replace(settings, textures=2, size=6, restarts=1, search_size=4, search_samples=300, copies=2)
        count = 1500
    paints, missing = cornell_files(data_folder(chosen.data))
    for message in missing:
        print(message, file=sys.stderr)
    rows: list[ComparisonRow] = []
    samplings, sentences = {}, {}
    for name in dict.fromkeys((*MATERIALS, *map(str, paints), *chosen.sources)):
        source = open_source(name, count=count, scheme="discs", seed=settings.seed)
        samplings[source.name] = sampling_of(source, settings)
        sentences[source.name] = sampling_in_sentences(source, settings)
        rows += experiment(source, settings)
    chosen.out.mkdir(parents=True, exist_ok=True)
    table = io.StringIO()
    records = [record(row, samplings[row.source]) for row in rows]
    writer = csv.DictWriter(table, list(records[0]), lineterminator="\n")
    writer.writeheader()
    writer.writerows(records)
    write(chosen.out / "errors.csv", table.getvalue())
    epsilons = {row.source: row.settings.epsilon for row in rows}
    statements = [
        line
        for grid in GRIDS
        for line in (f"\n## Statements of the thesis, McCool on the {grid} grid\n", statements_table(rows, grid))
    ]
    used = [
        "\n## Settings\n",
        *(f"- {name}: ε = {epsilons[name]:g}. {words}" for name, words in sentences.items()),
        *(f"- {message}" for message in missing),
        f"- Each fit has at most {settings.textures} textures of {settings.size}² texels. The search uses textures of"
        f" {settings.search_size}² texels, {settings.search_samples} samples and {settings.restarts} restarts, and"
        f" optimizes the last {settings.joint_terms} terms jointly. The smoothing is {settings.smoothing:g}, the seed"
        f" {settings.seed}. Values are RGB in float64.",
        f"- Machine: {machine()}",
        *(["- a smoke test: the figures mean nothing"] if chosen.short else []),
    ]
    head = ["# Repeat Cole's comparison with McCool", INTRODUCTION]
    every = ["\n## Errors, training / held out\n", errors_table(rows)]
    text = "\n".join([*head, *statements, *every, *used, ""])
    write(chosen.out / "errors.md", text)
    ladder = ["\n## Cole error by number of textures, training / held out\n", ladder_table(rows)]
    page = "\n".join([PAGE, *head, RESULT.lstrip(), PICTURE, READING, *statements, *ladder, *used, ""])
    title = f"Error against textures, {settings.size}², seed {settings.seed} (after Cole 2002, figure 4.2)"
    draw(chosen.out / "errors.png", records, title)
    if chosen.page:
        write(chosen.page, page)
    if chosen.plot:
        draw(chosen.plot, records, title)
    print(text)
    print(f"{chosen.out}: errors.csv, errors.md, errors.png")
    return 0


if __name__ == "__main__":
    sys.exit(main())
