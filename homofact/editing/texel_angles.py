"""The angles that a texture determines: γ at each texel, if γ depends on the texture coordinates alone.

A fixed projection uses coordinates unchanged: θh, θd, θi or θo along an axis, or the parabolic map of h, d, ωi or ωo,
whose radius is tan(θ/2). θh with φh, or the map of h, also determine γα, γβ, θx and θy. A warp is inverted. A searched
projection mixes its coordinates, so that its texture determines no angle.
"""

import math
from typing import Any

import torch
from torch import Tensor

from homofact.editing.angles import ANGLES, RIGHT_ANGLE, power_angle, tilt
from homofact.factor.factorization import Term
from homofact.geometry.directions import from_spherical
from homofact.linear.layout import texel_centres

_OF_DISC = {"i": "theta_i", "o": "theta_o", "h": "theta_h", "d": "theta_d"}


def angles_of_texels(term: Term[Any]) -> dict[str, Tensor]:
    """Return γ (rows, columns) in radians of every texel, by angle name; empty if no angle is determined.

    Texels beyond the rim of a disc count as on it.
    """
    names = [_axis(term, row) for row in (0, 1)]
    rows, columns = term.size
    by_row, by_column = term.projection.axes
    places = torch.broadcast_tensors(
        texel_centres(columns, by_column)[None, :].double(), texel_centres(rows, by_row)[:, None].double()
    )
    if term.projection.system.domain == "discs":
        found = _of_disc(term, names, places)
    else:
        found = {name: _raw(term, name, place) for name, place in zip(names, places, strict=True) if name}
    tilted = found.get("theta_h")
    if tilted is not None and "phi_h" in found:
        h = from_spherical(tilted, found["phi_h"])
        found |= {"gamma_alpha": power_angle(h, 0), "gamma_beta": power_angle(h, 1)}
        found |= {"theta_x": tilt(h, 0), "theta_y": tilt(h, 1)}
    return {name: found[name].clamp(0, RIGHT_ANGLE) for name in ANGLES if name in found}


def _axis(term: Term[Any], row: int) -> str | None:
    """Return the axis that a matrix row passes through unchanged; None for other rows."""
    entries = term.projection.matrix[row]
    taken = entries.nonzero()[0].tolist()
    if len(taken) != 1 or float(entries[taken[0]]) != 1:
        return None
    return term.projection.system.axes[taken[0]]


def _raw(term: Term[Any], name: str, place: Tensor) -> Tensor:
    """Return an axis coordinate of the texture square in radians."""
    system, warp = term.projection.system, term.projection.warp
    if warp is not None and name == "theta_h":
        return RIGHT_ANGLE * _unwarped((place + 1) / 2, warp.width)
    factor, offset = system.scales[system.axes.index(name)]
    return (place - offset) / factor


def _of_disc(term: Term[Any], names: list[str | None], places: tuple[Tensor, ...]) -> dict[str, Tensor]:
    first, second = names
    if first is None or second is None or (first[0], second[0]) != ("u", "v") or first[1:] != second[1:]:
        return {}
    letter = first[-1]
    radius = torch.hypot(*places).clamp_max(1)
    if term.projection.warp is not None and letter == "h":
        radius = _unwarped(radius, term.projection.warp.width)
    found = {_OF_DISC[letter]: 2 * torch.atan(radius)}
    return found | {"phi_h": torch.atan2(places[1], places[0])} if letter == "h" else found


def _unwarped(stretched: Tensor, width: float) -> Tensor:
    """Return ρ from its warped value asinh(ρ/width)/asinh(1/width)."""
    return width * torch.sinh(stretched * math.asinh(1 / width))
