"""A product of textures for a spectrum of many bands. The textures contain coordinates in a spectral basis.

f(ωi, ωo, λ) = A(λ) (exp(Σk sk bk(λ) + b0(λ)) − ε), cut at zero, where sk are sums of lookups as in a `Factorization`,
and bk are the vectors of a table (`factor.spectral_basis`). The fit evaluates to all bands, and is saved as one .npz
file like a `Factorization`.
"""

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from homofact.brdf.in_kind import answering_in_kind
from homofact.brdf.log_transform import LogTransform
from homofact.brdf.wavelengths import spectrum_of
from homofact.errors import BadInput
from homofact.factor.evaluation import Evaluation
from homofact.factor.factorization import (
    MOST_CHANNELS,
    MOST_TERMS,
    Factorization,
    Term,
    channels_and_transform,
    described_term,
    stored_term,
    sum_of_terms,
    term_arrays,
)
from homofact.factor.fitted import QuantizationGrid, Texture
from homofact.factor.spectral_basis import SpectralBasis
from homofact.files.archive import write_archive
from homofact.files.saved import SavedFit

if TYPE_CHECKING:
    from torch import Tensor

    from homofact.brdf.samples import Samples

FORMAT = "homofact spectral factorization"
FORMAT_VERSION = 1
# What the choice of a basis sees: samples at most, and pairs of any directions, which count as much.
MOST_SAMPLES, PAIRS = 8192, 4096
# One texture has four channels; a shader's program reads up to four as they are.
LEAST_BANDS = 5


@dataclass(frozen=True)
class SpectralFit:
    """A fitted product of textures with a spectral basis; a `Reflectance` and a `Fitted`.

    The textures of `terms` have a channel for each vector of the basis, R of them; `channels` names the W bands, and
    `transform` has an A for each. `provenance` as in a `Factorization`.
    """

    terms: tuple[Term[np.ndarray], ...]
    basis: SpectralBasis
    transform: LogTransform
    channels: tuple[str, ...]
    provenance: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Keep the terms as arrays. Raises BadInput as `bands_of`."""
        bands_of(self.channels)
        object.__setattr__(self, "terms", tuple(term.arrays() for term in self.terms))

    def __repr__(self) -> str:
        """In a line, without the texels."""
        sizes = ", ".join(f"{rows} × {columns}" for rows, columns in (term.size for term in self.terms))
        many = f"{len(self.channels)} bands from {self.channels[0]} to {self.channels[-1]}"
        return f"<SpectralFit: textures of {sizes} texels, {self.basis.rank} basis vectors for {many}>"

    @classmethod
    def of(cls, fit: Factorization, samples: "Samples", tolerance: float, seed: int = 0) -> "SpectralFit":
        """Return a fit of all bands with the basis of the smallest rank that a tolerance allows.

        `tolerance` limits the mean CIEDE2000 difference from the fit of all bands, under each of
        `colour_difference.ILLUMINANTS`. Half of the mean is over `samples`, weighted over the discs. The other half is
        over cosine-weighted pairs, which are typical of a renderer. The provenance gets the rank, the tolerance and the
        differences as "spectral". Raises BadInput if the channels are not a spectrum.
        """
        import torch

        from homofact.brdf.pair_density import over_discs
        from homofact.factor.spectral_choice import choose_basis
        from homofact.geometry.directions import draw_cosine_weighted

        wavelengths = bands_of(fit.channels)
        drawn = samples.to("cpu")
        if len(drawn) > MOST_SAMPLES:
            drawn = drawn.subset(MOST_SAMPLES, seed)
        wi, wo = draw_cosine_weighted(PAIRS, torch.Generator().manual_seed(seed))
        near = over_discs(drawn).double()
        weights = torch.cat((near / near.sum(), torch.full((PAIRS,), 1 / PAIRS, dtype=torch.float64)))
        logs = torch.cat([fit.evaluate_log(drawn.wi, drawn.wo), fit.evaluate_log(wi, wo)]).numpy()
        chosen = choose_basis(logs, weights.numpy(), fit.transform, wavelengths, tolerance)
        facts = {
            "rank": chosen.basis.rank,
            "bands": len(fit.channels),
            "tolerance": tolerance,
            "delta_e": dict(chosen.differences),
        }
        terms = tuple(
            replace(term, texture=chosen.basis.coordinates(term.texture), deviation=None, grid=None)
            for term in fit.terms
        )
        return cls(terms, chosen.basis, fit.transform, fit.channels, fit.provenance | {"spectral": facts})

    @property
    def wavelengths(self) -> tuple[float, ...]:
        """The bands in nm."""
        return bands_of(self.channels)

    @property
    def nbytes(self) -> int:
        """Bytes of all texels and of the basis as float32: what a renderer would use."""
        return sum(term.flat().texture.size * 4 for term in self.terms) + self.basis.nbytes

    @property
    def fetches(self) -> int:
        """Texture lookups of one evaluation, conjugates included."""
        return sum(term.projection.lookups for term in self.terms)

    def evaluate_log(self, wi: "Tensor", wo: "Tensor") -> "Tensor":
        """Return the logarithms (N, W), before the exponential."""
        import torch

        coordinates = sum_of_terms(self.terms, wi, wo)
        vectors, offset = (torch.from_numpy(part).to(coordinates) for part in (self.basis.vectors, self.basis.offset))
        return coordinates @ vectors + offset

    @answering_in_kind
    def evaluate(self, wi: "Tensor", wo: "Tensor") -> "Tensor":
        """Return BRDF values (N, W) in sr⁻¹, ≥ 0, without the cosine; 0 where a direction is under the horizon."""
        from homofact.geometry.directions import above_horizon

        above, wi, wo = above_horizon(wi, wo)
        return self.transform.inverse(self.evaluate_log(wi, wo)) * above[:, None]

    @property
    def components(self) -> tuple[str, ...]:
        """The names of the textures' channels."""
        return tuple(f"vector {k}" for k in range(self.basis.rank))

    @property
    def textures(self) -> tuple[Texture, ...]:
        """One texture of coordinates per term, flat (`Term.flat`), with R channels."""
        return tuple(replace(texture, components=self.components) for texture in self._product.textures)

    @property
    def evaluation(self) -> Evaluation:
        """Return the evaluation of the product of all bands (`expanded`), with W channels per texture instead of R."""
        return self.expanded.evaluation

    @cached_property
    def expanded(self) -> Factorization:
        """The same fit as a product of textures of all bands."""
        first, *rest = (replace(term, texture=term.texture @ self.basis.vectors, grid=None) for term in self.terms)
        # A constant c in a texture that is looked up m times is m·c in the sum.
        first = replace(first, texture=first.texture + self.basis.offset / first.projection.lookups)
        return Factorization((first, *rest), self.transform, self.channels, self.provenance)

    @property
    def _product(self) -> Factorization:
        """Return the textures alone as a product of R channels; its A is 1."""
        return Factorization(self.terms, LogTransform(1.0, np.ones(self.basis.rank)), self.components, self.provenance)

    def with_textures(
        self,
        texels: Sequence[Any],
        grids: Sequence[QuantizationGrid | None] | None = None,
        facts: Mapping[str, Any] | None = None,
    ) -> "SpectralFit":
        """Return the same projections, masks and basis with other coordinates (rows, columns, R), flat."""
        made = self._product.with_textures(texels, grids, facts)
        return replace(self, terms=made.terms, provenance=made.provenance)

    def describe(self) -> dict[str, Any]:
        """Return the projections, masks and the basis."""
        basis = {"vectors": self.basis.vectors.tolist(), "offset": self.basis.offset.tolist()}
        return self._product.describe() | {"basis": basis}

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write one .npz file atomically. Raises BadInput if the file cannot be written."""
        header = {
            "format": FORMAT,
            "format_version": FORMAT_VERSION,
            "epsilon": self.transform.epsilon,
            "channels": list(self.channels),
            "rank": self.basis.rank,
            "provenance": self.provenance,
            "terms": [described_term(term) for term in self.terms],
        }
        basis = self.basis
        arrays: dict[str, Any] = {"mean": self.transform.mean, "vectors": basis.vectors, "offset": basis.offset}
        arrays["dual"] = basis.dual
        for j, term in enumerate(self.terms):
            arrays |= term_arrays(j, term)
        write_archive(path, header, arrays)

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> "SpectralFit":
        """Read a file that `save` wrote. Raises BadInput if it is no such file, is damaged, or has a newer version."""
        saved = SavedFit.read(path, FORMAT, FORMAT_VERSION)
        channels, transform = channels_and_transform(saved)
        try:
            bands_of(channels)
        except BadInput as error:
            raise error.at(saved.path) from error
        bands, rank = len(channels), saved.fields.whole("rank", 1, MOST_CHANNELS)
        shapes = {"vectors": (rank, bands), "offset": (bands,), "dual": (bands, rank)}
        basis = SpectralBasis(**{name: saved.floats(name, shape) for name, shape in shapes.items()})
        described = enumerate(saved.fields.inners("terms", MOST_TERMS))
        terms = tuple(stored_term(entry, saved, j, rank) for j, entry in described)
        return cls(terms, basis, transform, channels, saved.fields.inner("provenance").found)


def bands_of(channels: Sequence[str]) -> tuple[float, ...]:
    """Return the wavelengths in nm of channels that form a visible spectrum of at least `LEAST_BANDS` bands.

    Raises BadInput for other channels, which have no spectral basis.
    """
    wavelengths = spectrum_of(channels)
    if len(wavelengths) < LEAST_BANDS:
        found, expected = f"{len(wavelengths)} bands", f"at least {LEAST_BANDS} for a spectral basis"
        raise BadInput(where="channels", found=found, expected=expected)
    return wavelengths
