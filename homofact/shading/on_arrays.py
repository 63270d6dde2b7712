"""Evaluate fits on NumPy arrays: interpret the shading program, or compile it for many pairs.

The program (`shading.program`) is also printed as shaders. The interpreter computes in the precision of the directions,
the compiled code in float32. Vectors of the program have at most four components, so more channels are evaluated four
at a time. This module does not import torch.
"""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from homofact.brdf.analytic.common import AnalyticModel
from homofact.factor.evaluation import Evaluation
from homofact.geometry.interpret import NUMPY, Value, interpret, value_of
from homofact.shading.encoded import plain
from homofact.shading.program import Program, program_of

if TYPE_CHECKING:
    from homofact.shading.compiled import Compiled

# Pairs of float32 in one call from which on they are worth the seconds that compiling takes.
MANY = 2**21
# Pairs that are interpreted at a time: their numbers stay in the caches.
_CHUNK = 2**13
_VECTOR = 4


class OnArrays(ABC):
    """The interface of objects that evaluate a fit with C `channels` on arrays."""

    channels: tuple[str, ...]

    def evaluate(self, wi: np.ndarray, wo: np.ndarray) -> np.ndarray:
        """Return BRDF values (N, C) in sr⁻¹, ≥ 0, without the cosine; 0 where a direction is under the horizon.

        `wi` and `wo` are unit vectors (N, 3), both float32 or both float64; the result has the same type. For float32
        and at least `MANY` pairs, compiled code reads the textures, which needs less memory.
        """
        above = ((wi[:, 2] >= 0) & (wo[:, 2] >= 0))[:, None]
        # What is below the horizon is evaluated in a safe place.
        wi, wo = (np.where(above, w, np.array((0, 0, 1), w.dtype)) for w in (wi, wo))
        return self._above(wi, wo) * above

    @abstractmethod
    def _above(self, wi: np.ndarray, wo: np.ndarray) -> np.ndarray:
        """Values (N, C), of directions (N, 3) of one floating type that are on or above the horizon."""


@dataclass(frozen=True)
class ModelOnArrays(OnArrays):
    """A model without textures."""

    channels: tuple[str, ...]
    model: AnalyticModel

    def _above(self, wi: np.ndarray, wo: np.ndarray) -> np.ndarray:
        # The formulas take arrays as they take tensors (`geometry.namespace`).
        return np.asarray(cast(Any, self.model).formula(wi, wo), wi.dtype)


@dataclass(frozen=True)
class TexturesOnArrays(OnArrays):
    """A product or a sum of products: textures as float64 `texels` (rows, columns, C), and their `evaluation`.

    `provenance` is for the comments of the program.
    """

    channels: tuple[str, ...]
    texels: tuple[np.ndarray, ...]
    evaluation: Evaluation
    provenance: Mapping[str, Any] = field(default_factory=dict)

    def compiled(self) -> "tuple[Compiled, ...]":
        """Return the compiled reflectances, of four channels each, that `evaluate` uses from `MANY` pairs on.

        Each takes float32 arrays (N, 3) above the horizon (`evaluate_array`); the first one compiles, in seconds.
        """
        return self._compiled

    def _above(self, wi: np.ndarray, wo: np.ndarray) -> np.ndarray:
        values = np.empty((len(wi), len(self.channels)), wi.dtype)
        if len(wi) >= MANY and wi.dtype == np.float32:
            single = [np.ascontiguousarray(w) for w in (wi, wo)]
            for group, part in zip(self._groups, self._compiled, strict=True):
                values[:, group] = part.evaluate_array(*single)
            return values
        texels = [[np.ascontiguousarray(own[..., g], wi.dtype) for own in self.texels] for g in self._groups]
        for begin in range(0, len(wi), _CHUNK):
            rows = slice(begin, begin + _CHUNK)
            for group, program, textures in zip(self._groups, self._programs, texels, strict=True):
                for channel, column in enumerate(_run(program, textures, wi[rows], wo[rows]), group.start):
                    values[rows, channel] = column
        return values

    @cached_property
    def _groups(self) -> list[slice]:
        count = len(self.channels)
        return [slice(begin, min(begin + _VECTOR, count)) for begin in range(0, count, _VECTOR)]

    @cached_property
    def _programs(self) -> list[Program]:
        made = []
        for group in self._groups:
            part = TexturesOnArrays(self.channels[group], (), self.evaluation.of_channels(group), self.provenance)
            made.append(program_of(part, [plain(own[..., group]) for own in self.texels]))
        return made

    @cached_property
    def _compiled(self) -> "tuple[Compiled, ...]":
        # numba alone takes most of a second to be imported.
        from homofact.shading.compiled import compiled_program

        pairs = zip(self._groups, self._programs, strict=True)
        return tuple(
            compiled_program(program, [own[..., group].astype(np.float32) for own in self.texels])
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
