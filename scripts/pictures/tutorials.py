"""Run the tutorials and time them; with --write, renew their output and pictures.

    python scripts/pictures/tutorials.py                    # all of them
    python scripts/pictures/tutorials.py paint trust --write

Each runs in a folder of its own with the embedded data, in one process, commands included.
"""

import argparse
import importlib.util
import os
import shutil
import sys
import tempfile
import time
from pathlib import Path

import torch

from homofact.evaluation.machine import machine

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "docs"))

from sitemaker.runnable import blocks_of, run, with_output  # noqa: E402

TUTORIALS = ("paint", "own_data", "trust", "plan", "relight", "edit", "sweep", "inverse_rendering")
# What each leaves that its page shows.
PICTURES = {
    "paint": {
        "out/paint/compare.png": "paint.png",
        "out/paint/texture_0.png": "paint_texture_0.png",
    },
    "own_data": {"out/gonio/compare.png": "own_data.png"},
    "plan": {"out/plan.png": "plan.png"},
    "edit": {"out/before.png": "edit_before.png", "out/after.png": "edit_after.png"},
}


def ran(name: str, folder: Path, write: bool) -> tuple[float, float]:
    """Run a tutorial in `folder`; wall and processor seconds."""
    page = ROOT / "docs" / "tutorials" / f"{name}.md"
    for data in ("data_synthetic", "configs"):
        shutil.copytree(ROOT / data, folder / data)
    text = page.read_text(encoding="utf-8")
    blocks = blocks_of(text)
    before, cpu = time.perf_counter(), time.process_time()
    with_folder = os.getcwd()
    os.chdir(folder)
    try:
        _, printed = run(page, blocks)
    finally:
        os.chdir(with_folder)
    seconds = time.perf_counter() - before, time.process_time() - cpu
    if write:
        page.write_text(with_output(text, blocks, printed), encoding="utf-8")
        for found, kept in PICTURES.get(name, {}).items():
            shutil.copyfile(folder / found, ROOT / "docs" / "pictures" / "tutorials" / kept)
    return seconds


def main() -> None:
    """Run those that are asked for and print their seconds."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"some of {', '.join(TUTORIALS)}; all unless given")
    parser.add_argument("--write", action="store_true", help="renew the output and the pictures that the pages show")
    asked = parser.parse_args()
    unknown = set(asked.names) - set(TUTORIALS)
    if unknown:
        parser.error(f"found {', '.join(sorted(unknown))}, expected some of {', '.join(TUTORIALS)}")
    print(machine())
    print(f"{'tutorial':10} {'wall s':>7} {'CPU s':>7}", flush=True)
    for name in asked.names or TUTORIALS:
        if name in ("relight", "edit") and importlib.util.find_spec("embreex") is None:
            print(f"{name:10} needs pip install 'homofact[relight]'")
            continue
        with tempfile.TemporaryDirectory() as folder, torch.random.fork_rng():
            wall, cpu = ran(name, Path(folder), asked.write)
        print(f"{name:10} {wall:7.1f} {cpu:7.1f}", flush=True)


if __name__ == "__main__":
    main()
