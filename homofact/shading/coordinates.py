"""The coordinates of a projection as few operations, for unit vectors ωi and ωo of the upper hemisphere.

With s = ωi + ωo and e = ωi − ωo (so s·e = 0, |s|² + |e|² = 4, h = s/|s|, ωi = (s + e)/2) nothing is normalised:

    parabolic h   = s.xy/(|s| + s.z)
    θh            = atan2(|s.xy|, s.z)
    θd            = atan2(|e|, |s|), half the angle between ωi and ωo
    φd            = atan2(|s.x e.y − s.y e.x|, |e.z| |s|)
    φh            = atan2(s.y, s.x)

that of φd from across = (h × ωi).z = (s × e).z/(2|s|) and along = ωi.z − cosθd h.z = e.z/2. For the frame of Kautz and
McCool, r = norm(t − (t·h)h) and q = |(s.y, s.z)| = |s| |t − (t·h)h|:

    r·ωi = r·e/2 = (q e.x − s.x (s.y e.y + s.z e.z)/q)/(2|s|) = e.x |s|/(2q)      as s.y e.y + s.z e.z = −s.x e.x
    (h × r)·ωi = (s.z e.y − s.y e.z)/(2q),   h·ωi = |s|/2
    parabolic d   = (e.x |s|, s.z e.y − s.y e.z)/(q (2 + |s|))

Where h is the tangent, on the horizon, s.z is kept at `LEAST`, which is the limit of the frame that Python takes
there and keeps |s| off 0. All angles come from atan2: in float32 acos loses half of a small angle's digits, and
drivers give it only roughly. Angles are taken together, one function of a vector for all that a fit needs. Where φd
and |φi − φo| are both needed, they share (s × e).z = −2 (ωi × ωo).z.

The parabolic coordinates and the angles are those of `geometry.coordinates`, but for their scales, which
`SCALES` gives as x = factor · raw + offset, to be folded into a matrix.
"""

import math
from collections.abc import Collection
from dataclasses import dataclass

from homofact.shading.expression import Expression, Let, call, constant, variable, vector

LEAST = 1e-6
_TINY = 1e-20
# x = factor · raw + offset, by coordinate system, an entry an axis.
SCALES: dict[str, tuple[tuple[float, float], ...]] = {
    "in-out": ((1, 0),) * 4,
    "half-diff": ((1, 0),) * 4,
    "isotropic-half-diff": ((4 / math.pi, -1),) * 3,
    "isotropic-in-out": ((4 / math.pi, -1), (4 / math.pi, -1), (2 / math.pi, -1)),
    "half-angles": ((4 / math.pi, -1), (1 / math.pi, 0)),
}


@dataclass(frozen=True)
class Coordinates:
    """The statements that compute the raw coordinates a program reads, and each axis by name, a scalar."""

    statements: list[Let]
    axes: dict[str, Expression]


def coordinates_of(used: Collection[str]) -> Coordinates:
    """Statements for the axes in `used`, from the parameters wi and wo (3,), and no others."""
    wi, wo = variable("wi", 3), variable("wo", 3)
    s, e = variable("s", 3), variable("e", 3)
    statements: list[Let] = []
    axes: dict[str, Expression] = {}
    frame = {"u_h", "v_h", "u_d", "v_d"} & set(used)
    if frame | {"theta_h", "theta_d", "phi_d", "phi_h"} & set(used):
        along = vector(wi.xy + wo.xy, call("max", wi.z + wo.z, LEAST)) if frame else wi + wo
        statements.append(Let("s", along, "s points along the half vector, at right angles to e"))
    if {"u_d", "v_d", "theta_d", "phi_d"} & set(used):
        statements.append(Let("e", wi - wo))
    length = _lengths(
        {
            "s": (s, frame | {"theta_d", "phi_d"} & set(used)),
            "s.xy": (s.xy, {"theta_h"} & set(used)),
            "s.yz": (s.yz, {"u_d", "v_d"} & set(used)),
            "e": (e, {"theta_d"} & set(used)),
        },
        statements,
    )
    for side, w in (("i", wi), ("o", wo)):
        if {f"u_{side}", f"v_{side}"} & set(used):
            name = f"disc_w{side}"
            statements.append(Let(name, w.xy / (1 + w.z), f"parabolic coordinates of w{side}"))
            axes |= _of_disc(name, side)
    if {"u_h", "v_h"} & set(used):
        statements.append(Let("disc_h", s.xy / (length["s"] + s.z), "parabolic coordinates of the half vector"))
        axes |= _of_disc("disc_h", "h")
    if {"u_d", "v_d"} & set(used):
        above = vector(e.x * length["s"], s.z * e.y - s.y * e.z)
        statements.append(
            Let(
                "disc_d",
                above / (length["s.yz"] * (length["s"] + 2)),
                "and of the difference vector",
            )
        )
        axes |= _of_disc("disc_d", "d")
    arcs = [axis for axis in ("theta_i", "theta_o") if axis in used]
    if arcs:
        sides = [{"theta_i": wi, "theta_o": wo}[axis] for axis in arcs]
        sines = call("sqrt", vector(*(call("dot", w.xy, w.xy) for w in sides)))
        axes |= _packed("theta", call("atan2", sines, vector(*(w.z for w in sides))), arcs, statements)
    across = call("abs", wi.x * wo.y - wi.y * wo.x)
    if {"phi_d", "delta_phi"} <= set(used):
        statements.append(Let("across", across, "|(wi x wo).z|, half of |(s x e).z|"))
        across = variable("across", 1)
    parts = {
        "theta_h": lambda: (length["s.xy"], s.z),
        "theta_d": lambda: (length["e"], length["s"]),
        "phi_d": lambda: (
            (across, call("abs", e.z) * length["s"] * 0.5)
            if "delta_phi" in used
            else (call("abs", s.x * e.y - s.y * e.x), call("abs", e.z) * length["s"])
        ),
        "delta_phi": lambda: (across, call("dot", wi.xy, wo.xy)),
        "phi_h": lambda: (s.y, s.x),
    }
    turns = [axis for axis in parts if axis in used]
    for begin in range(0, len(turns), 4):
        four = turns[begin : begin + 4]
        # atan2(0, 0) is not defined in shading languages.
        sides = [parts[axis]() for axis in four]
        opposite, adjacent = (vector(*(side[k] for side in sides)) for k in (0, 1))
        name = "angle" if begin == 0 else "angle_more"
        axes |= _packed(name, call("atan2", opposite, adjacent + _TINY), four, statements)
    return Coordinates(statements, axes)


def _lengths(wanted: dict[str, tuple[Expression, Collection[str]]], statements: list[Let]) -> dict[str, Expression]:
    """Where the length of each vector is that something needs: one square root for all of them."""
    kept = {name: v for name, (v, needed_by) in wanted.items() if needed_by}
    if not kept:
        return {}
    squares = vector(*(call("dot", v, v) for v in kept.values()))
    statements.append(Let("lengths", call("sqrt", squares), f"of {', '.join(kept)}"))
    whole = variable("lengths", len(kept))
    return {name: whole if len(kept) == 1 else getattr(whole, "xyzw"[k]) for k, name in enumerate(kept)}


def _of_disc(name: str, letter: str) -> dict[str, Expression]:
    disc = variable(name, 2)
    return {f"u_{letter}": disc.x, f"v_{letter}": disc.y}


def _packed(name: str, value: Expression, axes: list[str], statements: list[Let]) -> dict[str, Expression]:
    """One statement for several angles; where each is then."""
    statements.append(Let(name, value, ", ".join(axes)))
    whole = variable(name, len(axes))
    if len(axes) == 1:
        return {axes[0]: whole}
    return {axis: getattr(whole, "xyzw"[k]) for k, axis in enumerate(axes)}


def warped(
    system: str, width: float, number: int, axes: list[Expression]
) -> tuple[list[Let], list[Expression], tuple[tuple[float, float], ...]]:
    """(further statements, axes, scales) of a system whose half vector is stretched: ρ ↦ asinh(ρ/w)/asinh(1/w).

    `number` makes the names of the statements unique.
    """
    name, scales = f"warped_{number}", SCALES[system]
    what = "the half vector's radius r" if system == "half-diff" else "r = theta_h/(pi/2)"
    comment = f"{what} stretched to asinh(r/{width:.6g})/asinh(1/{width:.6g})"
    whole = math.asinh(1 / width)
    if system == "half-diff":
        h, radius = variable("disc_h", 2), variable(f"radius_{number}", 1)
        # Kept off 0, where the stretch is its slope.
        length = call("max", call("sqrt", call("dot", h, h)), LEAST)
        stretched = h * (call("asinh", radius * (1 / width)) / radius)
        made = [Let(radius.text, length, comment), Let(name, stretched)]
        new = variable(name, 2)
        return made, [new.x, new.y, *axes[2:]], (((1 / whole, 0.0),) * 2) + scales[2:]
    made = [Let(name, call("asinh", axes[0] * (2 / math.pi / width)), comment)]
    return made, [variable(name, 1), *axes[1:]], ((2 / whole, -1.0), *scales[1:])


def gathered(axes: list[Expression]) -> list[Expression]:
    """The axes with components of one vector written together: disc.x, disc.y as disc, angle.x, angle.y as angle.xy."""
    parts: list[Expression] = []
    for axis in axes:
        last = parts[-1] if parts else None
        if axis.kind == "swizzle" and last is not None and last.kind == "swizzle" and last.operands == axis.operands:
            parts[-1] = getattr(axis.operands[0], last.text + axis.text)
        else:
            parts.append(axis)
    return [part.operands[0] if part.kind == "swizzle" and part.text == _whole(part) else part for part in parts]


def _whole(part: Expression) -> str:
    return "xyzw"[: part.operands[0].dimension]


def place(rows: list[list[float]], offsets: list[float], axes: list[Expression], x: Expression) -> Expression:
    """(u, v) = rows · axes + offsets: one product where each row has one axis, else dot products with x.

    `x` (4,) names the axes in one vector, three of them with a 1 behind, which takes the offsets.
    """
    if all(sum(c != 0 for c in row) <= 1 for row in rows):
        picked = [next((k for k, c in enumerate(row) if c), None) for row in rows]
        if picked[0] is not None and picked[1] is not None:
            gain = constant(rows[0][picked[0]], rows[1][picked[1]])
            return vector(*gathered([axes[picked[0]], axes[picked[1]]])) * gain + constant(*offsets)
        single = [
            constant(o) if k is None else axes[k] * r[k] + o for k, r, o in zip(picked, rows, offsets, strict=True)
        ]
        return vector(*single)
    if len(axes) < 4:
        return vector(*(call("dot", constant(*row, offset), x) for row, offset in zip(rows, offsets, strict=True)))
    return vector(*(call("dot", constant(*row), x) for row in rows)) + constant(*offsets)
