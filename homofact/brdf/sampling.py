"""Sample a model: draw pairs of directions by a named scheme and evaluate the model there.

The default, `lobe`, draws half of the pairs in the parabolic discs and half where lobes are (`brdf.pair_density`).
`discs` is the sampling of the thesis, uniform in the discs like the texels. `cosine` draws pairs with the density that
matters in a picture. `grid` is a fixed grid and needs no seed.
"""

from typing import Protocol

import torch

from homofact.brdf.pair_density import RIM, draw_lobe
from homofact.brdf.reflectance import Reflectance
from homofact.brdf.samples import Samples
from homofact.brdf.source_names import DEFAULT_COUNT, SCHEMES
from homofact.errors import BadInput
from homofact.geometry.directions import draw_cosine_weighted, draw_in_discs, grid_of_pairs

RADIUS_SQUARED = RIM


class Drawable(Reflectance, Protocol):
    """A reflectance that is defined everywhere and has a flag for isotropy: a model or a complete table."""

    @property
    def isotropic(self) -> bool:
        """Whether the value is unchanged when both directions are turned about the normal together."""
        ...


def sample_model(
    model: Drawable,
    count: int = DEFAULT_COUNT,
    scheme: str = "discs",
    seed: int = 0,
    radius_squared: float = RADIUS_SQUARED,
    noise_free: bool = True,
) -> Samples:
    """Return `count` samples of `model` with weights 1; provenance["sampling"] records `noise_free`.

    `radius_squared` limits the parabolic discs to u² + v² below it, only for the scheme `discs`. For `grid`, the count
    is the nearest to `count` that a square grid in the discs allows, and `seed` has no effect. Raises BadInput for an
    unknown scheme, a count below 1 or a radius outside (0, 1].
    """
    if scheme not in SCHEMES:
        raise BadInput(where="sampling scheme", found=repr(scheme), expected=f"one of {', '.join(SCHEMES)}")
    if count < 1:
        raise BadInput(where="sample count", found=count, expected="at least 1")
    if not 0 < radius_squared <= 1:
        raise BadInput(where="sampling radius squared", found=radius_squared, expected="above 0 and at most 1")
    generator = torch.Generator().manual_seed(seed)
    facts: dict[str, object] = {"scheme": scheme, "noise_free": noise_free}
    if scheme == "discs":
        wi, wo = draw_in_discs(count, generator, radius_squared)
        facts |= {"seed": seed, "radius_squared": radius_squared}
    elif scheme == "lobe":
        wi, wo = draw_lobe(count, generator)
        facts |= {"seed": seed}
    elif scheme == "cosine":
        wi, wo = draw_cosine_weighted(count, generator)
        facts |= {"seed": seed}
    else:
        side = grid_side(count)
        wi, wo = grid_of_pairs(side)
        facts |= {"side": side}
    # Rounding can leave a rim direction a hair under the horizon.
    wi[:, 2].clamp_min_(0)
    wo[:, 2].clamp_min_(0)
    values = model.evaluate(wi, wo)
    provenance = {"sampling": facts}
    return Samples(
        wi, wo, values, channels=model.channels, isotropic=model.isotropic, provenance=provenance, all_azimuths=True
    )


def grid_side(count: int) -> int:
    """Return the side of the square grid whose number of pairs, cells in the disc squared, is nearest to `count`."""
    side, best, gap = 2, 2, float("inf")
    while True:
        centre = (torch.arange(side, dtype=torch.float64) + 0.5) * (2 / side) - 1
        cells = int(((centre[:, None] ** 2 + centre**2) < 1).sum())
        if abs(cells**2 - count) < gap:
            best, gap = side, abs(cells**2 - count)
        if cells**2 > 2 * count:
            return best
        side += 1
