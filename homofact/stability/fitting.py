"""Stressors of the fit's own settings: smoothing, and textures that the data cannot tell apart."""

from dataclasses import replace

from homofact.stability.problem import Problem, Scale, Stressor, unstressed

_LIST = ("wi", "h", "theta_h-theta_d", "d", "theta_i-theta_o", "theta_d-phi_d", "theta_i-delta_phi", "theta_h-phi_d")


def smoothing(strength: float, seed: int, scale: Scale) -> Problem:
    """Return the unstressed problem with the smoothing λ = `strength`."""
    return replace(unstressed(seed, scale), settings=({"smoothing": strength},), key="stressed")


def coincident(strength: float, seed: int, scale: Scale) -> Problem:
    """Return the unstressed problem with `strength` textures under the same projection."""
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
        "The smoothing weight λ goes from 0 to 1e8.",
        "At λ = 0, nothing determines the texels between the samples. From λ = 1 on, the Laplacian has at least as"
        " much weight as the data. The fit then approaches the functions that cost nothing under the Laplacian, {1,"
        " u, v,"
        " uv}, so a highlight becomes a ramp. The solvers do not warn, but the training error shows the problem.",
        "Set λ to 1e-4 to 1e-2, or leave the option out: `search` then finds λ by cross-validation.",
        "λ", (1e-3, 0, 1, 1e3, 1e8), smoothing,
    ),
    Stressor(
        "coincident", "projections that coincide",
        "Two or more textures have the same projection.",
        "The data determine only the sum of the log textures: you can add any function to one and subtract it from"
        " the other. This null space has as many dimensions as a texture has texels. It is far larger than the"
        " constants and ramps that the [gauge](concepts/gauge.md) fixes. The ridge term then divides the sum evenly"
        " between the textures. The product is correct, but a single texture has no meaning of its own.",
        "No action is needed if you use only the product. If you want to view or edit single textures, use each"
        " projection only once.",
        "textures", (1, 2, 3, 5), coincident,
    ),
    Stressor(
        "many-textures", "more textures than the data determine",
        "Two to twelve textures are fitted to a tenth of the samples.",
        "Overlapping projections can exchange constants, linear ramps and products uv. homofact fixes this null"
        " space in closed form (the [gauge](concepts/gauge.md)). Where samples are sparse, the projections can also"
        " exchange many functions that change no sample's value."
        " Smoothing and the gauge keep these small, so the product suffers little. A single texture is then"
        " determined mostly by the smoothing.",
        "Add textures only as long as the held-out error falls. `search` stops when another texture does not pay.",
        "textures", (2, 4, 8, 12), _many_textures,
    ),
)  # fmt: skip
