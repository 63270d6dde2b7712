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

import pytest
from homofact.methods.settings import FitSettings

from homofact.brdf.materials import material
from homofact.brdf.sampling import sample_model
from homofact.methods.cole_fit import fit_cole
from homofact.methods.mccool_fit import fit_mccool
from homofact.methods.search_fit import fit_search
from homofact.methods.separable_fit import fit_nmf, fit_svd

ROOT = Path(__file__).resolve().parents[2]
SMALL: dict[str, Any] = {"textures": 2, "size": 8, "search_samples": 800, "restarts": 2, "epsilon": 1e-5}
MANY: dict[str, Any] = SMALL | {"textures": 4, "size": 12, "restarts": 8}
FITS: dict[str, tuple[Any, FitSettings]] = {
    "search": (fit_search, FitSettings(budget=60.0, **SMALL)),
    # A budget that ends it half way: this is where a clock would show.
    "search, cut short": (fit_search, FitSettings(budget=0.3, **MANY)),
    "cole": (fit_cole, FitSettings(method="cole", search_size=6, **SMALL)),
    "mccool": (fit_mccool, FitSettings(method="mccool", **SMALL)),
    "svd": (fit_svd, FitSettings(method="svd", **SMALL)),
    "nmf": (fit_nmf, FitSettings(method="nmf", **SMALL)),
}


def fingerprints() -> dict[str, str]:
    """A hash of every texture's bytes, of the projections and of λ, by the fit's name."""
    samples = sample_model(material("lafortune-blue-paint").model, 1500)
    result = {}
    for name, (fit, settings) in FITS.items():
        fitted = fit(samples, settings).factorization
        digest = hashlib.sha256()
        for term in fitted.terms:
            textures = [term.texture] if hasattr(term, "texture") else list(term.textures)
            for tensor in (*textures, *([term.projection.matrix] if hasattr(term, "projection") else [term.signs])):
                digest.update(str(tuple(tensor.shape)).encode())
                digest.update(tensor.contiguous().numpy().tobytes())
        digest.update(json.dumps(fitted.provenance.get("smoothing")).encode())
        result[name] = digest.hexdigest()
    return result


def run(threads: int) -> dict[str, str]:
    """The fingerprints by a process that may use so many threads."""
    environment = os.environ | {
        name: str(threads) for name in ("OMP_NUM_THREADS", "NUMBA_NUM_THREADS", "MKL_NUM_THREADS")
    }
    environment["PYTHONPATH"] = os.pathsep.join((str(ROOT), str(ROOT / "tests"), environment.get("PYTHONPATH", "")))
    done = subprocess.run(
        [sys.executable, __file__, str(threads)], env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


@pytest.fixture(scope="module")
def alone() -> dict[str, str]:
    return run(1)


@pytest.fixture(scope="module")
def beside_others() -> dict[str, str]:
    spinning = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(os.cpu_count() or 1)]
    try:
        return run(1)
    finally:
        for each in spinning:
            each.kill()
            each.wait()


@pytest.fixture(scope="module")
def two_threads() -> dict[str, str]:
    return run(2)


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
