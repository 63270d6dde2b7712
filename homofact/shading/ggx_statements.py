"""Express a GGX model, with the formula of `brdf.analytic.ggx`, as shader expressions without textures.

The parameters of the model are constants. With m = ωi + ωo, cosθd = |m|/2 and sin²θh = (mx² + my²)/|m|², so

    cos²θh (α² − 1) + 1 = α² + sin²θh (1 − α²),

The right side is accurate for a narrow highlight in float32; the left side loses its digits by cancellation.
"""

import math

from homofact.brdf.analytic.common import MIN_COSINE
from homofact.brdf.analytic.ggx import GgxBrdf, GgxLobe
from homofact.geometry.expression import Expression, Let, call, constant, variable

# Of |ωi + ωo|², which vanishes where both directions are opposite on the horizon.
_LEAST_SQUARE = 1e-12


def ggx_statements(model: GgxBrdf) -> tuple[list[Let], Expression]:
    """Return statements in wi and wo (3,), and the expression of the value (C,) in sr⁻¹, valid above the horizon."""
    wi, wo, m = variable("wi", 3), variable("wo", 3), variable("m", 3)
    square, rest = variable("square", 1), variable("rest", 1)
    statements = [
        Let("m", wi + wo),
        Let("square", call("max", call("dot", m, m), _LEAST_SQUARE)),
        Let("sine2", call("dot", m.xy, m.xy) / square, "the square of the sine between half vector and normal"),
        Let("rest", 1.0 - call("sqrt", square) * 0.5, "1 - cosine between light and half vector"),
        Let("fresnel", rest * rest * rest * rest * rest),
        Let("ni", call("max", wi.z, MIN_COSINE)),
        Let("no", call("max", wo.z, MIN_COSINE)),
    ]
    value = constant(*(colour / math.pi for colour in model.diffuse))
    for number, lobe in enumerate(model.lobes):
        made, part = _lobe(number, lobe)
        statements += made
        value = value + part
    return statements, value


def _lobe(number: int, lobe: GgxLobe) -> tuple[list[Let], Expression]:
    """ks F D G/(4 cosθi cosθo) of one lobe, with the statements that it reads."""
    squared, f0 = lobe.roughness**2, lobe.reflectance
    ni, no, spread = variable("ni", 1), variable("no", 1), variable(f"spread_{number}", 1)
    statement = Let(spread.text, variable("sine2", 1) * (1 - squared) + squared, f"lobe {number}")
    masked = no * call("sqrt", ni * ni * (1 - squared) + squared) + ni * call("sqrt", no * no * (1 - squared) + squared)
    facets = (variable("fresnel", 1) * (1 - f0) + f0) * (squared / (2 * math.pi)) / (spread * spread * masked)
    value = Let(f"lobe_{number}", facets)
    return [statement, value], variable(value.name, 1) * constant(*lobe.specular)
