"""Mixes that often win, tried first.

A few mixes fit most materials best. `scripts/accuracy/known_mixes.py` runs exhaustive searches on surrogates and
analytic models, and stores in `known_mixes.json` the few mixes that together come closest to all results. A search with
effort "quick" or "normal" evaluates these mixes and refines the best ones; "thorough" and efforts given as numbers try
every mix.
"""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import torch

from homofact.factor.projection import Projection, Warp, fixed_projection
from homofact.geometry.rotation import Rotation
from homofact.methods.kinds import is_searched, takes_warp
from homofact.methods.mix import Mix

VERSION = 1  # of the table's form
DESCENDING = {"quick": 1, "normal": 3}  # efforts that try known mixes, and how many of them descend
TABLE = Path(__file__).with_name("known_mixes.json")


def mix_record(mix: Mix) -> dict[str, Any]:
    """Return the mix for JSON: kinds, rotations of the searched ones, warp, λ, and whether it is reciprocal."""
    quaternions = [None if p.quaternions is None else np.asarray(p.quaternions).tolist() for p in mix.projections]
    return {
        "kinds": list(mix.kinds),
        "quaternions": quaternions,
        "warp": None if mix.warp is None else mix.warp.width,
        "smoothing": list(mix.smoothing),
        "reciprocal": all(projection.reciprocal for projection in mix.projections),
    }


def mix_of_record(record: dict[str, Any], reciprocal: bool, bound: str) -> Mix:
    """Return the mix of a record, reciprocal or not as requested, without a validation error."""
    warp = None if record["warp"] is None else Warp(record["warp"])
    projections = tuple(
        _projection(kind, rows, reciprocal, bound, warp if takes_warp(kind) else None)
        for kind, rows in zip(record["kinds"], record["quaternions"], strict=True)
    )
    return Mix(tuple(record["kinds"]), projections, tuple(record["smoothing"]))


def _projection(
    kind: str, rows: Sequence[Sequence[float]] | None, reciprocal: bool, bound: str, warp: Warp | None
) -> Projection:
    if not is_searched(kind) or rows is None:
        return fixed_projection(kind, reciprocal, warp)
    rotation = Rotation(torch.tensor(rows, dtype=torch.float64, device="cpu")).normalized()
    return Projection.from_rotation(kind, rotation, reciprocal, bound, warp)


@dataclass(frozen=True)
class KnownMixes:
    """The mixes of the table as records, by number of textures; if the table is unusable, `note` explains why."""

    by_count: tuple[tuple[dict[str, Any], ...], ...] = ()
    note: str = ""

    def of(self, count: int, kinds: Sequence[str], reciprocal: bool, bound: str) -> list[Mix]:
        """Return the known mixes of `count` textures of these kinds; none where there are none."""
        if not 0 < count <= len(self.by_count):
            return []
        allowed = set(kinds)
        chosen = (record for record in self.by_count[count - 1] if allowed.issuperset(record["kinds"]))
        return [mix_of_record(record, reciprocal, bound) for record in chosen]


NONE = KnownMixes()


@lru_cache(maxsize=2)
def known_mixes(path: Path = TABLE) -> KnownMixes:
    """Return the table in the package. If it is missing or of another version, it is empty and a note explains why."""
    try:
        stored = json.loads(path.read_text(encoding="utf-8"))
        version = stored["version"]
    except (OSError, ValueError, TypeError, KeyError):
        return KnownMixes(note=f"{path.name} is missing or damaged: every mix was tried, which takes longer")
    if version != VERSION:
        return KnownMixes(note=f"{path.name} is of version {version}, not {VERSION}: every mix was tried")
    return KnownMixes(tuple(tuple(records) for records in stored["mixes"]))
