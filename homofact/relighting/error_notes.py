"""A note on an object whose relit picture differs visibly from the exact one."""

import math

from homofact.relighting.errors import RelightErrors

# Below this PSNR in dB a picture looks wrong at first sight; above this relative RMS the rim does, unless the picture's
# PSNR is so high that the rim is a few dark pixels.
_POOR, _POOR_RIM, _SAME = 30.0, 0.2, 45.0
# The part of an error above which one stage makes most of it.
_MOST = 0.7


def error_notes(name: str, found: RelightErrors | None, separate: bool) -> tuple[str, ...]:
    """Return a warning line about an object if its errors are visible.

    Parameters
    ----------
    name : str
        Name of the object.
    found : RelightErrors or None
        As measured; None if the camera does not see it.
    separate : bool
        Whether the object's sharp lobe is summed separately.

    Returns
    -------
    tuple of str
        One line, or none.

    Examples
    --------
    >>> error_notes("ball", RelightErrors({"picture": 0.03, "rim": 0.5}, 0.0, 64, psnr=19.7), False)[0][:47]
    'ball: its picture differs visibly from the exac'
    >>> error_notes("ball", RelightErrors({"picture": 0.03}, 0.0, 64, psnr=41.0), False)
    ()
    """
    if found is None:
        return ()
    rim = found.errors.get("rim", 0.0)
    poor = [] if found.psnr is None or found.psnr >= _POOR else [f"PSNR {found.psnr:.1f} dB"]
    same = found.psnr is not None and found.psnr >= _SAME
    poor += [f"an error of {rim:.0%} at the rim"] if rim > _POOR_RIM and not same else []
    if not poor:
        return ()
    advice = "more kept coefficients or terms may help"
    # An object without a pixel has the errors of its vertices alone.
    whole = found.errors.get("picture", found.errors.get("together", math.inf))
    if found.errors.get("bounce", 0.0) > _MOST * whole:
        advice = "most of it is the light between surfaces, which more coefficients or terms do not improve"
    elif not separate:
        advice = 'lobe = "separate" suits a sharp highlight, more terms a broad one'
    return (f"{name}: its picture differs visibly from the exact one ({', '.join(poor)}); {advice}",)
