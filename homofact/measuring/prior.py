"""Describe typical materials by statistics of published surrogates on the grid of `half_grid`.

A material is described by the logarithm of its brightness, L = log(f̄ + ε) with f̄ the mean of the channels, and by the
ratio of each channel to it, r = (f + ε)/(f̄ + ε). The ratio has a mean of 1 over the channels. It stays bounded where a
channel is 0, e.g. for colours outside the sRGB gamut.

The prior of L for an unknown material is a kernel density around the materials of the table:

    p(L) = mean over i of t(cᵢ, K),   cᵢ = μ + √(1 − h²) V zᵢ,   K = h² V Vᵀ + S,

Here μ is the mean of the materials, V their principal vectors times standard deviations, zᵢ their scores, and h the
width of the kernels. S is the covariance that the vectors do not describe: a standard deviation at each node, with the
correlations of `HalfGrid.correlation`. t is Student's distribution with `FREEDOM` degrees of freedom, so a material
unlike those of the table gets wider error bars. All cᵢ share K, so an update by samples needs one factorization. The
ratios have the mean 1, and one covariance of the same form for all channels. A Gaussian that does not change when
channels are exchanged has this form, so the prior works for any number of channels.

`scripts/planning/measuring_prior.py` makes the table `prior.json` of neural fits (Sztrajman et al. 2021, MIT).
The principal components of log-mapped BRDFs are those of Nielsen, Jensen and Ramamoorthi (2015, section 3).
"""

import base64
import json
import zlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from homofact.errors import BadInput
from homofact.measuring.half_grid import HalfGrid

VERSION = 1  # of the table's form
TABLE = Path(__file__).with_name("prior.json")
EPSILON = 1e-3
FREEDOM = 4.0
KERNEL, VECTORS, COLOUR_VECTORS = 0.7, 20, 6
LENGTHS = (0.15, 0.25, 0.7)
# The least variance of what the vectors do not describe.
LEAST = 0.01


@dataclass(frozen=True)
class BrdfPrior:
    """The statistics that the module's docstring defines.

    Attributes
    ----------
    grid : the grid of n nodes.
    mean : (n,) of L.
    vectors : (K, n) principal vectors of L times standard deviations.
    scores : (M, K) of the M materials, in standard deviations.
    rest : (n,) standard deviations of the remainder that the vectors do not describe.
    colour, colour_rest : (k, n) and (n,), the `vectors` and the `rest` of the ratios.
    widening : calibration of the error bars of `foretelling`, by name: factors on half-widths, and `psnr`, an offset in
        dB.
    """

    grid: HalfGrid
    mean: np.ndarray
    vectors: np.ndarray
    scores: np.ndarray
    rest: np.ndarray
    colour: np.ndarray
    colour_rest: np.ndarray
    widening: Mapping[str, float] = field(default_factory=dict)

    @classmethod
    def of(cls, grid: HalfGrid, logs: np.ndarray, ratios: np.ndarray) -> "BrdfPrior":
        """Return the statistics of M materials from their L (M, n) and ratios (M, C, n) at the nodes."""
        mean = logs.mean(0)
        left, deviations, right = np.linalg.svd((logs - mean) / np.sqrt(len(logs) - 1), full_matrices=False)
        kept = min(VECTORS, len(deviations))
        vectors = deviations[:kept, None] * right[:kept]
        # The direction of a vector is arbitrary, and differs between libraries.
        signs = np.sign(vectors[np.arange(kept), np.abs(vectors).argmax(1)])
        vectors, scores = signs[:, None] * vectors, signs * left[:, :kept] * np.sqrt(len(logs) - 1)
        apart = (ratios - 1).reshape(-1, grid.size)
        _, deviations, right = np.linalg.svd(apart / np.sqrt(len(apart)), full_matrices=False)
        colour = deviations[:COLOUR_VECTORS, None] * right[:COLOUR_VECTORS]
        return cls(
            grid, mean, vectors, scores, _rest((logs - mean).var(0, ddof=1), vectors), colour,
            _rest((apart**2).mean(0), colour),
        )  # fmt: skip

    @cached_property
    def centres(self) -> np.ndarray:
        """The centres cᵢ (M, n) of the kernels."""
        return self.mean + np.sqrt(1 - KERNEL**2) * self.scores @ self.vectors

    @cached_property
    def covariance(self) -> np.ndarray:
        """K (n, n)."""
        return KERNEL**2 * self.vectors.T @ self.vectors + self._smooth(self.rest)

    @cached_property
    def colour_covariance(self) -> np.ndarray:
        """The covariance (n, n) of the ratios."""
        return self.colour.T @ self.colour + self._smooth(self.colour_rest)

    def _smooth(self, deviations: np.ndarray) -> np.ndarray:
        return deviations[:, None] * self.grid.correlation(LENGTHS) * deviations

    def record(self) -> dict[str, Any]:
        """Return the table for JSON: the mean in 16 bits, all other arrays in 8 bits."""
        small = ("vectors", "scores", "rest", "colour", "colour_rest")
        arrays = {"mean": _packed(self.mean, np.int16)}
        arrays |= {name: _packed(getattr(self, name), np.int8) for name in small}
        return {
            "version": VERSION, "grid": list(self.grid.shape), "arrays": arrays, "widening": dict(self.widening),
        }  # fmt: skip

    @classmethod
    def from_record(cls, record: Mapping[str, Any]) -> "BrdfPrior":
        """Return the table of `record`."""
        arrays = {name: _unpacked(packed) for name, packed in record["arrays"].items()}
        return cls(HalfGrid(tuple(record["grid"])), widening=record["widening"], **arrays)


@lru_cache(maxsize=2)
def read_prior(path: Path = TABLE) -> BrdfPrior:
    """Return the package's table. Raises BadInput if it is missing, damaged or of another version."""
    try:
        stored = json.loads(path.read_text(encoding="utf-8"))
        if stored["version"] == VERSION:
            return BrdfPrior.from_record(stored)
    except (OSError, ValueError, TypeError, KeyError, zlib.error) as error:
        raise BadInput("missing or damaged", where=path, expected="the table of the package: install again") from error
    raise BadInput(where=path, found=f"version {stored['version']}", expected=f"{VERSION}: install again")


def _rest(variance: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    return np.sqrt((variance - (vectors**2).sum(0)).clip(LEAST))


def _packed(array: np.ndarray, kind: type[np.signedinteger[Any]]) -> dict[str, Any]:
    """Return an array as integers with a scale for each row; a vector has one scale."""
    rows = np.atleast_2d(array)
    scale = np.abs(rows).max(1) / np.iinfo(kind).max
    numbers = np.round(rows / scale[:, None]).astype(kind)
    text = base64.b64encode(zlib.compress(numbers.astype(numbers.dtype.newbyteorder("<")).tobytes(), 9)).decode()
    scales = [float(f"{each:.7g}") for each in scale]
    return {"type": numbers.dtype.name, "shape": list(array.shape), "scale": scales, "data": text}


def _unpacked(packed: Mapping[str, Any]) -> np.ndarray:
    kind = np.dtype(packed["type"]).newbyteorder("<")
    scale = np.array(packed["scale"])
    numbers = np.frombuffer(zlib.decompress(base64.b64decode(packed["data"])), kind).reshape(len(scale), -1)
    return (numbers * scale[:, None]).reshape(packed["shape"])
