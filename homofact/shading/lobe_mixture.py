"""Importance sampling of a material: a small table that approximates its lobe, with sampling and density.

For a viewer ωo, a direction ωi above the horizon has an angle φ about the mirror direction and a coordinate v in [0,
V(φ)] between the mirror direction and the horizon (`lobe_coordinates`), dω = s dv dφ. The factor 2 in the denominator
accounts for the sign of φ:

    p(ωi | ωo) = c cosθi/π + (1 − c) m(|φ|)/∫m dφ · g(v, |φ|)/∫g dv/(2 s).

c, m and g are linear between `THETAS` values of θo, at even steps of (a + a⁹)/2 with a = √(1 − cosθo). These nodes are
dense at grazing views. m and g are linear between `PHIS` values of φ, and g is linear in v between 0, where g = 0, and
`RADII` more values. The integrals of piecewise linear functions are exact, so p integrates to 1 for any table. Sampling
solves quadratic equations, and all sampled directions are above the horizon.

The table has (PHIS RADII + PHIS + 1) THETAS numbers, which take 1.9 KiB as half floats. The density and the sampling
are expressions (`lobe_statements`). They are printed as shaders, and Mitsuba and `LobeMixture` interpret them.
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
    """The density that the module docstring defines.

    `lobe` (THETAS, PHIS, RADII) is g and `turns` (THETAS, PHIS) is m, both > 0 and of any scale; `cosine` (THETAS,) is
    c in (0, 1]. All are float64 tensors whose values are representable as half floats. `scale` is σ > 0, and `grain`
    has the entries xx, xy, yy of A. `grained` is True for the coordinates of an anisotropic material, which an
    isotropic material may also use.
    """

    lobe: Tensor
    turns: Tensor
    cosine: Tensor
    scale: float
    grain: tuple[float, float, float] = ROUND
    grained: bool = False

    @property
    def isotropic(self) -> bool:
        """Whether the density does not depend on the azimuth of the viewer."""
        return self.grain == ROUND

    @property
    def nbytes(self) -> int:
        """Bytes of the table, as half floats, and of σ and A, as floats."""
        return 2 * self.rows().numel() + 4 * 4

    def rows(self) -> Tensor:
        """Return the table as rows of four numbers (N, 4): g by θo, φ and v, then for each θo m by φ, and c."""
        turns = torch.cat((self.turns, self.cosine[:, None]), 1)
        return torch.cat((self.lobe.reshape(-1, 4), turns.reshape(-1, 4)))

    def density(self, wi: Tensor, wo: Tensor) -> Tensor:
        """Return p(ωi | ωo) (N,) in sr⁻¹ for unit vectors (N, 3); 0 if a direction is below the horizon."""
        values = self._values(wo) | {"wi": list(wi.unbind(-1))}
        return interpret(density_statements(self.grained), values, TORCH)["density"][0]

    def draw(self, wo: Tensor, u: Tensor) -> Tensor:
        """Sample unit vectors ωi (N, 3) above the horizon, for viewers (N, 3) and points u (N, 3) of the unit cube."""
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
        """Return a JSON-able description, which `restored` reads."""
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
    """Return the mixture of a description that `LobeMixture.describe` made."""
    lobe, turns, cosine = (torch.tensor(record[name], dtype=torch.float64) for name in ("lobe", "turns", "cosine"))
    return LobeMixture(lobe, turns, cosine, record["scale"], tuple(record["grain"]), record["grained"])


def halves(values: Tensor) -> Tensor:
    """Return values rounded to half floats, as float64."""
    return torch.from_numpy(values.numpy().astype(np.float16).astype(np.float64))


def printed(statements: Sequence[Let], values: Mapping[str, Any]) -> tuple[Let, ...]:
    """Return statements with the parameters replaced by constants, or by the expressions in `values`."""
    given = {
        name: value if isinstance(value, Expression) else tuple(map(float, value)) for name, value in values.items()
    }
    return tuple(Let(let.name, substituted(let.expression, given), let.comment) for let in statements)


def parameter_tables(mixtures: Sequence[LobeMixture]) -> tuple[dict[str, Expression], Tables]:
    """Return (expressions that read each parameter from tables at the layer, the tables with a row per mixture)."""
    shape = table("lobes_shape", 4)
    reading: dict[str, Expression] = {"grain": shape.xyz, "scale": shape.w}
    tables = [("lobes_shape", tuple((*each.grain, each.scale) for each in mixtures))]
    constants = [each.constants() for each in mixtures]
    for name in row_names():
        reading[name] = table(f"lobes_{name}", 4)
        tables.append((f"lobes_{name}", tuple(tuple(each[name]) for each in constants)))
    return reading, tuple(tables)
