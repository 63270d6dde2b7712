"""Radiance pictures to the page's reader, in node: what Python's reader gives, and what it refuses."""

import json
import shutil
import subprocess
from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest
from refusals import refused

from homofact.errors import BadInput
from homofact.rendering.environment import read_environment

HEAD = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n"
FLAT = bytes((9, 8, 7, 129)) * 6
RUNS = b"".join(
    bytes((2, 2, 0, 16)) + bytes((128 + 16, each, 128 + 16, 3, 128 + 16, 7, 128 + 16, 129)) for each in (4, 5)
)
# The longest run of all: 127 pixels in two bytes, four times in a scanline.
DENSE = b"".join(bytes((2, 2, 127, 0)) + bytes((255, 9)) * 256 * 4 for _ in range(4))


def picture(rows: object, columns: object, pixels: bytes, more: bytes = b"") -> bytes:
    return HEAD + more + f"\n-Y {rows} +X {columns}\n".encode() + pixels


GOOD = {
    "flat": picture(2, 3, FLAT),
    "old runs": picture(2, 3, bytes((9, 8, 7, 129, 1, 1, 1, 5))),
    "shifted": picture(2, 129, bytes((9, 8, 7, 129, 1, 1, 1, 1, 1, 1, 1, 1))),
    "new runs": picture(2, 16, RUNS),
    "exposures": picture(2, 3, FLAT, b"EXPOSURE=2\nEXPOSURE=1.5\n"),
}
BAD = {
    "digits": picture("9" * 5000, 3, FLAT),
    "digits of columns": picture(2, "9" * 5000, FLAT),
    "blanks": picture(2, " " * 5000 + "x", FLAT),
    "exposure of digits": picture(2, 3, FLAT, b"EXPOSURE=" + b"9" * 5000 + b"\n"),
    "exposures that overflow": picture(2, 3, FLAT, b"EXPOSURE=1e200\n" * 2),
    "exposures that underflow": picture(2, 3, FLAT, b"EXPOSURE=1e-200\n" * 2),
    "exposure of 1e-300": picture(2, 3, FLAT, b"EXPOSURE=1e-300\n"),
    "exposure of 1e300": picture(2, 3, FLAT, b"EXPOSURE=1e300\n"),
    "format": picture(2, 3, FLAT).replace(b"32-bit_rle_rgbe", b"x" * 3000),
    "repeats of nothing": picture(2, 3, bytes((9, 8, 7, 129)) + bytes((1, 1, 1, 0)) * 3000 + bytes((1, 1, 1, 5))),
    "repeats that grow": picture(2, 3, bytes((9, 8, 7, 129)) + bytes((1, 1, 1, 0)) * 4 + bytes((1, 1, 1, 5))),
    "72 bytes for 134 million pixels": picture(8192, 16384, bytes((9, 8, 7, 129)) + bytes((1, 1, 1, 255)) * 4),
    "more than run lengths say": picture(40, 32512, DENSE[: len(DENSE) // 4]).replace(b"-Y 40", b"-Y 4000"),
    "radiance of 1.7e38": picture(2, 3, bytes((255, 255, 255, 255)) * 6),
    "radiance of 1e-30": picture(2, 3, bytes((200, 200, 200, 36)) * 6),
    "nothing but black": picture(2, 3, bytes(24)),
    "repeats first": picture(2, 3, bytes((1, 1, 1, 5)) * 3),
    "a run too long": picture(1, 16, bytes((2, 2, 0, 16, 248, 7)) + bytes(80)),
    "cut": picture(2, 3, FLAT[:20]),
    "more than it says": picture(2, 3, FLAT + b"more"),
    "more runs than it says": picture(2, 16, RUNS + b"more"),
}


def in_the_page(data: bytes, folder: Path) -> tuple[list[float] | None, str]:
    """(values, None where it is refused, and the refusal) of the page's reader."""
    (folder / "sky.hdr").write_bytes(data)
    code = files("homofact.web").joinpath("hdr.js").read_text(encoding="utf-8")
    (folder / "read.js").write_text(
        "class Trouble extends Error { constructor(message, remedy) { super(message); this.remedy = remedy; } }\n"
        f"{code}\n"
        'const bytes = new Uint8Array(require("fs").readFileSync(process.argv[2]));\n'
        "try { console.log(JSON.stringify([[...readHdr(bytes, 'sky.hdr').values], ''])); }\n"
        "catch (error) { if (!(error instanceof Trouble)) throw error;"
        " console.log(JSON.stringify([null, error.message])); }\n",
        encoding="utf-8",
    )
    if shutil.which("node") is None:
        pytest.skip("no node")
    done = subprocess.run(
        ["node", "--max-old-space-size=300", folder / "read.js", folder / "sky.hdr"],
        capture_output=True, text=True, timeout=60,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    values, words = json.loads(done.stdout)
    return values, words


@pytest.mark.parametrize("name", GOOD)
def test_the_page_reads_what_python_reads(name: str, tmp_path: Path) -> None:
    values, _ = in_the_page(GOOD[name], tmp_path)
    assert values is not None
    expected = read_environment(tmp_path / "sky.hdr").radiance.numpy().astype(np.float32)
    assert np.array_equal(np.array(values, np.float32), expected.reshape(-1))


@pytest.mark.parametrize("name", BAD)
def test_python_refuses_it_in_a_line(name: str, tmp_path: Path) -> None:
    (tmp_path / "sky.hdr").write_bytes(BAD[name])
    with pytest.raises(BadInput) as caught:
        read_environment(tmp_path / "sky.hdr")
    assert "sky.hdr" in str(caught.value)
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 300 + len(str(tmp_path))


@pytest.mark.parametrize("name", BAD)
def test_the_page_refuses_it_in_a_line(name: str, tmp_path: Path) -> None:
    values, words = in_the_page(BAD[name], tmp_path)
    assert values is None
    assert words.startswith("sky.hdr: ")
    assert len(words) < 200


def test_what_the_bytes_cannot_hold_is_refused_before_it_is_made_room_for(tmp_path: Path) -> None:
    import tracemalloc

    (tmp_path / "sky.hdr").write_bytes(BAD["72 bytes for 134 million pixels"])
    tracemalloc.start()
    with refused(where="sky.hdr"):
        read_environment(tmp_path / "sky.hdr")
    most = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert most < 2**20
