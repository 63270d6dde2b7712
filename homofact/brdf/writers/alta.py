"""Samples as ALTA text: the mirror of `homofact.brdf.readers.alta`.

f in sr⁻¹ (INV_STERADIAN), every number with all its digits. Isotropic samples are written as
ISOTROPIC_TV_TL_DPHI, others as SPHERICAL_TL_PL_TV_PV: angles, so that directions come back to rounding; with
CARTESIAN they come back bit for bit, but the file no longer says that the material is isotropic. Weights are
not kept.
"""

import math
import os

import torch
from torch import Tensor

from homofact.brdf.readers.files import write_bytes
from homofact.brdf.samples import Samples
from homofact.errors import BadInput
from homofact.geometry.directions import to_spherical

PARAMETERIZATIONS = ("ISOTROPIC_TV_TL_DPHI", "SPHERICAL_TL_PL_TV_PV", "CARTESIAN")


def write(
    path: str | os.PathLike[str],
    samples: Samples,
    parameterization: str | None = None,
    comments: tuple[str, ...] = (),
) -> None:
    """Write samples; without a `parameterization` the one that fits them, see the module's head.

    Raises BadInput for an unknown parameterization, an isotropic one for anisotropic samples, channel names
    with blanks, and where the place cannot be written.
    """
    name = parameterization or PARAMETERIZATIONS[0 if samples.isotropic else 1]
    if name not in PARAMETERIZATIONS:
        raise BadInput(f"ALTA parameterization: found {name!r}, expected one of {', '.join(PARAMETERIZATIONS)}")
    if name == PARAMETERIZATIONS[0] and not samples.isotropic:
        raise BadInput(f"ALTA parameterization: {name} for anisotropic samples, expected {PARAMETERIZATIONS[1]}")
    if any(channel.split() != [channel] for channel in samples.channels):
        raise BadInput(f"ALTA file: channels {', '.join(samples.channels)}, expected names without blanks")
    columns = torch.cat((_inputs(samples, name), samples.values), 1)
    head = [f"#SOURCE {' '.join(line.split())}" for line in comments]
    head += [
        f"#DIM {columns.shape[1] - len(samples.channels)} {len(samples.channels)}",
        "#VS 0",
        f"#PARAM_IN {name}",
        "#PARAM_OUT INV_STERADIAN",
        f"#CHANNELS {' '.join(samples.channels)}",
    ]
    rows = [" ".join(map(repr, row)) for row in columns.tolist()]
    write_bytes(path, ("\n".join([*head, *rows]) + "\n").encode())


def _inputs(samples: Samples, name: str) -> Tensor:
    if name == "CARTESIAN":
        return torch.cat((samples.wo, samples.wi), 1)
    theta_l, phi_l = to_spherical(samples.wi)
    theta_v, phi_v = to_spherical(samples.wo)
    if name == "SPHERICAL_TL_PL_TV_PV":
        return torch.stack((theta_l, phi_l, theta_v, phi_v), 1)
    turn = torch.remainder(phi_l - phi_v + math.pi, 2 * math.pi) - math.pi
    return torch.stack((theta_v, theta_l, turn), 1)
