"""The same samples, settings and seed give the same bits, however busy the machine is and however many threads work.

Fits run in processes of their own: alone, beside others that keep every core busy, and with another number of threads.
"""

import hashlib
import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from homofact.brdf.materials import material
from homofact.brdf.sampling import sample_model
from homofact.methods.cole import Cole
from homofact.methods.mccool import McCool
from homofact.methods.method import Method
from homofact.methods.nmf import Nmf
from homofact.methods.search import Search
from homofact.methods.svd import Svd

pytestmark = pytest.mark.slow
ROOT = Path(__file__).resolve().parents[2]
FITS: dict[str, Method] = {
    "search": Search(textures=2, size=8, search_samples=800, restarts=2, epsilon=1e-5, effort="quick"),
    # An effort that ends it half way: this is where a clock would show.
    "search, cut short": Search(textures=3, size=10, search_samples=800, epsilon=1e-5, effort=40.0),
    "cole": Cole(textures=2, size=8, search_samples=800, restarts=2, epsilon=1e-5, search_size=6),
    "mccool": McCool(size=8, epsilon=1e-5),
    "svd": Svd(textures=2, size=8, epsilon=1e-5),
    "nmf": Nmf(textures=2, size=8, epsilon=1e-5),
}


def fingerprints() -> dict[str, str]:
    """A hash of every texture's bytes, of the projections and of λ, by the fit's name."""
    samples = sample_model(material("lafortune-blue-paint").model, 1500)
    result = {}
    for name, method in FITS.items():
        fitted: Any = method.fit(samples).factorization
        digest = hashlib.sha256()
        for term in fitted.terms:
            textures = [term.texture] if hasattr(term, "texture") else list(term.textures)
            for tensor in (*textures, *([term.projection.matrix] if hasattr(term, "projection") else [term.signs])):
                digest.update(str(tuple(tensor.shape)).encode())
                digest.update(np.ascontiguousarray(tensor).tobytes())
        digest.update(json.dumps(fitted.provenance.get("smoothing")).encode())
        result[name] = digest.hexdigest()
    return result


def start(threads: int) -> "subprocess.Popen[str]":
    """A process that may use so many threads, at work on the fingerprints."""
    environment = os.environ | {
        name: str(threads) for name in ("OMP_NUM_THREADS", "NUMBA_NUM_THREADS", "MKL_NUM_THREADS")
    }
    environment["PYTHONPATH"] = os.pathsep.join((str(ROOT), str(ROOT / "tests"), environment.get("PYTHONPATH", "")))
    pipe = subprocess.PIPE
    return subprocess.Popen(
        [sys.executable, __file__, str(threads)], env=environment, stdout=pipe, stderr=pipe, text=True
    )


def answer(process: "subprocess.Popen[str]") -> dict[str, str]:
    """The fingerprints that it finds."""
    out, error = process.communicate()
    assert process.returncode == 0, error
    return json.loads(out)


@pytest.fixture(scope="module")
def alone() -> dict[str, str]:
    return answer(start(1))


@pytest.fixture(scope="module")
def side_by_side() -> tuple[dict[str, str], dict[str, str]]:
    """Of a process with one thread and of one with two, at the same time and beside others that take every core."""
    # The other of the two takes a core, or more.
    others = max(1, (os.cpu_count() or 1) - 1)
    spinning = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(others)]
    processes = [start(1), start(2)]
    try:
        one, two = map(answer, processes)
        return one, two
    finally:
        for each in (*spinning, *processes):
            each.kill()
            each.wait()


@pytest.fixture(scope="module")
def beside_others(side_by_side: tuple[dict[str, str], dict[str, str]]) -> dict[str, str]:
    return side_by_side[0]


@pytest.fixture(scope="module")
def two_threads(side_by_side: tuple[dict[str, str], dict[str, str]]) -> dict[str, str]:
    return side_by_side[1]


@pytest.mark.parametrize("name", FITS)
def test_a_busy_machine_changes_no_bit(name: str, alone: dict[str, str], beside_others: dict[str, str]) -> None:
    assert beside_others[name] == alone[name]


@pytest.mark.parametrize("name", FITS)
def test_two_threads_change_no_bit(name: str, alone: dict[str, str], two_threads: dict[str, str]) -> None:
    assert two_threads[name] == alone[name]


def test_fingerprints_differ_between_fits(alone: dict[str, str]) -> None:
    assert len(set(alone.values())) == len(FITS)


if __name__ == "__main__":
    import torch

    torch.set_num_threads(int(sys.argv[1]))
    sys.stdout.write(json.dumps(fingerprints()))
