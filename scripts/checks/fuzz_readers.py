"""Give damaged files to every reader: each must raise a BadInput of one line or return valid samples, quickly.

    python scripts/checks/fuzz_readers.py [--count 20000] [--seed 0] [--reader NAME …] [--whole NAME=FILE …]

From a small whole file of each format (made by our own writers) it makes `count` damaged ones: cut, padded,
bits flipped, bytes replaced, numbers in headers made absurd, numbers in text made absurd, lines lost or doubled,
stretches put in twice, noise, nothing. Three of four go to the format's own reader, one through the front door.
Wrong is any other exception, a warning, a message of several lines or without the file's name, a reading of over
2 s of the process's time, and memory above four times the file plus 200 MB: Python's and numpy's as traced for
every eighth file, and the growth of the whole process over all of a reader's files.
"""

import io
import random
import resource
import struct
import sys
import tempfile
import time
import warnings
from collections.abc import Callable
from functools import partial
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import torch

from homofact.brdf.analytic import Lambert
from homofact.brdf.formats import READERS, cornell, open_file, read_by, speos_writer, window_writer, zemax
from homofact.brdf.formats import alta as write_alta
from homofact.brdf.formats import astm as write_astm
from homofact.brdf.formats import csv as write_csv
from homofact.brdf.formats import curet as write_curet
from homofact.brdf.formats import merl as write_merl
from homofact.brdf.formats import npz as npz_reader
from homofact.brdf.formats import utia as write_utia
from homofact.brdf.formats.reading import Reading
from homofact.brdf.materials import material
from homofact.brdf.sampling import sample_model

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from scripts.checks.fuzzing import DAMAGES, Bounds, Tally, attempt, give_back_freed_memory, options, tell

SECONDS = 2.0
SLACK = 200 * 2**20


def whole_files(folder: Path) -> dict[str, bytes]:
    """A small whole file of every format that we can write, by the reader's name."""
    paint = sample_model(material("lafortune-blue-paint").model, 12)
    made: dict[str, bytes] = {}

    def take(name: str, write: Callable[[Path], object]) -> None:
        write(folder / "whole")
        made[name] = (folder / "whole").read_bytes()

    take("npz", lambda path: npz_reader.write(path, paint, {"name": "paint"}))
    take("csv", lambda path: write_csv.write(path, paint, ("a paint",)))
    take("alta", lambda path: write_alta.write(path, paint))
    take("astm", lambda path: write_astm.write(path, paint))
    take("merl", lambda path: write_merl.write(path, Lambert((0.3, 0.2, 0.1)), (4, 4, 8)))
    take("utia", lambda path: write_utia.write(path, Lambert((0.3, 0.2, 0.1))))
    take("window", lambda path: window_writer.write_klems(path, Lambert((0.3, 0.2, 0.1)), True, "grey"))
    take("zemax", lambda path: zemax.write(path, Lambert((0.3, 0.2, 0.1)), True))
    take("speos", lambda path: speos_writer.write_anisotropic(path, Lambert((0.3, 0.2, 0.1)), True))
    made["pabopto"] = b"#format: theta phi DSF\n#intheta 30\n#inphi 180\n" + b"".join(
        b"%d %d %.3f\n" % (theta, phi, 0.01 * theta + 0.1) for theta in range(0, 80, 10) for phi in range(0, 360, 30)
    )
    angles = torch.tensor([[0.1, 0.0, 0.2, 3.0], [0.5, 0.0, 0.6, 2.0]], dtype=torch.float64)
    take("cornell", lambda path: cornell.write(path, angles, torch.full((2, 5), 0.25), [400, 450, 500, 600, 700]))
    entries = np.random.default_rng(0).random((4, 4, 6, 3)).astype("<f4")
    head = b'NVIDIA ARC MBSDF V1\nname="paint"\nMBSDF_DATA_REFLECTION=\n' + struct.pack("<3I", 1, 4, 6)
    made["mdl"] = head + entries.tobytes()
    buffer = io.BytesIO()
    shapes = {"w0": (6, 21), "b0": (21,), "w1": (21, 21), "b1": (21,), "w2": (21, 3), "b2": (3,)}
    arrays: dict[str, Any] = {f"tin/{k}": np.full(v, 0.01, "<f4") for k, v in shapes.items()}
    np.savez_compressed(buffer, **arrays)
    made["nbrdf"] = buffer.getvalue()
    # Its table of directions stays in the folder, beside the damaged files.
    write_curet.write(folder, sample_model(material("lafortune-clay").model, 205))
    made["curet"] = (folder / "abrdf.dat").read_bytes()
    return made


def use(read: Callable[[Path], Reading], path: Path) -> str:
    """Read a file; "" where its samples are some."""
    samples = read(path).samples
    sound = bool(torch.isfinite(samples.values).all()) and not bool((samples.values < 0).any())
    return "" if sound else "samples that are none"


def fuzz(module: ModuleType, whole: bytes, count: int, seed: int, folder: Path) -> Tally:
    """`count` damaged files for one reader, every eighth with its memory traced, every fourth by the front door."""
    dice = random.Random(f"{seed} {module.NAME}")
    tally = Tally()
    path = folder / "damaged"
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    largest = len(whole)
    for k in range(count):
        raw = dice.choice(DAMAGES)(bytearray(whole), dice)
        if dice.random() < 0.2 and raw:
            raw = dice.choice(DAMAGES)(bytearray(raw), dice)
        read = open_file if k % 4 == 3 else partial(read_by, module)
        largest = max(largest, len(raw))
        path.write_bytes(raw)
        bounds = Bounds(SECONDS, SLACK)
        wrong = attempt(lambda own=read: use(own, path), path, len(raw), bounds, tally, traced=k % 8 == 0)
        if wrong:
            tally.wrong.append((wrong, raw))
    tally.growth = 1024 * (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before)
    if tally.growth > 4 * largest + SLACK:
        tally.wrong.append((f"the process grew by {tally.growth / 2**20:.0f} MB", b""))
    return tally


def main(arguments: list[str] | None = None) -> int:
    """Run the fuzzing and print a line a reader. Returns 1 where anything was wrong."""
    parser = options(__doc__, "names", "reader")
    parser.add_argument("--whole", nargs="*", default=[], metavar="NAME=FILE", help="whole files to damage instead")
    asked = parser.parse_args(arguments)
    give_back_freed_memory()
    warnings.simplefilter("error")
    failed = 0
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        files = whole_files(folder)
        for given in asked.whole:
            files[given.partition("=")[0]] = Path(given.partition("=")[2]).read_bytes()
        for module in READERS:
            if asked.reader and module.NAME not in asked.reader:
                continue
            if module.NAME not in files:
                print(f"{module.NAME:8} no whole file to damage")
                continue
            begun = time.perf_counter()
            tally = fuzz(module, files[module.NAME], asked.count, asked.seed, folder)
            failed += tell(module.NAME, tally, time.perf_counter() - begun, asked.keep)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
