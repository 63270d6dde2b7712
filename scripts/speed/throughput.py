"""Measure evaluations per second of two textures, of the NBRDF network, of the source and of a memory copy.

    python scripts/speed/throughput.py [--data FOLDER] [--short]

Everything goes from unit ωi and ωo to f in three channels, on the same cosine-weighted directions, in one run, on all
cores, each way at its best batch size; a round times every way once, and the best of the rounds counts. The ways:

    textures, compiled     the shading program in vector instructions (`homofact.shading.compiled`), float32
    textures, torch        `Factorization.evaluate` in float32
    network, torch         `NeuralBrdf.evaluate` in float32: the published network (Sztrajman et al. 2021), 675 numbers
    network alone, torch   without the change of coordinates
    network, compiled      the same network by the same compiler as the textures (`network_program`)
    source                 the material's own reflectance in float32: an RGL table, or the model's formula
    Mitsuba's measured     the same RGL file, by Mitsuba 3 where it is installed (f cosθ)
    copy                   36 bytes moved a pair, 24 read and 12 written, as every way must; mostly in the caches

The network is trained here on the same samples, with its paper's loss and with the Cole error, and the better by the
held-out Cole error counts.
"""

import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch

from homofact.brdf.neural import NeuralBrdf, network_input
from homofact.brdf.reflectance import Reflectance
from homofact.brdf.source import Source, open_source
from homofact.containers.formats import FORMATS
from homofact.errors import HomofactError
from homofact.evaluation.compare import fit_and_measure, held_out_samples
from homofact.evaluation.machine import machine
from homofact.evaluation.metrics import measure
from homofact.exporting.exported import exported
from homofact.factor.factorization import Factorization
from homofact.geometry.directions import draw_cosine_weighted
from homofact.methods.search import Search
from homofact.shading.compiled import Compiled, compiled, compiled_program

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from scripts.engines.mitsuba_throughput import measured_throughput
from scripts.shared.harness import data_folder, figure, finish, markdown, parser_of
from scripts.speed.network_program import LOSSES, network_program, train

RGL, MATERIAL, HELD_OUT, TARGET = "vch_golden_yellow_rgb.bsdf", "material:lafortune-blue-paint", 0.2, 4.0
BATCHES = tuple(1 << k for k in range(10, 21, 2))
TEXTURES, NETWORK = "textures, compiled", "network, torch"


@dataclass(frozen=True)
class Way:
    """One way to evaluate: what prepares a batch of directions for it and gives the function to time."""

    name: str
    prepare: Callable[[np.ndarray, np.ndarray], Callable[[], Any]]
    error: float | None
    nbytes: int | None


def of_torch(reflectance: Reflectance) -> Callable[[np.ndarray, np.ndarray], Callable[[], Any]]:
    """Float32 tensors in, float32 tensors out."""

    def prepare(wi: np.ndarray, wo: np.ndarray) -> Callable[[], Any]:
        a, b = torch.from_numpy(wi), torch.from_numpy(wo)
        return lambda: reflectance.evaluate(a, b)

    return prepare


def of_compiled(fast: Compiled) -> Callable[[np.ndarray, np.ndarray], Callable[[], Any]]:
    """Float32 arrays in, values into an array that is there."""

    def prepare(wi: np.ndarray, wo: np.ndarray) -> Callable[[], Any]:
        out = np.empty((len(wi), len(fast.channels)), np.float32)
        return lambda: fast.evaluate_array(wi, wo, out)

    return prepare


def network_alone(network: NeuralBrdf) -> Callable[[np.ndarray, np.ndarray], Callable[[], Any]]:
    """The layers on coordinates that are there already."""
    pairs = zip(network.weights, network.biases, strict=True)
    layers = [(torch.as_tensor(w).float(), torch.as_tensor(b).float()) for w, b in pairs]

    def run(x: torch.Tensor) -> torch.Tensor:
        for weight, bias in layers[:-1]:
            x = torch.addmm(bias, x, weight).relu_()
        return torch.addmm(layers[-1][1], x, layers[-1][0]).expm1_().clamp_min_(0)

    def prepare(wi: np.ndarray, wo: np.ndarray) -> Callable[[], Any]:
        x = network_input(torch.from_numpy(wi), torch.from_numpy(wo)).contiguous()
        return lambda: run(x)

    return prepare


def copy(wi: np.ndarray, wo: np.ndarray) -> Callable[[], Any]:
    """24 bytes read and 12 written a pair, by all of torch's threads."""
    a, b, out = torch.from_numpy(wi), torch.from_numpy(wo), torch.empty(len(wi), 3)
    return lambda: torch.add(a, b, out=out)


def rates(ways: Sequence[Way], batches: Sequence[int], rounds: int, least: float) -> dict[str, tuple[float, int]]:
    """(millions a second, batch size) at the best of each way; a measurement takes at least `least` seconds."""
    wi, wo = (w.float().numpy() for w in draw_cosine_weighted(max(batches), torch.Generator().manual_seed(0)))
    best: dict[str, tuple[float, int]] = {}
    calls = {(way.name, n): way.prepare(wi[:n], wo[:n]) for way in ways for n in batches}
    for call in calls.values():
        call()
    for _ in range(rounds):
        for (name, count), call in calls.items():
            times, began, seconds = 0, time.perf_counter(), 0.0
            while seconds < least:
                call()
                times += 1
                seconds = time.perf_counter() - began
            best[name] = max(best.get(name, (0.0, 0)), (times * count / seconds / 1e6, count))
    return best


def ways_of(source: Source, effort: str | float, steps: int) -> tuple[list[Way], str]:
    """The ways on one source, and words on what was fitted."""
    settings = Search(effort=effort, epsilon=source.default_epsilon)
    row = fit_and_measure(source, settings, HELD_OUT)
    fitted = row.factorization
    assert isinstance(fitted, Factorization)
    transform = fitted.transform
    samples = source.samples.split(HELD_OUT, settings.seed)[0]
    held = held_out_samples(source, HELD_OUT, settings.seed)
    networks = {loss: train(samples, transform, loss, steps) for loss in LOSSES}
    errors = {loss: measure(network, held, transform).log_mse for loss, network in networks.items()}
    loss = min(errors, key=lambda name: errors[name])
    network = networks[loss]
    found = measure(fitted, held, transform).log_mse
    ways = [
        Way(TEXTURES, of_compiled(compiled(fitted)), found, fitted.nbytes),
        Way("textures, torch", of_torch(fitted), found, fitted.nbytes),
        Way(NETWORK, of_torch(network), errors[loss], network.nbytes),
        Way("network alone, torch", network_alone(network), errors[loss], network.nbytes),
        Way("network, compiled", of_compiled(compiled_program(network_program(network), [])), errors[loss], None),
        Way("source", of_torch(source.reflectance), 0.0 if source.kind != "measurement" else None, None),
        Way("copy", copy, None, None),
    ]
    cost = exported(fitted, FORMATS["exr16"]).cost
    words = (
        f"{source.name}: {len(fitted.terms)} textures of {settings.size}², {cost.fetches} fetches and {cost.total}"
        f" operations ({cost.scalar} on scalars) in the shader; ε = {transform.epsilon:g}, A ="
        f" {', '.join(map(figure, transform.mean.tolist()))} sr⁻¹. Network: {steps} steps; held-out Cole error"
        f" {', '.join(f'{figure(error)} ({name})' for name, error in errors.items())}."
    )
    return ways, words


def main(arguments: Sequence[str] | None = None) -> int:
    """Print a table a material."""
    parser = parser_of(__doc__, "data", "out")
    options = parser.parse_args(arguments)
    batches, rounds, least, effort, steps = (
        ((1 << 10, 1 << 12), 1, 0.002, 1.0, 200) if options.short else (BATCHES, 7, 0.05, "normal", 20_000)
    )
    file = data_folder(options.data) / "rgl" / RGL
    if not file.is_file():
        print(f"skipped {file.stem}: no {file} (--data FOLDER or HOMOFACT_DATA names it)", file=sys.stderr)
    parts = []
    for text in (str(file),) * file.is_file() + (MATERIAL,):
        source = open_source(text)
        ways, words = ways_of(source, effort, steps)
        best = rates(ways, batches, rounds, least)
        rows = [
            (
                way.name,
                "–" if way.nbytes is None else way.nbytes,
                "–" if way.error is None else figure(way.error),
                figure(best[way.name][0]),
                best[way.name][1],
                figure(best[way.name][0] / best[NETWORK][0]),
            )
            for way in ways
        ]
        if text == str(file):
            rows.append(mitsuba_row(file, batches, rounds, best[NETWORK][0]))
        header = ("way", "bytes", "Cole error, held out", "M/s", "at a batch of", "times the network in torch")
        ratio = best[TEXTURES][0] / best[NETWORK][0]
        parts += [
            words,
            markdown(header, rows),
            f"Two textures, compiled, over the network in torch: {figure(ratio)}; expected at least {figure(TARGET)}.",
        ]
    return finish([*parts, machine()], options)


def mitsuba_row(file: Path, batches: Sequence[int], rounds: int, network: float) -> tuple[Any, ...]:
    """Mitsuba's own plugin on the same directions, or why there is none."""
    wi, wo = draw_cosine_weighted(max(batches), torch.Generator().manual_seed(0))
    try:
        found = measured_throughput(file, wi, wo, batches=batches, repeats=rounds)
    except HomofactError as error:
        return (f"Mitsuba's measured: {error}", "–", "–", "–", "–", "–")
    return (
        "Mitsuba's measured",
        file.stat().st_size,
        "–",
        figure(found.best),
        found.batch,
        figure(found.best / network),
    )


if __name__ == "__main__":
    sys.exit(main())
