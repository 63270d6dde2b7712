"""Write fits of any kind as shading programs, so that the same compiler counts their operations and times them.

With s = ωi + ωo, for which |s| = 2 cosθd and cosθh = s.z/|s|:

    abc   the model's formula; 1 − cosθh = |s.xy|²/(|s|² (1 + cosθh)), without a difference of numbers near 1; powers by
          exp and log
    sgd   the same; tan²θh = |s.xy|²/s.z², c βᵏ = exp(log c + k log β), so that no factor leaves float32
    hybrid  as its page's shader; what the network's first layer makes of the material's own numbers is a constant
    npf   D, F and G are textures of one row, read at √(θh/90°), θd/90°, θi/90° and θo/90°: bins' centres are texels'

Networks, GGX and textures have programs elsewhere, which `program_of_any` finds. Processes (nps) have a decoder of a
million numbers, which is no statement a neuron: torch runs it.
"""

import math
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import torch

from homofact.brdf.analytic.common import MIN_COSINE
from homofact.brdf.analytic.ggx import GgxBrdf
from homofact.brdf.factored import BINS, FactoredBrdf
from homofact.brdf.neural import NeuralBrdf
from homofact.brdf.reflectance import Reflectance
from homofact.geometry.expression import Expression, Let, call, constant, fetch, variable, vector
from homofact.parametric.model_fit import ModelFit
from homofact.shading.encoding import as_floats
from homofact.shading.program import Program, program_of

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from scripts.data.hybrid_fits import HybridBrdf
from scripts.data.published_fits import Abc, Sgd
from scripts.speed.ggx_program import ggx_program
from scripts.speed.network_program import dense, network_program

_TINY = 1e-20


def program_of_any(fit: Reflectance) -> tuple[Program, list[np.ndarray]]:
    """(the program, its textures' texels) of a published fit, of a model that was fitted here, or of textures."""
    model: Any = fit.model if isinstance(fit, ModelFit) else fit
    made = _PROGRAMS.get(type(model))
    if made is not None:
        return made(model), []
    if isinstance(model, FactoredBrdf):
        return npf_program(model)
    plain = [as_floats(texture.texels) for texture in model.textures]
    return program_of(model, plain), [texture.stored for texture in plain]


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


def hybrid_program(model: HybridBrdf) -> Program:
    """The statements of `HybridBrdf.formula`."""
    wi, wo, s = variable("wi", 3), variable("wo", 3), variable("s", 3)
    ax, ay = model.roughness
    cosine, spread = variable("cosine", 1), variable("spread", 1)
    h = [part / variable("length", 1) for part in (s.x, s.y)]
    statements = [
        *_geometry(),
        Let("spread", _squared(h[0] * (1 / ax)) + _squared(h[1] * (1 / ay)) + _squared(variable("peak", 1))),
        *(
            Let(f"masked_{name}", call("sqrt", 1 + (_squared(w.x * ax) + _squared(w.y * ay)) / _squared(z)) + 1)
            for name, w, z in (("wi", wi, variable("ni", 1)), ("wo", wo, variable("no", 1)))
        ),
        # D 2 2/(4 cosθi cosθo) without the 1/(π αx αy) that stands with the colours.
        Let("lobe", 1 / (spread * spread * variable("masked_wi", 1) * variable("masked_wo", 1)
                         * variable("ni", 1) * variable("no", 1))),
    ]  # fmt: skip
    values: list[Expression] = [wi.x, wi.y, wi.z, wo.x, wo.y, wo.z]
    own = torch.tensor(model.latent, dtype=torch.float64)
    last = len(model.weights) - 1
    for layer, (weight, bias) in enumerate(zip(model.weights, model.biases, strict=True)):
        if layer == 0:
            weight, bias = weight[:6], bias + own @ weight[6:]
        sums = dense(values, weight, bias, f"sum_{layer}")
        statements += sums
        values = [variable(let.name, 1) for let in sums]
        if layer < last:
            bent = [x * call("min", call("max", x + 1.5, 0.0), 3.0) * (1 / 3) for x in values]
            statements += [Let(f"layer_{layer}_{j}", x) for j, x in enumerate(bent)]
            values = [variable(f"layer_{layer}_{j}", 1) for j in range(len(bent))]
    parts = []
    for k in range(3):
        g, ratio = variable(f"g_{k}", 1), variable(f"ratio_{k}", 1)
        parallel = (cosine * (g + cosine) - 1) / (cosine * (g - cosine) + 1)
        statements += [
            Let(f"g_{k}", call("sqrt", cosine * cosine + (model.index[k] ** 2 - 1))),
            Let(f"ratio_{k}", (g - cosine) / (g + cosine)),
            Let(f"parallel_{k}", parallel),
            Let(f"fresnel_{k}", ratio * ratio * (_squared(variable(f"parallel_{k}", 1)) + 1)),
        ]
        base = variable(f"fresnel_{k}", 1) * variable("lobe", 1) * (0.5 / (math.pi * ax * ay))
        gate = 1 / (call("exp", 0.0 - values[3 + k]) + 1)
        parts.append(call("max", call("exp", values[k]) + gate * (base + model.diffuse[k] / math.pi), 0.0))
    return _program(statements, vector(*parts), "the hybrid")


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


def _squared(x: Expression) -> Expression:
    return x * x


def _angle(name: str) -> Expression:
    w = variable(name, 3)
    return call("atan2", call("sqrt", call("dot", w.xy, w.xy)), w.z)


def _program(statements: list[Let], total: Expression, words: str, shapes: Sequence[tuple[int, ...]] = ()) -> Program:
    above = call("step", 0.0, call("min", variable("wi", 3).z, variable("wo", 3).z))
    statements.append(Let("f", total))
    result = variable("f", 3) * above
    return Program(tuple(statements), result, tuple(shapes), ("R", "G", "B"), (words,))


_PROGRAMS: dict[type, Callable[[Any], Program]] = {
    Abc: abc_program,
    Sgd: sgd_program,
    HybridBrdf: hybrid_program,
    NeuralBrdf: network_program,
    GgxBrdf: ggx_program,
}
