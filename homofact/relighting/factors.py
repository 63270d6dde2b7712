"""Light maps and view maps of a material: f(ωi, ωo) ≈ Σ_k g_k(ωi) h_k(ωo), read bilinearly off parabolic maps.

`factoring` finds them. A texel beyond the rim of the disc corresponds to no direction. It has the value that bilinear
interpolation at the rim, the horizon, needs. Texels are not point samples: linear interpolation between samples cuts
every peak of a term, and this loss adds up over all terms. `fitted_texels` compensates for it.
"""

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import torch
from torch import Tensor

from homofact.brdf.reflectance import Reflectance
from homofact.brdf.tinted import Tinted
from homofact.geometry.parabolic import to_disc


@dataclass(frozen=True)
class InOutFactors:
    """Light maps `light` (K, M, M) and view maps `view` (K, M, M, C), float32, f in sr⁻¹ without the cosine.

    The last `bounced` terms are not of f but of light between surfaces (`interreflection`). `energy` is the expected
    Σ_c B² cosθo dωo of the reflected radiance B, under natural light or under the light given to `factor`. `strength`
    (K,) is each term's part of it, and `beside` the part of a separate lobe, which may be negative. If there are
    `tinted` terms, the tint of a texture multiplies the first `tinted` terms and the first half of the `bounced` ones.
    Texel (i, j) lies at (2(i + ½)/M − 1, 2(j + ½)/M − 1) of the parabolic disc (u, v). If `cosine` is true, the light
    maps include cosθi, as they do for mapped normals (`tilted_view`). A `Reflectance`.
    """

    light: np.ndarray
    view: np.ndarray
    strength: np.ndarray
    energy: float
    channels: tuple[str, ...]
    beside: float = 0.0
    bounced: int = 0
    tinted: int = 0
    cosine: bool = False

    @property
    def terms(self) -> int:
        """Return K, including the terms of interreflection."""
        return len(self.light)

    @property
    def direct(self) -> int:
        """Return the number of terms of f."""
        return self.terms - self.bounced

    @property
    def tinted_terms(self) -> np.ndarray:
        """Return which terms (K,) the tint of a texture multiplies."""
        place = np.arange(self.terms)
        between = (place >= self.direct) & (place < self.direct + self.bounced // 2)
        return (place < self.tinted) | ((self.tinted > 0) & between)

    @property
    def in_parts(self) -> Reflectance:
        """Return the maps as a reflectance, in two parts if the material has a texture."""
        if not self.tinted:
            return self
        return Tinted(*(self.chosen(np.flatnonzero(own)) for own in (self.tinted_terms, ~self.tinted_terms)))

    @property
    def share(self) -> float:
        """Return the share of the energy that the terms and a separate lobe cover."""
        return float((self.strength.sum() + self.beside) / self.energy)

    @property
    def expected_error(self) -> float:
        """Return √(1 − share), the relative RMS error of the reflected light over all rotations of the light."""
        return math.sqrt(max(0.0, 1 - self.share))

    @property
    def nbytes(self) -> int:
        """All maps as float32."""
        return self.light.nbytes + self.view.nbytes

    @property
    def fetches(self) -> int:
        """Return two fetches per term: its light map and its view map."""
        return 2 * self.terms

    @cached_property
    def packed_view(self) -> np.ndarray:
        """The view maps with a texel's numbers side by side: (M, M, K, C) float32."""
        return np.ascontiguousarray(self.view.transpose(1, 2, 0, 3))

    @cached_property
    def weights(self) -> np.ndarray:
        """Return the RMS (K,) float32 of each term's view map, the weight of an error in its transport.

        For mapped normals it is 1, since the functions of the tilt are orthonormal.
        """
        found = np.sqrt((self.view.astype(np.float64) ** 2).mean((1, 2, 3))).astype(np.float32)
        if self.cosine:
            found[: self.direct] = 1
        return found

    def first(self, terms: int) -> "InOutFactors":
        """The strongest `terms` alone."""
        return replace(self, light=self.light[:terms], view=self.view[:terms], strength=self.strength[:terms])

    def chosen(self, places: np.ndarray) -> "InOutFactors":
        """Return only these terms, as untinted terms of f."""
        own = {name: getattr(self, name)[places] for name in ("light", "view", "strength")}
        return replace(self, **own, bounced=0, tinted=0)

    def with_plain(self, plain: "InOutFactors") -> "InOutFactors":
        """Return these terms, tinted, followed by the untinted terms of `plain`; the energy is unchanged."""
        return InOutFactors(
            np.concatenate((self.light, plain.light)),
            np.concatenate((_widened(self.view), _widened(plain.view))),
            np.concatenate((self.strength, plain.strength)),
            self.energy,
            self.channels if len(self.channels) == 3 else ("R", "G", "B"),
            self.beside,
            tinted=self.terms,
        )

    def evaluate(self, wi: Tensor, wo: Tensor) -> Tensor:
        """Values (N, C) of the maps in sr⁻¹, negative ones included; 0 under the horizon."""
        above = (wi[:, 2] > 0) & (wo[:, 2] > 0)
        g = look_up(torch.from_numpy(self.light).permute(1, 2, 0).double(), wi.double())
        g = g / wi[:, 2:].double().clamp_min(1e-6) if self.cosine else g
        h = look_up(torch.from_numpy(self.packed_view).flatten(2).double(), wo.double())
        values = torch.einsum("nk,nkc->nc", g, h.reshape(len(h), self.terms, -1))
        return torch.where(above[:, None], values, 0.0).to(wi)


def _widened(view: np.ndarray) -> np.ndarray:
    return np.broadcast_to(view, (*view.shape[:3], 3))


def texel_points(size: int) -> Tensor:
    """(u, v) of a map's texel centres (M, M, 2), float64."""
    along = 2 * (torch.arange(size, dtype=torch.float64) + 0.5) / size - 1
    return torch.stack(torch.meshgrid(along, along, indexing="ij"), -1)


def fitted_texels(samples: Tensor) -> Tensor:
    """Return texels (K, M, M, ...) whose bilinear interpolation fits samples of smooth functions best.

    Along one axis, linear interpolation with step h deviates from f by h²/12 f″ on average. Subtracting this mean
    reduces the RMS error to 1/√6. The texels are therefore the samples minus a twelfth of their second differences,
    along both axes.
    """
    found = samples.clone()
    for axis in (1, 2):
        size = samples.shape[axis]
        place = torch.arange(size)
        before, after = (samples.index_select(axis, (place + by).clamp(0, size - 1)) for by in (-1, 1))
        found -= (before + after - 2 * samples) / 12
    return found


def look_up(maps: Tensor, w: Tensor) -> Tensor:
    """Bilinear values (N, P) of maps (M, M, P) at directions (N, 3)."""
    size = len(maps)
    at = ((to_disc(torch.cat((w[:, :2], w[:, 2:].clamp_min(0)), 1)) + 1) / 2 * size - 0.5).clamp(0, size - 1)
    low = at.long().clamp_max(size - 2)
    (i, j), (a, b) = low.unbind(1), (at - low)[..., None].unbind(1)
    near = maps[i, j] * (1 - b) + maps[i, j + 1] * b
    far = maps[i + 1, j] * (1 - b) + maps[i + 1, j + 1] * b
    return near * (1 - a) + far * a


def view_values(factors: InOutFactors, wo: np.ndarray) -> np.ndarray:
    """h_k (S, K, 3) of the view maps at directions (S, 3)."""
    maps = torch.from_numpy(factors.packed_view).flatten(2).double()
    found = look_up(maps, torch.from_numpy(wo)).reshape(len(wo), factors.terms, -1)
    return found.expand(-1, -1, 3).numpy()
