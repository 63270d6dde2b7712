"""`homofact relight` in processes of its own: the same bits on any number of threads, and after a kill −9."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from homofact.files.archive import read_arrays

pytestmark = pytest.mark.slow

pytest.importorskip("embreex", reason="embreex is not installed: pip install 'homofact[relight]'")

SCENE = """
seed = 3
[[object]]
mesh = "shape:knot"
material = "material:phong-10"
terms = 2
[ground]
albedo = [0.4]
half = 1.5
steps = 8
[lighting]
named = "studio"
[[camera]]
eye = [0, 1, 4]
pixels = [40, 30]
[transport]
cube = 8
rays = 2
kept = 24
clusters = 6
components = 3
"""


def started(folder: Path, threads: int) -> "subprocess.Popen[str]":
    """The command on so many threads, its result in folder/out."""
    folder.mkdir(exist_ok=True)
    (folder / "scene.toml").write_text(SCENE)
    environment = os.environ | {name: str(threads) for name in ("OMP_NUM_THREADS", "NUMBA_NUM_THREADS")}
    command = [sys.executable, "-m", "homofact.cli.main", "relight", "scene.toml", "--out", "out", "--vertices", "9"]
    return subprocess.Popen(
        [*command, "--json"], cwd=folder, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )


def finished(process: "subprocess.Popen[str]") -> dict[str, object]:
    out, error = process.communicate(timeout=300)
    assert process.returncode == 0, error
    return {name: each for name, each in json.loads(out).items() if name not in ("folder", "seconds")}


def arrays_of(folder: Path) -> dict[str, np.ndarray]:
    raw = (folder / "out" / "relight.npz").read_bytes()
    names = [name.removesuffix(".npy") for name in np.load(folder / "out" / "relight.npz").files if name != "header"]
    return read_arrays("relight.npz", raw, names, "a relit scene")


@pytest.fixture(scope="module")
def alone(tmp_path_factory: pytest.TempPathFactory) -> tuple[dict[str, np.ndarray], dict[str, object], bytes]:
    folder = tmp_path_factory.mktemp("alone")
    record = finished(started(folder, 1))
    return arrays_of(folder), record, (folder / "out" / "picture_1.png").read_bytes()


def test_equal_bits_on_two_threads_and_after_a_kill(
    alone: tuple[dict[str, np.ndarray], dict[str, object], bytes], tmp_path: Path
) -> None:
    """A run on two threads is killed after its first blocks; the next goes on with them, to the same bits."""
    process = started(tmp_path, 2)
    blocks = tmp_path / "out.blocks" / "object_0"
    until = time.monotonic() + 120
    while len(list(blocks.glob("block_*.npz"))) < 3 and process.poll() is None and time.monotonic() < until:
        time.sleep(0.002)
    process.send_signal(signal.SIGKILL)
    process.communicate()
    assert process.returncode == -signal.SIGKILL, "it had finished before it could be killed"
    assert not (tmp_path / "out").exists()
    left = {each.name: each.stat().st_mtime_ns for each in blocks.glob("block_*.npz")}
    assert 3 <= len(left) < 19
    again = started(tmp_path, 2)
    taken: dict[str, int] = {}
    while again.poll() is None:
        # They go with the run that ends.
        for name in left:
            try:
                taken[name] = (blocks / name).stat().st_mtime_ns
            except OSError:
                continue
        time.sleep(0.01)
    record = finished(again)
    assert taken == left
    arrays, first, picture = alone
    found = arrays_of(tmp_path)
    assert set(found) == set(arrays)
    assert [name for name in arrays if not np.array_equal(arrays[name], found[name], equal_nan=True)] == []
    assert record == first
    assert (tmp_path / "out" / "picture_1.png").read_bytes() == picture
    assert not (tmp_path / "out.blocks").exists()
