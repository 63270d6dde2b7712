"""Where to look for light, in a handful of instructions: a cosine and a few lobes, drawn from and with their density.

Seen from ωo, ωi is drawn from

    p(ωi | ωo) = (1 − Σk wk(cosθo)) cosθi/π + Σk wk(cosθo) pk(ωi | ωo).

pk mirrors ωo at a half vector of the GGX distribution of roughness (αx, αy), drawn among those that ωo sees and that
mirror it above a bound near the horizon (Eto and Tokuyoshi 2023, eq. 5 to 8; the spherical caps are those of Dupuy and
Benyoub 2023). With s = ωi + ωo,

    pk = D(s)/(2 (κ zo + t)),   D = |s|⁴/(π αx αy (sx²/αx² + sy²/αy² + sz²)²),   t = |(αx xo, αy yo, zo)|,
    κ = (1 − a²) σ²/(σ² + a² zo²),   a = min(αx, αy),   σ = 1 + √(xo² + yo²).

Few mirrored directions fall under the horizon: p integrates to 1 less their share. The weights wk are linear between
`NODES` even steps of cosθo, which hat functions give without a table: Σj wkj max(0, 1 − |(NODES − 1) cosθo − j|).

Both functions are expressions over named parameters (`density_statements`, `sample_statements`): printed, the
parameters are constants; interpreted on tensors, the density can be fitted (`mixture_fit`), and both are the reference
of the tests.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import torch
from torch import Tensor

from homofact.geometry.expression import Expression, Let, Tables, call, constant, substituted, table, variable, vector
from homofact.geometry.interpret import interpret
from homofact.geometry.torch_functions import TORCH

NODES = 8
LEAST = 0.1  # of the cosine, whatever cosθo: no weight f cosθi/p is above π f/LEAST
NARROWEST, WIDEST = 2e-3, 1.0
_TINY = 1e-20


@dataclass(frozen=True)
class LobeMixture:
    """The mixture of the module's head.

    `alphas` (αx, αy) in [NARROWEST, WIDEST] of each lobe, along axes turned by `turn` radians about the normal from the
    tangent; `weights` wkj of each, `NODES` of them at cosθo = j/(NODES − 1), ≥ 0, their sum over k at most 1 − LEAST.
    """

    alphas: tuple[tuple[float, float], ...]
    weights: tuple[tuple[float, ...], ...]
    turn: float = 0.0

    @property
    def isotropic(self) -> bool:
        """Whether it looks the same from every azimuth."""
        return all(x == y for x, y in self.alphas)

    def density(self, wi: Tensor, wo: Tensor) -> Tensor:
        """p(ωi | ωo) (N,) in sr⁻¹ of unit vectors (N, 3); 0 where a direction is under the horizon."""
        values = {"wi": list(wi.unbind(-1)), "wo": list(wo.unbind(-1)), **self.constants()}
        return interpret(density_statements(len(self.alphas), bool(self.turn)), values, TORCH)["density"][0]

    def draw(self, wo: Tensor, u: Tensor) -> Tensor:
        """ωi (N, 3) for viewers (N, 3) and points u (N, 3) of the unit cube; unit, some under the horizon."""
        values = {"wo": list(wo.unbind(-1)), "u": list(u.unbind(-1)), **self.constants()}
        return torch.stack(interpret(sample_statements(len(self.alphas), bool(self.turn)), values, TORCH)["wi"], -1)

    def constants(self) -> dict[str, Any]:
        """The parameters of the expressions by name, each a list of numbers."""
        return parameters(self.alphas, self.weights, (math.cos(self.turn), math.sin(self.turn)))

    def describe(self) -> dict[str, Any]:
        """JSON-able."""
        return {
            "kind": "cosine and GGX lobes, visible normals, bounded",
            "alphas": [list(pair) for pair in self.alphas],
            "turn": self.turn,
            "weights": [list(nodes) for nodes in self.weights],
        }


def parameters(alphas: Any, weights: Any, turn: Any) -> dict[str, Any]:
    """The parameters of the expressions by name, from numbers or scalar tensors alike."""
    given: dict[str, Any] = {"turn": list(turn)}
    for k, ((x, y), own) in enumerate(zip(alphas, weights, strict=True)):
        narrow = torch.minimum(x, y) if isinstance(x, Tensor) else min(x, y)
        given |= {
            f"alpha_{k}": [x, y, 1.0],
            f"stretch_{k}": [1 / x, 1 / y, 1.0],
            f"narrow_{k}": [narrow * narrow],
            f"gain_{k}": [1 / (2 * math.pi * x * y)],
        }
        for part in range(NODES // 4):
            given[f"weights_{k}_{part}"] = list(own[4 * part : 4 * part + 4])
    return given


def density_statements(lobes: int, turned: bool) -> list[Let]:
    """Statements over wi, wo (3,) and the parameters of so many lobes; the last is "density"."""
    wi, wo = variable("wi", 3), variable("wo", 3)
    made = _seen(wo, turned, wi + wo) + _weights(lobes)
    v, s = variable("v", 3), variable("s", 3)
    made.append(Let("s_squared", call("dot", s, s)))
    total = (1 - _sum([variable(f"w_{k}", 1) for k in range(lobes)])) * wi.z * (1 / math.pi)
    for k in range(lobes):
        made += [
            Let(f"stretched_{k}", s * variable(f"stretch_{k}", 3), f"lobe {k}: D/(2 (kappa z + t))"),
            Let(f"ratio_{k}", variable("s_squared", 1) / call("max", _squared(f"stretched_{k}"), _TINY)),
            Let(f"seen_{k}", v * variable(f"alpha_{k}", 3)),
            _bound(f"kappa_{k}", variable(f"narrow_{k}", 1)),
            Let(
                f"lobe_{k}",
                variable(f"ratio_{k}", 1) * variable(f"ratio_{k}", 1) * variable(f"gain_{k}", 1)
                / call("max", variable(f"kappa_{k}", 1) * v.z + call("sqrt", _squared(f"seen_{k}")), _TINY),
            ),
        ]  # fmt: skip
        total = total + variable(f"w_{k}", 1) * variable(f"lobe_{k}", 1)
    above = call("step", _TINY, call("min", wi.z, wo.z))
    return [*made, Let("density", total * above, "a cosine and the lobes, 0 under the horizon")]


def sample_statements(lobes: int, turned: bool) -> list[Let]:
    """Statements over wo, u (3,) and the parameters of so many lobes; the last is "wi"."""
    wo, u = variable("wo", 3), variable("u", 3)
    made = _seen(wo, turned) + _weights(lobes)
    v, alpha = variable("v", 3), variable("alpha", 3)
    # u.z picks the cosine first, then lobe after lobe; α goes from one to the next.
    edge, width, narrow = 1 - _sum([variable(f"w_{k}", 1) for k in range(lobes)]), constant(1, 1, 1), constant(1)
    for k in range(lobes):
        made.append(Let(f"picked_{k}", call("step", edge, u.z), "u.z picks the cosine or a lobe" if k == 0 else ""))
        edge = edge + variable(f"w_{k}", 1)
        picked = variable(f"picked_{k}", 1)
        width = width + (variable(f"alpha_{k}", 3) - _before("alpha", k, 3)) * picked
        narrow = narrow + (variable(f"narrow_{k}", 1) - _before("narrow", k, 1)) * picked
    lobe = variable("picked_0", 1)
    made += [
        Let("alpha", width),
        Let("stretched", v * alpha),
        Let("narrow", narrow),
        _bound("kappa", variable("narrow", 1)),
        Let(
            "view",
            variable("stretched", 3) / call("sqrt", call("max", _squared("stretched"), _TINY)) * lobe + _up(1 - lobe),
        ),
        Let(
            "low",
            variable("view", 3).z * (variable("kappa", 1) * lobe + (1 - lobe)),
            "a direction of the unit sphere above -low, added to the stretched view",
        ),
        Let("z", (1 - u.y) * (1 + variable("low", 1)) - variable("low", 1)),
        Let("radius", call("sqrt", call("max", 1 - variable("z", 1) * variable("z", 1), 0.0))),
        Let("phi", u.x * (2 * math.pi)),
        Let(
            "m",
            (
                vector(
                    variable("radius", 1) * call("cos", variable("phi", 1)),
                    variable("radius", 1) * call("sin", variable("phi", 1)),
                    variable("z", 1),
                )
                + variable("view", 3)
            )
            * alpha,
        ),
        Let("m_squared", call("max", _squared("m"), _TINY)),
        Let("mirrored", variable("m", 3) * (2 * call("dot", v, variable("m", 3)) / variable("m_squared", 1)) - v),
        Let(
            "found",
            variable("mirrored", 3) * lobe + variable("m", 3) * ((1 - lobe) / call("sqrt", variable("m_squared", 1))),
            "of the lobes mirrored at it, of the cosine itself",
        ),
    ]
    drawn = variable("found", 3)
    if not turned:
        return [*made[:-1], Let("wi", made[-1].expression, made[-1].comment)]
    turn = variable("turn", 2)
    back = vector(turn.x * drawn.x - turn.y * drawn.y, turn.y * drawn.x + turn.x * drawn.y, drawn.z)
    return [*made, Let("wi", back)]


def _seen(wo: Expression, turned: bool, both: Expression | None = None) -> list[Let]:
    """`v`, the viewer along the lobes' axes and not under the horizon, `s` along them, and what bounds need."""
    made, turn = [], variable("turn", 2)

    def along(w: Expression, z: Expression) -> Expression:
        if not turned:
            return vector(w.xy, z)
        return vector(turn.x * w.x + turn.y * w.y, turn.x * w.y - turn.y * w.x, z)

    made.append(Let("v", along(wo, call("max", wo.z, 0.0)), "the axes of the lobes" if turned else ""))
    if both is not None:
        made.append(Let("wi_wo" if turned else "s", both))
        if turned:
            made.append(Let("s", along(variable("wi_wo", 3), variable("wi_wo", 3).z)))
    # σ of the bound.
    made.append(Let("reach", 1 + call("sqrt", call("dot", wo.xy, wo.xy))))
    return [*made, Let("reach_squared", variable("reach", 1) * variable("reach", 1))]


def _bound(name: str, narrow: Expression) -> Let:
    """κ of the module's head, for a²."""
    z, reach = variable("v", 3).z, variable("reach_squared", 1)
    return Let(name, (1 - narrow) * reach / (reach + narrow * (z * z)))


def _weights(lobes: int) -> list[Let]:
    """w_k of every lobe."""
    made = [Let("level", call("min", variable("v", 3).z, 1.0) * (NODES - 1))]
    for part in range(NODES // 4):
        steps = constant(*range(4 * part, 4 * part + 4))
        hat = call("max", 1 - call("abs", variable("level", 1) - steps), 0.0)
        made.append(Let(f"hat_{part}", hat, "weights, linear between steps of the cosine" if part == 0 else ""))
    for k in range(lobes):
        parts = [call("dot", variable(f"hat_{p}", 4), variable(f"weights_{k}_{p}", 4)) for p in range(NODES // 4)]
        made.append(Let(f"w_{k}", _sum(parts)))
    return made


def _before(name: str, k: int, dimension: int) -> Expression:
    """A parameter of the lobe before number k; before the first, of the cosine: 1."""
    return variable(f"{name}_{k - 1}", dimension) if k else constant(*[1.0] * dimension)


def _squared(name: str) -> Expression:
    return call("dot", variable(name, 3), variable(name, 3))


def _up(length: Expression) -> Expression:
    return vector(constant(0), constant(0), length)


def _sum(parts: list[Expression]) -> Expression:
    total, *rest = parts
    for part in rest:
        total = total + part
    return total


def printed(statements: list[Let], values: Mapping[str, Any]) -> tuple[Let, ...]:
    """The statements with the parameters as constants, or as the expressions that `values` has for them."""
    given = {
        name: value if isinstance(value, Expression) else tuple(map(float, value)) for name, value in values.items()
    }
    return tuple(Let(let.name, substituted(let.expression, given), let.comment) for let in statements)


def parameter_tables(mixtures: Sequence[LobeMixture]) -> tuple[dict[str, Expression], Tables]:
    """(each parameter as what reads it from tables at the layer, the tables): a row for each of `mixtures`.

    Of a lobe (αx, αy, 1, a²), (1/αx, 1/αy, 1, 1/(2π αx αy)) and the weights are rows of four numbers; the turn is one
    of two. The mixtures have the same number of lobes.
    """
    constants = [mixture.constants() for mixture in mixtures]
    reading: dict[str, Expression] = {"turn": table("lobes_turn", 2)}
    names: dict[str, tuple[str, ...]] = {"lobes_turn": ("turn",)}
    for k in range(len(mixtures[0].alphas)):
        for vectors, scalar in ((f"alpha_{k}", f"narrow_{k}"), (f"stretch_{k}", f"gain_{k}")):
            row = table(f"lobes_{vectors}", 4)
            reading |= {vectors: row.xyz, scalar: row.w}
            names[f"lobes_{vectors}"] = (vectors, scalar)
        for part in range(NODES // 4):
            reading[f"weights_{k}_{part}"] = table(f"lobes_weights_{k}_{part}", 4)
            names[f"lobes_weights_{k}_{part}"] = (f"weights_{k}_{part}",)
    tables = tuple(
        (name, tuple(tuple(float(number) for one in own for number in lobe[one]) for lobe in constants))
        for name, own in names.items()
    )
    return reading, tables
