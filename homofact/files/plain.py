"""Values of any kind as JSON has them."""

import math
from typing import Any


def plain(value: Any) -> Any:
    """Return `value` in JSON's own types: tuples to lists, numbers that are not finite to None, others by str."""
    if isinstance(value, dict):
        return {str(key): plain(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [plain(entry) for entry in value]
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if value is None or isinstance(value, bool | int | str):
        return value
    return plain(value.tolist()) if hasattr(value, "tolist") else str(value)
