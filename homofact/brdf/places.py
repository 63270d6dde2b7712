"""Coordinates of direction pairs in which pairs with similar reflectance are neighbours.

Highlights follow the half vector h, not the two directions, so the coordinates are based on h. Angles are in units of
90°, and the square root of θh spreads the peak:

* isotropic pairs have the coordinates (√θh, θd, w φd √θh sinθd), with φd folded to [0, 1]. φd is undefined at θh = 0
  and at θd = 0, so the factors remove it there;
* anisotropic pairs have √θh (cos φh, sin φh), θd/2 and θd/10 (cos 2ψ, sin 2ψ), where ψ is the azimuth of ωi − ωo, on
  which f depends little. 2ψ is the same for swapped directions.
"""

import math

import torch
from torch import Tensor

from homofact.geometry.coordinates import coordinate_system, rusinkiewicz_angles
from homofact.geometry.directions import to_spherical

# The weight of φd by which isotropic samples are interpolated (scripts/accuracy/interpolated_samples.py).
READ_AZIMUTH = 0.5
_DIFFERENCE, _TURN = 0.5, 0.1  # weights of θd, and of its azimuth (scripts/accuracy/interpolated_samples.py)


def half_places(wi: Tensor, wo: Tensor, isotropic: bool, azimuth: float = 1.0) -> Tensor:
    """Return the coordinates of pairs (N, 3): (N, 3) for an isotropic material, (N, 5) for an anisotropic one.

    `azimuth` is the weight w of φd for isotropic pairs. Error bars are calibrated with w = 1.

    Examples
    --------
    >>> one, two = torch.tensor([[0.6, 0.0, 0.8]]), torch.tensor([[0.0, 0.6, 0.8]])
    >>> half_places(one, two, False).allclose(half_places(two, one, False))
    True
    """
    if isotropic:
        unit = (coordinate_system("isotropic-half-diff").evaluate(wi, wo) + 1) / 2
        root, wide = unit[:, 0].clamp(0, 1).sqrt(), unit[:, 1]
        return torch.stack((root, wide, azimuth * unit[:, 2] * root * torch.sin(wide * (math.pi / 2))), 1)
    theta_h, theta_d, _ = rusinkiewicz_angles(wi, wo)
    _, phi_h = to_spherical(wi + wo)
    apart = wi - wo
    turn = 2 * torch.atan2(apart[:, 1], apart[:, 0])
    root, wide = (theta_h / (math.pi / 2)).sqrt(), theta_d / (math.pi / 2)
    across, along = _TURN * wide * torch.cos(turn), _TURN * wide * torch.sin(turn)
    return torch.stack((root * torch.cos(phi_h), root * torch.sin(phi_h), _DIFFERENCE * wide, across, along), 1)
