"""Convert values of any type to JSON types."""

import math
from typing import Any


def plain(value: Any) -> Any:
    """Return `value` in JSON types: lists for tuples, None for non-finite numbers, strings for other types."""
    if isinstance(value, dict):
        return {str(key): plain(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [plain(entry) for entry in value]
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if value is None or isinstance(value, bool | int | str):
        return value
    return plain(value.tolist()) if hasattr(value, "tolist") else str(value)
