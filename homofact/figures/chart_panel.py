"""Draw one pair of axes of a chart: points with bars and labels, the Pareto front, and the reference."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from homofact.evaluation.chart_points import ChartPoint
from homofact.evaluation.pareto import front
from homofact.evaluation.spread import Spread
from homofact.figures.log_axis import log_y, plain_number, round_ticks, set_ticks
from homofact.figures.point_labels import PointLabel, label_points

# A series' colour, shape, and the shape's width in points.
Look = tuple[str, str, float]
FRONT_COLOUR = "#999999"
_MOST_POWERS = 7  # of two beside one axis
_Place = tuple[float, float]


@dataclass(frozen=True)
class CostAxis:
    """The x axis of a chart: its title, the cost of a point, its ticks and labels, and its scale.

    A point lies at the mean cost of its fits or, with `greatest`, at their greatest cost, e.g. the memory to reserve. A
    cost that may be 0, such as the fetches of a model without textures, needs a linear scale.
    """

    words: str
    of: Callable[[ChartPoint], Spread]
    ticks: Callable[[float, float, Sequence[float]], list[float]]
    logarithmic: bool = True
    greatest: bool = False
    label: Callable[[float], str] = plain_number

    def at(self, point: ChartPoint) -> float:
        """Return the x coordinate of a point."""
        return self.of(point).high if self.greatest else self.of(point).mean

    def ends(self, costs: Sequence[Spread]) -> tuple[float, float]:
        """Return the left and the right end of the axis, with room beside the points."""
        low, high = min(cost.low for cost in costs), max(cost.high for cost in costs)
        if self.logarithmic:
            return low / 1.5, high * 1.6
        room = 0.15 * max(high - low, 1.0)
        return low - room, high + 2 * room


def _doubling(low: float, high: float, _: Sequence[float]) -> list[float]:
    powers = [2.0**k for k in range(35) if low <= 2.0**k <= high]
    return powers[:: 1 + len(powers) // _MOST_POWERS] or round_ticks(low, high)


def _bytes(value: float) -> str:
    return f"{value:.0f}" if value < 1024 else f"{plain_number(value / 1024)}K"


SECONDS = CostAxis("fitting time [s]", lambda point: point.seconds, lambda low, high, _: round_ticks(low, high))
BYTES = CostAxis(
    "bytes, texels as float32 (1K = 1024)",
    lambda point: Spread.of(float(row.bytes) for row in point.rows),
    _doubling,
    greatest=True,
    label=_bytes,
)
FETCHES = CostAxis(
    "texture fetches of one evaluation",
    lambda point: point.fetches,
    lambda low, high, values: sorted({float(round(value)) for value in values}),
    logarithmic=False,
    greatest=True,
)


@dataclass(frozen=True)
class Panel:
    """One pair of axes with its points and its cost axis; identical points are drawn once."""

    axes: Axes
    all_points: Sequence[ChartPoint]
    cost: CostAxis

    @cached_property
    def points(self) -> list[ChartPoint]:
        """The points that are drawn."""
        points: dict[tuple[str, str, int, Spread, Spread], ChartPoint] = {}
        for point in self.all_points:
            key = (point.series, point.textures, point.first.size, self.cost.of(point), point.error)
            points.setdefault(key, point)
        return list(points.values())

    @cached_property
    def places(self) -> list[_Place]:
        """The cost and mean error of every drawn point."""
        return [(self.cost.at(point), point.error.mean) for point in self.points]

    def draw(self, looks: dict[str, Look], base: ChartPoint | None, limits: tuple[float, float]) -> list[_Place]:
        """Draw axes, points, bars, front and reference line; return the front's corners in data coordinates."""
        axes, costs = self.axes, [self.cost.of(point) for point in self.points]
        left, right = self.cost.ends(costs)
        log_y(axes, *limits)
        axes.set_xscale("log" if self.cost.logarithmic else "linear")
        axes.set_xlim(left, right)
        set_ticks(axes.xaxis, self.cost.ticks(left, right, [x for x, _ in self.places]), self.cost.label)
        axes.set_xlabel(self.cost.words)
        axes.grid(color="#eeeeee", linewidth=0.8, zorder=0)
        axes.set_axisbelow(True)
        axes.spines[["top", "right"]].set_visible(False)
        on = front(self.places)
        corners = [self.places[on[0]]]
        for i in on[1:]:
            corners += [(self.places[i][0], corners[-1][1]), self.places[i]]
        corners.append((right, corners[-1][1]))
        axes.plot(*zip(*corners, strict=True), color=FRONT_COLOUR, linewidth=1.2, zorder=1)
        if base is not None:
            axes.axhline(base.error.mean, color="#555555", linewidth=0.8, linestyle=(0, (1, 3)), zorder=1)
        for i, (point, (x, y)) in enumerate(zip(self.points, self.places, strict=True)):
            colour, shape, width = looks[point.series]
            for one, other in self._bars(point):
                axes.plot(*zip(one, other, strict=True), color=colour, linewidth=1.3, alpha=0.55, zorder=2)
            face, edge = (colour, "white") if i in on else ("white", colour)
            # A white rim, put on from outside, parts filled points that lie on each other.
            style = {"markerfacecolor": face, "markeredgecolor": edge, "markersize": width + (1.5 if i in on else 0)}
            axes.plot(x, y, shape, zorder=3, markeredgewidth=1.0, **style)
        return corners

    def label(self, figure: Figure, looks: dict[str, Look], base: ChartPoint | None, corners: Sequence[_Place]) -> None:
        """Draw every point's label where it overlaps nothing."""
        on = set(front(self.places))
        labels = []
        for i, (point, place) in enumerate(zip(self.points, self.places, strict=True)):
            words = f"{point.textures}×{point.first.size}²" if point.first.size else f"{point.first.bytes} bytes"
            if i in on and base is not None and not point.is_reference:
                share = point.error.mean / base.error.mean
                words += f"  ×{share:.2f}" if share >= 0.1 else f"  ×{share:.2g}"
            labels.append(PointLabel(words, place, looks[point.series][0], bold=i in on))
        paths: list[Sequence[_Place]] = [corners, *(bar for point in self.points for bar in self._bars(point))]
        if base is not None:
            paths.append([(x, base.error.mean) for x in self.axes.get_xlim()])
        label_points(figure, self.axes, labels, paths)

    def _bars(self, point: ChartPoint) -> list[tuple[_Place, _Place]]:
        """Return the end points of a point's vertical error bar and horizontal cost bar."""
        cost, error, x = self.cost.of(point), point.error, self.cost.at(point)
        bars = []
        if error.low < error.high:
            bars.append(((x, error.low), (x, error.high)))
        if cost.low < cost.high and not self.cost.greatest:
            bars.append(((cost.low, error.mean), (cost.high, error.mean)))
        return bars


def share_axis(axes: Axes, base: float, limits: tuple[float, float]) -> None:
    """Draw the right-hand axis: the error as a multiple of the reference's error."""
    right = axes.twinx()
    log_y(right, limits[0] / base, limits[1] / base)
    set_ticks(
        right.yaxis, round_ticks(limits[0] / base, limits[1] / base, 5, 9), lambda value: f"×{plain_number(value)}"
    )
    right.set_ylabel("of McCool's own factorization (dotted: its lowest error here)", color="#555555", fontsize=9)
    right.tick_params(axis="y", colors="#555555", labelsize=8)
    right.spines[["top", "left"]].set_visible(False)
    right.spines["right"].set_color("#cccccc")
