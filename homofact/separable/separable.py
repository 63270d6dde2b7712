"""The result of a separable fit: f(a, b) ≈ Σk sk gk(a) hk(b), cut at zero, on two direction maps.

(a, b) are (ωi, ωo) or (h, d). In a reciprocal in-out fit gk = hk, so f(ωi, ωo) = f(ωo, ωi) to the last bit, and a
term stores one texture. The factors of an SVD have both signs and their truncated sum may fall below zero; it is
cut there when it is evaluated (Wang, Tran and Luebke 2004 leave such values in and see false colours, 4.1), and
`clipped` says how often that happens. Channels are factored each by itself, as there (3.2).

All that an evaluation needs is in one .npz file of plain arrays and a JSON header.
"""

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import torch
from torch import Tensor

from homofact.brdf.log_transform import LogTransform
from homofact.brdf.reflectance import answering_in_kind
from homofact.factor.evaluation import Evaluation
from homofact.factor.fitted import Grid, Texture, bits
from homofact.files.archive import write_archive
from homofact.files.words import listed
from homofact.geometry.axes import map_axes
from homofact.geometry.coordinates import axes_of
from homofact.geometry.directions import above_horizon
from homofact.linear.bilinear import lookup
from homofact.separable.maps import direction_map
from homofact.separable.stored import FORMAT, FORMAT_VERSION, LETTERS, StoredPair, StoredSum, evaluation_of_sum

# What people call the letters of the sides' axes.
_LETTERS = {"i": "ωi", "o": "ωo", "h": "h", "d": "d"}


@dataclass(frozen=True)
class SeparableTerm:
    """One product: `first` gk and `second` hk (rows, columns, C), `second` None where it is `first`.

    `signs` (C,) are ±1. g·h is in sr⁻¹ without the cosine; the channels' terms are in order of size, each by itself.
    `grids`, one a stored texture, are there where its texels are rounded to whole numbers.
    """

    first: Tensor
    second: Tensor | None
    signs: Tensor
    grids: tuple[Grid, ...] = ()

    @property
    def textures(self) -> tuple[Tensor, ...]:
        """The one or two textures that are stored."""
        return (self.first,) if self.second is None else (self.first, self.second)


@dataclass(frozen=True)
class Separable:
    """A fitted sum of products; a `Reflectance` and a `Fitted`.

    `map` names the direction map of both sides, `parameterization` says what they are indexed by, `read`
    (rows, columns) is True where some direction reads the texel.
    """

    terms: tuple[SeparableTerm, ...]
    map: str
    parameterization: str
    read: Tensor
    transform: LogTransform
    channels: tuple[str, ...]
    provenance: dict[str, Any] = field(default_factory=dict)

    def __repr__(self) -> str:
        """In a line, without the texels."""
        return f"<Separable: terms {len(self.terms)}, bytes {self.nbytes}, {listed(self.channels)}>"

    @property
    def nbytes(self) -> int:
        """Bytes of all texels as float32; the signs, C bits a term, are not counted."""
        return sum(texture.numel() * 4 for term in self.terms for texture in term.textures)

    @property
    def fetches(self) -> int:
        """Texture lookups of one evaluation: two a term, a shared texture being read at both directions."""
        return 2 * len(self.terms)

    def evaluate_signed(self, wi: Tensor, wo: Tensor) -> Tensor:
        """The sum of products (N, C) in sr⁻¹ before it is cut at zero."""
        scales = direction_map(self.map).scales
        a, b = (axes_of(axes, wi, wo, scales) for axes in self._axes)
        first, second = self._stacked
        count, channels = len(self.terms), len(self.channels)
        left = lookup(first, a.to(first)).reshape(-1, count, channels)
        right = lookup(first if second is None else second, b.to(first)).reshape(-1, count, channels)
        signs = torch.stack([term.signs for term in self.terms])
        return (left * right * signs).sum(1).to(wi)

    @answering_in_kind
    def evaluate(self, wi: Tensor, wo: Tensor) -> Tensor:
        """BRDF values (N, C) in sr⁻¹, ≥ 0, without the cosine; 0 where a direction is under the horizon."""
        above, wi, wo = above_horizon(wi, wo)
        return self.evaluate_signed(wi, wo).clamp_min(0) * above[:, None]

    def clipped(self, wi: Tensor, wo: Tensor) -> float:
        """The share of values at these pairs, over all channels, that are negative and evaluate to 0."""
        return float((self.evaluate_signed(wi, wo) < 0).double().mean())

    @property
    def _axes(self) -> tuple[tuple[str, str], ...]:
        """The axes of the first and of the second side."""
        return tuple(map_axes(self.map, letter) for letter in LETTERS[self.parameterization])

    @property
    def textures(self) -> tuple[Texture, ...]:
        """Of every term its first factor and, where it has one, its second."""
        sides = [_LETTERS[letter] for letter in LETTERS[self.parameterization]]
        found = []
        for k, term in enumerate(self.terms):
            whats = [" and ".join(sides)] if term.second is None else sides
            for j, (side, texels) in enumerate(zip(("first", "second"), term.textures, strict=False)):
                caption = f"term {k + 1}: {whats[j]}, {self.map}"
                grid = term.grids[j] if term.grids else None
                found.append(Texture(f"term_{k}_{side}", caption, "factor", texels, self.read, grid))
        return tuple(found)

    @property
    def evaluation(self) -> Evaluation:
        """max(0, Σ signs · first lookup · second lookup)."""
        rows, columns = self.read.shape
        terms = [(tuple(term.signs.tolist()), len(term.textures)) for term in self.terms]
        return evaluation_of_sum(self.map, self.parameterization, terms, (rows, columns))

    def with_textures(
        self,
        texels: Sequence[Tensor],
        grids: Sequence[Grid | None] | None = None,
        facts: Mapping[str, Any] | None = None,
    ) -> "Separable":
        """The same terms with other factors (rows, columns, C); as `Fitted.with_textures`."""
        left, grid = iter(texels), iter(grids or (None,) * len(texels))
        terms = []
        for term in self.terms:
            made = [next(left) for _ in term.textures]
            on = tuple(found for _ in term.textures if (found := next(grid)) is not None)
            terms.append(SeparableTerm(made[0], made[1] if len(made) == 2 else None, term.signs, on))
        return replace(self, terms=tuple(terms), provenance=self.provenance | dict(facts or {}))

    def describe(self) -> dict[str, Any]:
        """The map, what the sides are indexed by, which texels are read, and the terms' signs."""
        terms, texture = [], 0
        for term in self.terms:
            numbers = list(range(texture, texture + len(term.textures)))
            texture += len(numbers)
            terms.append({"textures": numbers, "signs": term.signs.tolist()})
        return {
            "kind": "sum of products",
            "map": self.map,
            "parameterization": self.parameterization,
            "read": bits(self.read),
            "terms": terms,
        }

    @cached_property
    def _stacked(self) -> tuple[Tensor, Tensor | None]:
        """All terms' textures as the channels of one, so that a direction is looked up once."""
        first = torch.cat([term.first for term in self.terms], 2)
        seconds = [term.second for term in self.terms if term.second is not None]
        return first, torch.cat(seconds, 2) if seconds else None

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the one file (.npz), beside first and then renamed. Raises BadInput for an unwritable place."""
        header = {
            "format": FORMAT,
            "format_version": FORMAT_VERSION,
            "map": self.map,
            "parameterization": self.parameterization,
            "epsilon": self.transform.epsilon,
            "channels": list(self.channels),
            "terms": len(self.terms),
            "provenance": self.provenance,
        }
        if self.terms and self.terms[0].grids:
            header["levels"] = self.terms[0].grids[0].levels
        arrays: dict[str, Any] = {
            "mean": self.transform.mean.cpu().numpy(),
            "read": self.read.cpu().numpy(),
        }
        for k, term in enumerate(self.terms):
            arrays[f"first_{k}"] = term.first.cpu().numpy()
            arrays[f"signs_{k}"] = term.signs.cpu().numpy()
            if term.grids:
                pairs = [torch.stack((grid.low, grid.step)) for grid in term.grids]
                arrays[f"grids_{k}"] = torch.stack(pairs).cpu().numpy()
            if term.second is not None:
                arrays[f"second_{k}"] = term.second.cpu().numpy()
        write_archive(path, header, arrays)

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> "Separable":
        """Read what `save` wrote. Raises BadInput for a file that is none, is damaged, or is from a newer version."""
        stored = StoredSum.load(path)
        transform = LogTransform(stored.transform.epsilon, torch.from_numpy(stored.transform.mean))
        terms = tuple(_restored(term, stored.levels) for term in stored.terms)
        read = torch.from_numpy(stored.read)
        return cls(terms, stored.map, stored.parameterization, read, transform, stored.channels, stored.provenance)


def _restored(stored: StoredPair, levels: int) -> SeparableTerm:
    second = None if stored.second is None else torch.from_numpy(stored.second)
    pairs = () if stored.grids is None else torch.from_numpy(stored.grids)
    grids = tuple(Grid(low, step, levels) for low, step in pairs)
    return SeparableTerm(torch.from_numpy(stored.first), second, torch.from_numpy(stored.signs), grids)
