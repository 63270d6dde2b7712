"""The shading program of a separable fit: f = max(0, Σk sk gk(a) hk(b)) per channel, no logarithm in it.

(a, b) are (ωi, ωo) or (h, d). All three direction maps come from parabolic coordinates p with r² = |p|²: orthographic
(ωx, ωy) = 2p/(1 + r²), polar (atan2(p.y, p.x)/π, 2√(1 − ωz) − 1) with 1 − ωz = 2r²/(1 + r²). A term that stores one
texture reads it at both places.
"""

import math
from collections.abc import Sequence

import numpy as np

from homofact.errors import BadInput
from homofact.separable.separable import Separable
from homofact.shading.coordinates import coordinates_of
from homofact.shading.encoding import Encoded
from homofact.shading.expression import Expression, Let, call, constant, fetch, needed, variable, vector
from homofact.shading.program import TEXTURES, Program, name_of

_DISCS = {"in-out": ("wi", "wo"), "half-diff": ("h", "d")}
_AXES = {"wi": ("u_i", "v_i"), "wo": ("u_o", "v_o"), "h": ("u_h", "v_h"), "d": ("u_d", "v_d")}


def separable_program(fitted: Separable, textures: Sequence[Encoded]) -> Program:
    """The program that reads `textures`: of every term its first and, where it has one, its second.

    Raises BadInput for more than four channels.
    """
    count = len(fitted.channels)
    if count > 4:
        raise BadInput(f"channels: found {count}, expected at most the 4 of a texture: fit with --channels rgb")
    wi, wo = variable("wi", 3), variable("wo", 3)
    sides = _DISCS[fitted.parameterization]
    statements = list(coordinates_of({axis for side in sides for axis in _AXES[side]}).statements)
    rows, columns = (int(side) for side in fitted.read.shape)
    for side in sides:
        statements += _placed(side, fitted.map, (rows, columns))
    total: Expression | None = None
    number = 0
    for k, term in enumerate(fitted.terms):
        values = []
        for j, side in enumerate(sides):
            texture = number + (j if len(term.textures) == 2 else 0)
            name = f"g_{k}" if j == 0 else f"h_{k}"
            statements.append(Let(name, fetch(texture, variable(f"uv_{side}", 2), count)))
            values.append(_decoded(variable(name, count), textures[texture]))
        number += len(term.textures)
        product = values[0] * values[1]
        signs = term.signs.tolist()
        if total is None:
            total = product if min(signs) > 0 else product * constant(*signs)
        elif min(signs) > 0 or max(signs) < 0:
            total = total + product if min(signs) > 0 else total - product
        else:
            total = total + product * constant(*signs)
    if total is None:
        raise BadInput("separable fit: found no terms, expected at least one")
    statements.append(Let("above", call("step", 0.0, call("min", wi.z, wo.z)), "0 under the horizon"))
    statements.append(Let("f", call("max", total, 0.0), "a truncated sum may fall below 0"))
    result = variable("f", count) * variable("above", 1)
    terms = len(fitted.terms)
    title = (
        f"BRDF of {name_of(fitted.provenance)}, by homofact {fitted.provenance.get('homofact_version', '')}: sum of"
        f" {terms} product{'s' if terms > 1 else ''} of textures, {2 * terms} fetches.",
        *TEXTURES,
    )
    shapes = ((rows, columns),) * number
    return Program(needed(statements, result), result, shapes, fitted.channels, title)


def _decoded(value: Expression, texture: Encoded) -> Expression:
    if not np.all(texture.scale == 1):
        value = value * constant(*texture.scale.tolist())
    return value if not np.any(texture.bias) else value + constant(*texture.bias.tolist())


def _placed(side: str, name: str, shape: tuple[int, int]) -> list[Let]:
    """The statements that end in uv_SIDE, the sampler's coordinate of one side's direction."""
    rows, columns = shape
    gain = ((columns - 1) / (2 * columns), (rows - 1) / (2 * rows))
    p = variable(f"disc_{side}", 2)
    uv = f"uv_{side}"
    if name == "parabolic":
        return [Let(uv, p * constant(*gain) + 0.5, f"{side} on the parabolic map, {columns} x {rows} texels")]
    squared = Let(f"squared_{side}", call("dot", p, p))
    r = variable(squared.name, 1)
    if name == "orthographic":
        place = p * (2 / (1 + r)) * constant(*gain) + 0.5
        return [squared, Let(uv, place, f"{side} on the orthographic map, {columns} x {rows} texels")]
    azimuth = call("atan2", p.y, p.x + 1e-20) * (gain[0] / math.pi) + 0.5
    height = call("sqrt", r * 2 / (1 + r)) * (2 * gain[1]) + (0.5 - gain[1])
    return [squared, Let(uv, vector(azimuth, height), f"{side} on the polar map, {columns} x {rows} texels")]
