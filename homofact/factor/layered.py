"""Several materials under one set of projections: their textures are the layers of texture arrays.

Material k is a separate `Factorization` with its own ε and A. All materials have the same projections, texture sizes
and channels. They are saved in one .npz file, in which the layers of each texture are stacked along the rows.
"""

import os
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from homofact.brdf.log_transform import LogTransform
from homofact.errors import BadInput
from homofact.factor.factorization import (
    LEAST_MEAN,
    MOST_CHANNELS,
    MOST_TERMS,
    Factorization,
    Term,
    described_term,
    stored_term,
    term_arrays,
)
from homofact.files.archive import write_archive
from homofact.files.saved import SavedFit

if TYPE_CHECKING:
    from torch import Tensor

FORMAT = "homofact layered factorization"
FORMAT_VERSION = 1
# What every device of OpenGL ES 3.0 and WebGPU holds: GL_MAX_ARRAY_TEXTURE_LAYERS, maxTextureArrayLayers.
MOST_LAYERS = 256


@dataclass(frozen=True)
class Layered:
    """The factorizations of several materials, layer by layer."""

    layers: tuple[Factorization, ...]

    def __post_init__(self) -> None:
        """Raise BadInput for no layers or too many, and for fits that do not share projections, sizes and channels."""
        if not 1 <= len(self.layers) <= MOST_LAYERS:
            raise BadInput(where="layers", found=len(self.layers), expected=f"1 to {MOST_LAYERS}")
        first = self.layers[0]
        for k, layer in enumerate(self.layers):
            same = layer.channels == first.channels and len(layer.terms) == len(first.terms)
            if not same or not all(map(_alike, layer.terms, first.terms)):
                raise BadInput(
                    f"number {k} has other projections, sizes or channels", where="layers", expected="those of all"
                )

    @property
    def nbytes(self) -> int:
        """Bytes of all layers' texels as float32."""
        return sum(layer.nbytes for layer in self.layers)

    @property
    def transforms(self) -> tuple[LogTransform, ...]:
        """ε and A of every layer."""
        return tuple(layer.transform for layer in self.layers)

    def evaluate(self, wi: "Tensor", wo: "Tensor", labels: "Tensor") -> "Tensor":
        """Return BRDF values (N, C) in sr⁻¹ at pairs (N, 3); `labels` (N,) select the layer of each pair.

        Raises BadInput for a label that no layer has.
        """
        if len(labels) and not 0 <= int(labels.min()) <= int(labels.max()) < len(self.layers):
            found = f"{int(labels.min())} to {int(labels.max())}"
            raise BadInput(where="labels", found=found, expected=f"0 to {len(self.layers) - 1}")
        values = wi.new_zeros(len(wi), len(self.layers[0].channels)).double()
        for k in labels.unique().tolist():
            own = labels == k
            values[own] = self.layers[k].evaluate(wi[own], wo[own])
        return values

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write one .npz file. Raises BadInput if the file cannot be written."""
        first = self.layers[0]
        header = {
            "format": FORMAT,
            "format_version": FORMAT_VERSION,
            "channels": list(first.channels),
            "terms": [described_term(term) for term in first.terms],
            "layers": [{"epsilon": each.transform.epsilon, "provenance": each.provenance} for each in self.layers],
        }
        arrays: dict[str, Any] = {"mean": np.stack([each.transform.mean for each in self.layers])}
        for j in range(len(first.terms)):
            arrays |= term_arrays(j, _stacked([layer.terms[j] for layer in self.layers]))
        write_archive(path, header, arrays)

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> "Layered":
        """Read a file that `save` wrote. Raises BadInput if it is no such file, is damaged, or has a newer version."""
        saved = SavedFit.read(path, FORMAT, FORMAT_VERSION)
        fields = saved.fields
        channels = tuple(fields.texts("channels", MOST_CHANNELS))
        described = fields.inners("layers", MOST_LAYERS)
        mean = saved.floats("mean", (len(described), len(channels)), least=LEAST_MEAN)
        terms = [
            _apart(stored_term(entry, saved, j, len(channels)), len(described), saved.path)
            for j, entry in enumerate(fields.inners("terms", MOST_TERMS))
        ]
        layers = [
            Factorization(
                tuple(each[k] for each in terms),
                LogTransform(entry.number("epsilon", above=0), mean[k]),
                channels,
                entry.inner("provenance").found,
            )
            for k, entry in enumerate(described)
        ]
        return cls(tuple(layers))


def _alike(one: Term, other: Term) -> bool:
    mine, theirs = one.projection, other.projection
    return (
        one.size == other.size
        and (mine.coordinates, mine.reciprocal, mine.warp) == (theirs.coordinates, theirs.reciprocal, theirs.warp)
        and np.array_equal(mine.matrix, theirs.matrix)
    )


def _stacked(terms: list[Term[np.ndarray]]) -> Term[np.ndarray]:
    """Return one texture's layers stacked by rows, without the layers' own quantization grids and deviations."""
    texture = np.concatenate([term.texture for term in terms])
    return replace(
        terms[0], texture=texture, mask=np.concatenate([term.mask for term in terms]), deviation=None, grid=None
    )


def _apart(term: Term[np.ndarray], count: int, path: str) -> list[Term[np.ndarray]]:
    rows = term.size[0]
    if rows % count:
        raise BadInput(
            where=path, found=f"{rows} rows of texels", expected=f"a multiple of {count}, the number of layers"
        )
    parts = zip(np.split(term.texture, count), np.split(term.mask, count), strict=True)
    return [replace(term, texture=texture, mask=mask) for texture, mask in parts]
