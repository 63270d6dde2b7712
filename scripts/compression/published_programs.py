"""Published fits (`published_fits`) as shading programs, to be timed by the compiler that ours is timed with.

With s = ωi + ωo, for which |s| = 2 cosθd and cosθh = s.z/|s|:

    abc   the model's formula; 1 − cosθh = |s.xy|²/(|s|² (1 + cosθh)), without a difference of numbers near 1; powers by
          exp and log
    sgd   the same; tan²θh = |s.xy|²/s.z², c βᵏ = exp(log c + k log β), so that no factor leaves float32
    npf   D, F and G are textures of one row, read at √(θh/90°), θd/90°, θi/90° and θo/90°: bins' centres are texels'

Processes (nps) have a decoder of a million numbers, which is no statement a neuron: torch runs it.
"""

import math
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import torch

from homofact.brdf.analytic.common import MIN_COSINE
from homofact.brdf.factored import BINS, FactoredBrdf
from homofact.geometry.expression import Expression, Let, call, constant, fetch, variable, vector
from homofact.shading.program import Program

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from scripts.data.published_fits import Abc, Sgd

_TINY = 1e-20


def abc_program(model: Abc) -> Program:
    """The statements of `Abc.formula`."""
    cosine, index2 = variable("cosine", 1), model.index**2
    g, plus, minus = (variable(name, 1) for name in ("g", "plus", "minus"))
    parallel, ratio = variable("parallel", 1), variable("ratio", 1)
    statements = [
        *_geometry(),
        Let("fallen", variable("flat", 1) / (variable("squared", 1) * (variable("peak", 1) + 1))),
        Let("g", call("sqrt", cosine * cosine + (index2 - 1))),
        Let("plus", g + cosine),
        Let("minus", call("max", g - cosine, 0.0)),
        Let("parallel", (cosine * plus - 1) / (cosine * minus + 1)),
        Let("ratio", minus / plus),
        Let("fresnel", ratio * ratio * (parallel * parallel + 1) * 0.5),
        Let("masked", call("min", variable("peak", 1) * call("min", variable("ni", 1), variable("no", 1)) * 2
                           / call("max", cosine, MIN_COSINE), 1.0)),
        Let("lobe", call("exp", call("log", variable("fallen", 1) * model.b + 1) * -model.c) * variable("fresnel", 1)
            * variable("masked", 1) / (variable("ni", 1) * variable("no", 1))),
    ]  # fmt: skip
    total = constant(*(x / math.pi for x in model.diffuse)) + variable("lobe", 1) * constant(
        *(x / math.pi for x in model.a)
    )
    return _program(statements, total, "ABC")


def sgd_program(model: Sgd) -> Program:
    """The statements of `Sgd.formula`, each channel with its own."""
    n = model.numbers
    cosine = variable("cosine", 1)
    missing = variable("missing", 1)
    statements = [
        *_geometry(),
        Let("tangent", variable("flat", 1) / call("max", variable("sz", 1) * variable("sz", 1), _TINY)),
        Let("peaked", variable("peak", 1) * variable("peak", 1)),
        Let("missing", call("max", 1 - cosine, 0.0)),
        Let("fifth", missing * missing * missing * missing * missing),
        *(Let(f"theta_{w}", _angle(w)) for w in ("wi", "wo")),
        Let("divided", variable("peaked", 1) * variable("peaked", 1) * variable("ni", 1) * variable("no", 1)),
    ]
    parts: list[Expression] = []
    for k in range(3):
        alpha, x = n["alpha"][k], variable(f"x_{k}", 1)
        statements += [
            Let(f"x_{k}", variable("tangent", 1) * (1 / alpha) + alpha),
            Let(f"d_{k}", call("exp", 0.0 - x - call("log", x) * n["p"][k]) * (n["kappa"][k] / math.pi)),
            Let(
                f"fresnel_{k}",
                call("max", variable("fifth", 1) * (1 - n["f0"][k]) - cosine * n["f1"][k] + n["f0"][k], 0.0),
            ),
        ]
        for w in ("wi", "wo"):
            beyond = call("max", variable(f"theta_{w}", 1) - n["theta0"][k], _TINY)
            log_c = math.log(max(n["c"][k], 1e-38))
            power = call("exp", call("min", call("log", beyond) * n["k"][k] + log_c, 3.0))
            fallen = (1 - call("exp", power)) * n["lambda"][k] + 1
            statements.append(Let(f"g_{w}_{k}", call("min", call("max", fallen, 0.0), 1.0)))
        lobe = variable(f"d_{k}", 1) * variable(f"fresnel_{k}", 1) * variable(f"g_wi_{k}", 1) * variable(f"g_wo_{k}", 1)
        parts.append((lobe * n["rho_s"][k] / variable("divided", 1) + n["rho_d"][k]) * (1 / math.pi))
    return _program(statements, vector(*(call("max", part, 0.0) for part in parts)), "SGD")


def npf_program(model: FactoredBrdf) -> tuple[Program, list[np.ndarray]]:
    """(the statements of `FactoredBrdf.formula`, its tables D, F and G as textures)."""
    base, scale, peak, masking, fresnel = torch.as_tensor(model.table).double().split((1, 1, BINS, BINS, BINS))
    # θd = atan2(|ωi − ωo|, |ωi + ωo|).
    e, to_unit = variable("e", 3), 2 / math.pi
    apart = call("sqrt", call("dot", e, e))
    places = {
        "h": call("sqrt", call("atan2", call("sqrt", variable("flat", 1)), variable("sz", 1)) * to_unit),
        "d": call("atan2", apart, variable("length", 1)) * to_unit,
        "i": _angle("wi") * to_unit,
        "o": _angle("wo") * to_unit,
    }
    statements = [*_geometry(), Let("e", variable("wi", 3) - variable("wo", 3))]
    statements += [Let(f"uv_{k}", vector(place, constant(0.5))) for k, place in places.items()]
    statements += [
        Let(f"p_{k}", fetch(t, variable(f"uv_{k}", 2), 3)) for k, t in zip(places, (0, 1, 2, 2), strict=True)
    ]
    product = variable("p_h", 3) * variable("p_d", 3) * variable("p_i", 3) * variable("p_o", 3)
    product = product * constant(*(scale[0] / math.pi).tolist()) / (variable("ni", 1) * variable("no", 1))
    total = call("max", product + constant(*(base[0] / math.pi).tolist()), 0.0)
    textures = [table[None].float().numpy() for table in (peak, fresnel, masking)]
    return _program(statements, total, "NPF", ((1, BINS),) * 3), textures


def _geometry() -> list[Let]:
    """s, |s.xy|², |s|², |s|, s.z, cosθd, cosθh, and the cosines to divide by."""
    wi, wo, s = variable("wi", 3), variable("wo", 3), variable("s", 3)
    return [
        Let("s", wi + wo),
        Let("flat", call("dot", s.xy, s.xy)),
        Let("sz", s.z),
        Let("squared", call("max", call("dot", s, s), 1e-30)),
        Let("length", call("sqrt", variable("squared", 1))),
        Let("cosine", variable("length", 1) * 0.5),
        Let("peak", call("max", variable("sz", 1) / variable("length", 1), MIN_COSINE)),
        Let("ni", call("max", wi.z, MIN_COSINE)),
        Let("no", call("max", wo.z, MIN_COSINE)),
    ]


def _angle(name: str) -> Expression:
    w = variable(name, 3)
    return call("atan2", call("sqrt", call("dot", w.xy, w.xy)), w.z)


def _program(statements: list[Let], total: Expression, words: str, shapes: Sequence[tuple[int, ...]] = ()) -> Program:
    above = call("step", 0.0, call("min", variable("wi", 3).z, variable("wo", 3).z))
    statements.append(Let("f", total))
    result = variable("f", 3) * above
    return Program(tuple(statements), result, tuple(shapes), ("R", "G", "B"), (words,))
