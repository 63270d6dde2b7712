"""Any reflectance at the nodes of the UTIA database's files: the mirror of `homofact.brdf.readers.utia`."""

import os

import torch

from homofact.brdf.readers.files import write_bytes
from homofact.brdf.readers.utia import SHAPE, axes
from homofact.brdf.reflectance import Reflectance
from homofact.errors import BadInput
from homofact.geometry.directions import from_spherical


def write(path: str | os.PathLike[str], reflectance: Reflectance) -> None:
    """Write an RGB reflectance in float64. Raises BadInput for other channels and values not finite."""
    if len(reflectance.channels) != 3:
        raise BadInput(f"UTIA file: channels {', '.join(reflectance.channels)}, expected R, G and B")
    grid = torch.meshgrid(*(axis.nodes for axis in axes()), indexing="ij")
    theta_i, phi_i, theta_o, phi_o = (x.reshape(-1) for x in grid)
    values = reflectance.evaluate(from_spherical(theta_i, phi_i), from_spherical(theta_o, phi_o)).double()
    if not bool(torch.isfinite(values).all()):
        raise BadInput("UTIA file: a value is not finite, expected finite numbers")
    write_bytes(path, values.T.reshape(SHAPE).contiguous().cpu().numpy().astype("<f8").tobytes())
