"""Label the points of a chart without overlaps (`label_places`), with leader lines for distant labels."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from homofact.figures.label_places import nearest_edge, place_labels, struck_labels

Place = tuple[float, float]


@dataclass(frozen=True)
class PointLabel:
    """The `words` at the point `at`, in data coordinates, in a colour; the point's marker has a `radius` in points.

    An `optional` label is omitted if it would cover something.
    """

    words: str
    at: Place
    colour: str
    bold: bool = False
    radius: float = 4.5
    optional: bool = False


def label_points(
    figure: Figure,
    axes: Axes,
    labels: Sequence[PointLabel],
    paths: Sequence[Sequence[Place]] = (),
    *,
    markers: Sequence[tuple[Place, float]] = (),
    fontsize: float = 7.5,
) -> None:
    """Write `labels` into `axes` without covering points, `markers` or, where possible, `paths`.

    `paths` are corners of lines in data coordinates, `markers` are points without a label (place, radius in points).
    The figure's layout has to be final. Positions are computed in 1/72 inch, so they do not depend on the resolution of
    the picture.
    """
    scale = 72 / figure.dpi
    renderer = FigureCanvasAgg(figure).get_renderer()

    def place(point: Place) -> Place:
        x, y = axes.transData.transform(point)
        return float(x) * scale, float(y) * scale

    texts = [
        axes.annotate(
            label.words,
            label.at,
            xytext=(0, 0),
            textcoords="offset points",
            fontsize=fontsize,
            fontweight="bold" if label.bold else "normal",
            color=label.colour,
            zorder=4,
        )
        for label in labels
    ]
    extents = [text.get_window_extent(renderer) for text in texts]
    frame = axes.get_window_extent(renderer)
    places = [place(label.at) for label in labels]
    lines = [point for path in paths for point in _along([place(corner) for corner in path])]
    kept, unnamed = list(range(len(labels))), [(place(at), radius) for at, radius in markers]
    while True:
        others = [*unnamed, *((places[k], labels[k].radius) for k in range(len(labels)) if k not in kept)]
        radii = [*(labels[k].radius for k in kept), *(radius for _, radius in others)]
        chosen = place_labels(
            [places[k] for k in kept],
            [(extents[k].width * scale + 1, extents[k].height * scale) for k in kept],
            (frame.x0 * scale, frame.y0 * scale, frame.x1 * scale, frame.y1 * scale),
            others=[at for at, _ in others],
            lines=lines,
            radius=radii,
        )
        struck = struck_labels(chosen, [*(places[k] for k in kept), *(at for at, _ in others)], radii)
        # The worse half at a time: those that are left get other places.
        optional = [k for k in range(len(kept)) if labels[kept[k]].optional and struck[k]]
        worst = sorted(optional, key=lambda k: -struck[k])
        if not worst:
            break
        for k in sorted(worst[: (len(worst) + 1) // 2], reverse=True):
            texts[kept.pop(k)].remove()
    for k, chosen_place in zip(kept, chosen, strict=True):
        text, label, extent, (x, y) = texts[k], labels[k], extents[k], places[k]
        # An extent begins below its text's baseline, which is what is placed.
        text.set_position((chosen_place.box[0] - extent.x0 * scale + 0.5, chosen_place.box[1] - extent.y0 * scale))
        if chosen_place.leader:
            end = nearest_edge((x, y), chosen_place.box)
            arrow = {"arrowstyle": "-", "linewidth": 0.6, "color": text.get_color(), "shrinkA": 0, "shrinkB": 3}
            offset = (end[0] - x, end[1] - y)
            axes.annotate("", label.at, xytext=offset, textcoords="offset points", arrowprops=arrow, zorder=2)


def _along(corners: Sequence[Place], step: float = 3.0) -> list[Place]:
    """Return points at intervals of about `step` along the line through `corners`."""
    places = []
    for (x0, y0), (x1, y1) in pairwise(corners):
        count = round((abs(x1 - x0) + abs(y1 - y0)) / step) + 1
        places += [(x0 + (x1 - x0) * k / count, y0 + (y1 - y0) * k / count) for k in range(count + 1)]
    return places
