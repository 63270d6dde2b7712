"""Cache results that are computed from a source or from samples, as long as that object exists."""

import weakref
from collections.abc import Callable
from typing import Any, Generic, TypeVar

Made = TypeVar("Made")


class Kept(Generic[Made]):
    """A cache of `make(source)` per source object; it drops an entry when its source is deleted."""

    def __init__(self, make: Callable[[Any], Made]) -> None:
        self._make = make
        # By id: sources are compared by their tensors, and cannot be keys.
        self._found: dict[int, Made] = {}

    def of(self, source: Any) -> Made:
        """Return the result for a source, computed at the first call."""
        if id(source) not in self._found:
            self._found[id(source)] = self._make(source)
            weakref.finalize(source, self._found.pop, id(source), None)
        return self._found[id(source)]
