"""Measure the import time and the speed of `homofact.runtime`, compared with torch.

Imports are timed in processes of their own, from the first statement to the last; the fastest of `--repeats` counts,
since other work on a machine can only add. Pairs are uniform on the hemisphere.

    python scripts/speed/runtime_numbers.py [--repeats 5] [--pairs 262144] [--out FILE.md]
"""

import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import torch

from homofact.brdf.materials import material
from homofact.brdf.sampling import sample_model
from homofact.evaluation.machine import machine
from homofact.geometry.directions import draw_uniform
from homofact.methods.mccool import McCool
from homofact.shading.on_arrays import TexturesOnArrays

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from scripts.shared.harness import finish, markdown, parser_of

IMPORTED = ("numpy", "homofact.runtime", "numba", "torch")
CLOCKS = "time.perf_counter(), time.process_time()"
TIMED = f"import time; a, b = {CLOCKS}; import {{}}; c, d = {CLOCKS}; print(c - a, d - b)"


def import_seconds(name: str, repeats: int) -> tuple[str, ...]:
    """Seconds of one import in a fresh process, by the wall and of the processor, the least of several each."""
    command = [sys.executable, "-c", TIMED.format(name)]
    found = [subprocess.run(command, capture_output=True, text=True, check=True).stdout for _ in range(repeats)]
    return tuple(f"{min(column):.2f}" for column in zip(*(map(float, each.split()) for each in found), strict=True))


def seconds(work: Callable[[], object], repeats: int) -> float:
    """Seconds of some work, the fastest of several."""
    found = []
    for _ in range(repeats):
        began = time.perf_counter()
        work()
        found.append(time.perf_counter() - began)
    return min(found)


def main(arguments: list[str] | None = None) -> int:
    """Print both tables and write them."""
    parser = parser_of(__doc__, "out")
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--pairs", type=int, default=2**18)
    given = parser.parse_args(arguments)
    if given.short:
        given.repeats, given.pairs = 1, 2**10
    imports = [(f"`import {name}`", *import_seconds(name, given.repeats)) for name in IMPORTED]
    fit = McCool(size=16).fit(sample_model(material("lafortune-blue-paint").model, 2000, "lobe", 0)).factorization
    terms = tuple(fit.textures)
    assert fit.evaluation is not None
    own = TexturesOnArrays(fit.channels, tuple(each.texels for each in terms), fit.evaluation)
    wi, wo = draw_uniform(given.pairs, torch.Generator().manual_seed(0))
    arrays = [w.numpy() for w in (wi, wo)]
    singles = [w.astype(np.float32) for w in arrays]
    (fast,) = own.compiled()
    first = seconds(lambda: fast.evaluate_array(*singles), 1)
    ways: list[tuple[str, Callable[[], object]]] = [
        ("torch, float64", lambda: fit.evaluate(wi, wo)),
        ("NumPy, float64", lambda: own.evaluate(*arrays)),
        ("NumPy, float32", lambda: own.evaluate(*singles)),
        ("compiled, float32", lambda: fast.evaluate_array(*singles)),
    ]
    rows = [(name, f"{given.pairs / seconds(work, given.repeats) / 1e6:.2f}") for name, work in ways]
    text = "\n\n".join(
        (
            machine(),
            markdown(("import", "seconds", "of the processor"), imports),
            f"McCool's {len(terms)} textures of 16², {fit.fetches} fetches, {given.pairs} pairs; the first compiled"
            f" evaluation takes {first:.1f} s.",
            markdown(("way", "million pairs a second"), rows),
        )
    )
    return finish(text, given)


if __name__ == "__main__":
    sys.exit(main())
