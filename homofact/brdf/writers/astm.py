"""Samples as ASTM E1392 text: the mirror of `homofact.brdf.readers.astm`, angles in radians with all digits.

Isotropic samples are turned until the light stands at φi = 0, which is what makes them isotropic again when
they are read; directions come back to rounding, values bit for bit. Weights are not kept.
"""

import os

import torch

from homofact.brdf.readers.astm import ANGLES
from homofact.brdf.readers.files import write_bytes
from homofact.brdf.samples import Samples
from homofact.errors import BadInput
from homofact.geometry.directions import to_spherical


def write(path: str | os.PathLike[str], samples: Samples, name: str = "sample") -> None:
    """Write samples under the SAMPLE_NAME `name`. Raises BadInput for channel names that the format cannot hold."""
    for channel in samples.channels:
        if channel in ANGLES or " ".join(channel.split()) != channel or not channel or "," in channel:
            raise BadInput(f"ASTM file: channel {channel!r}, expected a name without commas that is no angle")
    theta_i, phi_i = to_spherical(samples.wi)
    theta_s, phi_s = to_spherical(samples.wo)
    if samples.isotropic:
        phi_i, phi_s = torch.zeros_like(phi_i), torch.remainder(phi_s - phi_i, 2 * torch.pi)
    columns = torch.cat((torch.stack((theta_i, phi_i, theta_s, phi_s), 1), samples.values), 1)
    head = [
        f'SAMPLE_NAME "{" ".join(name.split())}"',
        "MEAS_NAME BRDF",
        f"NUM_POINTS {len(samples)}",
        f"VARS {','.join((*ANGLES, *samples.channels))}",
    ]
    rows = [",".join(map(repr, row)) for row in columns.tolist()]
    write_bytes(path, ("\n".join([*head, "", *rows]) + "\n").encode())
