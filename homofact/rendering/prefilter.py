"""The split sum of one material under one sky: the chain, the material's table, and the statements that read both.

The table is a texture of K + 2 rows over cosθo (`rendering.split_sum`): for each lobe its shares and its level, then
the share of the irradiance, then the lobes' leans. The chain is a cube map with levels (`rendering.sky_chain`), which
knows nothing of the material: one serves all.
"""

from dataclasses import dataclass
from functools import cached_property

import torch
from torch import Tensor

from homofact.geometry.expression import Expression, Let, call, constant, cube, fetch, variable, vector
from homofact.geometry.interpret import Value, interpret
from homofact.geometry.torch_functions import TORCH
from homofact.linear.bilinear import lookup
from homofact.rendering.sky_chain import SkyChain
from homofact.rendering.split_sum import Response
from homofact.shading.program import Program

TABLE, MAP, LIT = 0, 1, 2


@dataclass(frozen=True)
class Prefiltered:
    """All that the shader reads: `table` (K + 2, COLUMNS, 4) and the `sky`."""

    table: Tensor
    sky: SkyChain

    @property
    def lobes(self) -> int:
        """K."""
        return len(self.table) - 2

    def radiance(self, n: Tensor, wo: Tensor) -> Tensor:
        """Radiance (N, 3) towards `wo` of surfaces with unit normals `n`, both (N, 3) in the world."""
        values = {"n": list(n.unbind(-1)), "wo": list(wo.unbind(-1))}
        table = self.table.to(n)

        def read(number: int, place: Value) -> Value:
            whole = [
                coordinate if isinstance(coordinate, Tensor) else torch.full_like(n[:, 0], coordinate)
                for coordinate in place
            ]
            if number in (MAP, LIT):
                *direction, level = whole
                chosen = self.sky.cube if number == MAP else self.sky.lit
                return list(chosen.read(torch.stack(direction, 1), level).to(n).unbind(1))
            rows, columns, _ = table.shape
            # A sampler's coordinate as that of `linear.bilinear`.
            sides = zip(whole, (columns, rows), strict=True)
            uv = [(x * size - 0.5) * (2 / (size - 1)) - 1 for x, size in sides]
            return list(lookup(table, torch.stack(uv, 1)).unbind(1))

        return torch.stack(interpret(self.statements, values, TORCH, read)["reflected"], -1)

    @cached_property
    def statements(self) -> list[Let]:
        """Statements over n and wo (3,), unit, in the world; the last is "reflected", radiance (3,)."""
        n, wo, along = variable("n", 3), variable("wo", 3), variable("along", 1)
        rows, columns, _ = self.table.shape
        u = variable("u", 1)

        def row(number: int) -> list[Let]:
            place = vector(u, constant((number + 0.5) / rows))
            named = Let(f"place_{number}", place)
            return [named, Let(f"row_{number}", fetch(TABLE, variable(named.name, 2), 4), _words(self.lobes, number))]

        cosine = call("min", call("max", along, 0.0), 1.0)
        made = [Let("along", call("dot", n, wo)), Let("u", cosine * ((columns - 1) / columns) + 0.5 / columns)]
        for number in range(rows):
            made += row(number)
        made.append(Let("irradiance", cube(LIT, n, constant(0), 3), "over pi"))
        total = variable(f"row_{self.lobes}", 4).xyz * variable("irradiance", 3)
        for k in range(self.lobes):
            own, tilt = variable(f"row_{k}", 4), variable(f"row_{rows - 1}", 4).__getattr__("xyzw"[k])
            towards = n * (2 * along + tilt) - wo
            made += [
                Let(f"towards_{k}", towards, "the lobe's direction" if k == 0 else ""),
                Let(f"light_{k}", cube(MAP, variable(f"towards_{k}", 3), own.w, 3)),
            ]
            total = total + own.xyz * variable(f"light_{k}", 3)
        return [*made, Let("reflected", total if self.sky.factor == 1 else total * self.sky.factor)]


def _words(lobes: int, number: int) -> str:
    """What a row of the table holds."""
    if number == 0:
        return "shares of the lobes, and their levels"
    return {lobes: "the share of the irradiance", lobes + 1: "the lobes' leans to the normal"}.get(number, "")


def prefiltered(response: Response, sky: SkyChain) -> Prefiltered:
    """A material's table beside a sky. They have the same levels."""
    assert response.side == sky.side, "the table is for another chain"
    columns, lobes, _ = response.lobes.shape
    table = torch.zeros(lobes + 2, columns, 4, dtype=torch.float64)
    table[: lobes + 1, :, :3] = response.shares.movedim(1, 0)
    table[:lobes, :, 3] = response.lobes[..., 0].T
    table[lobes + 1, :, :lobes] = response.lobes[..., 1]
    return Prefiltered(table, sky)


def program_of_light(data: Prefiltered, title: tuple[str, ...], first: int) -> Program:
    """`PREFIX_reflected(n, wo)`, radiance (3,), its textures numbered from `first`: table, chain, irradiance."""
    result: Expression = variable("reflected", 3)
    chain = (len(data.sky.levels), 6, data.sky.side, data.sky.side)
    shapes: tuple[tuple[int, ...], ...] = (tuple(data.table.shape[:2]), chain, (1, *data.sky.irradiance.shape[:3]))
    return Program(
        tuple(data.statements), result, shapes, ("R", "G", "B"), title, function="reflected", parameters=("n", "wo"),
        first=first,
    )  # fmt: skip
