"""Load the real measurements, list the methods to compare, and make one fit and measure its cost."""

import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from homofact.brdf.formats.nbrdf import load, material_names
from homofact.brdf.reflectance import Reflectance
from homofact.brdf.samples import Samples
from homofact.brdf.scattered import made_of_samples
from homofact.brdf.source import Source, open_source
from homofact.brdf.symmetry import ring_numbers
from homofact.brdf.tilt import Straightened
from homofact.methods.mccool import McCool
from homofact.methods.method import Method
from homofact.methods.models import Ggx, Nbrdf, Npf
from homofact.methods.search import Search
from homofact.methods.separable_fit import separable_of
from homofact.methods.svd import Svd
from homofact.shading.cost import cost_of

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from scripts.compression.compression_fits import SharedSearch, fitted_to
from scripts.compression.published_programs import program_of_any
from scripts.data.hybrid_fits import hybrid_file, read_hybrid
from scripts.shared.harness import CORNELL

RGL, CAR_PAINT, PAINTS, TAPE = "RGL", "car paint", "Cornell", "tape"
RAW, STRAIGHT, SAMPLES, RINGS = "raw", "straightened", "left-out samples", "left-out rings"
NBRDF, HYBRID = "NBRDF, published", "hybrid, published"
PUBLISHED = (NBRDF, HYBRID)
BOUND = "its own reciprocal mean"
BUDGETS = {"1 KiB": 1024, "3.2 KiB": 3276, "6 KiB": 6144, "12 KiB": 12288}
OURS = tuple(f"ours {size}" for size in BUDGETS)
METHODS: dict[str, Method] = {
    "GGX × 1": Ggx(),
    "GGX × 2": Ggx(lobes=2),
    "McCool 3 KiB": McCool(size=11),
    "McCool 12 KiB": McCool(size=22),
    # Each the better one at its bytes of in-out and half-difference matrices.
    "SVD 3 KiB": Svd(textures=3, size=9),
    "SVD 12 KiB": Svd(textures=1, size=22, coordinates="half-diff"),
    "NPF, fitted here": Npf(),
    "NBRDF, trained here": Nbrdf(),
    **{label: Search(bytes=nbytes) for label, nbytes in zip(OURS, BUDGETS.values(), strict=True)},
}
LABELS = (BOUND, *PUBLISHED, *METHODS)
NONE_PUBLISHED = "none was published"
HELD_OUT, SEED = 0.2, 0
_EVERY = 3  # which of the inner rings are left out


@dataclass(frozen=True)
class Subject:
    """A measurement: its name in the tables, its file, and what kind of data it is."""

    name: str
    path: Path
    group: str

    def opened(self, way: str, count: int) -> Source:
        """The source with the tilt left in (`RAW`), or as homofact opens it."""
        return open_source(str(self.path), count=count, calibrate=["none" if way == RAW else "auto"])


def subjects(folder: Path) -> list[Subject]:
    """The real measurements that are in the folder, in the order of the tables."""
    files = [(path.stem.removesuffix("_rgb"), path, RGL) for path in sorted((folder / "rgl").glob("*_rgb.bsdf"))]
    files.append(("carpaint_red", folder / "mdl" / "carpaint_red.mbsdf", CAR_PAINT))
    files += [(name, folder / "cornell" / f"{name}.brdf", PAINTS) for name in CORNELL]
    files.append(("retro-3M-jaune", folder / "retro" / "retro-3M-jaune.dat", TAPE))
    return [Subject(*each) for each in files if each[1].is_file()]


@dataclass(frozen=True)
class Problem:
    """What methods are fitted to, one `way`: a `source` to evaluate anywhere, or `test` samples to judge by."""

    way: str
    source: Source
    train: Samples
    test: Samples | None = None


def problems(subject: Subject, count: int) -> Iterator[Problem]:
    """The ways that a measurement is fitted: raw and, where a tilt is undone, straightened; or by what is left out."""
    source = subject.opened(RAW, count)
    train, test = source.samples.split(HELD_OUT, SEED)
    if not made_of_samples(source.reflectance):
        yield Problem(RAW, source, train)
        straight = subject.opened(STRAIGHT, count)
        if isinstance(straight.reflectance, Straightened):
            yield Problem(STRAIGHT, straight, straight.samples.split(HELD_OUT, SEED)[0])
        return
    yield Problem(SAMPLES, source, train, test.rotated_at_random(SEED))
    rings = ring_numbers(source.samples.wi)
    if rings is not None:
        rank, number = rings
        out = (rank % _EVERY == 1) & (rank < number - 1)
        samples = source.samples
        yield Problem(RINGS, source, samples.select(~out), samples.select(out).rotated_at_random(SEED))


def published(label: str, subject: Subject, folder: Path, shaders: Path | None) -> Reflectance | str:
    """What others published of a material, or why there is nothing."""
    if subject.group != RGL:
        return NONE_PUBLISHED
    if label == NBRDF:
        weights = folder / "nbrdf" / "rgl_nbrdf_weights.npz"
        there = weights.is_file() and subject.name in material_names(weights)
        return load(f"{weights}#{subject.name}") if there else "its weights are not at hand"
    shader = None if shaders is None else hybrid_file(shaders, subject.name)
    return "its shaders are not at hand" if shader is None or not shader.is_file() else read_hybrid(shader)


def fitted_here(method: Method, problem: Problem, shared: SharedSearch) -> tuple[Reflectance, float]:
    """(a fit by a method, its seconds): of the training samples, but of a source itself where that serves a method.

    A matrix resampled from samples holds a sharp highlight's largest value over a whole texel; a decomposition is
    given the source's own values where it can be asked.
    """
    if isinstance(method, Svd) and problem.test is None:
        began = time.perf_counter()
        fit = separable_of(
            problem.source.reflectance,
            method.textures,
            method.size,
            map=method.map,
            parameterization=method.coordinates,
            decomposition=method.chosen_decomposition,
            weighted=True,
            isotropic=True,
        )
        return fit, time.perf_counter() - began
    return fitted_to(problem.train, replace(method, epsilon=problem.source.default_epsilon), shared, SEED)


def cost(fit: Reflectance, seconds: float | None) -> dict[str, Any]:
    """Bytes, operations of one evaluation (in all, and each component by itself), fetches, seconds of the fit."""
    found = cost_of(program_of_any(fit)[0], fit.nbytes)
    return {
        "bytes": fit.nbytes,
        "operations": found.total,
        "scalar operations": found.scalar,
        "fetches": found.fetches,
        "seconds": seconds,
    }
