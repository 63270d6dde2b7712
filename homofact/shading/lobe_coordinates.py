"""Polar coordinates of directions around the mirror direction, in which lobes are simple, as shader expressions.

For a viewer ωo, every direction above the horizon has an angle φ and a radius 0 < r < R(φ) about the mirror direction;
the ray at φ meets the horizon at R. The coordinate v along the ray is roughly uniform in log r, since lobes fall with
log r.

For an isotropic material, x = ω.xy/√(1 + ωz) maps the hemisphere onto the unit disc and preserves areas, dω = 2 dx
(Lambert). The mirror direction is at −x(ωo), and

    x(ωi) + x(ωo) = r e(φ),   dω = 2 r dr dφ,   R = b + √(b² + zo),   b = e·x(ωo),
    v = log((1 + r/σ)/(1 − κ r))/L,   κ = 1/(R (1 + E)),   dr/dv = L (r + σ)(1 − κ r)/(1 + κ σ),

e(φ) a unit vector at the angle φ from ωo.xy. R solves |R e − x(ωo)| = 1 with |x(ωo)|² = 1 − zo. v is in [0, 1], and L
scales it to 1 at R. κ also makes nodes dense near the horizon, where a material at a grazing view reflects much light.
Without κ, half of the variance of a white paint at 80° came from the last cell.

On an anisotropic material, lobes are ellipses in the slopes of the half vector, m = (ωi + ωo).xy/(ωi + ωo).z. A
symmetric matrix A with determinant 1 maps circles to these ellipses, so that with s = r/√(1 − r²)

    m = s A e(φ),   dω = 4 (h·ωo) dωh = 4 (m·ωo.xy + zo)/(1 + |m|²)² · r dr dφ/(1 − r²)²,
    v = log(1 + r/σ)/log(1 + 1/σ),

e(φ) at the angle φ from A⁻¹ ωo.xy. The mirrored direction reaches the horizon where 2 θh is a right angle more than the
elevation of ωo in the plane through n and h (`geometry.quadrature`): with d = A e and b = d·ωo.xy/|d|, at the slope
s = (b + √(b² + zo²))/(zo |d|). There v is below 1, at the same r/σ whatever the azimuth of the viewer.

Of the two forms of the root of a quadratic, the code uses the one without a subtraction, to avoid cancellation.
"""

import math

from homofact.geometry.expression import Expression, Let, call, constant, variable, vector

THETAS, PHIS, RADII = 8, 7, 16
_TINY = 1e-20
_NEAR = 1e-8  # of r and R
_EDGE = 0.2  # E


def viewer_statements(grained: bool) -> list[Let]:
    """Return statements that compute the values that depend only on wo (3,): "level" is the place between θo nodes."""
    wo, far = variable("wo", 3), variable("far", 1)
    fourth = far * far
    # Along the normal there is no azimuth.
    axis = wo.xy + constant(_NEAR, 0)
    disc = wo.xy / call("sqrt", 1 + variable("z", 1))
    return [
        Let("z", call("min", call("max", wo.z, 0.0), 1.0)),
        Let("far", 1 - variable("z", 1)),
        Let("level", call("sqrt", far) * (1 + fourth * fourth) * (0.5 * (THETAS - 1))),
        Let("axis", unstretched(axis) if grained else axis),
        *([] if grained else [Let("shift", disc, "on a disc of equal areas the mirror direction is at -shift")]),
    ]


def place_statements(grained: bool) -> list[Let]:
    """Return statements that compute `around` = |φ| (PHIS − 1)/π and `place` = v RADII from wi, after the viewer's."""
    wi, both, axis, even = variable("wi", 3), variable("both", 3), variable("axis", 2), variable("even", 2)
    nearly, length, r = constant(_NEAR, 0), variable("even_length", 1), variable("r", 1)
    if grained:
        made = [
            Let("both", wi + variable("wo", 3)),
            Let("slope", both.xy / call("max", both.z, _TINY) + nearly, "of the half vector"),
            Let("even", unstretched(variable("slope", 2))),
        ]
    else:
        disc = wi.xy / call("sqrt", 1 + call("max", wi.z, 0.0))
        made = [Let("even", disc + (variable("shift", 2) + nearly), "from the mirror direction")]
    across = call("abs", axis.x * even.y - axis.y * even.x)
    angle = call("atan2", call("max", across, _TINY), call("dot", axis, even))
    return [
        *made,
        Let("even_length", call("max", call("sqrt", call("dot", even, even)), _NEAR)),
        Let("ray", (variable("slope", 2) if grained else even) / length),
        Let("around", angle * ((PHIS - 1) / math.pi)),
        *_reach(grained),
        Let("r", length / call("sqrt", 1 + length * length) if grained else length),
        *([] if grained else [_rest()]),
        Let("place", call("min", _log(_ratio(r, grained)) * RADII / variable("whole_log", 1), variable("limit", 1))),
    ]


def ray_statements(grained: bool) -> list[Let]:
    """Return statements for the ray and its `limit` from `around` and `side`, the sign of φ, after the viewer's."""
    axis, unit, turned, even = variable("axis", 2), variable("unit", 2), variable("cos_sin", 2), variable("even", 2)
    turn = variable("phi", 1)
    return [
        Let("phi", variable("around", 1) * (math.pi / (PHIS - 1))),
        Let("unit", axis / call("sqrt", call("dot", axis, axis))),
        Let("cos_sin", vector(call("cos", turn), call("sin", turn) * variable("side", 1))),
        Let("even", vector(turned.x * unit.x - turned.y * unit.y, turned.x * unit.y + turned.y * unit.x)),
        Let("ray", stretched(even) if grained else even),
        *_reach(grained),
    ]


def found_statements(grained: bool) -> list[Let]:
    """Return statements that compute the direction "found" (3,) and "spread" from the ray and `place`."""
    ray, r, place = variable("ray", 2), variable("r", 1), variable("place", 1)
    growth = call("exp", place * variable("whole_log", 1) * (1 / RADII)) - 1
    scale, edge = variable("scale", 1), variable("edge", 1)
    made = [Let("r", scale * growth if grained else scale * growth / (1 + scale * edge * (growth + 1)))]
    if grained:
        slope, wo = variable("slope", 2), variable("wo", 3)
        made += [Let("slope", ray * (r / call("sqrt", call("max", 1 - r * r, _TINY)))), *spread_statements(True)]
        half = vector(slope, constant(1))
        return [*made, Let("found", half * (2 * variable("towards", 1) * variable("upright", 1)) - wo)]
    x, square = variable("x", 2), variable("x_squared", 1)
    return [
        *made,
        _rest(),
        *spread_statements(False),
        Let("x", ray * r - variable("shift", 2)),
        Let("x_squared", call("min", call("dot", x, x), 1.0)),
        Let("found", vector(x * call("sqrt", 2 - square), 1 - square)),
    ]


def spread_statements(grained: bool) -> list[Let]:
    """Return statements that compute "spread" = dω/(dv dφ) at the radius r on the ray."""
    r, scale, edge = variable("r", 1), variable("scale", 1), variable("edge", 1)
    disc = r * (scale + r) * variable("whole_log", 1)
    if not grained:
        return [Let("spread", disc * 2 * variable("rest", 1) / (1 + edge * scale))]
    slope, flat = variable("slope", 2), variable("flatness", 1)
    return [
        Let("towards", call("dot", slope, variable("wo", 3).xy) + variable("z", 1)),
        Let("upright", 1 / (1 + call("dot", slope, slope))),
        Let("flatness", variable("upright", 1) / call("max", 1 - r * r, _TINY)),
        Let("spread", disc * 4 * variable("towards", 1) * (flat * flat)),
    ]


def _reach(grained: bool) -> list[Let]:
    """Along `ray`: L as `whole_log`, κ as `edge`, and the `limit` of `place`, where the horizon is."""
    ray, off, root, z, length = (
        variable("ray", 2), variable("off", 1), variable("root", 1), variable("z", 1), variable("ray_length", 1)
    )  # fmt: skip
    outward = call("step", 0.0, off)
    seen = variable("wo", 3).xy if grained else variable("shift", 2)
    far = root / call("max", z, 1e-6) if grained else root
    reach = far * outward + z / call("max", root, _TINY) * (1 - outward)
    made = [Let("ray_length", call("sqrt", call("max", call("dot", ray, ray), _TINY)))] if grained else []
    made += [
        Let("off", call("dot", ray, seen) / length if grained else call("dot", ray, seen)),
        Let("root", call("abs", off) + call("sqrt", off * off + (z * z if grained else z))),
        Let("reach", call("max", reach / length if grained else reach, _NEAR), "as far as the horizon"),
    ]
    reach = variable("reach", 1)
    if not grained:
        return [
            *made,
            Let("edge", 1 / (reach * (1 + _EDGE))),
            Let("whole_log", _log((reach * ((1 + _EDGE) / _EDGE) / variable("scale", 1)) + 1 / _EDGE)),
            Let("limit", constant(RADII)),
        ]
    bent = reach / call("sqrt", 1 + reach * reach)
    return [
        *made,
        Let("whole_log", call("log", 1 + 1 / variable("scale", 1))),
        Let("limit", _log(_ratio(bent, True)) * RADII / variable("whole_log", 1)),
    ]


def _ratio(r: Expression, grained: bool) -> Expression:
    """e^(Lv) − 1 at r."""
    inverse = 1 / variable("scale", 1)
    return r * inverse if grained else r * (inverse + variable("edge", 1)) / variable("rest", 1)


def _rest() -> Let:
    """1 − κ r as "rest", at least what it is at the horizon."""
    least = _EDGE / (1 + _EDGE)
    return Let("rest", call("max", 1 - variable("edge", 1) * variable("r", 1), least))


def _log(y: Expression) -> Expression:
    """log(1 + y) for y ≥ 0 with its relative precision: by its series where y is small."""
    series = y * (1 - y * (0.5 - y * (1 / 3)))
    large = call("step", 0.01, y)
    return series * (1 - large) + call("log", 1 + y) * large


def stretched(w: Expression) -> Expression:
    """Return A w."""
    grain = variable("grain", 3)
    return vector(grain.x * w.x + grain.y * w.y, grain.y * w.x + grain.z * w.y)


def unstretched(w: Expression) -> Expression:
    """A⁻¹ w: the determinant of A is 1."""
    grain = variable("grain", 3)
    return vector(grain.z * w.x - grain.y * w.y, grain.x * w.y - grain.y * w.x)
