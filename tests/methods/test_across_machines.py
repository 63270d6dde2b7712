"""The same fit on processors that add in another order: equal kinds, and projections to far less than a texel.

BLAS, torch and numba choose their kernels by the processor, so last digits differ from machine to machine. A search
takes up no more than it rounds away: projections are rounded after every descent. Another machine is another choice
of kernels in a process of its own. What the same machine gives twice is `test_reproducible`'s.
"""

import json
import os
import platform
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
import torch

from homofact.brdf.materials import material
from homofact.brdf.sampling import sample_model
from homofact.methods.cole import Cole
from homofact.methods.method import Method
from homofact.methods.search import Search

ROOT = Path(__file__).resolve().parents[2]
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(
        platform.machine() not in ("x86_64", "AMD64"), reason="the choice of kernels is by the names of x86 processors"
    ),
]
SMALL: dict[str, Any] = {"textures": 2, "size": 8, "restarts": 2, "search_samples": 300, "epsilon": 1e-5}
FITS: dict[str, Method] = {
    "search": Search(effort=20.0, **SMALL),
    "search in 4D": Search(effort=20.0, projections=("half-diff",), **SMALL),
    "cole": Cole(textures=2, size=8, restarts=1, search_samples=200, search_size=4, epsilon=1e-5),
}
MACHINES = {
    "Haswell": {"OPENBLAS_CORETYPE": "Haswell", "ATEN_CPU_CAPABILITY": "avx2", "MKL_CBWR": "AVX2"},
    "old": {
        "OPENBLAS_CORETYPE": "Prescott", "ATEN_CPU_CAPABILITY": "default", "MKL_CBWR": "COMPATIBLE",
        "NUMBA_CPU_NAME": "generic", "NUMBA_CPU_FEATURES": "",
    },
}  # fmt: skip


def described() -> dict[str, Any]:
    """Kinds, projections and textures of every fit."""
    samples = sample_model(material("lafortune-blue-paint").model, 600)
    found = {}
    for name, method in FITS.items():
        fitted: Any = method.fit(samples).factorization
        found[name] = {
            "kinds": [term.projection.name + " " + term.projection.coordinates for term in fitted.terms],
            "matrices": [term.projection.matrix.tolist() for term in fitted.terms],
            "textures": [term.texture.tolist() for term in fitted.terms],
        }
    return found


def on(machine: dict[str, str], cache: Path) -> dict[str, Any]:
    """What a process finds with these kernels, which it compiles anew where numba is told to."""
    environment = os.environ | {"OMP_NUM_THREADS": "1", "NUMBA_NUM_THREADS": "1"} | machine
    if "NUMBA_CPU_NAME" in machine:
        environment["NUMBA_CACHE_DIR"] = str(cache)
    environment["PYTHONPATH"] = os.pathsep.join((str(ROOT), str(ROOT / "tests"), environment.get("PYTHONPATH", "")))
    done = subprocess.run([sys.executable, __file__], env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


@pytest.fixture(scope="module")
def here(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    return on({}, tmp_path_factory.mktemp("numba"))


@pytest.fixture(scope="module", params=MACHINES)
def there(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    return on(MACHINES[request.param], tmp_path_factory.mktemp("numba"))


@pytest.mark.parametrize("name", FITS)
def test_another_machine_finds_the_same_projections(name: str, here: dict[str, Any], there: dict[str, Any]) -> None:
    mine, theirs = here[name], there[name]
    assert mine["kinds"] == theirs["kinds"]
    for one, other in zip(mine["matrices"], theirs["matrices"], strict=True):
        assert torch.allclose(torch.tensor(one), torch.tensor(other), rtol=0, atol=1e-9)


def test_the_kernels_differ_and_their_textures_hardly(here: dict[str, Any], there: dict[str, Any]) -> None:
    """Else nothing was compared."""
    different = [name for name in FITS if here[name]["textures"] != there[name]["textures"]]
    if not different:
        pytest.skip("this processor has these kernels for its own")
    for name in different:
        for one, other in zip(here[name]["textures"], there[name]["textures"], strict=True):
            assert torch.allclose(torch.tensor(one), torch.tensor(other), rtol=1e-3, atol=1e-3)


if __name__ == "__main__":
    sys.stdout.write(json.dumps(described()))
