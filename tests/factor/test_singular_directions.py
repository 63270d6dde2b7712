"""Where an angle is undefined nothing may hang on it: normal incidence, the mirror direction, retro-reflection."""

import math

import pytest
import torch
from torch import Tensor

from homofact.brdf.analytic.ward import Ward
from homofact.brdf.sampling import sample_model
from homofact.factor.fixed_projections import FIXED_AXES
from homofact.geometry.coordinates import coordinate_system
from homofact.methods.kinds import ISOTROPIC_CANDIDATES, coordinates_of, is_searched
from homofact.methods.search import Search

RADIUS = 1e-4


def towards(theta: float, phi: float) -> Tensor:
    return torch.tensor(
        [math.sin(theta) * math.cos(phi), math.sin(theta) * math.sin(phi), math.cos(theta)], dtype=torch.float64
    )


# ωi, and the ωo about which everything is looked at.
PLACES = {
    "the viewer along the normal": (towards(0.7, 0.3), towards(0.0, 0.0)),
    "the light along the normal": (towards(0.0, 0.0), towards(0.5, 1.0)),
    "the mirror direction": (towards(0.7, 0.3), towards(0.7, 0.3 + math.pi)),
    "retro-reflection": (towards(0.7, 0.3), towards(0.7, 0.3)),
    "both along the normal": (towards(0.0, 0.0), towards(0.0, 0.0)),
}


def around(centre: Tensor, radius: Tensor | float, phi: Tensor) -> Tensor:
    """Directions (…, 3) on circles of `radius` radians about `centre`, kept above the horizon's neighbourhood."""
    first = torch.linalg.cross(centre, towards(1.3, 2.0))
    first = first / first.norm()
    second = torch.linalg.cross(centre, first)
    reach = torch.as_tensor(radius, dtype=torch.float64)
    aside = phi.cos()[..., None] * first + phi.sin()[..., None] * second
    return reach.cos()[..., None] * centre + reach.sin()[..., None] * aside


@pytest.mark.parametrize("kind", ISOTROPIC_CANDIDATES)
@pytest.mark.parametrize("place", PLACES)
def test_no_coordinate_of_a_default_kind_jumps_there(kind: str, place: str) -> None:
    """On a circle of 1e-4 radians a coordinate that is a function on the sphere moves by about as much."""
    system = coordinate_system(coordinates_of(kind))
    axes = system.axes if is_searched(kind) else FIXED_AXES[kind][1]
    wi, centre = PLACES[place]
    wo = around(centre, RADIUS, torch.linspace(0, 2 * math.pi, 64, dtype=torch.float64))
    x = system.evaluate(wi.expand_as(wo), wo)[:, [system.axes.index(axis) for axis in axes]]
    moved = (x.max(0).values - x.min(0).values).abs()
    assert float(moved.max()) < 10 * RADIUS


def test_azimuths_do_jump_there_which_is_why_they_are_not_among_them() -> None:
    wi, normal = PLACES["the viewer along the normal"]
    wo = around(normal, RADIUS, torch.linspace(0, 2 * math.pi, 64, dtype=torch.float64))
    x = coordinate_system("isotropic-in-out").evaluate(wi.expand_as(wo), wo)[:, 2]
    assert float(x.max() - x.min()) > 1.5


@pytest.fixture(scope="module")
def gloss() -> tuple[Ward, object]:
    model = Ward((0.1,), (0.3,), alpha_x=0.15, alpha_y=0.15, channels=("Y",))
    samples = sample_model(model, 6000, "lobe", seed=1)
    return model, Search(textures=2, size=12, effort=60.0).fit(samples).factorization


@pytest.mark.parametrize("place", PLACES)
def test_second_differences_of_a_fit_are_those_of_its_source_and_of_its_texels(place: str, gloss) -> None:
    """Across each of these directions log f cosθo bends about as in the source: no star, needle or pinpoint.

    Over steps of a degree; what bilinear texels may bend by is the source's own bend over a texel's distance.
    """
    model, fit = gloss
    wi, centre = PLACES[place]
    step, count = math.radians(1), 4
    radii = torch.arange(-count, count + 1, dtype=torch.float64) * step
    phi = torch.arange(24, dtype=torch.float64)[:, None] * (math.pi / 24)
    wo = around(centre, radii.expand(24, -1), phi.expand(-1, len(radii)))

    def bend(reflectance) -> Tensor:
        flat = wo.reshape(-1, 3)
        values = reflectance.evaluate(wi.expand_as(flat), flat)[:, 0] * flat[:, 2]
        logs = values.clamp_min(1e-6).log().reshape(24, -1)
        return (logs[:, 2:] - 2 * logs[:, 1:-1] + logs[:, :-2]).abs()

    source, found = bend(model), bend(fit)
    assert float(found.max()) < 3 * float(source.max()) + 0.06
    logs = fit.evaluate(wi.expand(24, 3), around(centre, RADIUS, phi[:, 0]))[:, 0].log()
    assert float(logs.max() - logs.min()) < 0.01
