"""An anisotropic goniometer: a brushed steel whose values are known everywhere, measured on rings."""

import torch

from homofact.brdf.analytic import Ward
from homofact.brdf.samples import Samples
from homofact.geometry.directions import from_spherical

STEEL = Ward((0.03, 0.03, 0.025), (0.55, 0.53, 0.48), 0.09, 0.22)
LIGHTS, TURNS = (5.0, 20.0, 35.0, 50.0, 65.0), (0.0, 30.0, 60.0, 90.0)


def steel_rings(
    lights: tuple[float, ...] = LIGHTS, turns: tuple[float, ...] = TURNS, steps: tuple[float, float] = (5, 10)
) -> Samples:
    """Lights at θi and φi, views up to θo = 80° in steps of θo and of φo, all in degrees; no noise."""
    grid = torch.meshgrid(
        *(torch.tensor(each, dtype=torch.float64) for each in (lights, turns)),
        torch.arange(0, 80.5, steps[0], dtype=torch.float64), torch.arange(0, 360, steps[1], dtype=torch.float64),
        indexing="ij",
    )  # fmt: skip
    theta_i, phi_i, theta_o, phi_o = (torch.deg2rad(each.reshape(-1)) for each in grid)
    wi, wo = from_spherical(theta_i, phi_i), from_spherical(theta_o, phi_o)
    return Samples(wi, wo, STEEL.evaluate(wi, wo).double(), isotropic=False)
