"""Finished blocks of an object's transport in a folder, from which an interrupted run resumes.

A block has the vectors of `BLOCK` vertices and is written whole or not at all. The folder stores a fingerprint of all
inputs of the blocks, so that homofact rejects the blocks of another scene. Finished blocks are joined into one
memory-mapped file for each array of `LONG`.
"""

from pathlib import Path

import numpy as np

from homofact.errors import BadInput
from homofact.files.archive import read_arrays, write_arrays
from homofact.files.atomic import replace_file
from homofact.files.reading import read_bytes

BLOCK = 256
PARTS = ("count", "index", "number", "scale")
# What is large, and kept in files of its own.
LONG = {"index": np.uint16, "number": np.int16}
_EXPECTED = "a block of transport that homofact wrote"


def blocks_folder(folder: Path) -> Path:
    """Return the folder for an object's finished blocks, created if missing. Raises BadInput if it is a file."""
    if folder.exists() and not folder.is_dir():
        raise BadInput(where=folder, found="a file", expected="a folder for blocks of transport")
    folder.mkdir(parents=True, exist_ok=True)
    return folder


def claim(folder: Path, fingerprint: str, name: str) -> None:
    """Mark the folder as this precomputation's. Raises BadInput if it contains the blocks of another one."""
    mark = folder / "fingerprint.npz"
    if mark.exists():
        found = read_arrays(mark, read_bytes(mark, _EXPECTED), ("digest", "mesh"), _EXPECTED)
        if str(found.get("digest")) != fingerprint:
            what = f"holds transport of {found.get('mesh')} with another mesh, material or setting"
            raise BadInput(what, where=folder, expected=f"that of {name} or an empty folder")
        return
    if any(folder.glob("block_*.npz")):
        raise BadInput("holds blocks of transport and no fingerprint", where=folder, expected="an empty folder")
    write_arrays(mark, {"digest": np.array(fingerprint), "mesh": np.array(name)})


def read_block(file: Path, terms: int, vertices: int) -> dict[str, np.ndarray] | None:
    """Return a finished block, or None if its file does not exist. Raises BadInput for a damaged block."""
    if not file.exists():
        return None
    found = read_arrays(file, read_bytes(file, _EXPECTED), PARTS, _EXPECTED)
    if len(found) < len(PARTS) or len(found["count"]) != vertices * terms:
        raise BadInput(f"not a whole block of {vertices} vertices", where=file, expected="one, or delete it")
    if len(found["scale"]) != len(found["count"]) or not np.isfinite(found["scale"]).all():
        raise BadInput("its scales are not those of its vectors", where=file, expected=f"{_EXPECTED}, or delete it")
    if found["count"].sum() != len(found["index"]) or len(found["index"]) != len(found["number"]):
        raise BadInput("its parts do not belong together", where=file, expected=f"{_EXPECTED}, or delete it")
    return found


def block_file(folder: Path, first: int) -> Path:
    """The file of the block of vertices from `first` on."""
    return folder / f"block_{first // BLOCK:05d}.npz"


def joined_blocks(folder: Path, places: list[int], entries: int) -> list[np.ndarray]:
    """Return the arrays of `LONG`, each joined over all blocks in one memory-mapped file."""
    found = []
    for name, kind in LONG.items():
        file = folder / f"{name}.bin"

        def write(target: Path, part: str = name) -> None:
            with target.open("wb") as out:
                for first in places:
                    block = block_file(folder, first)
                    out.write(read_arrays(block, read_bytes(block, _EXPECTED), (part,), _EXPECTED)[part].data)

        replace_file(file, write)
        # Copied where it is written to: nothing writes, but compiled loops know one kind of array then.
        mapped = np.memmap(file, kind, "c", shape=(entries,)) if entries else np.zeros(0, kind)
        found.append(np.asarray(mapped))
    return found
