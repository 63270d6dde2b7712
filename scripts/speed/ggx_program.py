"""Write GGX lobes over a diffuse base (`homofact.brdf.analytic.ggx`) as a shading program for timing.

The program has no textures. With s = ωi + ωo, for which |s| = 2 cosθd and |s.xy|²/|s|² = sin²θh,

    D = α²/(π (α² + (1 − α²) sin²θh)²)

which is the model's eq. 33 without the difference of two numbers near 1 that float32 would lose at the peak of a
narrow lobe. Masking and Fresnel are those of the model; α, F0 and the colours are constants.
"""

import math

from homofact.brdf.analytic.common import MIN_COSINE
from homofact.brdf.analytic.ggx import GgxBrdf, GgxLobe
from homofact.geometry.expression import Expression, Let, call, constant, variable
from homofact.shading.program import Program


def ggx_program(model: GgxBrdf) -> Program:
    """The statements of the module's head, a colour of as many components as the model has channels (at most 4)."""
    wi, wo, s = variable("wi", 3), variable("wo", 3), variable("s", 3)
    squared, missing, square = variable("squared", 1), variable("missing", 1), variable("square", 1)
    statements = [
        Let("s", wi + wo),
        # Back to back on the horizon s is 0, and the half vector the normal.
        Let("squared", call("max", call("dot", s, s), 1e-30)),
        Let("sin2", call("dot", s.xy, s.xy) / squared, "squared sine of theta_h"),
        Let("missing", call("max", 1 - call("sqrt", squared) * 0.5, 0.0), "1 - cos theta_d"),
        Let("square", missing * missing),
        Let("fifth", square * square * missing),
        Let("ni", call("max", wi.z, MIN_COSINE)),
        Let("no", call("max", wo.z, MIN_COSINE)),
    ]
    total: Expression = constant(*(value / math.pi for value in model.diffuse))
    for k, lobe in enumerate(model.lobes):
        statements += _lobe(lobe, k)
        colour = constant(*(value * lobe.roughness**2 / (2 * math.pi) for value in lobe.specular))
        total = total + colour * variable(f"lobe_{k}", 1)
    result = total * call("step", 0.0, call("min", wi.z, wo.z))
    return Program(tuple(statements), result, (), model.channels, (f"GGX of {len(model.lobes)} over a diffuse base",))


def _lobe(lobe: GgxLobe, k: int) -> list[Let]:
    """Statements up to `lobe_k`, the lobe without its colour and α²/(2π)."""
    squared, f0 = lobe.roughness**2, lobe.reflectance
    ni, no, spread = variable("ni", 1), variable("no", 1), variable(f"spread_{k}", 1)
    masked = [a * call("sqrt", b * b * (1 - squared) + squared) for a, b in ((no, ni), (ni, no))]
    fresnel = variable("fifth", 1) * (1 - f0) + f0
    return [
        Let(f"spread_{k}", variable("sin2", 1) * (1 - squared) + squared),
        Let(f"masked_{k}", masked[0] + masked[1]),
        Let(f"lobe_{k}", fresnel / (spread * spread * variable(f"masked_{k}", 1))),
    ]
