"""Where to look for light: a small table that follows the lobe of a material, drawn from and with its density.

Seen from ωo, a direction ωi above the horizon has an angle φ round the mirror direction and a place v in [0, V(φ)]
on its way to the horizon (`lobe_coordinates`), dω = s dv dφ. With 2 for the sign of φ,

    p(ωi | ωo) = c cosθi/π + (1 − c) m(|φ|)/∫m dφ · g(v, |φ|)/∫g dv/(2 s).

c, m and g are linear between `THETAS` values of θo, at even steps of (a + a⁹)/2, a = √(1 − cosθo): close to each other
where a view grazes. m and g are linear between `PHIS` values of φ, and g is linear in v between 0, where g = 0, and
`RADII` more values. The integrals of piecewise linear functions are exact, so that p integrates to 1 whatever the table
holds, and roots of quadratics draw from it. No direction is lost under the horizon.

The table has (PHIS RADII + PHIS + 1) THETAS numbers, which half floats hold: 1.9 KiB. The density and the sampling are
expressions (`lobe_statements`). The shaders print them, Mitsuba and `LobeMixture` interpret them.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from torch import Tensor

from homofact.geometry.expression import Expression, Let, Tables, substituted, table
from homofact.geometry.interpret import interpret
from homofact.geometry.torch_functions import TORCH
from homofact.shading.lobe_statements import density_statements, row_names, sample_statements

ROUND = (1.0, 0.0, 1.0)  # no grain
LEAST = 1 / 256  # share of the cosine: no weight f cosθi/p is above π f/LEAST


@dataclass(frozen=True)
class LobeMixture:
    """The density of the module's head.

    `lobe` (THETAS, PHIS, RADII) is g and `turns` (THETAS, PHIS) is m, both > 0 and of any scale; `cosine` (THETAS,) is
    c in (0, 1]. All are float64 and half floats. `scale` is σ > 0, `grain` the entries xx, xy, yy of A, and
    `grained` whether the coordinates are those of an anisotropic material, which an isotropic one may have as well.
    """

    lobe: Tensor
    turns: Tensor
    cosine: Tensor
    scale: float
    grain: tuple[float, float, float] = ROUND
    grained: bool = False

    @property
    def isotropic(self) -> bool:
        """Whether it looks the same from every azimuth."""
        return self.grain == ROUND

    @property
    def nbytes(self) -> int:
        """Bytes of the table, as half floats, and of σ and A, as floats."""
        return 2 * self.rows().numel() + 4 * 4

    def rows(self) -> Tensor:
        """The table as rows of four numbers (N, 4): g by θo, φ and v, then m by φ and c for each θo."""
        turns = torch.cat((self.turns, self.cosine[:, None]), 1)
        return torch.cat((self.lobe.reshape(-1, 4), turns.reshape(-1, 4)))

    def density(self, wi: Tensor, wo: Tensor) -> Tensor:
        """p(ωi | ωo) (N,) in sr⁻¹ of unit vectors (N, 3); 0 where a direction is under the horizon."""
        values = self._values(wo) | {"wi": list(wi.unbind(-1))}
        return interpret(density_statements(self.grained), values, TORCH)["density"][0]

    def draw(self, wo: Tensor, u: Tensor) -> Tensor:
        """ωi (N, 3) for viewers (N, 3) and points u (N, 3) of the unit cube; unit, above the horizon."""
        values = self._values(wo) | {"u": list(u.unbind(-1))}
        return torch.stack(interpret(sample_statements(self.grained), values, TORCH)["wi"], -1)

    def _values(self, wo: Tensor) -> dict[str, Any]:
        constants = {name: list(wo.new_tensor(numbers)) for name, numbers in self.constants().items()}
        return {"wo": list(wo.unbind(-1)), **constants}

    def constants(self) -> dict[str, Any]:
        """The parameters of the expressions by name, each a list of numbers."""
        rows = dict(zip(row_names(), self.rows().tolist(), strict=True))
        return {"scale": [self.scale], "grain": [*self.grain], **rows}

    def describe(self) -> dict[str, Any]:
        """JSON-able; `restored` reads it back."""
        return {
            "kind": "cosine and a table round the mirror direction",
            "scale": self.scale,
            "grain": list(self.grain),
            "grained": self.grained,
            "cosine": self.cosine.tolist(),
            "turns": self.turns.tolist(),
            "lobe": self.lobe.tolist(),
        }


def restored(record: Mapping[str, Any]) -> LobeMixture:
    """The mixture that `LobeMixture.describe` wrote."""
    lobe, turns, cosine = (torch.tensor(record[name], dtype=torch.float64) for name in ("lobe", "turns", "cosine"))
    return LobeMixture(lobe, turns, cosine, record["scale"], tuple(record["grain"]), record["grained"])


def halves(values: Tensor) -> Tensor:
    """The half floats nearest to the values, in float64."""
    return torch.from_numpy(values.numpy().astype(np.float16).astype(np.float64))


def printed(statements: Sequence[Let], values: Mapping[str, Any]) -> tuple[Let, ...]:
    """The statements with the parameters as constants, or as the expressions that `values` has for them."""
    given = {
        name: value if isinstance(value, Expression) else tuple(map(float, value)) for name, value in values.items()
    }
    return tuple(Let(let.name, substituted(let.expression, given), let.comment) for let in statements)


def parameter_tables(mixtures: Sequence[LobeMixture]) -> tuple[dict[str, Expression], Tables]:
    """(each parameter as what reads it from tables at the layer, the tables): a row for each of `mixtures`."""
    shape = table("lobes_shape", 4)
    reading: dict[str, Expression] = {"grain": shape.xyz, "scale": shape.w}
    tables = [("lobes_shape", tuple((*each.grain, each.scale) for each in mixtures))]
    constants = [each.constants() for each in mixtures]
    for name in row_names():
        reading[name] = table(f"lobes_{name}", 4)
        tables.append((f"lobes_{name}", tuple(tuple(each[name]) for each in constants)))
    return reading, tuple(tables)
