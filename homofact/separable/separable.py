"""The result of a separable fit: f(a, b) ≈ Σk sk gk(a) hk(b), cut at zero, on two direction maps.

(a, b) are (ωi, ωo) or (h, d). In a reciprocal in-out fit gk = hk, so f(ωi, ωo) = f(ωo, ωi) exactly, and a term stores
one texture. The factors of an SVD have both signs, and the truncated sum of their products may be negative. Evaluation
clips it at zero (Wang, Tran and Luebke 2004 keep negative values and observe false colours, 4.1). `clipped` measures
the share of clipped values. Each channel is factored separately, as in their paper (3.2).

One .npz file of plain arrays with a JSON header contains everything that an evaluation needs.
"""

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from homofact.brdf.in_kind import answering_in_kind
from homofact.brdf.log_transform import LogTransform
from homofact.errors import BadInput
from homofact.factor.evaluation import Evaluation, Product, TextureLookup
from homofact.factor.factorization import MOST_LEVELS, MOST_TERMS, channels_and_transform
from homofact.factor.fitted import QuantizationGrid, Texture, bits
from homofact.files.archive import write_archive
from homofact.files.saved import SavedFit
from homofact.files.words import listed
from homofact.geometry.axes import map_axes
from homofact.geometry.coordinates import axes_of
from homofact.linear.arrays import Held, as_array, as_arrays
from homofact.linear.names import Shape
from homofact.separable.decomposition_names import MAP_NAMES, MAP_SCALES, SIDES

if TYPE_CHECKING:
    from torch import Tensor

FORMAT = "homofact separable factorization"
FORMAT_VERSION = 1
# Letters of the two sides' axes.
LETTERS = {"in-out": ("i", "o"), "half-diff": ("h", "d")}

# What people call the letters of the sides' axes.
_LETTERS = {"i": "ωi", "o": "ωo", "h": "h", "d": "d"}


@dataclass(frozen=True)
class SeparableTerm:
    """One product of the textures `first` gk and `second` hk (rows, columns, C); `second` is None if equal.

    `signs` (C,) are ±1. g·h is in sr⁻¹ without the cosine. Each channel's terms are sorted by size separately. `grids`,
    one per stored texture, are set if the texels are quantized. All arrays are NumPy arrays; tensors are converted.
    """

    first: Held
    second: Held | None
    signs: Held
    grids: tuple[QuantizationGrid, ...] = ()

    def __post_init__(self) -> None:
        """Keep arrays."""
        as_arrays(self, "first", "second", "signs")

    @property
    def textures(self) -> tuple[np.ndarray, ...]:
        """The one or two textures that are stored."""
        return (self.first,) if self.second is None else (self.first, self.second)


@dataclass(frozen=True)
class Separable:
    """A fitted sum of products; a `Reflectance` and a `Fitted`.

    `map` is the name of the direction map of both factors, and `parameterization` names the directions that index them.
    `read` (rows, columns) is True for texels that a direction reads.
    """

    terms: tuple[SeparableTerm, ...]
    map: str
    parameterization: str
    read: Held
    transform: LogTransform
    channels: tuple[str, ...]
    provenance: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Keep an array."""
        as_arrays(self, "read")

    def __repr__(self) -> str:
        """In a line, without the texels."""
        return f"<Separable: terms {len(self.terms)}, bytes {self.nbytes}, {listed(self.channels)}>"

    @property
    def nbytes(self) -> int:
        """Bytes of all texels as float32, without the signs (C bits per term)."""
        return sum(texture.size * 4 for term in self.terms for texture in term.textures)

    @property
    def fetches(self) -> int:
        """Texture lookups of one evaluation: two per term, since a shared texture is read at both directions."""
        return 2 * len(self.terms)

    def evaluate_signed(self, wi: "Tensor", wo: "Tensor") -> "Tensor":
        """Return the sum of products (N, C) in sr⁻¹ before clipping at zero."""
        import torch

        from homofact.linear.bilinear import lookup

        a, b = self.places(wi, wo)
        first, second = (None if own is None else torch.from_numpy(own).to(wi.device) for own in self._stacked)
        assert first is not None
        count, channels = len(self.terms), len(self.channels)
        left = lookup(first, a.to(first)).reshape(-1, count, channels)
        right = lookup(first if second is None else second, b.to(first)).reshape(-1, count, channels)
        signs = torch.from_numpy(np.stack([term.signs for term in self.terms])).to(first)
        return (left * right * signs).sum(1).to(wi)

    def places(self, wi: "Tensor", wo: "Tensor") -> "tuple[Tensor, Tensor]":
        """Return the lookup places in the first and the second textures, (N, 2) in [−1, 1]² each."""
        scales = MAP_SCALES[self.map]
        first, second = (axes_of(axes, wi, wo, scales) for axes in self._axes)
        return first, second

    @answering_in_kind
    def evaluate(self, wi: "Tensor", wo: "Tensor") -> "Tensor":
        """Return BRDF values (N, C) in sr⁻¹, ≥ 0, without the cosine; 0 where a direction is under the horizon."""
        from homofact.geometry.directions import above_horizon

        above, wi, wo = above_horizon(wi, wo)
        return self.evaluate_signed(wi, wo).clamp_min(0) * above[:, None]

    def clipped(self, wi: "Tensor", wo: "Tensor") -> float:
        """Return the share of values at these pairs, over all channels, that are negative and evaluate to 0."""
        return float((self.evaluate_signed(wi, wo) < 0).double().mean())

    @property
    def _axes(self) -> tuple[tuple[str, str], ...]:
        """The axes of the first and of the second side."""
        return tuple(map_axes(self.map, letter) for letter in LETTERS[self.parameterization])

    @property
    def textures(self) -> tuple[Texture, ...]:
        """Return the first factor of every term and, if it has one, the second."""
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
        """The evaluation max(0, Σ signs · first lookup · second lookup)."""
        rows, columns = self.read.shape
        terms = [(tuple(term.signs.tolist()), len(term.textures)) for term in self.terms]
        return evaluation_of_sum(self.map, self.parameterization, terms, (rows, columns))

    def with_textures(
        self,
        texels: Sequence[Any],
        grids: Sequence[QuantizationGrid | None] | None = None,
        facts: Mapping[str, Any] | None = None,
    ) -> "Separable":
        """Return the fit with other factors (rows, columns, C); see `Fitted.with_textures`."""
        left, grid = map(as_array, texels), iter(grids or (None,) * len(texels))
        terms = []
        for term in self.terms:
            made = [next(left) for _ in term.textures]
            on = tuple(found for _ in term.textures if (found := next(grid)) is not None)
            terms.append(SeparableTerm(made[0], made[1] if len(made) == 2 else None, term.signs, on))
        return replace(self, terms=tuple(terms), provenance=self.provenance | dict(facts or {}))

    def describe(self) -> dict[str, Any]:
        """Return the map, the directions that index the factors, the texels that are read, and the terms' signs."""
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
    def _stacked(self) -> tuple[np.ndarray, np.ndarray | None]:
        """All terms' textures as the channels of one, so that a direction is looked up once."""
        first = np.concatenate([term.first for term in self.terms], 2)
        seconds = [term.second for term in self.terms if term.second is not None]
        return first, np.concatenate(seconds, 2) if seconds else None

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write one .npz file under a temporary name, then rename it. Raises BadInput if it cannot be written."""
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
        arrays: dict[str, Any] = {"mean": self.transform.mean, "read": self.read}
        for k, term in enumerate(self.terms):
            arrays[f"first_{k}"] = term.first
            arrays[f"signs_{k}"] = term.signs
            if term.grids:
                arrays[f"grids_{k}"] = np.stack([np.stack((grid.low, grid.step)) for grid in term.grids])
            if term.second is not None:
                arrays[f"second_{k}"] = term.second
        write_archive(path, header, arrays)

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> "Separable":
        """Read a file that `save` wrote. Raises BadInput if it is no such file, is damaged, or has a newer version."""
        saved = SavedFit.read(path, FORMAT, FORMAT_VERSION)
        fields = saved.fields
        channels, transform = channels_and_transform(saved)
        read = saved.flags("read", (None, None))
        shared = "second_0" not in saved
        shape = (*read.shape, len(channels))
        count = fields.whole("terms", 1, MOST_TERMS)
        whole = any(f"grids_{k}" in saved for k in range(count))
        name, kind = fields.text("map", MAP_NAMES), fields.text("parameterization", SIDES)
        levels = fields.whole("levels", 1, MOST_LEVELS) if whole else 0
        terms = tuple(_stored_pair(saved, k, shape, shared, levels) for k in range(count))
        return cls(terms, name, kind, read, transform, channels, fields.inner("provenance").found)


def evaluation_of_sum(
    name: str, parameterization: str, terms: Sequence[tuple[tuple[float, ...], int]], shape: Shape
) -> Evaluation:
    """max(0, Σ signs · first lookup · second lookup) on the map `name`; `terms` are (signs, stored textures)."""
    rows, columns = shape
    lookups, products, texture = [], [], 0
    for signs, stored in terms:
        for j, letter in enumerate(LETTERS[parameterization]):
            what = letter if letter in "hd" else f"w{letter}"
            words = f"{what} on the {name} map, {columns} x {rows} texels"
            number = texture + (j if stored == 2 else 0)
            lookups.append(TextureLookup(number, map_axes(name, letter), MAP_SCALES[name], np.eye(2), None, words))
        texture += stored
        products.append(Product((len(lookups) - 2, len(lookups) - 1), signs))
    return Evaluation(tuple(lookups), tuple(products), None)


def _stored_pair(saved: SavedFit, k: int, shape: tuple[int, ...], shared: bool, levels: int) -> SeparableTerm:
    """Term number `k` of a saved sum. Raises BadInput for what no fit could have saved."""
    if shared and f"second_{k}" in saved:
        raise BadInput(f"holds second_{k} and no second_0", where=saved.path, expected="as many textures in every term")
    signs = saved.floats(f"signs_{k}", shape[2:])
    if not (np.abs(signs) == 1).all():
        raise BadInput(f"signs_{k} holds other numbers", where=saved.path, expected="1 or -1 a channel")
    factors = [saved.floats(f"{name}_{k}", shape) for name in (("first",) if shared else ("first", "second"))]
    pairs = saved.floats(f"grids_{k}", (len(factors), 2, shape[2])) if f"grids_{k}" in saved else ()
    grids = tuple(QuantizationGrid(low, step, levels) for low, step in pairs)
    return SeparableTerm(factors[0], None if shared else factors[1], signs, grids)
