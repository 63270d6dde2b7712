"""Fit twelve materials and compare the bits of the fits with stored ones.

    python scripts/checks/same_fits.py [--write] [--out FILE]

Six methods fit a noise-free model and a measurement with noise, at small effort. Of every fit the script stores a hash
of all arrays that `save` writes, and of its values at 200 fixed pairs. The same seed gives the same bits on one kind of
processor; on another one values differ in the last places, so that the largest relative difference is printed too.
"""

import argparse
import hashlib
import json
import platform
import sys
import tempfile
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import torch

import homofact

ROOT = Path(__file__).resolve().parents[2]
STORED = Path(__file__).with_suffix(".json")
SOURCES = ("material:lafortune-blue-paint", str(ROOT / "data_synthetic" / "synthetic_cornell.brdf"))
METHODS = {
    "search": lambda: homofact.Search(textures=2, size=8, effort=40, seed=3),
    "cole": lambda: homofact.Cole(textures=2, size=8, restarts=1, search_samples=800, copies=2, seed=3),
    "mccool": lambda: homofact.McCool(size=8),
    "svd": lambda: homofact.Svd(textures=2, size=12, seed=3),
    "nmf": lambda: homofact.Nmf(textures=2, size=12, seed=3),
    "ggx": lambda: homofact.Ggx(lobes=2, seed=3),
}


def pairs() -> tuple[np.ndarray, np.ndarray]:
    """200 fixed pairs of directions above the horizon, (200, 3) each."""
    generator = np.random.default_rng(1)
    both = generator.normal(size=(2, 200, 3))
    both[..., 2] = np.abs(both[..., 2]) + 0.05
    both /= np.linalg.norm(both, axis=-1, keepdims=True)
    return both[0], both[1]


def hashed(path: Path) -> str:
    """The hash of all arrays of a saved fit, without its header."""
    digest = hashlib.sha256()
    with zipfile.ZipFile(path) as archive:
        for name in sorted(archive.namelist()):
            if name.endswith(".npy") and "header" not in name:
                digest.update(name.encode() + archive.read(name))
    return digest.hexdigest()


def main() -> int:
    """Fit, and print one line per fit; 1 where bits differ from the stored ones."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--write", action="store_true", help="store these fits as what later ones are compared with")
    parser.add_argument("--out", type=Path, default=STORED, help="the stored fits")
    options = parser.parse_args()
    wi, wo = map(torch.from_numpy, pairs())
    made: dict[str, Any] = {}
    for source in SOURCES:
        opened = homofact.read(source, count=3000)
        for name, method in METHODS.items():
            fitted = homofact.fit(opened, method())
            with tempfile.TemporaryDirectory() as folder:
                fitted.save(Path(folder) / "fit.npz")
                bits = hashed(Path(folder) / "fit.npz")
            values = fitted.evaluate(wi, wo).numpy()
            made[f"{name} of {Path(source).name}"] = {
                "arrays": bits,
                "evaluated": hashlib.sha256(np.ascontiguousarray(values).tobytes()).hexdigest(),
                "values": values[:10].tolist(),
            }
    if options.write:
        options.out.write_text(json.dumps({"machine": platform.processor() or platform.machine(), "fits": made}) + "\n")
        return 0
    stored = json.loads(options.out.read_text())["fits"]
    different = 0
    for name, fit in made.items():
        before, after = np.array(stored[name]["values"]), np.array(fit["values"])
        apart = float((np.abs(after - before) / np.maximum(np.abs(before), 1e-12)).max())
        same = fit == stored[name]
        different += not same
        print(f"{name}: {'equal bits' if same else f'different, values by up to {apart:.1e}'}")
    return 1 if different else 0


if __name__ == "__main__":
    sys.exit(main())
