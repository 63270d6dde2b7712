"""Arrays out of what a solver hands over: tensors become NumPy arrays once, here."""

from typing import Any, TypeAlias

import numpy as np

# An array that a record holds; whoever makes the record may give a tensor (`as_arrays`), which no type can say.
Held: TypeAlias = Any


def as_array(values: Any, kind: Any = None) -> np.ndarray:
    """Return a tensor of any device, an array or numbers as an array (of the type `kind`), shared where it can be."""
    if hasattr(values, "detach"):
        values = values.detach().cpu().numpy()
    return np.asarray(values, dtype=kind)


def as_arrays(record: Any, *names: str) -> None:
    """Make the fields `names` of a frozen record arrays; None stays None. For its `__post_init__`."""
    for name in names:
        value = getattr(record, name)
        if value is not None:
            object.__setattr__(record, name, as_array(value))
