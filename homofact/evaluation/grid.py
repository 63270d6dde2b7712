"""What charts and sweeps have in common: grids of fits that go on where they stopped.

A run is known by its key, a digest of all that could change its result. Its finished result is kept under that key,
written whole or not at all: a line of a CSV (`evaluation.chart_ledger`), or a folder (`sweeps.ledger`). What is asked
for again is looked up before it is done.
"""

import hashlib
import json
from collections.abc import Callable, Iterable, Mapping
from typing import Any, TypeVar

Run = TypeVar("Run")


def content_key(facts: Mapping[str, Any]) -> str:
    """32 hexadecimal digits of JSON-able facts, whatever their order."""
    text = json.dumps(facts, sort_keys=True, allow_nan=False)
    return hashlib.sha256(text.encode()).hexdigest()[:32]


def each_once(runs: Iterable[Run], key: Callable[[Run], str]) -> dict[str, Run]:
    """Return the runs by key, in the order in which they are asked for; the first of those with one key."""
    by_key: dict[str, Run] = {}
    for run in runs:
        by_key.setdefault(key(run), run)
    return by_key
