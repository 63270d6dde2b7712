"""The density and the sampling of `lobe_mixture` as expressions, for printing, interpreting and fitting.

Parameters are "scale" σ, "grain" A (xx, xy, yy) and the rows of the table, four numbers each (`row_names`): g by θo, φ
and v, then two rows for each θo, m by φ and c. The code has no loop, branch or index. A function that is linear between
nodes is a sum over all nodes with weights max(0, 1 − |place − node|); a GPU adds four of them per instruction.
"""

import math
from collections.abc import Sequence

from homofact.geometry.expression import Expression, Let, call, constant, variable, vector
from homofact.shading.lobe_coordinates import (
    PHIS,
    RADII,
    THETAS,
    found_statements,
    place_statements,
    ray_statements,
    spread_statements,
    viewer_statements,
)

_PARTS = RADII // 4  # rows of g at one θo and φ
_TINY, _MOST = 1e-20, 1e30


def row_names() -> tuple[str, ...]:
    """Return the names of the table's rows, in the order of `LobeMixture.rows`."""
    lobe = [f"g_{i}_{j}_{part}" for i in range(THETAS) for j in range(PHIS) for part in range(_PARTS)]
    return (*lobe, *(f"m_{i}_{part}" for i in range(THETAS) for part in range(2)))


def density_statements(grained: bool) -> list[Let]:
    """Return statements in wi, wo (3,), the parameters and the table; the last one defines "density"."""
    wi, wo, cosine = variable("wi", 3), variable("wo", 3), variable("turns_1", 4).w
    made = [
        *_seen(grained),
        *place_statements(grained),
        *_turns(),
        *_lobe(grained),
        Let("value", _read("row", _PARTS, _hats(variable("place", 1), _PARTS, 1.0)), "the table, linear"),
        Let("turn", _read("turns", 2, _hats(variable("around", 1), 2, 0.0))),
        *spread_statements(grained),
    ]
    # Of v, and of φ on both sides.
    gain = (1 - cosine) * (RADII * (PHIS - 1) / (2 * math.pi))
    share = variable("value", 1) / call("max", variable("row_sum", 1), _TINY) * variable("turn", 1)
    lobe = gain * share / call("max", variable("turns_sum", 1) * variable("spread", 1), _TINY)
    # On the horizon itself it may overflow.
    total = cosine * wi.z * (1 / math.pi) + call("min", lobe, _MOST)
    above = call("step", _TINY, call("min", wi.z, wo.z))
    return [*made, Let("density", total * above, "a cosine and the lobe, 0 under the horizon")]


def sample_statements(grained: bool) -> list[Let]:
    """Return statements in wo, u (3,), the parameters and the table; the last one defines "wi"."""
    u, radius, turn, lobe = (
        variable("u", 3),
        variable("cosine_radius", 1),
        variable("cosine_turn", 1),
        variable("lobe", 1),
    )
    cosine = vector(radius * call("cos", turn), radius * call("sin", turn), call("sqrt", 1 - u.y))
    return [
        *_seen(grained),
        *_turns(),
        Let("side", call("step", 0.5, u.x) * 2 - 1, "equal probability on both sides of the plane of incidence"),
        *_inverted("around", "turns", PHIS, call("abs", u.x * 2 - 1) * variable("turns_sum", 1), False),
        *ray_statements(grained),
        *_lobe(grained),
        *_inverted("place", "row", RADII + 1, u.y * variable("row_sum", 1), True),
        *found_statements(grained),
        Let("lobe", call("step", variable("turns_1", 4).w, u.z), "u.z picks the cosine or the lobe"),
        Let("cosine_radius", call("sqrt", u.y)),
        Let("cosine_turn", u.x * (2 * math.pi)),
        Let("wi", variable("found", 3) * lobe + cosine * (1 - lobe)),
    ]


def _seen(grained: bool) -> list[Let]:
    return [*viewer_statements(grained), *_weights("level", THETAS)]


def _weights(name: str, count: int) -> list[Let]:
    """The shares of `count` nodes in what is linear between them at the place called `name`, four by four."""
    hats = _hats(variable(name, 1), (count + 3) // 4, 0.0)
    return [Let(f"{name}_{'near' if k == 0 else 'far'}", hat) for k, hat in enumerate(hats)]


def _share(name: str, k: int) -> Expression:
    """The share of node k."""
    return getattr(variable(f"{name}_{'near' if k < 4 else 'far'}", 4), "xyzw"[k % 4])


def _turns() -> list[Let]:
    """m at the viewer's θo, as `turns_0` and `turns_1`, whose last number is c; the integral of m in steps of φ."""
    made = []
    for k in range(2):
        rows = [variable(f"m_{i}_{k}", 4) * _share("level", i) for i in range(THETAS)]
        made.append(Let(f"turns_{k}", _sum(rows), "the table at the viewer" if k == 0 else ""))
    ends = [1.0] * 8
    ends[0] = ends[PHIS - 1] = 0.5
    ends[PHIS:] = [0.0] * (8 - PHIS)
    return [*made, Let("turns_sum", _read("turns", 2, [constant(*ends[4 * k : 4 * k + 4]) for k in range(2)]))]


def _lobe(grained: bool) -> list[Let]:
    """g at the viewer's θo and at φ, as `row_0` and so on, and the integral of it in steps of v, up to the limit."""
    made = _weights("around", PHIS)
    for part in range(_PARTS):
        for j in range(PHIS):
            rows = [variable(f"g_{i}_{j}_{part}", 4) * _share("level", i) for i in range(THETAS)]
            made.append(Let(f"at_{j}_{part}", _sum(rows)))
        mixed = [variable(f"at_{j}_{part}", 4) * _share("around", j) for j in range(PHIS)]
        made.append(Let(f"row_{part}", _sum(mixed)))
    if grained:
        sums = [0.5 + (1 - 0.5 * call("abs", each)) * each for each in _apart(variable("limit", 1), _PARTS)]
    else:
        sums = [constant(1, 1, 1, 1)] * (_PARTS - 1) + [constant(1, 1, 1, 0.5)]
    return [*made, Let("row_sum", _read("row", _PARTS, sums))]


def _apart(place: Expression, parts: int) -> list[Expression]:
    """How far a place is beyond nodes 1, 2, …, at most a step, four by four."""
    steps = [constant(*(1.0 + 4 * part + k for k in range(4))) for part in range(parts)]
    return [call("min", call("max", place - each, -1.0), 1.0) for each in steps]


def _inverted(name: str, rows: str, count: int, target: Expression, from_zero: bool) -> list[Let]:
    """`name`, where the integral of what is linear between `count` nodes, from the first on, reaches `target`.

    The nodes' values are the numbers of `rows`_0 and so on; `from_zero` puts a node of value 0 before them.
    """
    numbers = [variable(f"{rows}_{k // 4}", 4) for k in range(count)]
    nodes = [getattr(number, "xyzw"[k % 4]) for k, number in enumerate(numbers)]
    nodes = [constant(0), *nodes[: count - 1]] if from_zero else nodes
    parts, aim = (count + 2) // 4, variable(f"{name}_aim", 1)
    made = [Let(f"{name}_aim", target * 2)]
    # Twice the areas of the cells, added up; whole cells below the aim are counted.
    passed, areas = [], []
    for k in range(1, count - 1):
        area = nodes[1] if from_zero and k == 1 else nodes[k - 1] + nodes[k]
        made.append(Let(f"{name}_{k}", area if k == 1 else variable(f"{name}_{k - 1}", 1) + area))
        passed.append(Let(f"{name}_past_{k}", call("step", variable(f"{name}_{k}", 1), aim)))
        areas.append(variable(f"{name}_past_{k}", 1) * area)
    cell = variable(f"{name}_below", 1)
    first = 1.0 if from_zero else 0.0
    low, high, rest = (variable(f"{name}_{word}", 1) for word in ("low", "high", "rest"))
    root = call("sqrt", call("max", low * low + (high - low) * rest, 0.0))
    return [
        *made,
        *passed,
        Let(f"{name}_below", _sum([variable(each.name, 1) for each in passed])),
        Let(f"{name}_rest", call("max", aim - _sum(areas), 0.0)),
        Let(f"{name}_low", _read(rows, parts, _hats(cell, parts, first))),
        Let(f"{name}_high", _read(rows, parts, _hats(cell + 1, parts, first))),
        Let(name, cell + call("min", rest / call("max", low + root, _TINY), 1.0)),
    ]


def _hats(place: Expression, parts: int, first: float) -> list[Expression]:
    """The shares of nodes first, first + 1, … in what is linear between them, four by four."""
    steps = [constant(*(first + 4 * part + k for k in range(4))) for part in range(parts)]
    return [call("max", 1 - call("abs", place - each), 0.0) for each in steps]


def _read(name: str, parts: int, weights: Sequence[Expression]) -> Expression:
    """The sum of the numbers of `name`_0 and so on, weighted."""
    return _sum([call("dot", variable(f"{name}_{k}", 4), weights[k]) for k in range(parts)])


def _sum(parts: Sequence[Expression]) -> Expression:
    total, *rest = parts
    for part in rest:
        total = total + part
    return total
