"""The single definition of all coordinates: each axis by name, with few operations on the unit vectors ωi and ωo.

Shading languages print these expressions, numba compiles them, torch and Dr.Jit interpret them (`interpret`).

With s = ωi + ωo and e = ωi − ωo (so s·e = 0, |s|² + |e|² = 4, h = s/|s|, ωi = (s + e)/2) nothing is normalised:

    parabolic h   = s.xy/(|s| + s.z)
    θh            = atan2(|s.xy|, s.z)
    θd            = atan2(|e|, |s|), half the angle between ωi and ωo
    φd            = atan2(|s.x e.y − s.y e.x|, |e.z| |s|)
    φh            = atan2(s.y, s.x)
    tilt          = |e.z| = |cosθi − cosθo| = 2 sinθh sinθd cosφd

that of φd from across = (h × ωi).z = (s × e).z/(2|s|) and along = ωi.z − cosθd h.z = e.z/2. For the frame of Kautz and
McCool, r = norm(t − (t·h)h) and q = |(s.y, s.z)| = |s| |t − (t·h)h|:

    r·ωi = r·e/2 = (q e.x − s.x (s.y e.y + s.z e.z)/q)/(2|s|) = e.x |s|/(2q)      as s.y e.y + s.z e.z = −s.x e.x
    (h × r)·ωi = (s.z e.y − s.y e.z)/(2q),   h·ωi = |s|/2
    parabolic d   = (e.x |s|, s.z e.y − s.y e.z)/(q (2 + |s|))

s.z is at least `LEAST`. This keeps |s| above 0, and if h is the tangent, on the horizon, it gives the same limit of the
frame as the Python code. All angles use atan2: in float32, acos loses half of the digits of a small angle, and graphics
drivers compute it inaccurately. All angles of a fit are computed together, by one vector function. If φd and |φi − φo|
are both needed, they share (s × e).z = −2 (ωi × ωo).z.

With its sign, over the whole circle ("azimuth_d"), φd is atan2((s × e).z, −e.z |s|), and φh is atan2(s.y, s.x).

Direction maps of a separable fit come from parabolic coordinates p with r² = |p|²: orthographic (ωx, ωy) = 2p/(1 + r²),
polar (atan2(p.y, p.x), √(1 − ωz)) with 1 − ωz = 2r²/(1 + r²).

The axes here are not scaled: parabolic coordinates, cosines, radians. `geometry.coordinates` maps each to its domain by
an affine map, which shaders combine with the projection matrix.
"""

import math
from collections.abc import Collection
from dataclasses import dataclass
from functools import lru_cache

from homofact.geometry.expression import Expression, Let, call, variable, vector

LEAST = 1e-6
_TINY = 1e-20
MAPS = ("parabolic", "orthographic", "polar")


def map_axes(name: str, letter: str) -> tuple[str, str]:
    """Return the two axes of a direction map (`MAPS`) of ωi, ωo, h or d ("i", "o", "h", "d")."""
    begin = "" if name == "parabolic" else f"{name}_"
    return f"{begin}u_{letter}", f"{begin}v_{letter}"


@dataclass(frozen=True)
class Coordinates:
    """The statements that compute raw axes, and each axis by name, a scalar."""

    statements: tuple[Let, ...]
    axes: dict[str, Expression]


@lru_cache(maxsize=256)
def coordinates_of(used: frozenset[str]) -> Coordinates:
    """Return the statements needed for the axes in `used`, from the parameters wi and wo (3,)."""
    mapped = {letter for letter in "iohd" for name in MAPS if set(map_axes(name, letter)) & used}
    wi, wo = variable("wi", 3), variable("wo", 3)
    s, e = variable("s", 3), variable("e", 3)
    statements: list[Let] = []
    axes: dict[str, Expression] = {}
    frame = {"h", "d"} & mapped
    if frame | {"theta_h", "theta_d", "phi_d", "phi_h", "azimuth_d"} & used:
        along = vector(wi.xy + wo.xy, call("max", wi.z + wo.z, LEAST)) if frame else wi + wo
        statements.append(Let("s", along, "s points along the half vector, at right angles to e"))
    if {"d"} & mapped | {"theta_d", "phi_d", "azimuth_d"} & used:
        statements.append(Let("e", wi - wo))
    length = _lengths(
        {
            "s": (s, frame | {"theta_d", "phi_d", "azimuth_d"} & used),
            "s.xy": (s.xy, {"theta_h"} & used),
            "s.yz": (s.yz, {"d"} & mapped),
            "e": (e, {"theta_d"} & used),
        },
        statements,
    )
    for side, w in (("i", wi), ("o", wo)):
        if side in mapped:
            name = f"disc_w{side}"
            statements.append(Let(name, w.xy / (1 + w.z), f"parabolic coordinates of w{side}"))
            axes |= _of_disc(name, side)
    if "h" in mapped:
        statements.append(Let("disc_h", s.xy / (length["s"] + s.z), "parabolic coordinates of the half vector"))
        axes |= _of_disc("disc_h", "h")
    if "d" in mapped:
        above = vector(e.x * length["s"], s.z * e.y - s.y * e.z)
        statements.append(
            Let(
                "disc_d",
                above / (length["s.yz"] * (length["s"] + 2)),
                "and of the difference vector",
            )
        )
        axes |= _of_disc("disc_d", "d")
    for name in MAPS[1:]:
        for letter in "iohd":
            if set(map_axes(name, letter)) & used:
                axes |= _mapped(name, letter, axes, statements)
    arcs = [axis for axis in ("theta_i", "theta_o") if axis in used]
    if arcs:
        sides = [{"theta_i": wi, "theta_o": wo}[axis] for axis in arcs]
        sines = call("sqrt", vector(*(call("dot", w.xy, w.xy) for w in sides)))
        axes |= _packed("theta", call("atan2", sines, vector(*(w.z for w in sides))), arcs, statements)
    if "tilt" in used:
        axes["tilt"] = call("abs", wi.z - wo.z)
    across = call("abs", wi.x * wo.y - wi.y * wo.x)
    if {"phi_d", "delta_phi"} <= used:
        statements.append(Let("across", across, "|(wi x wo).z|, half of |(s x e).z|"))
        across = variable("across", 1)
    around = variable("around", 2)
    if "azimuth_d" in used:
        sides = vector(s.x * e.y - s.y * e.x, length["s"] * e.z * -1)
        statements.append(Let("around", sides, "of wi about h: across and along the plane of n and h"))
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
        "azimuth_d": lambda: (around.x, around.y),
    }
    turns = [axis for axis in parts if axis in used]
    for begin in range(0, len(turns), 4):
        some = turns[begin : begin + 4]
        sides = [parts[axis]() for axis in some]
        opposite, adjacent = (vector(*(side[k] for side in sides)) for k in (0, 1))
        # atan2(0, 0) is not defined in shading languages.
        angle = call("atan2", opposite, adjacent + _TINY)
        axes |= _packed(f"angle_{begin}" if begin else "angle", angle, some, statements)
    return Coordinates(tuple(statements), axes)


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


def _mapped(name: str, letter: str, axes: dict[str, Expression], statements: list[Let]) -> dict[str, Expression]:
    """The axes of another map of a direction whose parabolic ones are there."""
    what = letter if letter in "hd" else f"w{letter}"
    p = axes[f"u_{letter}"].operands[0]
    squared = variable(f"squared_{what}", 1)
    if not any(statement.name == squared.text for statement in statements):
        statements.append(Let(squared.text, call("dot", p, p)))
    if name == "orthographic":
        place = p * (2 / (1 + squared))
    else:
        place = vector(call("atan2", p.y, p.x + _TINY), call("sqrt", squared * 2 / (1 + squared)))
    made = Let(f"{name}_{what}", place, f"{what} on the {name} map")
    statements.append(made)
    whole = variable(made.name, 2)
    return dict(zip(map_axes(name, letter), (whole.x, whole.y), strict=True))


def _packed(name: str, value: Expression, axes: list[str], statements: list[Let]) -> dict[str, Expression]:
    """One statement for several angles; where each is then."""
    statements.append(Let(name, value, ", ".join(axes)))
    whole = variable(name, len(axes))
    if len(axes) == 1:
        return {axes[0]: whole}
    return {axis: getattr(whole, "xyzw"[k]) for k, axis in enumerate(axes)}


def stretched(name: str, half: list[Expression], width: float) -> tuple[list[Let], list[Expression], float]:
    """Return (statements, axes, factor) of the half vector's raw axes with its radius ρ stretched by w = `width`.

    ρ ↦ asinh(ρ/w)/asinh(1/w), where ρ is the length of parabolic h (two axes) or θh/(π/2) (one). The factor
    1/asinh(1/w) is returned, for the caller to include in the scales. `name` makes the names of the statements unique.
    """
    whole = 1 / math.asinh(1 / width)
    what = "the half vector's radius r" if len(half) == 2 else "r = theta_h/(pi/2)"
    comment = f"{what} stretched to asinh(r/{width:.6g})/asinh(1/{width:.6g})"
    if len(half) == 1:
        return [Let(name, call("asinh", half[0] * (2 / math.pi / width)), comment)], [variable(name, 1)], whole
    h, radius = vector(*gathered(half)), variable(f"{name}_radius", 1)
    # Kept off 0, where the stretch is its slope.
    length = call("max", call("sqrt", call("dot", h, h)), LEAST)
    made = [Let(radius.text, length, comment), Let(name, h * (call("asinh", radius * (1 / width)) / radius))]
    return made, [variable(name, 2).x, variable(name, 2).y], whole


def gathered(axes: list[Expression]) -> list[Expression]:
    """Merge components of one vector: disc.x, disc.y become disc, and angle.x, angle.y become angle.xy."""
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
