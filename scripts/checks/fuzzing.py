"""Code that the fuzzers share. It damages a file, tries to open it, and reports the result.

`fuzz_readers.py` tries measurements, `fuzz_results.py` everything else that is opened.
"""

import argparse
import ctypes
import platform
import random
import time
import tracemalloc
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from homofact.errors import BadInput


@dataclass
class Tally:
    """What became of one kind's files; `wrong` holds (what, the damaged file)."""

    outcomes: Counter[str] = field(default_factory=Counter)
    slowest: float = 0.0
    most_memory: int = 0
    growth: int = 0
    wrong: list[tuple[str, bytes]] = field(default_factory=list)


@dataclass(frozen=True)
class Bounds:
    """What an attempt may take: seconds of the process's time, bytes beside four times the file's."""

    seconds: float
    slack: int


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


def attempt(act: Callable[[], str], path: Path, size: int, bounds: Bounds, tally: Tally, traced: bool) -> str:
    """What was wrong with one attempt, or "": `act` uses a damaged file of `size` bytes and says so of its answer.

    The tally counts whether it was used, refused (a BadInput) or raised something else. Only what is `traced` is asked
    for its memory, only what is not for its time: tracing slows everything several times over.
    """
    if traced:
        tracemalloc.start()
    begun = time.process_time()
    outcome = "used"
    try:
        wrong = act()
    except BadInput as error:
        outcome = "refused"
        wrong = f"message {str(error)!r}" if "\n" in str(error) or str(path) not in str(error) else ""
    except Exception as error:
        outcome, wrong = "raised", f"{type(error).__name__}: {error}"
    # The process's own time, so that a busy machine accuses nobody.
    seconds = time.process_time() - begun
    if traced:
        memory = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        tally.most_memory = max(tally.most_memory, memory)
        if memory > 4 * size + bounds.slack:
            wrong = wrong or f"{memory / 2**20:.0f} MB for {size} bytes"
    else:
        tally.slowest = max(tally.slowest, seconds)
        if seconds > bounds.seconds:
            wrong = wrong or f"{seconds:.2f} s"
    tally.outcomes[outcome] += 1
    return wrong


def give_back_freed_memory() -> None:
    """Have glibc return freed arrays to the system at once: holes in its heap are nobody's memory.

    Without it the process grows by some 16 KB a damaged RGL file of 660 KB, for good.
    """
    if platform.libc_ver()[0] == "glibc":
        library = ctypes.CDLL(None)
        for parameter in (-3, -1):  # M_MMAP_THRESHOLD, M_TRIM_THRESHOLD
            library.mallopt(parameter, 65_536)


def options(doc: str | None, names: str, what: str) -> argparse.ArgumentParser:
    """The options of both: how many, which seed, which of `names`, where to keep what went wrong."""
    parser = argparse.ArgumentParser(description=(doc or "").splitlines()[0])
    parser.add_argument("--count", type=int, default=20_000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument(f"--{what}", nargs="*", help=f"{names}; all unless given")
    parser.add_argument("--keep", type=Path, help="where to leave the files that went wrong")
    return parser


def tell(name: str, tally: Tally, seconds: float, keep: Path | None) -> int:
    """Print a line for one kind and a line for each of the first ten that went wrong; how many did."""
    outcomes = ", ".join(f"{count} {what}" for what, count in sorted(tally.outcomes.items()))
    grown = f", process +{tally.growth / 2**20:.0f} MB" if tally.growth else ""
    print(
        f"{name:8} {outcomes}; slowest {tally.slowest:.3f} s, most memory {tally.most_memory / 2**20:.1f} MB{grown},"
        f" {seconds:.0f} s; wrong {len(tally.wrong)}",
        flush=True,
    )
    for number, (what, raw) in enumerate(tally.wrong[:10]):
        print(f"  {what[:300]}")
        if keep:
            keep.mkdir(parents=True, exist_ok=True)
            (keep / f"{name}-{number}").write_bytes(raw)
    return len(tally.wrong)
