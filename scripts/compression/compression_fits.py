"""Define the compared methods that homofact fits itself, and the proxies to which it fits them.

Budgets of bytes that give the structure search the same textures, samples and effort have the same search: it is run
once for them (`SharedSearch`), and its seconds count for each. Nothing else differs from fitting them one by one.
"""

import hashlib
import math
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any
from unittest import mock

import torch
from torch import Tensor

from homofact.brdf.analytic.common import RGB, AnalyticModel
from homofact.brdf.reflectance import Reflectance
from homofact.brdf.samples import Samples
from homofact.brdf.sampling import sample_model
from homofact.brdf.source_names import DEFAULT_COUNT, DEFAULT_SCHEME
from homofact.errors import HomofactError
from homofact.methods import search_fit
from homofact.methods.mccool import McCool
from homofact.methods.method import Method
from homofact.methods.models import Ggx, Nbrdf, Npf
from homofact.methods.search import Search
from homofact.methods.structure_search import SearchOutcome, StructureSearch

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from scripts.compression.compression_protocol import Shown, kept, scores, shown, surroundings
from scripts.data.published_fits import PUBLISHED, published

READINGS = ("nbrdf", "npf", "nps")
METHODS: dict[str, Method] = {
    "GGX × 1": Ggx(),
    "GGX × 2": Ggx(lobes=2),
    "McCool 3 KiB": McCool(size=11),
    "McCool 12 KiB": McCool(size=22),
    "ours 3.2 KiB": Search(bytes=3276),
    "ours 12 KiB": Search(bytes=12288),
    "ours 48 KiB": Search(bytes=49152),
    "NPF, fitted here": Npf(),
    "NBRDF, trained here": Nbrdf(),
}
# What is fitted where nothing else is asked for: the last two take a minute a reading.
DEFAULT_METHODS = tuple(METHODS)[:-2]


@dataclass(frozen=True)
class Mean:
    """The mean of readings, to be fitted."""

    readings: tuple[AnalyticModel, ...]
    isotropic: bool = True
    channels: tuple[str, ...] = RGB
    nbytes: int = 0
    fetches: int = 0

    def evaluate(self, wi: Tensor, wo: Tensor) -> Tensor:
        """Their mean (N, 3) in sr⁻¹."""
        return torch.stack([each.evaluate(wi, wo).to(torch.float64) for each in self.readings]).mean(0)


@dataclass
class SharedSearch:
    """Outcomes of structure searches by what was asked, with the seconds that each took; `saved` by the last fit."""

    known: dict[tuple[Any, ...], tuple[SearchOutcome, float]] = field(default_factory=dict)
    saved: float = 0.0

    @contextmanager
    def during(self) -> Iterator[None]:
        """Searches of the fit inside ask here first."""
        self.saved, shared = 0.0, self

        class Remembering(StructureSearch):
            def run(self, textures: int, candidates: tuple[tuple[str, ...], ...]) -> SearchOutcome:
                data = hashlib.sha256()
                for part in self._materials.digested():
                    data.update(part.numpy().tobytes())
                asked = (data.hexdigest(), repr(self._settings), self._budget.granted, textures, candidates)
                if asked in shared.known:
                    outcome, shared.saved = shared.known[asked]
                    return outcome
                began = time.perf_counter()
                outcome = super().run(textures, candidates)
                shared.known[asked] = outcome, time.perf_counter() - began
                return outcome

        with mock.patch.object(search_fit, "StructureSearch", Remembering):
            yield


def fitted(
    reading: AnalyticModel | Mean, method: Method, shared: SharedSearch, seed: int = 0
) -> tuple[Reflectance, float]:
    """(the fit of a reading by a method, seconds, those of a shared search included)."""
    return fitted_to(sample_model(reading, DEFAULT_COUNT, DEFAULT_SCHEME, seed), method, shared, seed)


def fitted_to(samples: Samples, method: Method, shared: SharedSearch, seed: int = 0) -> tuple[Reflectance, float]:
    """(the fit of samples by a method, seconds, those of a shared search included)."""
    began = time.perf_counter()
    with shared.during():
        found = replace(method, seed=seed).fit(samples)
    return found.factorization, time.perf_counter() - began + shared.saved


@dataclass(frozen=True)
class Entry:
    """One method on one material: fitted to `readings` (the published one: itself), judged by another `by`."""

    material: str
    label: str
    readings: tuple[str, ...]
    by: str
    shown: Shown
    scores: dict[str, float]


def wanted(labels: Sequence[str], means: Sequence[str]) -> list[tuple[str, tuple[str, ...]]]:
    """(method, what it is fitted to): each reading, and for those of `means` the mean of each two."""
    both = [tuple(kind for kind in READINGS if kind != by) for by in READINGS]
    singles = [(label, (reading,)) for label in labels for reading in READINGS]
    return singles + [(label, two) for label in means for two in both]


def name_of(label: str, readings: Sequence[str]) -> str:
    """What the cache calls a fit."""
    return f"{label} of {'+'.join(readings)}"


def entries(
    material: str, fits: Sequence[tuple[str, tuple[str, ...]]], cache_folder: Path, folder: Path
) -> Iterator[Entry]:
    """Everything on one material: what is published, and the fits."""
    sources = {kind: published(kind, material, folder) for kind in PUBLISHED}
    here = {
        kind: kept(cache_folder, material, kind, lambda kind=kind: shown(sources[kind], folder, math.nan))
        for kind in PUBLISHED
    }
    coverage, shared = surroundings(folder)[0].coverage, SharedSearch()
    for kind in PUBLISHED:
        for by in READINGS:
            if by != kind:
                yield Entry(material, kind, (kind,), by, here[kind], scores(here[by], here[kind], coverage))
    for label, readings in fits:

        def make(label: str = label, readings: tuple[str, ...] = readings) -> Shown:
            alone = len(readings) == 1
            reading = sources[readings[0]] if alone else Mean(tuple(sources[kind] for kind in readings))
            fit, seconds = fitted(reading, METHODS[label], shared)
            return shown(fit, folder, seconds)

        try:
            found = kept(cache_folder, material, name_of(label, readings), make)
        except HomofactError as error:
            print(f"{material}, {name_of(label, readings)}: {error}", file=sys.stderr)
            continue
        for by in READINGS:
            yield Entry(material, label, readings, by, found, scores(here[by], found, coverage))
