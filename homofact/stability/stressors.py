"""All stressors by name."""

from homofact.errors import BadInput
from homofact.stability import fitting, measuring, real, values
from homofact.stability.problem import Stressor

STRESSORS: dict[str, Stressor] = {
    stress.name: stress for stress in (*measuring.STRESSORS, *values.STRESSORS, *fitting.STRESSORS, *real.STRESSORS)
}


def stressor(name: str) -> Stressor:
    """Return the stressor called `name`. Raises BadInput that lists the names."""
    if name not in STRESSORS:
        raise BadInput(where="stressors", found=repr(name), expected=f"some of {', '.join(STRESSORS)}")
    return STRESSORS[name]
