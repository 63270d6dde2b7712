"""The result of a factorization: log textures with their projections, which you can evaluate, save and load.

f(ωi, ωo) = A (exp Σj p̃j(πj(ωi, ωo)) − ε), cut at zero; a reciprocal projection adds its texture at the
conjugate too. On a periodic axis of the coordinates, the texture is periodic, too (`linear.layout`). One .npz file of
plain arrays and a JSON header contains everything that an evaluation needs, and can be read without homofact. Arrays
are stored without conversion, so a loaded factorization is bit-identical.

A factorization contains NumPy arrays. torch is imported only if directions are given as tensors.
"""

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, Generic, TypeVar

import numpy as np

from homofact.brdf.in_kind import answering_in_kind
from homofact.brdf.log_transform import LogTransform
from homofact.errors import BadInput
from homofact.factor.evaluation import Evaluation, Indexed, evaluation_of_product
from homofact.factor.fitted import QuantizationGrid, Texture, bits
from homofact.factor.projection import Projection, Warp, describe_projection, layout_of
from homofact.files.archive import write_archive
from homofact.files.fields import Fields
from homofact.files.saved import SavedFit
from homofact.files.words import listed
from homofact.geometry.coordinates import COORDINATES, check_half_axes
from homofact.linear.arrays import as_array
from homofact.linear.names import CLAMPED, Axes, Axis

if TYPE_CHECKING:
    from torch import Tensor

    from homofact.linear.layout import TexelLayout

FORMAT = "homofact factorization"
FORMAT_VERSION = 1
# What a saved fit may hold at most: more is no fit's.
MOST_CHANNELS, MOST_TERMS, MOST_LEVELS = 4096, 1000, 65535
LEAST_MEAN, LEAST_WARP = 1e-30, 1e-9

_LETTERS = {
    "wi": "ωi", "wo": "ωo", "theta_i": "θi", "theta_o": "θo", "theta_h": "θh", "theta_d": "θd", "phi_d": "φd",
    "phi_h": "φh", "delta_phi": "Δφ",
}  # fmt: skip
_SPACES = {
    "in-out": "ωi, ωo", "half-diff": "h, d", "isotropic-half-diff": "θh, θd, φd", "isotropic-in-out": "θi, θo, Δφ",
    "isotropic-angles": "θi, θo, θd", "isotropic-half-tilt": "θh, θd, |cosθi − cosθo|", "tilt": "|cosθi − cosθo|",
    "half-angles": "θh, φh",
}  # fmt: skip

# Arrays of a factorization, or the tensors of a solver.
A = TypeVar("A", np.ndarray, "Tensor")


@dataclass(frozen=True)
class Term(Generic[A]):
    """One texture and the projection that indexes it: tensors while a solver works on it, NumPy arrays in a fit.

    `texture` (rows, columns, C) contains logarithms in float64. `mask` (rows, columns) is True for texels that samples
    and smoothing determine, and False for filler texels. `deviation` (rows, columns, C), if requested, is the standard
    deviation of each texel under a repeated measurement in log units (`factor.confidence`); it is 0 for filler texels.
    `grid` is set if the texels are quantized (`factor.quantize`).
    """

    projection: Projection
    texture: A
    mask: A
    deviation: A | None = None
    grid: QuantizationGrid | None = None

    @property
    def size(self) -> tuple[int, int]:
        """(rows, columns)."""
        return int(self.texture.shape[0]), int(self.texture.shape[1])

    def arrays(self) -> "Term[np.ndarray]":
        """Return the term as NumPy arrays, which share memory with tensors if possible."""
        return self._mapped(as_array)

    def tensors(self, device: Any = "cpu") -> "Term[Tensor]":
        """Return the term as tensors on a device; on the CPU, they share memory with the arrays."""
        import torch

        return self._mapped(lambda values: torch.as_tensor(values).to(device))

    def flat(self: "Term[np.ndarray]") -> "Term[np.ndarray]":
        """The term with the first texels of each periodic axis repeated after the last, for clamping samplers.

        M texels around a circle plus the repeated first texel are M + 1 texels from −1 to +1, as on a clamped axis.
        """
        return self._around(lambda texels, d: np.concatenate((texels, texels.take([0], d)), d))

    def round(self: "Term[np.ndarray]") -> "Term[np.ndarray]":
        """Return the inverse of `flat`: a periodic axis without its last texels."""
        return self._around(lambda texels, d: texels.take(range(texels.shape[d] - 1), d))

    def _around(self, change: Callable[[Any, int], Any]) -> "Term[np.ndarray]":
        term: Any = self
        for dimension, axis in enumerate(self.projection.axes):
            if axis is Axis.PERIODIC:
                term = term._mapped(lambda texels, d=dimension: change(texels, d))
        return term

    def _mapped(self, change: Callable[[Any], Any]) -> "Term[Any]":
        deviation = None if self.deviation is None else change(self.deviation)
        return replace(self, texture=change(self.texture), mask=change(self.mask), deviation=deviation)


def layout_of_terms(terms: Sequence[Term[Any]]) -> "TexelLayout":
    """Return the texels of all textures, one after another."""
    return layout_of(tuple(term.projection for term in terms), tuple(term.size for term in terms))


def sum_of_terms(terms: Sequence[Term[Any]], wi: "Tensor", wo: "Tensor") -> "Tensor":
    """Σj p̃j(πj(ωi, ωo)), conjugate lookups included: (N, C) logarithms of at least one term."""
    import torch

    from homofact.linear.bilinear import lookup

    total = torch.zeros(wi.shape[0], terms[0].texture.shape[2], dtype=wi.dtype, device=wi.device)
    for term in terms:
        # Of float64 on the CPU this copies nothing.
        texture = torch.as_tensor(term.texture).to(wi)
        for uv in term.projection.place(wi, wo):
            total = total + lookup(texture, uv, term.projection.axes)
    return total


@dataclass(frozen=True)
class Factorization:
    """A fitted product of textures; a `Reflectance` and a `Fitted`.

    The terms contain NumPy arrays; tensors of a solver are converted. `provenance` is the JSON-able record of how the
    fit was made (method, seed, sampling, version).
    """

    terms: tuple[Term[Any], ...]
    transform: LogTransform
    channels: tuple[str, ...]
    provenance: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Keep the terms as arrays."""
        object.__setattr__(self, "terms", tuple(term.arrays() for term in self.terms))

    def __repr__(self) -> str:
        """In a line, without the texels."""
        sizes = ", ".join(f"{rows} × {columns}" for rows, columns in (term.size for term in self.terms))
        return f"<Factorization: textures of {sizes} texels, {listed(self.channels)}>"

    @property
    def nbytes(self) -> int:
        """Bytes of all texels as float32, as a clamping sampler reads them (`Term.flat`): what a renderer would use."""
        return sum(term.flat().texture.size * 4 for term in self.terms)

    @property
    def fetches(self) -> int:
        """Texture lookups of one evaluation, conjugates included."""
        return sum(term.projection.lookups for term in self.terms)

    def evaluate_log(self, wi: "Tensor", wo: "Tensor") -> "Tensor":
        """Σj p̃j (N, C): the sum of the textures, before the exponential."""
        return sum_of_terms(self.terms, wi, wo)

    @answering_in_kind
    def evaluate(self, wi: "Tensor", wo: "Tensor") -> "Tensor":
        """Return BRDF values (N, C) in sr⁻¹, ≥ 0, without the cosine; 0 where a direction is under the horizon."""
        from homofact.geometry.directions import above_horizon

        above, wi, wo = above_horizon(wi, wo)
        return self.transform.inverse(self.evaluate_log(wi, wo)) * above[:, None]

    @property
    def textures(self) -> tuple[Texture, ...]:
        """One log texture per term, flat (`Term.flat`), since every reader clamps."""
        return tuple(
            Texture(
                f"texture_{k}", _caption(term.projection), "log", term.texture, term.mask, term.grid, term.deviation
            )
            for k, term in enumerate(term.flat() for term in self.terms)
        )

    @property
    def evaluation(self) -> Evaluation:
        """The evaluation A (exp Σ lookups − ε), in which a conjugate is a separate lookup."""
        indexed = []
        for term in self.terms:
            projection, warp = term.projection, term.projection.warp
            width = None if warp is None else warp.width
            matrices = projection.lookup_matrices
            indexed.append(Indexed(projection.name, projection.system, matrices, width, term.flat().size))
        return evaluation_of_product(indexed, self.transform)

    def with_textures(
        self,
        texels: Sequence[Any],
        grids: Sequence[QuantizationGrid | None] | None = None,
        facts: Mapping[str, Any] | None = None,
    ) -> "Factorization":
        """Return a fit with the same projections and masks and other logarithms (rows, columns, C), flat."""
        chosen = grids or (None,) * len(self.terms)
        terms = zip(self.terms, map(as_array, texels), chosen, strict=True)
        made = tuple(replace(term.flat(), texture=own, grid=grid).round() for term, own, grid in terms)
        return replace(self, terms=made, provenance=self.provenance | dict(facts or {}))

    def trained(
        self, projections: Sequence[Projection], texels: Sequence[Any], facts: Mapping[str, Any]
    ) -> "Factorization":
        """Return a fit with the same masks and other projections and logarithms (rows, columns, C), not flat."""
        terms = tuple(
            replace(term, projection=projection, texture=as_array(own), deviation=None, grid=None)
            for term, projection, own in zip(self.terms, projections, texels, strict=True)
        )
        return replace(self, terms=terms, provenance=self.provenance | dict(facts))

    def describe(self) -> dict[str, Any]:
        """Return the projections and masks."""
        return {
            "kind": "product",
            "terms": [
                {"texture": k, "projection": describe_projection(term.projection), "mask": bits(term.flat().mask)}
                for k, term in enumerate(self.terms)
            ],
        }

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write one .npz file under a temporary name and rename it, so that a failure leaves no partial file."""
        header = {
            "format": FORMAT,
            "format_version": FORMAT_VERSION,
            "epsilon": self.transform.epsilon,
            "channels": list(self.channels),
            "provenance": self.provenance,
            "terms": [described_term(term) for term in self.terms],
        }
        arrays: dict[str, Any] = {"mean": self.transform.mean}
        for j, term in enumerate(self.terms):
            arrays |= term_arrays(j, term)
        write_archive(path, header, arrays)

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> "Factorization":
        """Read a file that `save` wrote. Raises BadInput if it is no such file, is damaged, or has a newer version."""
        saved = SavedFit.read(path, FORMAT, FORMAT_VERSION)
        fields = saved.fields
        channels, transform = channels_and_transform(saved)
        described = enumerate(fields.inners("terms", MOST_TERMS))
        terms = tuple(stored_term(entry, saved, j, len(channels)) for j, entry in described)
        return cls(terms, transform, channels, fields.inner("provenance").found)


def _caption(projection: Projection) -> str:
    """Return a caption of a texture's coordinates, e.g. "θh, θd, warped" or "searched in θi, θo, Δφ"."""
    if projection.quaternions is None:
        where = ", ".join(_LETTERS.get(axis, axis) for axis in projection.name.split("-"))
    else:
        where = f"{projection.name} in {_SPACES.get(projection.coordinates, projection.coordinates)}"
    return where if projection.warp is None else f"{where}, warped"


def term_arrays(j: int, term: Term[np.ndarray]) -> dict[str, Any]:
    """Return the arrays of term number `j` in a saved fit, by name."""
    arrays: dict[str, Any] = {f"texture_{j}": term.texture, f"mask_{j}": term.mask}
    if term.deviation is not None:
        arrays[f"deviation_{j}"] = term.deviation
    if term.grid is not None:
        arrays[f"grid_{j}"] = np.stack((term.grid.low, term.grid.step))
    arrays[f"matrix_{j}"] = term.projection.matrix
    quaternions = term.projection.quaternions
    if quaternions is not None:
        # (2, 4) for a pair, (4,) for a single quaternion.
        arrays[f"rotation_{j}"] = quaternions if len(quaternions) == 2 else quaternions[0]
    return arrays


def described_term(term: Term[np.ndarray]) -> dict[str, Any]:
    """Return the entry of a term in the header of a saved fit, without its arrays."""
    projection = term.projection
    return {
        "coordinates": projection.coordinates,
        "reciprocal": projection.reciprocal,
        "name": projection.name,
        "warp": None if projection.warp is None else projection.warp.width,
        "axes": _names_of_axes(projection.axes),
    } | ({} if term.grid is None else {"levels": term.grid.levels})


def channels_and_transform(saved: SavedFit) -> tuple[tuple[str, ...], LogTransform]:
    """Return the channels of a saved fit, and the ε and A (C,) of its logarithms.

    Raises BadInput for invalid values.
    """
    channels = tuple(saved.fields.texts("channels", MOST_CHANNELS))
    mean = saved.floats("mean", (len(channels),), least=LEAST_MEAN)
    return channels, LogTransform(saved.fields.number("epsilon", above=0), mean)


def stored_term(fields: Fields, saved: SavedFit, j: int, channels: int) -> Term[np.ndarray]:
    """Return term number `j` of a saved fit. Raises BadInput for data that no fit can contain."""
    name = fields.text("coordinates", COORDINATES)
    system = COORDINATES[name]
    quaternions, warp, grid, deviation = None, None, None, None
    if f"rotation_{j}" in saved:
        shape = (2, 4) if system.dimension == 4 else (4,)
        quaternions = saved.floats(f"rotation_{j}", shape).reshape(-1, 4)
        if (np.abs(np.linalg.norm(quaternions, axis=1) - 1) > 1e-3).any():
            raise BadInput(f"rotation_{j} has another length than 1", where=saved.path, expected="unit quaternions")
    if fields.found.get("warp") is not None:
        warp = Warp(fields.number("warp", above=LEAST_WARP))
    matrix = saved.floats(f"matrix_{j}", (2, system.dimension))
    reciprocal, called = fields.flag("reciprocal"), fields.text("name")
    try:
        projection = Projection(name, matrix, reciprocal, called, quaternions, warp)
        if warp is not None:
            check_half_axes(system.axes)
    except BadInput as error:
        raise error.at(f"{saved.path}: term {j}") from error
    expected = _names_of_axes(projection.axes)
    if fields.found.get("axes", _names_of_axes(CLAMPED)) != expected:
        fields.refuse("axes", f"{expected}, which {called} has")
    texture = saved.floats(f"texture_{j}", (None, None, channels))
    rows, columns = texture.shape[:2]
    mask = saved.flags(f"mask_{j}", (rows, columns))
    if f"deviation_{j}" in saved:
        deviation = saved.floats(f"deviation_{j}", (rows, columns, channels), least=0)
    if f"grid_{j}" in saved:
        low, step = saved.floats(f"grid_{j}", (2, channels))
        grid = QuantizationGrid(low, step, fields.whole("levels", 1, MOST_LEVELS))
    return Term(projection, texture, mask, deviation, grid)


def _names_of_axes(axes: Sequence[Axis] | Axes) -> list[str]:
    """Return the names of the kinds of a texture's two axes, rows first."""
    return [axis.value for axis in axes]
