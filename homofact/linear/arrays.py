"""Convert the tensors of a solver to NumPy arrays."""

from typing import Any, TypeAlias

import numpy as np

# An array that a record holds; whoever makes the record may give a tensor (`as_arrays`), which no type can say.
Held: TypeAlias = Any


def as_array(values: Any, kind: Any = None) -> np.ndarray:
    """Return tensors, arrays or numbers as a NumPy array of type `kind`, which shares memory if possible."""
    if hasattr(values, "detach"):
        values = values.detach().cpu().numpy()
    return np.asarray(values, dtype=kind)


def as_arrays(record: Any, *names: str) -> None:
    """Convert the fields `names` of a frozen dataclass to arrays in its `__post_init__`; None stays None."""
    for name in names:
        value = getattr(record, name)
        if value is not None:
            object.__setattr__(record, name, as_array(value))
