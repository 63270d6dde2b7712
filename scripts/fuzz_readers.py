"""Damaged files for every reader: each must give a BadInput of one line or valid samples, soon and in little memory.

    python scripts/fuzz_readers.py [--count 20000] [--seed 0] [--reader NAME …] [--whole NAME=FILE …] [--keep FOLDER]

From a small whole file of each format (made by our own writers) it makes `count` damaged ones: cut, padded,
bits flipped, bytes replaced, numbers in headers made absurd, numbers in text made absurd, lines lost or doubled,
stretches put in twice, noise, nothing. Three of four go to the format's own reader, one through the front door.
Wrong is any other exception, a warning, a message of several lines or without the file's name, a reading of over
2 s of the process's time, and memory above four times the file plus 200 MB: Python's and numpy's as traced for
every eighth file, and the growth of the whole process over all of a reader's files.
"""

import argparse
import ctypes
import io
import platform
import random
import resource
import struct
import sys
import tempfile
import time
import tracemalloc
import warnings
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import torch

from homofact.brdf.analytic import Lambert
from homofact.brdf.formats import READERS, cornell, open_file
from homofact.brdf.formats import alta as write_alta
from homofact.brdf.formats import astm as write_astm
from homofact.brdf.formats import csv as write_csv
from homofact.brdf.formats import curet as write_curet
from homofact.brdf.formats import merl as write_merl
from homofact.brdf.formats import npz as npz_reader
from homofact.brdf.formats import utia as write_utia
from homofact.brdf.materials import material
from homofact.brdf.samples import Samples
from homofact.brdf.sampling import sample_model
from homofact.errors import BadInput

SECONDS = 2.0
SLACK = 200 * 2**20


@dataclass
class Tally:
    """What became of one reader's files; `wrong` holds (what, the damaged file)."""

    outcomes: Counter[str] = field(default_factory=Counter)
    slowest: float = 0.0
    most_memory: int = 0
    growth: int = 0
    wrong: list[tuple[str, bytes]] = field(default_factory=list)


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


ABSURD = (
    "0",
    "-1",
    "1e999",
    "nan",
    "99999999999999999999",
    "4294967295",
    "1_000",
    "",
    "0x10",
    "9" * 400,
    "٣",
    "1e-320",
)


def cut(raw: bytearray, dice: random.Random) -> bytes:
    """Shorter by any amount."""
    return bytes(raw[: dice.randrange(len(raw))])


def padded(raw: bytearray, dice: random.Random) -> bytes:
    """Longer by zeros or noise."""
    size = dice.choice((1, 7, 8, 64, 5000))
    return bytes(raw) + (dice.randbytes(size) if dice.random() < 0.5 else bytes(size))


def flipped(raw: bytearray, dice: random.Random) -> bytes:
    """One to eight bits turned, half of the time near the start."""
    for _ in range(dice.randint(1, 8)):
        reach = min(len(raw), 128) if dice.random() < 0.5 else len(raw)
        raw[dice.randrange(reach)] ^= 1 << dice.randrange(8)
    return bytes(raw)


def replaced(raw: bytearray, dice: random.Random) -> bytes:
    """A stretch of noise somewhere."""
    start = dice.randrange(len(raw))
    size = dice.choice((1, 4, 16, 256))
    raw[start : start + size] = dice.randbytes(len(raw[start : start + size]))
    return bytes(raw)


def huge_integers(raw: bytearray, dice: random.Random) -> bytes:
    """Integers of 16, 32 or 64 bits overwritten, mostly in the header or at the end (a zip's directory)."""
    for _ in range(dice.randint(1, 3)):
        width = dice.choice((2, 4, 8))
        value = dice.choice((0, 1, 2**31 - 1, 2**31, 2**32 - 1, 2**63 - 1, 2**64 - 1, 65535, 4096)) % 256**width
        place = dice.randrange(min(len(raw), 96)) if dice.random() < 0.6 else dice.randrange(len(raw))
        if dice.random() < 0.2:
            place = max(0, len(raw) - dice.randrange(1, 400))
        raw[place : place + width] = value.to_bytes(width, "little")[: len(raw[place : place + width])]
    return bytes(raw)


def absurd_words(raw: bytearray, dice: random.Random) -> bytes:
    """Words of a text (or what looks like one) replaced by absurd numbers."""
    lines = bytes(raw).split(b"\n")
    for _ in range(dice.randint(1, 3)):
        index = dice.randrange(min(len(lines), 12)) if dice.random() < 0.6 else dice.randrange(len(lines))
        words = lines[index].replace(b",", b" , ").split(b" ")
        words[dice.randrange(len(words))] = dice.choice(ABSURD).encode()
        lines[index] = b" ".join(words).replace(b" , ", b",")
    return b"\n".join(lines)


def lines_lost(raw: bytearray, dice: random.Random) -> bytes:
    """A line lost, doubled or exchanged with another."""
    lines = bytes(raw).split(b"\n")
    a, b = dice.randrange(len(lines)), dice.randrange(len(lines))
    kind = dice.randrange(3)
    if kind == 0:
        del lines[a]
    elif kind == 1:
        lines.insert(b, lines[a])
    else:
        lines[a], lines[b] = lines[b], lines[a]
    return b"\n".join(lines)


def noise(raw: bytearray, dice: random.Random) -> bytes:
    """Nothing, the head with noise after it, or noise alone."""
    kind = dice.randrange(4)
    if kind == 0:
        return b""
    if kind == 1:
        return bytes(raw[: dice.randint(1, min(len(raw), 200))]) + dice.randbytes(dice.randrange(2000))
    if kind == 2:
        return dice.randbytes(dice.randrange(1, 3000))
    return "".join(dice.choice("0123456789.,-+eE \n#abcxyz_") for _ in range(dice.randrange(1, 2000))).encode()


def spliced(raw: bytearray, dice: random.Random) -> bytes:
    """A stretch of the file put in again elsewhere."""
    start = dice.randrange(len(raw))
    piece = raw[start : start + dice.choice((4, 12, 60, 700))]
    place = dice.randrange(len(raw))
    raw[place:place] = piece
    return bytes(raw)


DAMAGES = (cut, padded, flipped, replaced, huge_integers, absurd_words, lines_lost, noise, spliced)


def attempt(reader: Callable[[Path], Samples], path: Path, raw: bytes, tally: Tally, traced: bool) -> None:
    """Read one damaged file and note what became of it."""
    path.write_bytes(raw)
    if traced:
        tracemalloc.start()
    begun = time.process_time()
    try:
        samples = reader(path)
        outcome = "read"
        if not bool(torch.isfinite(samples.values).all()) or bool((samples.values < 0).any()):
            tally.wrong.append(("samples that are none", raw))
    except BadInput as error:
        outcome = "refused"
        if "\n" in str(error) or str(path) not in str(error):
            tally.wrong.append((f"message {error!r}", raw))
    except Exception as error:
        outcome = "raised"
        tally.wrong.append((f"{type(error).__name__}: {error}", raw))
    # The process's own time, so that a busy machine accuses no reader.
    seconds = time.process_time() - begun
    if traced:
        memory = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        tally.most_memory = max(tally.most_memory, memory)
        if memory > 4 * len(raw) + SLACK:
            tally.wrong.append((f"{memory / 2**20:.0f} MB for a file of {len(raw)} bytes", raw))
    # Tracing slows everything several times over.
    elif seconds > SECONDS:
        tally.wrong.append((f"{seconds:.2f} s", raw))
    else:
        tally.slowest = max(tally.slowest, seconds)
    tally.outcomes[outcome] += 1


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
        reader = (lambda p: open_file(p).samples) if k % 4 == 3 else module.read
        largest = max(largest, len(raw))
        attempt(reader, path, raw, tally, traced=k % 8 == 0)
    tally.growth = 1024 * (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before)
    if tally.growth > 4 * largest + SLACK:
        tally.wrong.append((f"the process grew by {tally.growth / 2**20:.0f} MB", b""))
    return tally


def give_back_freed_memory() -> None:
    """Have glibc return freed arrays to the system at once: holes in its heap are no reader's memory.

    Without it the process grows by some 16 KB a damaged RGL file of 660 KB, for good.
    """
    if platform.libc_ver()[0] == "glibc":
        library = ctypes.CDLL(None)
        for parameter in (-3, -1):  # M_MMAP_THRESHOLD, M_TRIM_THRESHOLD
            library.mallopt(parameter, 65_536)


def main(arguments: list[str] | None = None) -> int:
    """Run the fuzzing and print a line a reader. Returns 1 where anything was wrong."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--count", type=int, default=20_000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--reader", nargs="*", help="names; all readers unless given")
    parser.add_argument("--whole", nargs="*", default=[], metavar="NAME=FILE", help="whole files to damage instead")
    parser.add_argument("--keep", type=Path, help="where to leave the files that went wrong")
    options = parser.parse_args(arguments)
    give_back_freed_memory()
    warnings.simplefilter("error")
    failed = 0
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        files = whole_files(folder)
        for given in options.whole:
            files[given.partition("=")[0]] = Path(given.partition("=")[2]).read_bytes()
        for module in READERS:
            if options.reader and module.NAME not in options.reader:
                continue
            if module.NAME not in files:
                print(f"{module.NAME:8} no whole file to damage")
                continue
            begun = time.perf_counter()
            tally = fuzz(module, files[module.NAME], options.count, options.seed, folder)
            kinds = ", ".join(f"{count} {kind}" for kind, count in sorted(tally.outcomes.items()))
            print(
                f"{module.NAME:8} {kinds}; slowest {tally.slowest:.3f} s, most memory"
                f" {tally.most_memory / 2**20:.1f} MB, process +{tally.growth / 2**20:.0f} MB,"
                f" {time.perf_counter() - begun:.0f} s; wrong {len(tally.wrong)}",
                flush=True,
            )
            for number, (what, raw) in enumerate(tally.wrong[:10]):
                print(f"  {what}")
                if options.keep:
                    options.keep.mkdir(parents=True, exist_ok=True)
                    (options.keep / f"{module.NAME}-{number}").write_bytes(raw)
            failed += len(tally.wrong)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
