"""What is computed of a source, or of samples, once and kept for the next use, as long as the object lives."""

import weakref
from collections.abc import Callable
from typing import Any, Generic, TypeVar

Made = TypeVar("Made")


class Kept(Generic[Made]):
    """The results of `make(source)`, one for each source object; an entry goes with its source, keeping none alive."""

    def __init__(self, make: Callable[[Any], Made]) -> None:
        self._make = make
        # By id: sources are compared by their tensors, and cannot be keys.
        self._found: dict[int, Made] = {}

    def of(self, source: Any) -> Made:
        """Return the result of a source, made on first asking."""
        if id(source) not in self._found:
            self._found[id(source)] = self._make(source)
            weakref.finalize(source, self._found.pop, id(source), None)
        return self._found[id(source)]
