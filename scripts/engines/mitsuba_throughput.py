"""Measure how many evaluations of a material Mitsuba 3 makes per second, with all channels, at its best batch size.

`measured_throughput` times Mitsuba's own `measured` plugin on an RGL file, for scripts that time other things on the
same directions; `throughput_of` any material. The directions lie in memory before, the values after a call, and
nothing is sampled or rendered. Kernels are compiled before; each figure is the best of `repeats` calls.
"""

import time
from collections.abc import Sequence
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
from torch import Tensor

from homofact.rendering.mitsuba_bsdf import measured_bsdf, open_mitsuba

BATCHES = tuple(1 << k for k in range(12, 23, 2))


@dataclass(frozen=True)
class Throughput:
    """Millions of evaluations a second by batch size, on so many `threads`."""

    rates: dict[int, float]
    threads: int

    @property
    def batch(self) -> int:
        """The best batch size."""
        return max(self.rates, key=lambda count: self.rates[count])

    @property
    def best(self) -> float:
        """Millions a second at the best batch size."""
        return self.rates[self.batch]


def measured_throughput(
    file: Path,
    wi: Tensor,
    wo: Tensor,
    threads: int | None = None,
    batches: Sequence[int] = BATCHES,
    repeats: int = 15,
) -> Throughput:
    """`throughput_of` the RGL file's material in Mitsuba's variant `mitsuba_bsdf.VARIANT`.

    Raises MissingDependency where Mitsuba or LLVM is missing, BadInput where Mitsuba refuses the file.
    """
    mi = open_mitsuba()
    return throughput_of(mi, measured_bsdf(file), wi, wo, threads, batches, repeats)


def throughput_of(
    mi: Any,
    bsdf: Any,
    wi: Tensor,
    wo: Tensor,
    threads: int | None = None,
    batches: Sequence[int] = BATCHES,
    repeats: int = 15,
) -> Throughput:
    """Rates of a `mitsuba.BSDF` on `threads` threads (None: a thread a core) for unit directions (N, 3).

    The first rows of `wi` (the light) and `wo` (the viewer) are taken, from the beginning again where a batch is
    larger than N. The number of Dr.Jit's threads is what it was before when this returns.
    """
    dr = import_module("drjit")
    before = dr.thread_count()
    if threads is not None:
        dr.set_thread_count(threads)
    try:
        rates = {count: _rate(mi, dr, bsdf, wi, wo, count, repeats) for count in batches}
        return Throughput(rates, dr.thread_count())
    finally:
        dr.set_thread_count(before)


def _rate(mi: Any, dr: Any, bsdf: Any, wi: Tensor, wo: Tensor, count: int, repeats: int) -> float:
    def vectors(directions: Tensor) -> Any:
        rows = np.resize(directions.numpy().astype(np.float32), (count, 3))
        return mi.Vector3f(np.ascontiguousarray(rows.T))

    context, interaction = mi.BSDFContext(), dr.zeros(mi.SurfaceInteraction3f, count)
    interaction.wi, light = vectors(wo), vectors(wi)
    dr.eval(interaction, light)
    seconds = []
    for _ in range(repeats + 1):
        dr.sync_thread()
        began = time.perf_counter()
        dr.eval(bsdf.eval(context, interaction, light))
        dr.sync_thread()
        seconds.append(time.perf_counter() - began)
    return count / min(seconds[1:]) / 1e6
