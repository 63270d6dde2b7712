"""Place labels beside crowded points: near their own point, without covering anything else.

Each label has candidate positions on several rings round its point. The cost of a position increases with its distance
from the point and with what the label would cover: other labels, points, lines, or the edge. Each label starts at the
position of least cost without other labels. The labels then move in turn until no move lowers the cost, at most 12
times. The result is deterministic; the method suits some tens of labels.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

_RINGS = (2.0, 4.0, 7.0, 12.0, 18.0, 26.0, 36.0, 48.0)  # from a point's edge to its label's, in points
_ANGLES = 24
_SWEEPS = 12
LEADER = 10.0  # beyond this distance a line should lead from the point to its label


@dataclass(frozen=True)
class Place:
    """A label's box (x0, y0, x1, y1), and `leader`: whether it is far enough from its point to need a leader line."""

    box: tuple[float, float, float, float]
    leader: bool


def place_labels(
    points: Sequence[tuple[float, float]],
    sizes: Sequence[tuple[float, float]],
    bounds: tuple[float, float, float, float],
    *,
    others: Sequence[tuple[float, float]] = (),
    lines: Sequence[tuple[float, float]] = (),
    radius: float | Sequence[float] = 4.0,
) -> list[Place]:
    """Return a place for every label of `sizes` (width, height) beside its point, all in one unit (1/72 inch).

    Labels avoid the discs at `points` and `others`, which have one common `radius` or one radius each. Where possible,
    they also avoid the points `lines` along lines, and stay within `bounds` (x0, y0, x1, y1).
    """
    if not points:
        return []
    discs = np.array([*points, *others], dtype=float)
    radii = np.broadcast_to(np.asarray(radius, dtype=float), len(discs))
    along = np.array(lines, dtype=float).reshape(-1, 2)
    trials = [_trials(*each) for each in zip(points, sizes, radii[: len(points)].tolist(), strict=True)]
    alone = [
        _cost_alone(boxes, rings, np.array(point), discs, along, bounds, radii)
        for (boxes, rings), point in zip(trials, points, strict=True)
    ]
    paths = [np.stack([_leader(point, box) for box in boxes]) for (boxes, _), point in zip(trials, points, strict=True)]
    chosen = [int(costs.argmin()) for costs in alone]
    for _ in range(_SWEEPS):
        moved = False
        for i, (boxes, rings) in enumerate(trials):
            others_of = [j for j in range(len(trials)) if j != i]
            rest = np.array([trials[j][0][chosen[j]] for j in others_of]).reshape(-1, 4)
            theirs = np.array([paths[j][chosen[j]] for j in others_of]).reshape(-1, 2)
            shared = _overlap(boxes, rest)
            struck = _inside(rest, paths[i].reshape(-1, 2)).any(0).reshape(len(boxes), -1).sum(1) * (rings > LEADER)
            costs = alone[i] + 40.0 * (shared > 0).sum(1) + 0.5 * shared.sum(1)
            costs += 6.0 * (_inside(boxes, theirs).sum(1) + struck)
            best = int(costs.argmin())
            if costs[best] < costs[chosen[i]] - 1e-9:
                chosen[i], moved = best, True
        if not moved:
            break
    places = []
    for (boxes, rings), j in zip(trials, chosen, strict=True):
        x0, y0, x1, y1 = (float(value) for value in boxes[j])
        places.append(Place((x0, y0, x1, y1), bool(rings[j] > LEADER)))
    return places


def _trials(point: tuple[float, float], size: tuple[float, float], radius: float) -> tuple[np.ndarray, np.ndarray]:
    """Return boxes (T, 4) whose nearest edge is at a ring's distance from a point, and their rings (T,)."""
    boxes, rings = [], []
    for ring in _RINGS:
        for k in range(_ANGLES):
            angle = 2 * math.pi * k / _ANGLES
            dx, dy = math.cos(angle), math.sin(angle)
            # The box slides along the ring: beside the point its middle is level, above it is centred.
            centre_x = point[0] + dx * (radius + ring) + _side(dx) * size[0] / 2
            centre_y = point[1] + dy * (radius + ring) + _side(dy) * size[1] / 2
            left, bottom = centre_x - size[0] / 2, centre_y - size[1] / 2
            boxes.append((left, bottom, centre_x + size[0] / 2, centre_y + size[1] / 2))
            rings.append(ring)
    return np.array(boxes), np.array(rings)


def _side(cosine: float) -> float:
    """Return the side of its point on which a box is placed in this direction: −1 or 1, or between them if centred."""
    return max(-1.0, min(1.0, 1.6 * cosine))


def _cost_alone(
    boxes: np.ndarray,
    rings: np.ndarray,
    point: np.ndarray,
    discs: np.ndarray,
    along: np.ndarray,
    bounds: tuple[float, float, float, float],
    radii: np.ndarray,
) -> np.ndarray:
    """Return the cost (T,) of each position without other labels."""
    x0, y0, x1, y1 = bounds
    outside = (
        np.clip(x0 - boxes[:, 0], 0, None)
        + np.clip(y0 - boxes[:, 1], 0, None)
        + np.clip(boxes[:, 2] - x1, 0, None)
        + np.clip(boxes[:, 3] - y1, 0, None)
    )
    covered = _inside(boxes, discs, radii).sum(1)
    crossed = _inside(boxes, along, 1.0).sum(1)
    # A label that is as near to another point as to its own, or a leader over one, would name the wrong one.
    apart = np.hypot(*(discs - point).T) > 1e-6
    foreign, reach = discs[apart], radii[apart]
    doubtful = (_gap(boxes, foreign) - reach < (rings + 2)[:, None]).sum(1)
    misled = np.zeros(len(boxes))
    for t in np.flatnonzero(rings > LEADER):
        line = _leader((float(point[0]), float(point[1])), boxes[t])
        if len(foreign):
            gaps = np.hypot(line[:, None, 0] - foreign[None, :, 0], line[:, None, 1] - foreign[None, :, 1])
            misled[t] = (gaps.min(0) < reach).sum()
    return (
        0.4 * rings
        + 30.0 * covered
        + 4.0 * crossed
        + 3.0 * outside
        + 40.0 * (outside > 0)
        + 15.0 * misled
        + 2.5 * doubtful
    )


def struck_labels(placed: Sequence[Place], discs: Sequence[tuple[float, float]], radii: Sequence[float]) -> list[int]:
    """Count the other labels and discs that each label covers; disc k is label k's own and does not count.

    Examples
    --------
    >>> placed = [Place((0, 0, 10, 4), False), Place((8, 2, 18, 6), False)]
    >>> struck_labels(placed, [(-3, 0), (20, 4), (15, 4)], [2, 1, 1])
    [1, 2]
    """
    boxes = np.array([each.box for each in placed], dtype=float).reshape(-1, 4)
    covered = _inside(boxes, np.array(discs, dtype=float).reshape(-1, 2), np.array(radii, dtype=float))
    shared = (_overlap(boxes, boxes) > 0).sum(1) - 1
    own = covered[np.arange(len(boxes)), np.arange(len(boxes))]
    return (shared + covered.sum(1) - own).tolist()


def nearest_edge(point: tuple[float, float], box: Sequence[float]) -> tuple[float, float]:
    """Return the point of a box that is nearest to a given point."""
    return min(max(point[0], box[0]), box[2]), min(max(point[1], box[1]), box[3])


def _leader(point: tuple[float, float], box: np.ndarray) -> np.ndarray:
    """Return nine points (9, 2) along the line from a point to its label."""
    end = np.array(nearest_edge(point, [float(value) for value in box]))
    return np.array(point) + np.linspace(0.1, 0.9, 9)[:, None] * (end - np.array(point))


def _gap(boxes: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Return the distance (T, P) of each point (P, 2) from each box; 0 inside the box."""
    x, y = places[None, :, 0], places[None, :, 1]
    gap_x = np.maximum(np.maximum(boxes[:, None, 0] - x, x - boxes[:, None, 2]), 0)
    gap_y = np.maximum(np.maximum(boxes[:, None, 1] - y, y - boxes[:, None, 3]), 0)
    return np.hypot(gap_x, gap_y)


def _inside(boxes: np.ndarray, places: np.ndarray, margin: float | np.ndarray = 0.0) -> np.ndarray:
    """Return whether (T, P) each point (P, 2) is within `margin`, a number or (P,), of each box."""
    return _gap(boxes, places) <= margin


def _overlap(boxes: np.ndarray, rest: np.ndarray) -> np.ndarray:
    """Return the shared area (T, R) of each box (T, 4) with each other one (R, 4), with a gap between words."""
    width = np.minimum(boxes[:, None, 2], rest[None, :, 2]) - np.maximum(boxes[:, None, 0], rest[None, :, 0]) + 4
    height = np.minimum(boxes[:, None, 3], rest[None, :, 3]) - np.maximum(boxes[:, None, 1], rest[None, :, 1]) + 1
    return np.clip(width, 0, None) * np.clip(height, 0, None)
