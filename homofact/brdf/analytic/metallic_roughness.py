"""glTF 2.0's metallic-roughness material, as appendix B of the specification writes it, with three of its extensions.

With α = roughness², base colour c, metallic m, F(x) = x + (1 − x)(1 − V·H)⁵ and the specular lobe s below:

    metal       s F(c)
    dielectric  c/π (1 − F(.04)) + s F(.04)
    material    (1 − m) dielectric + m metal
    s = D V,    D = α²/(π ((N·H)²(α² − 1) + 1)²),    V = V1(N·L) V1(N·V),    V1(x) = 1/(x + √(α² + (1 − α²) x²))

KHR_materials_specular changes the Fresnel term of the dielectric alone: with its factor σ and its colour k, F(.04) is
F0 + (σ − F0)(1 − V·H)⁵ with F0 = σ min(.04 k, 1), one number per channel. With F0 = σ the lobe is equally bright at
every angle, which suits most rough metals better. The diffuse part of each channel is scaled by 1 − F of that channel,
as in three.js and Khronos's sample viewer. The text of the extension uses 1 − the largest F for all channels, which
gives another result if k is coloured.

KHR_materials_clearcoat adds a layer with its own roughness on top of the material: κ s' + (1 − κ) material, κ =
clearcoat · F(.04).

KHR_materials_anisotropy makes the lobe longer along the tangent t, which the parameter `rotation` turns: αt = α + (1 −
α) strength² and αb = α. Then D = 1/(π αt αb ((t·H/αt)² + (b·H/αb)² + (N·H)²)²), and V is the height-correlated term of
the extension.
"""

import math
from dataclasses import dataclass

import torch
from torch import Tensor

from homofact.brdf.analytic.common import AnalyticModel, Colour, grazing, half_vector, schlick
from homofact.errors import BadInput

DIELECTRIC = 0.04
# Renderers keep α above 0: below, a lamp's mirror image is a point that no pixel meets.
_LEAST_ALPHA = 1e-4


@dataclass(frozen=True)
class MetallicRoughness(AnalyticModel):
    """The model of the module docstring in sr⁻¹; parameters in [0, 1], but `rotation` in radians, counterclockwise.

    `specular_colour` may exceed 1, as the extension allows; None means 1 in every channel.
    """

    base_colour: Colour
    metallic: float
    roughness: float
    clearcoat: float = 0.0
    clearcoat_roughness: float = 0.0
    anisotropy: float = 0.0
    rotation: float = 0.0
    specular: float = 1.0
    specular_colour: Colour | None = None

    def __post_init__(self) -> None:
        """Refuse a colour that does not fit the channels, and numbers outside [0, 1]."""
        self.check_colour("base_colour")
        if self.specular_colour is not None:
            self.check_colour("specular_colour")
        single = ("metallic", "roughness", "clearcoat", "clearcoat_roughness", "anisotropy", "specular")
        numbers = {name: getattr(self, name) for name in single} | {"base_colour": max(self.base_colour)}
        for name, value in numbers.items():
            if not 0 <= value <= 1:
                raise BadInput(f"{name} is {value}", where="MetallicRoughness", expected="0 to 1")

    @property
    def isotropic(self) -> bool:
        """Whether there is no anisotropy."""
        return self.anisotropy == 0

    @property
    def extended_specular(self) -> bool:
        """Whether the Fresnel term of the dielectric differs from F(.04)."""
        return self.specular != 1 or self.specular_colour is not None

    @property
    def normal_reflectance(self) -> Colour:
        """F0 of the dielectric in every channel."""
        colour = self.specular_colour or (1.0,) * len(self.channels)
        return tuple(self.specular * min(DIELECTRIC * each, 1.0) for each in colour)

    def formula(self, wi: Tensor, wo: Tensor) -> Tensor:
        """Return the material under its coat."""
        numbers = [self.metallic, self.roughness, self.clearcoat, self.clearcoat_roughness]
        more = [self.anisotropy, self.rotation] if self.anisotropy else None
        along = None if more is None else self.colour(tuple(more), wi)
        fresnel = (self.normal_reflectance, self.specular) if self.extended_specular else None
        given = None if fresnel is None else self.colour((*fresnel[0], fresnel[1]), wi)
        colour = self.colour(self.base_colour, wi)
        own, more_of_it = base_parts(len(colour), self.colour(tuple(numbers), wi), along, given, wi, wo)
        return own + more_of_it * colour


def base_parts(
    channels: int, numbers: Tensor, along: Tensor | None, fresnel: Tensor | None, wi: Tensor, wo: Tensor
) -> tuple[Tensor, Tensor]:
    """Return (a, b), each (N, C) in sr⁻¹, such that the material is a + b · base colour at every pair.

    `numbers` are metallic, roughness, clearcoat and clearcoat roughness. `along` contains the strength and rotation of
    the anisotropy, or is None. `fresnel` contains F0 of every channel and then σ (see the module docstring), or is
    None.
    """
    metallic, roughness, coat, coat_roughness = numbers
    h, towards = half_vector(wi, wo)
    lobe = _lobe(roughness, h, wi, wo) if along is None else _long_lobe(roughness, along, h, wi, wo)
    lobe = lobe[:, None].expand(-1, channels)
    plain = schlick(torch.full_like(numbers[:1], DIELECTRIC), towards)
    grazed = schlick(torch.zeros_like(numbers[:1]), towards)
    own = plain if fresnel is None else fresnel[:-1] + (fresnel[-1] - fresnel[:-1]) * grazed
    constant = (1 - metallic) * own * lobe + metallic * grazed * lobe
    slope = (1 - metallic) / math.pi * (1 - own) + metallic * (1 - grazed) * lobe
    share = coat * plain
    over = share * _lobe(coat_roughness, h, wi, wo)[:, None]
    return over + (1 - share) * constant, (1 - share) * slope


def _lobe(roughness: Tensor, h: Tensor, wi: Tensor, wo: Tensor) -> Tensor:
    squared = (roughness**2).clamp_min(_LEAST_ALPHA) ** 2
    spread = h[:, 2] ** 2 * (squared - 1) + 1
    visible = torch.ones_like(h[:, 2])
    for cosine in (grazing(wi[:, 2]), grazing(wo[:, 2])):
        visible = visible / (cosine + (squared + (1 - squared) * cosine**2).sqrt())
    return squared / (math.pi * spread**2) * visible


def _long_lobe(roughness: Tensor, along: Tensor, h: Tensor, wi: Tensor, wo: Tensor) -> Tensor:
    alpha = (roughness**2).clamp_min(_LEAST_ALPHA)
    stretched = torch.stack((alpha + (1 - alpha) * along[0] ** 2, alpha))
    cos, sin = torch.cos(along[1]), torch.sin(along[1])

    def turned(w: Tensor) -> Tensor:
        return torch.stack((w[:, 0] * cos + w[:, 1] * sin, w[:, 1] * cos - w[:, 0] * sin), 1)

    spread = ((turned(h) / stretched) ** 2).sum(1) + h[:, 2] ** 2
    ni, no = grazing(wi[:, 2]), grazing(wo[:, 2])
    lengths = [(((turned(w) * stretched) ** 2).sum(1) + w[:, 2] ** 2).sqrt() for w in (wi, wo)]
    visible = 0.5 / (ni * lengths[1] + no * lengths[0])
    return visible / (math.pi * stretched[0] * stretched[1] * spread**2)
