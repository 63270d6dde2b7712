"""The pattern of texels in the reflection of a sky if a lobe is narrower than a texel of the cube map.

The light of a lobe is a sum over texels, each at its centre. A lobe narrower than the step d between centres is bright
where a centre is mirrored and dark between: pictures show a grid of dots. The sum of Gaussians of the standard
deviation σ at steps of d varies around its mean by

    A = 2 exp(−2π² σ²/d²)

along each axis (the first term of Poisson's summation formula; the next is of fourth order): the brightest dots have
(1 + A)² of the mean light. The half vector turns half as far as the light: a lobe whose half width at half height is s
in slopes of h has σ = 2 s/√(2 ln 2). At the middle of a face the step is d = 2/n, the largest.

So the sums divide the texels near the mirror direction until the pattern is gone, again and again into 2 × 2 parts with
the texel's radiance, down to `FINEST` along a face: a narrow highlight then mirrors squares of even light, smoothed by
its own width.
"""

import math

# Parts along a face at most.
FINEST = 256
# The strongest pattern that is left where a texel can be divided. Obliquely, at a cosine of `_OBLIQUE`, the lobe is so
# much narrower across the plane of incidence.
_UNSEEN, _OBLIQUE = 0.01, 0.4
_WORTH_A_NOTE = 0.03


def texel_ripple(half_width: float, size: int) -> float:
    """How much brighter than the mean the brightest dots are, as a part of the lobe's mean light, under an even sky.

    Parameters
    ----------
    half_width : float
        Of the lobe at half height, in slopes of the half vector.
    size : int
        Texels along a face of the cube map.

    Returns
    -------
    float
        About 0 for lobes wider than a texel. The formula is accurate up to a ripple of about 3.

    Examples
    --------
    >>> round(texel_ripple(0.02, 64), 4)
    0.0
    >>> round(texel_ripple(0.0085, 32), 2)
    1.88
    """
    sigma = 2 * half_width / math.sqrt(2 * math.log(2))
    return (1 + 2 * math.exp(-2 * (math.pi * sigma * size / 2) ** 2)) ** 2 - 1


def texel_divisions(half_width: float, size: int) -> int:
    """How often the texels of a cube map are divided into 2 × 2 parts for a lobe of this half width.

    Parameters
    ----------
    half_width : float
        Of the lobe at half height, in slopes of the half vector.
    size : int
        Texels along a face of the cube map.

    Returns
    -------
    int
        0 for lobes wider than a texel; as often as `FINEST` allows for the narrowest.

    Examples
    --------
    >>> texel_divisions(0.05, 64), texel_divisions(0.02, 64), texel_divisions(0.0085, 64), texel_divisions(0.0085, 32)
    (0, 1, 2, 3)
    """
    narrow, times = _OBLIQUE * half_width, 0
    while size << times < FINEST and texel_ripple(narrow, size << times) >= _UNSEEN:
        times += 1
    return times


def texel_note(name: str, half_width: float, size: int) -> tuple[str, ...]:
    """Return a line about the pattern if an object's pictures show it although texels are divided."""
    ripple = texel_ripple(_OBLIQUE * half_width, size << texel_divisions(half_width, size))
    if ripple < _WORTH_A_NOTE:
        return ()
    return (
        f"{name}: its highlight is so narrow that, seen obliquely, its light is up to {ripple:.0%} too bright in a"
        " pattern of dots",
    )
