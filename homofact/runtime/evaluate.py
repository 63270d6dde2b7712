"""Fits without torch: the shading program interpreted on arrays, or compiled where there are many pairs.

The program (`shading.program`) is what shaders print and numba compiles. Interpreted it holds in the precision of the
directions; compiled it answers in float32. A shader's vector has four components, so more channels are evaluated four
at a time.
"""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from numpy.typing import ArrayLike

from homofact.brdf.analytic.common import AnalyticModel
from homofact.errors import BadInput
from homofact.factor.evaluation import Evaluation
from homofact.factor.stored import StoredProduct
from homofact.geometry.interpret import NUMPY, Value, interpret, value_of
from homofact.separable.stored import StoredSum
from homofact.shading.encoded import plain
from homofact.shading.program import Program, program_of

if TYPE_CHECKING:
    from homofact.shading.compiled import Compiled

# Pairs in one call from which on they are worth the seconds that compiling takes.
MANY = 2**21
# Pairs that are interpreted at a time: their numbers stay in the caches.
_CHUNK = 2**13
_VECTOR = 4


class RuntimeFit(ABC):
    """A saved fit, read to be evaluated: names of its C `channels`, and its `provenance` as it was saved."""

    channels: tuple[str, ...]
    provenance: Mapping[str, Any]

    def evaluate(self, wi: ArrayLike, wo: ArrayLike) -> np.ndarray:
        """BRDF values (..., C) in sr⁻¹, ≥ 0, without the cosine; 0 where a direction is under the horizon.

        `wi` and `wo` are unit vectors (..., 3) to the light and the viewer in the surface frame (z the normal, x the
        tangent), of shapes that broadcast. float32 of float32 directions, else float64; from `MANY` pairs on textures
        are read by compiled code, to float32's precision, with less memory. Raises BadInput for other shapes and what
        are no real numbers.
        """
        pairs, shape = _pairs(wi, wo)
        above = ((pairs[0][:, 2] >= 0) & (pairs[1][:, 2] >= 0))[:, None]
        # What is below the horizon is evaluated in a safe place.
        wi, wo = (np.where(above, w, np.array((0, 0, 1), w.dtype)) for w in pairs)
        return (self._above(wi, wo) * above).reshape(*shape, len(self.channels))

    @abstractmethod
    def _above(self, wi: np.ndarray, wo: np.ndarray) -> np.ndarray:
        """Values (N, C), of directions (N, 3) of one floating type that are on or above the horizon."""


@dataclass(frozen=True)
class ModelRuntime(RuntimeFit):
    """A model without textures."""

    channels: tuple[str, ...]
    provenance: Mapping[str, Any]
    model: AnalyticModel

    def _above(self, wi: np.ndarray, wo: np.ndarray) -> np.ndarray:
        # The formulas take arrays as they take tensors (`geometry.namespace`).
        return np.asarray(cast(Any, self.model).formula(wi, wo), wi.dtype)


@dataclass(frozen=True)
class TextureRuntime(RuntimeFit):
    """A product or a sum of products of textures: `texels` (rows, columns, C) float64, and their `evaluation`."""

    channels: tuple[str, ...]
    provenance: Mapping[str, Any]
    texels: tuple[np.ndarray, ...]
    evaluation: Evaluation

    @classmethod
    def of(cls, stored: StoredProduct | StoredSum) -> "TextureRuntime":
        """A fit as it was read."""
        return cls(stored.channels, stored.provenance, stored.texels, stored.evaluation)

    def compiled(self) -> "tuple[Compiled, ...]":
        """The compiled reflectances, of four channels each, that `evaluate` uses from `MANY` pairs on.

        Each takes float32 arrays (N, 3) above the horizon (`evaluate_array`); the first one compiles, in seconds.
        """
        return self._compiled

    def _above(self, wi: np.ndarray, wo: np.ndarray) -> np.ndarray:
        values = np.empty((len(wi), len(self.channels)), wi.dtype)
        if len(wi) >= MANY:
            single = [np.ascontiguousarray(w, np.float32) for w in (wi, wo)]
            for group, part in zip(self._groups, self._compiled, strict=True):
                values[:, group] = part.evaluate_array(*single)
            return values
        texels = [[np.ascontiguousarray(each[..., g], wi.dtype) for each in self.texels] for g in self._groups]
        for begin in range(0, len(wi), _CHUNK):
            rows = slice(begin, begin + _CHUNK)
            for group, program, textures in zip(self._groups, self._programs, texels, strict=True):
                for channel, found in enumerate(_run(program, textures, wi[rows], wo[rows]), group.start):
                    values[rows, channel] = found
        return values

    @cached_property
    def _groups(self) -> list[slice]:
        count = len(self.channels)
        return [slice(begin, min(begin + _VECTOR, count)) for begin in range(0, count, _VECTOR)]

    @cached_property
    def _programs(self) -> list[Program]:
        made = []
        for group in self._groups:
            part = TextureRuntime(self.channels[group], self.provenance, (), self.evaluation.of_channels(group))
            made.append(program_of(part, [plain(each[..., group]) for each in self.texels]))
        return made

    @cached_property
    def _compiled(self) -> "tuple[Compiled, ...]":
        # numba alone takes most of a second to be imported.
        from homofact.shading.compiled import compiled_program

        pairs = zip(self._groups, self._programs, strict=True)
        return tuple(
            compiled_program(program, [each[..., group].astype(np.float32) for each in self.texels])
            for group, program in pairs
        )


def _run(program: Program, texels: list[np.ndarray], wi: np.ndarray, wo: np.ndarray) -> Value:
    """The program's channels, (N,) each, of directions (N, 3)."""
    values = {name: [w[:, k] for k in range(3)] for name, w in (("wi", wi), ("wo", wo))}

    def fetch(number: int, uv: Value) -> Value:
        return _fetch(texels[number], np.broadcast_to(uv[0], len(wi)), np.broadcast_to(uv[1], len(wi)))

    interpret(program.statements, values, NUMPY, fetch)
    return value_of(program.result, values, NUMPY)


def _fetch(texels: np.ndarray, u: np.ndarray, v: np.ndarray) -> Value:
    """What a bilinear, clamping sampler finds at (u, v) in [0, 1]² (N,): each channel (N,)."""
    rows, columns, channels = texels.shape
    (column, right, x), (row, above, y) = _cell(u, columns), _cell(v, rows)
    flat = texels.reshape(-1, channels)
    x, y = x[:, None], y[:, None]
    low = (1 - x) * flat[row * columns + column] + x * flat[row * columns + right]
    high = (1 - x) * flat[above * columns + column] + x * flat[above * columns + right]
    return list(((1 - y) * low + y * high).T)


def _cell(coordinate: np.ndarray, size: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The lower texel, the next, and the fraction towards it."""
    # A direction that is no number reads the first texel, and stays none by the fraction.
    place = np.clip(coordinate * size - 0.5, 0, size - 1)
    lower = np.nan_to_num(place).astype(np.int64).clip(0, max(size - 2, 0))
    return lower, np.minimum(lower + 1, size - 1), place - lower


def _pairs(wi: ArrayLike, wo: ArrayLike) -> tuple[list[np.ndarray], tuple[int, ...]]:
    """(both directions (N, 3) of one floating type, the shape that they broadcast to, without the 3)."""
    given = []
    for name, w in (("wi", wi), ("wo", wo)):
        try:
            array = np.asarray(w)
        except ValueError as error:
            raise BadInput(f"{name}: found no table of numbers ({error}), expected (..., 3) directions") from error
        if array.dtype.kind not in "fiu" or array.ndim == 0 or array.shape[-1] != 3:
            raise BadInput(
                f"{name}: found {array.dtype} of shape {array.shape}, expected real numbers of shape (..., 3)"
            )
        given.append(array)
    try:
        shape = np.broadcast_shapes(*(array.shape[:-1] for array in given))
    except ValueError:
        shapes = " and ".join(str(array.shape) for array in given)
        raise BadInput(f"wi, wo: found the shapes {shapes}, expected shapes that broadcast") from None
    kind = np.float32 if all(array.dtype in (np.float32, np.float16) for array in given) else np.float64
    return [np.broadcast_to(array, (*shape, 3)).reshape(-1, 3).astype(kind) for array in given], shape
