"""Stressors of the fit's own settings: smoothing, and textures that the data cannot tell apart."""

from dataclasses import replace

from homofact.stability.problem import Problem, Scale, Stressor, unstressed

_LIST = ("wi", "h", "theta_h-theta_d", "d", "theta_i-theta_o", "theta_d-phi_d", "theta_i-delta_phi", "theta_h-phi_d")


def smoothing(strength: float, seed: int, scale: Scale) -> Problem:
    """λ of the Laplacian."""
    return replace(unstressed(seed, scale), settings=({"smoothing": strength},), key="stressed")


def coincident(strength: float, seed: int, scale: Scale) -> Problem:
    """`strength` textures under one and the same projection."""
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
        "smoothing", "smoothing from none to far too much",
        "λ of the Laplacian from 0 to 1e8.",
        "At 0 the texels between the samples hang in the air; at 1 and more the Laplacian costs as much as the data,"
        " and what is left are the functions it does not see, {1, u, v, uv}: a highlight becomes a ramp. Solvers"
        " do not complain: the training error does.",
        "λ of 1e-4 to 1e-2, or none given: `search` finds it by cross-validation.",
        "λ", (1e-3, 0, 1, 1e3, 1e8), smoothing,
    ),
    Stressor(
        "coincident", "projections that coincide",
        "Two and more textures under one projection.",
        "Only the sum of such textures reads the data; any function can move from one to the other. The null space is"
        " as large as a texture, far more than the constants and ramps that the gauge fixes, and the ridge decides: it"
        " shares the sum evenly. The product is right, each texture by itself means nothing.",
        "None for the product. For textures to look at or edit: one texture a projection.",
        "textures", (1, 2, 3, 5), coincident,
    ),
    Stressor(
        "many-textures", "more textures than the data can tell apart",
        "Two to twelve textures for a tenth of the samples.",
        "Besides the constant, overlapping projections share linear ramps and products (the null space that is fixed in"
        " closed form), and where samples are sparse far more functions that no sample sees. Smoothing and the gauge"
        " keep these small, so the product suffers little; what the textures show by themselves is then mostly"
        " smoothing.",
        "As many textures as lower the held-out error; `search` stops by itself where one is not worth having.",
        "textures", (2, 4, 8, 12), _many_textures,
    ),
)  # fmt: skip
