"""All stressors by name."""

from homofact.errors import BadInput
from homofact.evaluate.stability import fitting, measuring, real, values
from homofact.evaluate.stability.problem import Stressor

STRESSORS: dict[str, Stressor] = {
    each.name: each for each in (*measuring.STRESSORS, *values.STRESSORS, *fitting.STRESSORS, *real.STRESSORS)
}


def stressor(name: str) -> Stressor:
    """The stressor called `name`. Raises BadInput that lists the names."""
    if name not in STRESSORS:
        raise BadInput(f"stressors: found {name!r}, expected some of {', '.join(STRESSORS)}")
    return STRESSORS[name]
