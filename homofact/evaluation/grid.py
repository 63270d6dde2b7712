"""Common code of charts and sweeps: grids of fits that resume after an interruption.

The key of a run is a digest of everything that could change its result. A finished result is stored under this key in
one atomic write, as a line of a CSV file (`evaluation.chart_ledger`) or as a folder (`sweeps.ledger`). Before a run
starts, its key is looked up, and a stored result is reused.
"""

import hashlib
import json
from collections.abc import Callable, Iterable, Mapping
from typing import Any, TypeVar

Run = TypeVar("Run")


def content_key(facts: Mapping[str, Any]) -> str:
    """Return a digest of JSON-able facts, 32 hexadecimal digits that do not depend on the order of the facts."""
    text = json.dumps(facts, sort_keys=True, allow_nan=False)
    return hashlib.sha256(text.encode()).hexdigest()[:32]


def each_once(runs: Iterable[Run], key: Callable[[Run], str]) -> dict[str, Run]:
    """Return the runs by key, in the given order; of runs with the same key, only the first."""
    by_key: dict[str, Run] = {}
    for run in runs:
        by_key.setdefault(key(run), run)
    return by_key
