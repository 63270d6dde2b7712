"""The result: log textures with their projections, which evaluate, save and load.

f(ωi, ωo) = A (exp Σj p̃j(πj(ωi, ωo)) − ε), cut at zero; a reciprocal projection adds its texture at the
conjugate too. On an axis that is periodic in the coordinates a texture goes round (`linear.layout`). Everything an
evaluation needs is in one .npz file of plain arrays and a JSON header, readable without homofact; arrays are stored
as they are, so a loaded factorization is bit-identical.
"""

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import torch
from torch import Tensor

from homofact.brdf.log_transform import LogTransform
from homofact.brdf.reflectance import answering_in_kind
from homofact.factor.evaluation import Evaluation, Exponential, Indexed, evaluation_of_product
from homofact.factor.fitted import Grid, Texture, bits
from homofact.factor.projection import Projection, Warp, describe_projection, layout_of
from homofact.factor.stored import FORMAT, FORMAT_VERSION, StoredProduct, StoredTerm, names_of_axes
from homofact.files.archive import write_archive
from homofact.files.words import listed
from homofact.geometry.directions import above_horizon
from homofact.geometry.rotation import Rotation
from homofact.linear.bilinear import lookup
from homofact.linear.layout import Axis, TexelLayout

_LETTERS = {
    "wi": "ωi", "wo": "ωo", "theta_i": "θi", "theta_o": "θo", "theta_h": "θh", "theta_d": "θd", "phi_d": "φd",
    "phi_h": "φh", "delta_phi": "Δφ",
}  # fmt: skip
_SPACES = {
    "in-out": "ωi, ωo", "half-diff": "h, d", "isotropic-half-diff": "θh, θd, φd", "isotropic-in-out": "θi, θo, Δφ",
    "isotropic-angles": "θi, θo, θd", "isotropic-half-tilt": "θh, θd, |cosθi − cosθo|", "tilt": "|cosθi − cosθo|",
    "half-angles": "θh, φh",
}  # fmt: skip


@dataclass(frozen=True)
class Term:
    """One texture and the projection that indexes it.

    `texture` is (rows, columns, C) float64, logarithms; `mask` (rows, columns) is True where the texel is
    held by samples and smoothing, False where its value is only filler. `deviation` (rows, columns, C), where it was
    asked for, is how far a texel would move in another measurement (`factor.confidence`), in log units; 0 in filler.
    `grid` is there where every texel is one of its values (`factor.quantize`).
    """

    projection: Projection
    texture: Tensor
    mask: Tensor
    deviation: Tensor | None = None
    grid: Grid | None = None

    @property
    def size(self) -> tuple[int, int]:
        """(rows, columns)."""
        return int(self.texture.shape[0]), int(self.texture.shape[1])

    def flat(self) -> "Term":
        """The term with the first texels of a periodic axis once more behind the last, as a clamping sampler reads it.

        M texels evenly round and the first again are M + 1 from −1 to +1: what the convention of a clamped axis says.
        """
        term = self
        for dimension, axis in enumerate(self.projection.axes):
            if axis is Axis.PERIODIC:
                term = term._mapped(lambda texels, d=dimension: torch.cat((texels, texels.narrow(d, 0, 1)), d))
        return term

    def round(self) -> "Term":
        """The inverse of `flat`: a periodic axis without its last texels."""
        term = self
        for dimension, axis in enumerate(self.projection.axes):
            if axis is Axis.PERIODIC:
                term = term._mapped(lambda texels, d=dimension: texels.narrow(d, 0, texels.shape[d] - 1))
        return term

    def _mapped(self, change: Callable[[Tensor], Tensor]) -> "Term":
        deviation = None if self.deviation is None else change(self.deviation)
        return replace(self, texture=change(self.texture), mask=change(self.mask), deviation=deviation)


def layout_of_terms(terms: tuple[Term, ...]) -> TexelLayout:
    """The texels of all textures, one after another."""
    return layout_of(tuple(term.projection for term in terms), tuple(term.size for term in terms))


def sum_of_terms(terms: tuple[Term, ...], wi: Tensor, wo: Tensor) -> Tensor:
    """Σj p̃j(πj(ωi, ωo)), conjugate lookups included: (N, C) logarithms of at least one term."""
    total = torch.zeros(wi.shape[0], terms[0].texture.shape[2], dtype=wi.dtype, device=wi.device)
    for term in terms:
        texture = term.texture.to(wi)
        for uv in term.projection.place(wi, wo):
            total = total + lookup(texture, uv, term.projection.axes)
    return total


@dataclass(frozen=True)
class Factorization:
    """A fitted product of textures; a `Reflectance` and a `Fitted`.

    `provenance` holds what the fit was made from and by (method, seed, sampling, version), JSON-able.
    """

    terms: tuple[Term, ...]
    transform: LogTransform
    channels: tuple[str, ...]
    provenance: dict[str, Any] = field(default_factory=dict)

    def __repr__(self) -> str:
        """In a line, without the texels."""
        sizes = ", ".join(f"{rows} × {columns}" for rows, columns in (term.size for term in self.terms))
        return f"<Factorization: textures of {sizes} texels, {listed(self.channels)}>"

    @property
    def nbytes(self) -> int:
        """Bytes of all texels as float32, as a clamping sampler reads them (`Term.flat`): what a renderer would use."""
        return sum(term.flat().texture.numel() * 4 for term in self.terms)

    @property
    def fetches(self) -> int:
        """Texture lookups of one evaluation, conjugates included."""
        return sum(term.projection.lookups for term in self.terms)

    def evaluate_log(self, wi: Tensor, wo: Tensor) -> Tensor:
        """Σj p̃j (N, C): the sum of the textures, before the exponential."""
        return sum_of_terms(self.terms, wi, wo)

    @answering_in_kind
    def evaluate(self, wi: Tensor, wo: Tensor) -> Tensor:
        """BRDF values (N, C) in sr⁻¹, ≥ 0, without the cosine; 0 where a direction is under the horizon."""
        above, wi, wo = above_horizon(wi, wo)
        return self.transform.inverse(self.evaluate_log(wi, wo)) * above[:, None]

    @property
    def textures(self) -> tuple[Texture, ...]:
        """One texture of logarithms a term, flat (`Term.flat`): every reader clamps."""
        return tuple(
            Texture(
                f"texture_{k}", _caption(term.projection), "log", term.texture, term.mask, term.grid, term.deviation
            )
            for k, term in enumerate(term.flat() for term in self.terms)
        )

    @property
    def evaluation(self) -> Evaluation:
        """A (exp Σ lookups − ε); a conjugate is a lookup of its own."""
        indexed = []
        for term in self.terms:
            projection, warp = term.projection, term.projection.warp
            matrices = [matrix.detach().cpu().to(torch.float64).numpy() for matrix in projection.matrices()]
            width = None if warp is None else warp.width
            indexed.append(Indexed(projection.name, projection.system, matrices, width, term.flat().size))
        return evaluation_of_product(indexed, exponential(self.transform))

    def with_textures(
        self,
        texels: Sequence[Tensor],
        grids: Sequence[Grid | None] | None = None,
        facts: Mapping[str, Any] | None = None,
    ) -> "Factorization":
        """The same projections and masks with other logarithms (rows, columns, C), flat; as `Fitted.with_textures`."""
        chosen = grids or (None,) * len(self.terms)
        terms = zip(self.terms, texels, chosen, strict=True)
        made = tuple(replace(term.flat(), texture=each, grid=grid).round() for term, each, grid in terms)
        return replace(self, terms=made, provenance=self.provenance | dict(facts or {}))

    def describe(self) -> dict[str, Any]:
        """The projections and masks."""
        return {
            "kind": "product",
            "terms": [
                {"texture": k, "projection": describe_projection(term.projection), "mask": bits(term.flat().mask)}
                for k, term in enumerate(self.terms)
            ],
        }

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the one file (.npz), beside first and then renamed, so that a failure leaves no half file."""
        header = {
            "format": FORMAT,
            "format_version": FORMAT_VERSION,
            "epsilon": self.transform.epsilon,
            "channels": list(self.channels),
            "provenance": self.provenance,
            "terms": [described_term(term) for term in self.terms],
        }
        arrays: dict[str, Any] = {"mean": self.transform.mean.cpu().numpy()}
        for j, term in enumerate(self.terms):
            arrays |= term_arrays(j, term)
        write_archive(path, header, arrays)

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> "Factorization":
        """Read what `save` wrote. Raises BadInput for a file that is none, is damaged, or is from a newer version."""
        stored = StoredProduct.load(path)
        transform = LogTransform(stored.transform.epsilon, torch.from_numpy(stored.transform.mean))
        return cls(tuple(map(restored_term, stored.terms)), transform, stored.channels, stored.provenance)


def exponential(transform: LogTransform) -> Exponential:
    """ε and A as plain numbers."""
    return Exponential(transform.epsilon, transform.mean.detach().cpu().to(torch.float64).numpy())


def _caption(projection: Projection) -> str:
    """What a texture is indexed by, in the field's letters: "θh, θd, warped", "searched in θi, θo, Δφ"."""
    if projection.rotation is None:
        where = ", ".join(_LETTERS.get(axis, axis) for axis in projection.name.split("-"))
    else:
        where = f"{projection.name} in {_SPACES.get(projection.coordinates, projection.coordinates)}"
    return where if projection.warp is None else f"{where}, warped"


def term_arrays(j: int, term: Term) -> dict[str, Any]:
    """The arrays of term number `j` in a saved fit, by name."""
    arrays: dict[str, Any] = {f"texture_{j}": term.texture.cpu().numpy(), f"mask_{j}": term.mask.cpu().numpy()}
    if term.deviation is not None:
        arrays[f"deviation_{j}"] = term.deviation.cpu().numpy()
    if term.grid is not None:
        arrays[f"grid_{j}"] = torch.stack((term.grid.low, term.grid.step)).cpu().numpy()
    arrays[f"matrix_{j}"] = term.projection.matrix.cpu().numpy()
    rotation = term.projection.rotation
    if rotation is not None:
        # (2, 4) for a pair, (4,) for a single quaternion.
        arrays[f"rotation_{j}"] = rotation.quaternions.squeeze(0).cpu().numpy()
    return arrays


def described_term(term: Term) -> dict[str, Any]:
    """What the header of a saved fit says of a term beside its arrays."""
    projection = term.projection
    return {
        "coordinates": projection.coordinates,
        "reciprocal": projection.reciprocal,
        "name": projection.name,
        "warp": None if projection.warp is None else projection.warp.width,
        "axes": names_of_axes(projection.axes),
    } | ({} if term.grid is None else {"levels": term.grid.levels})


def restored_term(stored: StoredTerm) -> Term:
    """The term of arrays as tensors."""
    rotation = None if stored.quaternions is None else Rotation(torch.from_numpy(stored.quaternions))
    warp = None if stored.warp is None else Warp(stored.warp)
    matrix = torch.from_numpy(stored.matrix)
    projection = Projection(stored.coordinates, matrix, stored.reciprocal, stored.name, rotation, warp)
    deviation = None if stored.deviation is None else torch.from_numpy(stored.deviation)
    grid = None
    if stored.grid is not None:
        low, step = torch.from_numpy(stored.grid)
        grid = Grid(low, step, stored.levels)
    return Term(projection, torch.from_numpy(stored.texture), torch.from_numpy(stored.mask), deviation, grid)
