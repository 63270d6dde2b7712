"""The tables of the commands, made to be read in 80 columns: costs and errors stacked, not side by side."""

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from rich.table import Table
from rich.text import Text

from homofact.cli.flags import with_options
from homofact.cli.layout import add_figures, add_names, plain_table
from homofact.errors import Status
from homofact.evaluation.wording import brief_figure, counted, figure, of_repeats, ratio_figure, repeated_by, shapes

if TYPE_CHECKING:
    from homofact.evaluation.means import MeanRow
    from homofact.evaluation.paired import MethodPair


_SHORT_NAME = 10


def error_table(records: Mapping[str, Mapping[str, Any]]) -> Table:
    """Return six metrics of every labelled record, with the held-out errors above the training errors.

    A fit without held-out samples has one line. For a record of several fits, the table shows means, with standard
    deviations below.
    """
    from homofact.evaluation.metric_table import SIX

    seeds = f"; mean ± standard deviation of {of_repeats(*_most_repeats(records.values()))}" * any(
        "spread" in record for record in records.values()
    )
    epsilons = sorted({record["epsilon"] for record in records.values()})
    used = f"ε = {' to '.join(f'{epsilon:g}' for epsilon in dict.fromkeys((epsilons[0], epsilons[-1])))}"
    table = plain_table(f"Error (log mse is the Cole error, {used}; mse in sr⁻², mae and max in sr⁻¹{seeds})")
    longest = max(map(len, records), default=0)
    # Short names stay whole beside figures with deviations; longer ones would leave these no room.
    add_names(table, longest=longest if longest <= _SHORT_NAME else 0)
    add_names(table, "set", longest=len("held out"))
    add_figures(table, *(name.replace("_", " ") for name in SIX))
    for label, record in records.items():
        parts = {"held_out": "held out", "train": "training"}
        for key, words in ({"source": "all"} if "source" in record["error"] else parts).items():
            figures = [figure(record["error"][key][name]) for name in SIX]
            style = "dim" if key == "train" else "bold"
            table.add_row("" if key == "train" else Text(label), words, *(Text(f, style) for f in figures))
            if "spread" in record:
                spread = record["spread"]["error"][key]
                table.add_row("", "", *(Text(_under(spread[name]), "dim") for name in SIX))
        table.add_section()
    return table


def _most_repeats(records: Iterable[Mapping[str, Any]]) -> tuple[int, int]:
    """The numbers of seeds and of splits of the record that has most fits."""
    counts = [(len(record["seeds"]), len(record["splits"])) for record in records if "spread" in record]
    return max(counts, key=math.prod, default=(1, 1))


def _under(spread: Mapping[str, float | None]) -> str:
    """The standard deviation for a line below its mean: two digits, so that six of them fit into 80 columns."""
    found = spread["standard_deviation"]
    return "" if found is None else f"±{brief_figure(found)}"


def appearance_tables(records: Mapping[str, Mapping[str, Any]]) -> list[Table]:
    """Return tables of light and picture errors of every labelled record; empty if no record has them.

    If records were compared with another reflectance than their source, their entry "against" names it.
    """
    found = {label: record["appearance"] for label, record in records.items() if record["appearance"] is not None}
    if not found:
        return []
    against = next((record["against"] for record in records.values() if "against" in record), None)
    what = "Light, fit over source" if against is None else f"Light over that of {against}"
    table = plain_table(
        f"{what} (albedo: at the worst angle; highlight: directions with the brightest 1% of the light;"
        " rms: relative RMS of f cosθi cosθo; floor: the smallest rms that a reciprocal fit can reach)"
    )
    add_names(table)
    add_figures(table, "rms", "floor", "albedo", "energy", "highlight", "lamp dB", "sky dB")
    names = ("rms_cosine", "floor_cosine", "albedo_worst", "energy_overall", "highlight", "psnr_light", "psnr_sky")
    for label, each in found.items():
        table.add_row(Text(label), *(figure(each[name]) for name in names))
        if "spread" in records[label]:
            spread = records[label]["spread"]["appearance"]
            table.add_row("", *(Text(_under(spread[name]) if name in spread else "", "dim") for name in names))
    scores = {label: each["opinion"] for label, each in found.items() if each.get("opinion") is not None}
    grades = grade_table(scores, "fit and source" if against is None else f"it and {against}")
    return [table] if grades is None else [table, grades]


def chart_grades(records: Sequence[Mapping[str, Any]]) -> list[Table]:
    """Return a table of the expected grades of a chart's points; empty if the source is a list of samples.

    A point is called "cole, 2 × 16²", and an analytic model, which has no textures, by its name alone.
    """
    from homofact.evaluation.chart_ledger import run_name, series_name

    graded = [each for each in records if (each["appearance"] or {}).get("opinion") is not None]
    scores = {
        run_name(series_name(each["label"], each["search"]), each["textures"], each["size"]): each["appearance"][
            "opinion"
        ]
        for each in graded
    }
    table = grade_table(scores)
    return [] if table is None else [table]


def identical_grade() -> str:
    """Return the expected grade of identical pictures with its 90% interval: "4.4 (3.8 to 4.8)"."""
    from homofact.evaluation.opinion import opinion_table

    law = opinion_table().law
    best = law.opinion(0).score
    return f"{best:.1f} ({{:.1f}} to {{:.1f}})".format(*law.interval(best))


def grade_table(scores: Mapping[str, float], pair: str = "fit and source") -> Table | None:
    """Return the expected grades, by label, of pictures of a `pair`, with 90% intervals; None without grades."""
    if not scores:
        return None
    from homofact.evaluation.opinion import opinion_table

    law = opinion_table().law
    table = plain_table(
        f"Grade that people would give (expected mean of 30 people who compare pictures of {pair}, 1 very poor to"
        f" 5 excellent; identical pictures get {identical_grade()})"
    )
    add_names(table)
    add_figures(table, "grade", "90% interval")
    for label, score in scores.items():
        table.add_row(Text(label), f"{score:.1f} of 5", "{:.1f} to {:.1f}".format(*law.interval(score)))
    return table


def cost_table(records: Mapping[str, Mapping[str, Any]]) -> Table:
    """Return the cost of every labelled record's evaluation and fit, and the fit's status; means of several seeds."""
    table = plain_table("Cost")
    longest = max(map(len, records), default=0)
    add_names(table, longest=longest if longest <= _SHORT_NAME else 0)
    # Three textures of three sizes wrap between two of them, and how a fit ended between words.
    table.add_column("textures", justify="right")
    add_figures(table, "bytes", "fetches", "evals", "fit s", "total s")
    table.add_column("ended")
    for label, record in records.items():
        seconds = record["seconds"]
        table.add_row(
            Text(label),
            _shapes(record),
            *(str(record[name]) for name in ("bytes", "fetches")),
            f"{record['evaluations']:.0f}",
            f"{seconds['fit']:.3g}",
            f"{seconds['total']:.3g}",
            str(record["status"]),
        )
        if "spread" in record:
            spread = record["spread"]
            spreads = (spread["evaluations"], spread["seconds"]["fit"], spread["seconds"]["total"])
            table.add_row("", "", "", "", *(Text(_under(one), "dim") for one in spreads), "")
    return table


def _shapes(record: Mapping[str, Any]) -> str:
    """The textures of a fit; of several fits that came out with different ones, how many they have."""
    every = [row["shapes"] for row in record.get("rows", (record,))]
    if all(own == every[0] for own in every):
        return shapes(every[0])
    low, high = (end(map(len, every)) for end in (min, max))
    return f"{low if low == high else f'{low}–{high}'}, sizes differ"


def size_table(records: Mapping[str, Mapping[str, Any]]) -> Table:
    """Return the textures, bytes and fetches of every labelled fit."""
    table = plain_table("Size")
    add_names(table)
    add_figures(table, "textures", "bytes", "fetches")
    for label, record in records.items():
        table.add_row(Text(label), shapes(record["shapes"]), str(record["bytes"]), str(record["fetches"]))
    return table


def stored_table(errors: Mapping[str, Mapping[str, Any]], part: str) -> Table:
    """Return the errors of a fit as stored on `part` of the samples, and the change of its logarithms by storing."""
    words = {"held_out": "held out", "source": "of the source"}[part]
    table = plain_table(f"Error ({words}; mae in sr⁻¹; change: RMS change of log f by the storage)")
    add_names(table)
    names = [name for name in ("log_mse", "log_mae", "mae") if any(part in each for each in errors.values())]
    add_figures(table, *(*(name.replace("_", " ") for name in names), "change"))
    for label, each in errors.items():
        tested = each.get(part, {})
        table.add_row(Text(label), *(figure(tested.get(name)) for name in names), figure(each["log_difference"]))
    return table


def metric_tables(values: Mapping[str, Mapping[str, float | None]]) -> list[Table]:
    """Return one line per held-out metric and one column per fit, without the six metrics of `error_table`.

    Each table has at most five fits.
    """
    from homofact.evaluation.metric_table import METRICS, SIX

    names = [name for name in next(iter(values.values()), {}) if name not in SIX]
    labels = list(values) if names else []
    notes = [
        f"{', '.join(some)}: {words}"
        for good, words in (("high", "more is better"), ("one", "1 is best"))
        if (some := [name for name in names if METRICS[name].good == good])
    ]
    title = f"Further metrics ({'; '.join(notes)})" if notes else "Further metrics"
    tables = []
    for first in range(0, len(labels), 5):
        table = plain_table(title)
        table.add_column("", no_wrap=True)
        for label in labels[first : first + 5]:
            table.add_column(Text(label), justify="right", overflow="fold", min_width=8)
        for name in names:
            table.add_row(name, *(figure(values[label][name]) for label in labels[first : first + 5]))
        tables.append(table)
    return tables


def pair_table(pairs: "Sequence[MethodPair]") -> Table:
    """Compare methods in pairs: on how many splits the first has the lower errors, and the ratios of the errors."""
    table = plain_table(
        "Methods compared per split (lower: splits where the first has the lower held-out error; ratio: its error"
        " divided by the other's, smallest to largest)"
    )
    add_names(table, longest=max(len(pair.method) for pair in pairs))
    add_names(table, "against", longest=max(len("against"), *(len(pair.other) for pair in pairs)))
    names = list(pairs[0].ratios)
    add_figures(table, *(word for name in names for word in (f"{name.replace('_', ' ')}\nlower", "ratio")))
    for pair, last in zip(pairs, (None, *pairs), strict=False):
        cells = []
        for name in names:
            spread = pair.spread(name)
            cells += [
                f"{pair.lower(name)} of {spread.count}",
                f"{ratio_figure(spread.low)}–{ratio_figure(spread.high)}",
            ]
        again = last is not None and last.method == pair.method
        table.add_row("" if again else Text(pair.method), Text(pair.other), *cells)
    return table


def mean_table(rows: "Sequence[MeanRow]") -> Table:
    """Return means over sources, seeds and splits by method and bytes: a line per metric, with deviations."""
    from homofact.evaluation.metric_table import METRICS

    fits = max(row.fits for row in rows)
    upto = "" if all(row.fits == fits for row in rows) else "up to "
    counts = f"over {upto}{counted(fits, 'fit')}" if fits > 1 else "of one fit each"
    table = plain_table(f"Means and standard deviations (±) {counts}, by method and bytes")
    add_names(table)
    add_figures(table, "bytes", "fits")
    add_names(table, "metric")
    over_sources = any(row.sources > 1 for row in rows)
    within = not over_sources or any(value is not None for row in rows for value in row.within_source.values())
    heads = {"± between sources": over_sources, "± within a source" if over_sources else "±": within}
    add_figures(table, "mean", *(head for head, shown in heads.items() if shown))
    for row in rows:
        about = [Text(row.method), str(row.nbytes), str(row.fits)]
        for name, spread in row.spreads.items():
            unit = METRICS[name].unit
            own = None if spread is None else spread.deviation
            pair = (own, row.within_source[name]) if row.sources > 1 else (None, own)
            kept = [value for value, shown in zip(pair, heads.values(), strict=True) if shown]
            mean = "–" if spread is None else figure(spread.mean)
            deviations = ("" if value is None else figure(value) for value in kept)
            table.add_row(*about, f"{name}, {unit}" if unit else name, mean, *deviations)
            about = ["", "", ""]
        table.add_section()
    return table


def chart_table(
    title: str, records: Sequence[Mapping[str, Any]], base: float | None, losses: Sequence[int | None]
) -> Table:
    """Return one line per point: its held-out Cole error, its ratio to `base` (McCool's error), and its cost.

    `losses` are the numbers of splits on which each point has a larger error than the best point; the table shows them
    if there are several splits. For a record of several fits, it shows means and the standard deviation of the error.
    """
    from homofact.evaluation.chart_ledger import series_name

    table = plain_table(title)
    add_names(table, longest=max(len(series_name(record["label"], record["search"])) for record in records))
    spread = any("spread" in record for record in records)
    error = f"error\n± {repeated_by(*_most_repeats(records))}" if spread else "error"
    several = _most_repeats(records)[1] > 1
    over = ("loses\nto best",) if several else ()
    add_figures(table, *("textures", error, *over, "of\nMcCool", "bytes", "fetches", "fit s"))
    for record, lost in zip(records, losses, strict=True):
        held = record["error"]["held_out"]["log_mse"]
        on_splits = "best" if lost is None else f"{lost} of {len(record.get('splits', [0]))}"
        luck = f"\n{_under(record['spread']['error']['held_out']['log_mse'])}" if "spread" in record else ""
        table.add_row(
            Text(series_name(record["label"], record["search"])),
            _texels(record) or "–",
            Text.assemble((figure(held), "bold"), (luck, "dim")),
            *((on_splits,) if several else ()),
            "–" if base is None else f"×{held / base:.2f}" if held >= 0.1 * base else f"×{held / base:.2g}",
            *(str(record[name]) for name in ("bytes", "fetches")),
            f"{record['seconds']['fit']:.3g}",
        )
    return table


def _texels(record: Mapping[str, Any]) -> str:
    return f"{record['textures']} × {record['size']}²" if record["size"] else ""


def chart_endings(records: Sequence[Mapping[str, Any]]) -> list[str]:
    """Return a line on the points whose fits ended neither converged nor direct; empty if there are none."""
    from homofact.evaluation.chart_ledger import series_name

    usual = {Status.CONVERGED.value, Status.DIRECT.value}
    odd = []
    for record in records:
        status = str(record["status"])
        if not set(status.split(", ")) <= usual:
            name = f"{series_name(record['label'], record['search'])} {_texels(record)}".rstrip()
            odd.append(f"{name}: {status}")
    return [f"How fits ended that did not all converge: {'; '.join(odd)}."] if odd else []


def facts_table(title: str, facts: Mapping[str, Any]) -> Table:
    """Return names and values, without those that are empty; values wrap in their column.

    In a name that is an identifier, underscores become spaces. Any other name, for example one that contains a file's
    name, is printed unchanged.
    """
    table = plain_table(title)
    table.show_header = False
    add_names(table)
    table.add_column("", overflow="fold")
    for name, value in facts.items():
        if value is not None and value != {} and value != []:
            shown = " to ".join(map(words, value)) if name.endswith("_degrees") and len(value) == 2 else words(value)
            table.add_row(name.replace("_", " ") if name.isidentifier() else Text(name), Text(with_options(shown)))
    return table


def words(value: Any, inner: bool = False) -> str:
    """Return a value in words; a mapping has one line per entry, or one line if inside another value."""
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{value:.4g}"
    if isinstance(value, Mapping):
        entries = [f"{str(name).replace('_', ' ')} {words(entry, True)}" for name, entry in value.items()]
        return (", " if inner else "\n").join(entries)
    if isinstance(value, Sequence) and not isinstance(value, str):
        sentences = not inner and any(isinstance(entry, str) and " " in entry for entry in value)
        parts = "; " if any(isinstance(entry, Mapping) for entry in value) else ", "
        return ("\n" if sentences else parts).join(words(entry, True) for entry in value)
    return "none" if value is None else str(value)
