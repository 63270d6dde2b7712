"""The picture of a comparison: every metric of every method, training beside held out, with the spread of seeds."""

import os
from collections.abc import Sequence

from matplotlib.figure import Figure

from homofact.evaluate.compare import Row
from homofact.evaluate.seeds import SeedRows
from homofact.evaluate.wording import shapes
from homofact.figures.log_axis import log_x
from homofact.files.atomic import replace_file

_METRICS = (
    ("log_mse", "log space, mean squared (Cole error)"),
    ("log_mae", "log space, mean absolute"),
    ("log_max", "log space, maximum"),
    ("mse", "linear, mean squared [sr⁻²]"),
    ("mae", "linear, mean absolute [sr⁻¹]"),
    ("max", "linear, maximum [sr⁻¹]"),
)


def plot_rows(path: str | os.PathLike[str], rows: Sequence[Row | SeedRows]) -> None:
    """Draw the six metrics of `rows` as bars on logarithmic axes into `path` (PNG, SVG or PDF by its ending).

    Of several seeds the bar is the mean, and a line goes from the least to the greatest.

    Raises BadInput where the place cannot be written.
    """
    several = [row if isinstance(row, SeedRows) else SeedRows((row,)) for row in rows]
    names = [_name(each) for each in several]
    figure = Figure(figsize=(12, 3 + 0.5 * len(rows)), layout="constrained")
    axes = figure.subplots(2, 3).ravel()
    places = range(len(rows))
    for axis, (metric, title) in zip(axes, _METRICS, strict=True):
        for spreads, shift, colour, label in (
            ([each.train[metric] for each in several], -0.2, "#7f9fbf", "training"),
            ([each.held_out[metric] for each in several], 0.2, "#1f4e79", "held out"),
        ):
            at = [place + shift for place in places]
            axis.barh(at, [each.mean for each in spreads], 0.38, color=colour, label=label)
            for place, each in zip(at, spreads, strict=True):
                if each.low < each.high:
                    axis.plot((each.low, each.high), (place, place), color="#111111", linewidth=1.2, marker="|")
                axis.annotate(
                    f"{each.mean:.3g}",
                    (each.high, place),
                    xytext=(4, 0),
                    textcoords="offset points",
                    va="center",
                    fontsize=8,
                )
        axis.set_xscale("log")
        low, high = axis.get_xlim()
        log_x(axis, low / 2, high * 6, most=5)  # room for the numbers
        axis.set_yticks(list(places), names, fontsize=9)
        axis.invert_yaxis()
        axis.set_title(title, fontsize=10)
        axis.spines[["top", "right"]].set_visible(False)
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=2, frameon=False)
    first, most = several[0].first, max(len(each.rows) for each in several)
    seeds = "" if most == 1 else f"; means of {most} fits by different seeds, lines from least to greatest"
    epsilon = first.factorization.transform.epsilon
    figure.suptitle(f"{first.source}: lower is better (ε = {epsilon:g}, {first.samples} samples{seeds})")
    replace_file(path, lambda made: figure.savefig(made, dpi=110))


def _name(several: SeedRows) -> str:
    found = dict.fromkeys(shapes([texture.size for texture in row.factorization.textures]) for row in several.rows)
    settings = several.first.settings
    if not several.first.factorization.textures:
        lobes = getattr(settings, "lobes", 0)
        return f"{settings.name}, {lobes} lobe{'' if lobes == 1 else 's'}" if lobes else settings.name
    return f"{settings.name}, {' or '.join(found)}"
