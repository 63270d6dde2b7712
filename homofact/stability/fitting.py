"""Stressors of the fit's own settings: smoothing, and textures that the data cannot tell apart."""

from dataclasses import replace

from homofact.stability.problem import Problem, Scale, Stressor, unstressed

_LIST = ("wi", "h", "theta_h-theta_d", "d", "theta_i-theta_o", "theta_d-phi_d", "theta_i-delta_phi", "theta_h-phi_d")


def smoothing(strength: float, seed: int, scale: Scale) -> Problem:
    """λ of the Laplacian."""
    return replace(unstressed(seed, scale), settings=({"smoothing": strength},), key="stressed")


def coincident(strength: float, seed: int, scale: Scale) -> Problem:
    """Return `strength` textures under one and the same projection."""
    count = int(strength)
    choices = (
        {"projections": ("theta_h-theta_d",) * count, "textures": count},
        {"projections": ("wi", *("h",) * count)},
    )
    return replace(unstressed(seed, scale), settings=choices, key="stressed")


def _many_textures(strength: float, seed: int, scale: Scale) -> Problem:
    """`strength` textures for a tenth of the samples."""
    count = int(strength)
    problem = unstressed(seed, scale)
    fewer = problem.samples.subset(scale.samples // 10, seed)
    choices = ({"textures": count}, {"projections": (_LIST * 2)[:count]})
    return replace(problem.measuring(fewer), settings=choices)


STRESSORS = (
    Stressor(
        "smoothing", "too little or too much smoothing",
        "λ of the Laplacian goes from 0 to 1e8.",
        "At 0, nothing determines the texels between the samples. From 1 on, the Laplacian costs as much as the data,"
        " and the fit approaches the functions that the Laplacian ignores, {1, u, v, uv}: a highlight becomes a ramp."
        " Solvers do not warn, but the training error shows it.",
        "Use a λ of 1e-4 to 1e-2, or give none: `search` then finds it by cross-validation.",
        "λ", (1e-3, 0, 1, 1e3, 1e8), smoothing,
    ),
    Stressor(
        "coincident", "projections that coincide",
        "Two or more textures have the same projection.",
        "The data determine only the sum of such textures: any function can move from one to the other. The null space"
        " is as large as a texture, far larger than the constants and ramps that the gauge fixes. The ridge decides"
        " and divides the sum evenly. The product is right, but each single texture means nothing.",
        "Nothing is needed for the product. If you want to view or edit textures, use each projection once.",
        "textures", (1, 2, 3, 5), coincident,
    ),
    Stressor(
        "many-textures", "more textures than the data determine",
        "Two to twelve textures are fitted to a tenth of the samples.",
        "Overlapping projections share a constant, linear ramps and products, which is the null space that homofact"
        " fixes in closed form. Where samples are sparse, they also share many functions that no sample sees."
        " Smoothing and the gauge keep these small, so the product suffers little. A single texture then shows mostly"
        " smoothing.",
        "Use as many textures as lower the held-out error. `search` stops when another texture does not pay.",
        "textures", (2, 4, 8, 12), _many_textures,
    ),
)  # fmt: skip
