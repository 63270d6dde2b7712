"""An environment filtered for one material: the light that `render.split_sum` multiplies by its table.

P(m, θo) is stored for each of the lobes as a square of the octahedral map with a rim of one texel (`render.octahedral`,
Praun and Hoppe 2003), the squares one under another, the first for the viewer at grazing angles, in one texture;
E(n)/π is the last square. Within a square every reading is bilinear and no texel of another square is read. Between two
lobes P is linear in cosθo.

Rings near m are read from the environment's pyramid at places about as far apart as rings are; what is further away
varies little from texel to texel, and is summed over lamps that stand for the whole environment, on the smallest
square.
"""

import math
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from homofact.geometry.expression import Expression, Let, call, constant, fetch, variable, vector
from homofact.geometry.interpret import Value, interpret
from homofact.geometry.torch_functions import TORCH
from homofact.linear.bilinear import lookup
from homofact.linear.kernels import kernel
from homofact.render.light import EnvironmentMap
from homofact.render.octahedral import Pyramid, directions_of, rimmed
from homofact.render.octahedral import fetch as fetch_light
from homofact.render.split_sum import Response, ring_edges
from homofact.shading.program import Program

MOST_SIDE, LEAST_SIDE = 256, 32
# Rings wider than this many radians round a direction vary little from texel to texel of the smallest square.
_FAR = 0.35
_LEAST_SHARE = 1e-6
_LAMPS = (32, 128)
_MOST = 2.0**15  # half floats end at 65504
TABLE, MAP = 0, 1


@dataclass(frozen=True)
class Prefiltered:
    """All that the shader reads: `table` (2, COLUMNS, 4), `map` ((levels + 1) · side, side, 3).

    Of the table, row 0 is S, row 1 D, the fourth component of row 0 is t. `harmonics` (9, 3) is E/π once more, as
    `irradiance_coefficients`, for engines that have no place for a square. The map is to be multiplied by `factor`, a
    power of two, with which half floats hold it. `name` is the environment's.
    """

    table: Tensor
    map: Tensor
    harmonics: Tensor
    factor: float
    levels: int
    name: str

    @property
    def side(self) -> int:
        """Texels of a square's side, its rim among them."""
        return int(self.map.shape[1])

    def radiance(self, n: Tensor, wo: Tensor) -> Tensor:
        """Radiance (N, 3) towards `wo` of surfaces with unit normals `n`, both (N, 3) in the world."""
        values = {"n": list(n.unbind(-1)), "wo": list(wo.unbind(-1))}
        textures = (self.table.to(n), self.map.to(n))

        def read(number: int, uv: Value) -> Value:
            u, v = (each if isinstance(each, Tensor) else torch.full_like(n[:, 0], each) for each in uv)
            rows, columns, _ = textures[number].shape
            # A sampler's coordinate as that of `linear.bilinear`.
            place = [(x * size - 0.5) * (2 / (size - 1)) - 1 for x, size in ((u, columns), (v, rows))]
            return list(lookup(textures[number], torch.stack(place, 1)).unbind(1))

        statements = reading_statements(self)
        return torch.stack(interpret(statements, values, TORCH, read)["reflected"], -1)


def prefiltered(response: Response, light: EnvironmentMap, side: int | None = None) -> Prefiltered:
    """The light for a material; squares of `side` texels with the rim, what the narrowest lobe needs unless given."""
    pyramid = Pyramid.of(light, torch.eye(3, dtype=torch.float64))
    side = needed_side(response) if side is None else side
    edges = ring_edges(response.lobes.shape[1])
    middle = ((edges[1:] + edges[:-1]) / 2).numpy()
    # Readings about as far apart along a ring as rings are.
    spokes = np.maximum(np.ceil(2 * math.pi * np.sin(middle) / (edges[1:] - edges[:-1]).numpy()), 6).astype(np.int64)
    solid = (edges[:-1].cos() - edges[1:].cos()).numpy() * (2 * math.pi / spokes)
    wide = np.log2(solid) / 2
    lamps = pyramid.lamps(*_LAMPS)
    far = middle > _FAR
    # sr⁻¹ of the rings, on even steps of the cube root of the angle.
    whole = (solid * spokes)[None]
    density = np.where(far, response.lobes.numpy() / whole, 0)
    small, large = (directions_of(size - 2).reshape(-1, 3).numpy() for size in (LEAST_SIDE, side))
    shares = np.where(far | (response.lobes.numpy() < _LEAST_SHARE), 0, response.lobes.numpy())
    near = _filtered(large, shares, middle, wide, spokes, *pyramid[:3])
    dark = _summed(small, density, *lamps)
    squares = [_square(one) + _enlarged(_square(two), side) for one, two in zip(near, dark, strict=True)]
    squares.append(_enlarged(_square(_lit(small, *lamps)), side))
    table = torch.zeros(2, len(response.tilt), 4, dtype=torch.float64)
    table[0, :, :3], table[0, :, 3], table[1, :, :3] = response.scale, response.tilt, response.diffuse
    whole = torch.cat(squares)
    factor = 2.0 ** max(0, math.ceil(math.log2(float(whole.max()) / _MOST)))
    harmonics = irradiance_coefficients(pyramid)
    return Prefiltered(table, whole / factor, harmonics, factor, len(response.lobes), light.name)


def _square(light: np.ndarray) -> Tensor:
    """Light (N², 3) by row as a square with its rim."""
    side = math.isqrt(len(light))
    return torch.from_numpy(rimmed(light.reshape(side, side, 3)))


def _lit(towards: np.ndarray, places: np.ndarray, lights: np.ndarray) -> np.ndarray:
    """E/π (N, 3) at normals (N, 3) of lamps (K, 3)."""
    return np.maximum(towards @ places.T, 0) @ lights / math.pi


def _enlarged(square: Tensor, side: int) -> Tensor:
    """A square with its rim at so many texels with theirs, the same place at the same place."""
    small = len(square)
    ticks = (torch.arange(side, dtype=torch.float64) - 0.5) / (side - 2) * (small - 2) + 0.5
    y, x = torch.meshgrid(ticks, ticks, indexing="ij")
    uv = torch.stack((x, y), -1).reshape(-1, 2) * (2 / (small - 1)) - 1
    return lookup(square, uv).reshape(side, side, -1)


def needed_side(response: Response) -> int:
    """The power of two whose texels are half the angle that holds half of the narrowest lobe's flux."""
    edges = ring_edges(response.lobes.shape[1])
    half = [float(edges[1 + int((lobe.cumsum(0) >= 0.5).nonzero()[0])]) for lobe in response.lobes]
    side = 1 << math.ceil(math.log2(2 * math.pi / min(half)))
    return min(max(side, LEAST_SIDE), MOST_SIDE)


def irradiance_coefficients(pyramid: Pyramid) -> Tensor:
    """E/π (9, 3) over 1, x, y, z, xy, yz, zx, 3z² − 1, x² − y² (Ramamoorthi and Hanrahan 2001, eq. 12)."""
    places, light = (torch.from_numpy(each).double() for each in pyramid.lamps(*_LAMPS))
    x, y, z = places.unbind(1)
    basis = torch.stack((torch.ones_like(x), x, y, z, x * y, y * z, z * x, 3 * z * z - 1, x * x - y * y), 1)
    # Of each: 4π times its squared norm on the sphere, turned over; and A_l/π of the clamped cosine.
    norms = [1, 3, 3, 3, 15, 15, 15, 1.25, 3.75]
    shares = [1, *[2 / 3] * 3, *[1 / 4] * 5]
    factor = torch.tensor([a * b / (4 * math.pi) for a, b in zip(norms, shares, strict=True)], dtype=torch.float64)
    return basis.T @ light * factor[:, None]


def reading_statements(data: Prefiltered) -> list[Let]:
    """Statements over n and wo (3,), unit, in the world; the last is "reflected", radiance (3,)."""
    n, wo = variable("n", 3), variable("wo", 3)
    columns, side, levels = data.table.shape[1], data.side, data.levels
    cosine = variable("cosine", 1)
    u = cosine * ((columns - 1) / columns) + 0.5 / columns
    made = [
        Let("along", call("dot", n, wo)),
        Let("cosine", call("min", call("max", variable("along", 1), 0.0), 1.0)),
        Let("scale", fetch(TABLE, vector(u, constant(0.25)), 4), "the lobe's share, its lean to the normal"),
        Let("diffuse", fetch(TABLE, vector(u, constant(0.75)), 4)),
        Let("towards", n * (2 * variable("along", 1) + variable("scale", 4).w) - wo, "the lobe's direction"),
    ]  # fmt: skip
    made += _octahedral("towards", "lobe", side) + _octahedral("n", "normal", side)
    made += [
        Let("level", cosine * (levels - 1), "squares under one another, a step of the cosine each"),
        Let("lower", call("min", call("floor", variable("level", 1)), float(max(levels - 2, 0)))),
        Let("part", variable("level", 1) - variable("lower", 1)),
    ]
    low = variable("lower", 1)

    def square(number: Expression, name: str) -> Expression:
        place = variable(f"{name}_place", 2)
        return fetch(MAP, vector(place.x * (1 / side), (number * side + place.y) * (1 / (side * (levels + 1)))), 3)

    made.append(Let("light", square(low, "lobe")))
    light: Expression = variable("light", 3)
    if levels > 1:
        made.append(Let("light_above", square(low + 1, "lobe")))
        light = light + (variable("light_above", 3) - light) * variable("part", 1)
    made.append(Let("irradiance", square(constant(levels), "normal"), "over pi: the last square"))
    result = variable("scale", 4).xyz * light + variable("diffuse", 4).xyz * variable("irradiance", 3)
    return [*made, Let("reflected", result if data.factor == 1 else result * data.factor)]


def program_of_light(data: Prefiltered, title: tuple[str, ...], first: int) -> Program:
    """`PREFIX_reflected(n, wo)`, radiance (3,), its textures numbered from `first`: the table, then the map."""
    statements = reading_statements(data)
    shapes = (tuple(data.table.shape[:2]), tuple(data.map.shape[:2]))
    result = variable("reflected", 3)
    return Program(
        tuple(statements), result, shapes, ("R", "G", "B"), title, function="reflected", parameters=("n", "wo"),
        first=first,
    )  # fmt: skip


def _octahedral(direction: str, name: str, side: int) -> list[Let]:
    """The place of a direction of any length in a square, in texels from its corner."""
    w, o, flat = variable(direction, 3), variable(f"{name}_octahedral", 3), variable(f"{name}_flat", 2)
    upper, signs = variable(f"{name}_upper", 1), variable(f"{name}_signs", 2)
    folded = (1 - call("abs", vector(o.y, o.x))) * signs
    return [
        Let(o.text, w / (call("abs", w.x) + call("abs", w.y) + call("abs", w.z)), "the octahedral map"),
        Let(upper.text, call("step", 0.0, o.z)),
        Let(signs.text, call("step", constant(0, 0), o.xy) * 2 - constant(1, 1)),
        Let(flat.text, o.xy * upper + folded * (1 - upper)),
        Let(f"{name}_place", flat * (0.5 * (side - 2)) + constant(0.5 * side, 0.5 * side)),
    ]


@kernel(nogil=True, fastmath=True)
def _summed(towards, density, places, lights):  # pragma: no cover (compiled)
    """Light (L, N, 3) of lamps (K, 3), by densities (L, R) at the middles of rings, linear between, round (N, 3)."""
    lobes, rings = density.shape
    found = np.zeros((lobes, len(towards), 3))
    for k in range(len(towards)):
        for lamp in range(len(places)):
            cosine = towards[k, 0] * places[lamp, 0] + towards[k, 1] * places[lamp, 1] + towards[k, 2] * places[lamp, 2]
            step = (math.acos(min(max(cosine, -1.0), 1.0)) / math.pi) ** (1 / 3) * rings - 0.5
            below = min(max(int(step), 0), rings - 2)
            part = min(max(step - below, 0.0), 1.0)
            for lobe in range(lobes):
                value = (1 - part) * density[lobe, below] + part * density[lobe, below + 1]
                for channel in range(3):
                    found[lobe, k, channel] += value * lights[lamp, channel]
    return found


@kernel(nogil=True, fastmath=True)
def _filtered(towards, shares, middle, wide, spokes, texels, starts, sides):  # pragma: no cover (compiled)
    """Light (L, N, 3) by shares (L, R) of rings at angles `middle` round directions (N, 3), read at `spokes` places."""
    lobes, rings = shares.shape
    found = np.zeros((lobes, len(towards), 3))
    wanted = np.zeros(rings, np.bool_)
    for ring in range(rings):
        for lobe in range(lobes):
            wanted[ring] |= shares[lobe, ring] > 0
    for k in range(len(towards)):
        x, y, z = towards[k, 0], towards[k, 1], towards[k, 2]
        # Two axes across (Duff et al. 2017).
        sign = 1.0 if z >= 0 else -1.0
        a = -1 / (sign + z)
        b = x * y * a
        ax, ay, az = 1 + sign * x * x * a, sign * b, -sign * x
        bx, by, bz = b, sign + y * y * a, -y
        for ring in range(rings):
            if not wanted[ring]:
                continue
            sine, cosine = math.sin(middle[ring]), math.cos(middle[ring])
            red = green = blue = 0.0
            for spoke in range(spokes[ring]):
                turn = (spoke + 0.5 * (ring % 2)) * (2 * math.pi / spokes[ring])
                c, s = sine * math.cos(turn), sine * math.sin(turn)
                u, v, w = cosine * x + c * ax + s * bx, cosine * y + c * ay + s * by, cosine * z + c * az + s * bz
                one, two, three = fetch_light(texels, starts, sides, u, v, w, wide[ring])
                red += one
                green += two
                blue += three
            for lobe in range(lobes):
                each = shares[lobe, ring] / spokes[ring]
                found[lobe, k, 0] += each * red
                found[lobe, k, 1] += each * green
                found[lobe, k, 2] += each * blue
    return found
