"""The split sum of one material under one sky: the chain, the material's table, and the statements that read both.

The table is a texture of K + 2 rows over cosθo (`rendering.split_sum`): for each lobe its shares and its level, then
the share of the irradiance, then the lobes' tilts t. An anisotropic material has one more row, the lobes' spreads a.
The chain is a cube map with levels (`rendering.sky_chain`, or an engine's). It does not depend on the material, so one
chain serves all materials.
"""

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Generic, TypeVar

import numpy as np
import torch
from numpy.typing import DTypeLike
from torch import Tensor

from homofact.geometry.expression import Expression, Let, call, constant, cube, fetch, variable, vector
from homofact.geometry.interpret import Value, interpret
from homofact.geometry.torch_functions import TORCH
from homofact.linear.bilinear import lookup
from homofact.rendering.sky_chain import FilteredSky, SkyChain
from homofact.rendering.split_sum import Response
from homofact.shading.program import Program

TABLE, MAP, LIT = 0, 1, 2


@dataclass(frozen=True)
class LevelTable:
    """A material's `table` (K + 2, COLUMNS, 4), or with the spreads K + 3 rows; `across` is the azimuth of g, or None.

    The light that it reads is multiplied by `factor`.
    """

    table: Tensor
    across: float | None = None
    factor: float = 1.0

    @property
    def lobes(self) -> int:
        """K."""
        return len(self.table) - 2 - (self.across is not None)

    def rounded(self, kind: DTypeLike) -> "LevelTable":
        """Return the table rounded to the number type of a texture."""
        return replace(self, table=torch.from_numpy(self.table.numpy().astype(kind).astype(np.float64)))

    @property
    def parameters(self) -> tuple[str, ...]:
        """Return the names of the statements' world vectors: n, t and b of anisotropic materials, and wo."""
        return ("n", "wo") if self.across is None else ("n", "t", "b", "wo")

    @cached_property
    def statements(self) -> list[Let]:
        """Return statements that use the `parameters`; the last one is "reflected", radiance (3,)."""
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
        if self.across is not None:
            axis = variable("t", 3) * math.cos(self.across) + variable("b", 3) * math.sin(self.across)
            made.append(Let("g", axis, "across the grain"))
        made.append(Let("irradiance", cube(LIT, n, constant(0), 3), "over pi"))
        total = variable(f"row_{self.lobes}", 4).xyz * variable("irradiance", 3)
        for k in range(self.lobes):
            own, tilt = variable(f"row_{k}", 4), variable(f"row_{self.lobes + 1}", 4).__getattr__("xyzw"[k])
            if self.across is None:
                towards = n * (2 * along + tilt) - wo
            else:
                spread = variable(f"row_{self.lobes + 2}", 4).__getattr__("xyzw"[k])
                made.append(Let(f"half_{k}", n + variable("g", 3) * spread))
                half = variable(f"half_{k}", 3)
                towards = half * (2 * call("dot", half, wo)) - wo * call("dot", half, half) + n * tilt
            made += [
                Let(f"towards_{k}", towards, "the lobe's direction" if k == 0 else ""),
                Let(f"light_{k}", cube(MAP, variable(f"towards_{k}", 3), own.w, 3)),
            ]
            total = total + own.xyz * variable(f"light_{k}", 3)
        total = call("max", total, 0.0) if bool((self.table[: self.lobes + 1, :, :3] < 0).any()) else total
        return [*made, Let("reflected", total if self.factor == 1 else total * self.factor)]

    def program(self, skies: tuple[tuple[int, ...], ...], title: tuple[str, ...], first: int = 0) -> Program:
        """Return `PREFIX_reflected`, radiance (3,), its textures numbered from `first`: table, chain, irradiance.

        `skies` are the (levels, 6, rows, columns) of chain and irradiance.
        """
        result: Expression = variable("reflected", 3)
        shapes: tuple[tuple[int, ...], ...] = (tuple(self.table.shape[:2]), *skies)
        return Program(
            tuple(self.statements), result, shapes, ("R", "G", "B"), title, function="reflected",
            parameters=self.parameters, first=first,
        )  # fmt: skip


S = TypeVar("S", SkyChain, FilteredSky)


@dataclass(frozen=True)
class Prefiltered(Generic[S]):
    """The data that the shader reads: a material's table `material` and the `sky`."""

    material: LevelTable
    sky: S

    def radiance(self, n: Tensor, wo: Tensor, t: Tensor | None = None) -> Tensor:
        """Radiance (N, 3) towards `wo` of surfaces with unit normals `n` and tangents `t`, all (N, 3) in the world.

        The tangents are needed for anisotropic materials alone.
        """
        given = {"n": n, "wo": wo} | ({} if t is None else {"t": t, "b": torch.linalg.cross(n, t)})
        values = {name: list(given[name].unbind(-1)) for name in self.material.parameters}
        table = self.material.table.to(n)

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

        return torch.stack(interpret(self.material.statements, values, TORCH, read)["reflected"], -1)

    def program(self: "Prefiltered[SkyChain]", title: tuple[str, ...], first: int) -> Program:
        """Return the program of the material's table for this sky."""
        sky = self.sky
        return self.material.program(
            ((len(sky.levels), 6, sky.side, sky.side), (1, *sky.irradiance.shape[:3])), title, first
        )


def _words(lobes: int, number: int) -> str:
    """What a row of the table holds."""
    if number == 0:
        return "shares of the lobes, and their levels"
    told = (
        "the share of the irradiance",
        "the lobes' leans to the normal",
        "the half vectors' spreads across the grain",
    )
    return told[number - lobes] if number >= lobes else ""


def level_table(response: Response, factor: float = 1.0) -> LevelTable:
    """Return the table's texels, with three channels; a single channel is repeated."""
    columns, lobes, _ = response.lobes.shape
    rows = lobes + 2 + (response.across is not None)
    table = torch.zeros(rows, columns, 4, dtype=torch.float64)
    table[: lobes + 1, :, :3] = response.shares.movedim(1, 0)
    table[:lobes, :, 3] = response.lobes[..., 0].T
    for row, kind in zip(range(lobes + 1, rows), (1, 2), strict=False):
        table[row, :, :lobes] = response.lobes[..., kind]
    return LevelTable(table, response.across, factor)


def prefiltered(response: Response, sky: S) -> Prefiltered[S]:
    """Return a material's table with a sky of the same levels."""
    assert response.kernels == sky.kernels, "the table is for another chain"
    return Prefiltered(level_table(response, sky.factor), sky)
