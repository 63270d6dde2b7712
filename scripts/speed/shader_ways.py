"""Define the shaders that `shader_throughput` times, and the directions at which it evaluates them.

Each way is a shading program with the textures that it reads, fitted to the same samples, beside the reflectance in
Python that it must equal.
"""

import math
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch

from homofact.brdf.analytic.ggx_fit import fit_ggx
from homofact.brdf.reflectance import Reflectance
from homofact.brdf.source import Source
from homofact.containers.formats import FORMATS
from homofact.errors import BadInput
from homofact.evaluation.compare import held_out_samples
from homofact.evaluation.metrics import measure
from homofact.exporting.exported import Exported, exported
from homofact.factor.factorization import Factorization
from homofact.geometry.expression import variable
from homofact.methods.mccool import McCool
from homofact.methods.search import Search
from homofact.shading.encoding import Encoded
from homofact.shading.program import Program

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from scripts.speed.ggx_program import ggx_program
from scripts.speed.network_program import LOSSES, network_program, train

HELD_OUT = 0.2
# WebGL 2's names of the storages that it always has.
STORED = {"float32": "RGBA32F", "float16": "RGBA16F", "unorm8": "RGBA8"}
NAMED = {name: form for name, form in FORMATS.items() if form.storage in STORED}
# Relative differences that float32 may leave outside of lookups, in whatever order a compiler adds.
ROUNDING = 1e-3


@dataclass(frozen=True)
class Way:
    """One way to evaluate: its program with its textures, and the reflectance that it must equal.

    `error` is the Cole error on held-out samples and `nbytes` what is stored, None for the empty shader; `allowed` is
    the relative difference that the machine's arithmetic may leave.
    """

    key: str
    name: str
    program: Program
    textures: tuple[Encoded, ...]
    reflectance: Reflectance
    error: float | None
    nbytes: int | None
    allowed: float = ROUNDING


@dataclass(frozen=True)
class Sum:
    """What the empty shader gives: ωi + ωo, the least that needs both directions."""

    channels: tuple[str, ...] = ("R", "G", "B")
    nbytes: int = 0
    fetches: int = 0

    def evaluate(self, wi: torch.Tensor, wo: torch.Tensor) -> torch.Tensor:
        """ωi + ωo, (N, 3)."""
        return wi + wo


def hashed(v: np.ndarray) -> np.ndarray:
    """pcg4d of Jarzynski and Olano (2020, "Hash functions for GPU rendering"): (N, 4) uint32 from (N, 4) uint32."""
    x, y, z, w = (v.astype(np.uint32) * np.uint32(1664525) + np.uint32(1013904223)).T
    for last in (False, True):
        x = x + y * w
        y = y + z * x
        z = z + x * y
        w = w + y * z
        if not last:
            x, y, z, w = (part ^ (part >> np.uint32(16)) for part in (x, y, z, w))
    return np.stack((x, y, z, w), 1)


def directions(count: int, seed: int = 0) -> tuple[torch.Tensor, torch.Tensor]:
    """(ωi, ωo), (count, 3) float64: the page's pairs of these numbers and this seed, above the horizon all over it.

    Two numbers of a pair's hash are a point of the square, and that a point of the octahedron's upper half, brought to
    length 1: no sines in the shader, and nearly even on the hemisphere.
    """
    v = np.zeros((count, 4), np.uint32)
    v[:, 0], v[:, 1], v[:, 2], v[:, 3] = np.arange(count), seed, 1, 2
    a = ((hashed(v) >> np.uint32(9)) + 0.5) * (2 / 2**23) - 1
    pair = []
    for u, t in ((a[:, 0], a[:, 1]), (a[:, 2], a[:, 3])):
        x, y = (u + t) / 2, (u - t) / 2
        w = np.stack((x, y, 1 - np.abs(x) - np.abs(y)), 1)
        pair.append(torch.from_numpy(w / np.linalg.norm(w, axis=1, keepdims=True)))
    return pair[0], pair[1]


def sampler_bound(made: Exported) -> float:
    """The relative difference that a sampler may leave which divides the way between texels into 256 steps.

    Along each axis of a lookup the logarithm then moves by at most the largest difference of neighbouring texels over
    256, and what an 8-bit texture returns by half a step of its own.
    """
    total = 0.0
    assert isinstance(made.stored, Factorization)
    for term, texture in zip(made.stored.terms, made.textures, strict=True):
        texels = texture.decoded().numpy()
        across, along = (float(np.abs(np.diff(texels, axis=axis)).max(initial=0)) for axis in (1, 0))
        own = float(texture.scale.max()) / 510 if texture.storage == "unorm8" else 0.0
        total += term.projection.lookups * ((across + along) / 256 + own)
    return ROUNDING + math.expm1(total)


def of_textures(key: str, name: str, made: Exported, error: float) -> Way:
    """A fit as the export stores it."""
    stored, bound = made.stored, sampler_bound(made)
    return Way(key, name, made.program, made.textures, stored, error, made.cost.nbytes, bound)


def ways_of(source: Source, formats: Sequence[str], settings: Search, steps: int) -> tuple[list[Way], str]:
    """The ways on one source, the empty shader first, and words on what was fitted.

    Raises BadInput for a source of other than three channels.
    """
    if len(source.samples.channels) != 3:
        found = ", ".join(source.samples.channels)
        raise BadInput(where=source.name, found=f"the channels {found}", expected="the three that the network has")
    samples = source.samples.split(HELD_OUT, settings.seed)[0]
    held = held_out_samples(source, HELD_OUT, settings.seed)
    fitted = settings.fit(samples).factorization
    transform = fitted.transform
    mccool = McCool(epsilon=settings.epsilon, size=settings.size, seed=settings.seed).fit(samples).factorization
    networks = [train(samples, transform, loss, steps) for loss in LOSSES]
    errors = [measure(network, held, transform).log_mse for network in networks]
    network = networks[errors.index(min(errors))]
    ggx = fit_ggx(samples, 1, settings.seed)[0]

    def error(reflectance: Reflectance) -> float:
        return measure(reflectance, held, transform).log_mse

    nothing = Program((), variable("wi", 3) + variable("wo", 3), (), ("R", "G", "B"), ("the directions alone",))
    ways = [Way("empty", "empty: the directions alone", nothing, (), Sum(), None, None)]
    for form in formats:
        for key, name, fit in (("textures", "two textures", fitted), ("mccool", "McCool's two textures", mccool)):
            made = exported(fit, FORMATS[form])
            storage = STORED[FORMATS[form].storage]
            ways.append(of_textures(f"{key}-{form}", f"{name}, {storage}", made, error(made.stored)))
    ways += [
        Way("network", "NBRDF network", network_program(network), (), network, min(errors), network.nbytes),
        Way("ggx", "GGX, one lobe", ggx_program(ggx), (), ggx, error(ggx), ggx.nbytes),
    ]
    loss = LOSSES[errors.index(min(errors))]
    words = (
        f"{source.name}: {len(fitted.terms)} textures of {settings.size}² found by the search, effort"
        f" {settings.effort}, McCool's of the same size; the network trained for {steps} steps with the loss {loss};"
        f" one GGX lobe over a diffuse base; errors with ε = {transform.epsilon:g}."
    )
    return ways, words
