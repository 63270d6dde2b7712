"""Where the samples of a measurement lie: the spread of their angles, and the holes between them.

Holes are the empty cells of a coarse grid of θi × θo × |Δφ| with six steps each, of 15°, 15° and 30°. Every fit
extrapolates in an empty cell. Swapped samples do not fill a cell. The grid has no absolute azimuth, so it does not
detect azimuths that are missing in the samples of an anisotropic material.
"""

import math
from typing import Any

import torch
from torch import Tensor

from homofact.brdf.samples import Samples
from homofact.geometry.coordinates import coordinate_system, rusinkiewicz_angles
from homofact.geometry.directions import to_spherical

STEPS = 6
_ROUNDING = 1e-7  # of the grid


def holes(samples: Samples) -> dict[str, Any]:
    """Return the share and number of empty cells of the grid, and the number of all cells (JSON-able)."""
    place = (coordinate_system("isotropic-in-out").evaluate(samples.wi, samples.wo) + 1) / 2
    # An angle on the border of two cells, such as 15°, belongs to the upper one, whatever its rounding.
    cells = occupied_cells(place + _ROUNDING, (STEPS, STEPS, STEPS))
    total = STEPS**3
    empty = total - int(torch.unique(cells).numel())
    return {"share": round(empty / total, 4), "empty": empty, "cells": total}


def occupied_cells(place: Tensor, steps: tuple[int, ...]) -> Tensor:
    """Return the grid cell (N,) int64 of each point (N, k) in [0, 1]^k; points outside get the nearest cell."""
    index = torch.zeros(place.shape[0], dtype=torch.int64, device=place.device)
    for axis, count in enumerate(steps):
        index = index * count + (place[:, axis] * count).long().clamp(0, count - 1)
    return index


def spread(samples: Samples) -> dict[str, Any]:
    """Return [5%, median, 95%] of θi, θo, θh and θd in degrees, and the number of light directions.

    `lights` counts the ωi that differ by more than 0.01° (JSON-able).
    """
    theta_h, theta_d, _ = rusinkiewicz_angles(samples.wi, samples.wo)
    angles = {
        "theta_i": to_spherical(samples.wi)[0],
        "theta_o": to_spherical(samples.wo)[0],
        "theta_h": theta_h,
        "theta_d": theta_d,
    }
    figures: dict[str, Any] = {name: _quantiles(angle * (180 / math.pi)) for name, angle in angles.items()}
    theta, phi = to_spherical(samples.wi)
    # At the normal every azimuth is the same light.
    pair = torch.stack((theta, torch.where(theta < 1e-6, 0.0, phi)), 1) * (180 / math.pi)
    hundredths = (pair * 100).round()
    # One number for both: sorted ten times as fast as rows.
    figures["lights"] = int(torch.unique(hundredths[:, 0] * 100_000 + hundredths[:, 1]).numel())
    return figures


def _quantiles(degrees: Tensor) -> list[float]:
    # Sorted by hand: torch.quantile refuses more than 16 million values.
    ordered = degrees.sort().values
    last = len(ordered) - 1
    return [round(float(ordered[round(part * last)]), 2) for part in (0.05, 0.5, 0.95)]
