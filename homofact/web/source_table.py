"""Tabulate the source for the page: its reflectance in a 3D texture, and the shader text that reads it.

A pair of directions is described by its half vector h = (θh, φh) and by the direction of ωi relative to h, (θd, φd):

    ωi = cosθd h + sinθd (cosφd a + sinφd b),    a = ∂h/∂θh,  b = z × h / |z × h|,    ωo with φd + π.

The table's axes are

    θh    crowded towards both ends: a highlight gets nodes, and so do the directions at the horizon
    θd    crowded towards π/2, likewise
    φd    spread over what is possible at this θh and θd (below), over its period: π where the source is reciprocal and
          2π where not; folded in half where it is isotropic and left-right symmetric
    φh    for an anisotropic source only: slices one above the other along θh, two fetches and a mix; folded by the
          half turn and by the mirror (φh, φd) ~ (−φh, −φd) where the source has these symmetries

"Crowded" towards the end means x = (1 − e) u + e (1 − √(1 − u)) of the share u of the axis. That of θd is θd/(π/2), and
that of θh is asinh(r/w)/asinh(1/w) with r = θh/(π/2); the w that suits the highlight is chosen. Towards the horizon f
may grow like 1/(cosθi + cosθo), which even nodes there overestimate, up to twice.

Both directions are above the horizon where |cosφd| ≤ 1/t, t = tanθh tanθd. The axis of φd is therefore the angle with
the cosine cosφd max(1, t), which is (cosθo − cosθi)/(cosθo + cosθi) where t > 1. All nodes are above the horizon then,
and neighbouring nodes are neighbouring pairs of directions, also at the horizon. With s = ωi + ωo and e = ωi − ωo, the
angle is atan2 of (s × e).z, kept within ±2 |s| √(cosθi cosθo), and −e.z |s|.

There are nodes at both ends of each axis. Symmetries are tested on random pairs. The texels contain x = log(f/A + δ) in
steps of 1/256, where A is the mean and δ = `FLOOR`; then f = A max(0, exp(x) − δ). Interpolating logarithms follows a
lobe over several decades.

The page states the error of the table, measured at random directions between the nodes. The table approximates the
source.
"""

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import torch
from torch import Tensor

from homofact.brdf.reflectance import Reflectance
from homofact.brdf.symmetry import Symmetry, find_symmetry
from homofact.errors import BadInput
from homofact.geometry.axes import coordinates_of, stretched
from homofact.geometry.directions import draw_cosine_weighted, normalize
from homofact.geometry.expression import Expression, Let, call, constant, fetch, needed, variable, vector
from homofact.geometry.interpret import interpret
from homofact.geometry.torch_functions import TORCH
from homofact.shading.languages import GLSL, shader
from homofact.shading.program import Program
from homofact.web.packing import differences, pack

STEP = 1 / 256
FLOOR = 1e-5
WIDTHS = (0.005, 0.02, 0.08, 0.3, 1.0)
# Nodes of φh, θh, θd, φd, from small to large: the first that is close enough is taken.
ISOTROPIC = ((1, 48, 24, 12), (1, 64, 32, 24), (1, 96, 32, 24), (1, 160, 32, 24))
ANISOTROPIC = ((9, 24, 12, 17), (17, 32, 16, 25))
ENOUGH = (0.0035, 0.02)
# Of the nodes towards the horizon (e above).
_CROWDED_H, _CROWDED_D = 0.3, 0.5
# Cosine of nodes at the horizon, half a degree above it: there many models and all measurements are at a loss.
_LOWEST = 0.009
_TINY = 1e-20
_BATCH = 1 << 15
_TITLE = "The source as a table over the angles of the half vector; logarithms, linear between its nodes."


@dataclass(frozen=True)
class TableError:
    """|table − f| / max(f, A/1000) over `count` random cosine-weighted pairs and all channels."""

    median: float
    percentile_95: float
    count: int

    def words(self) -> str:
        """For a line of the page."""
        return f"median {_percent(self.median)}, 95th percentile {_percent(self.percentile_95)}"


@dataclass(frozen=True)
class SourceTable:
    """A tabulated reflectance.

    `steps` is (slices, θh, θd, φd, C) int16, the logarithms in units of STEP; `mean` is A (C,) in sr⁻¹; `width` is w of
    the warp.
    """

    steps: np.ndarray
    mean: tuple[float, ...]
    width: float
    symmetry: Symmetry
    error: TableError

    @property
    def size(self) -> str:
        """For a line of the page: nodes of each axis."""
        slices, theta_h, theta_d, phi_d = self.steps.shape[:4]
        more = "" if self.symmetry.isotropic else f" × {slices} φh"
        return f"{theta_h} θh × {theta_d} θd × {phi_d} φd{more}"

    def differences(self) -> np.ndarray:
        """Return (3, slices · θh, θd, φd) int16 for the page: green, red − green, blue − green.

        Along φd and θd, each node is stored as the difference from the previous node. A single channel is repeated
        three times.
        """
        steps = self.steps.reshape(-1, *self.steps.shape[2:])
        red, green, blue = (steps[..., min(k, steps.shape[-1] - 1)] for k in range(3))
        return differences(np.stack((green, red - green, blue - green)), (2, 3))

    @cached_property
    def _values(self) -> Tensor:
        return torch.from_numpy(self.steps.astype(np.float64)) * STEP

    def evaluate(self, wi: Tensor, wo: Tensor) -> Tensor:
        """Return the shader's values in float64: (N, C) in sr⁻¹ without the cosine, 0 below the horizon."""
        place = [self._values.shape[0] - 1, *(n - 1 for n in self._values.shape[1:4])]
        x = torch.stack(_place(wi, wo, self.symmetry, self.width), -1) * torch.tensor(place, dtype=torch.float64)
        low = torch.minimum(x.floor(), torch.tensor(place, dtype=torch.float64) - 1).clamp_min(0)
        share, low = x - low, low.long()
        total = torch.zeros(len(wi), len(self.mean), dtype=torch.float64)
        for corner in range(16):
            up = torch.tensor([corner >> 3 & 1, corner >> 2 & 1, corner >> 1 & 1, corner & 1])
            if not place[0] and up[0]:
                continue
            a, b, c, d = (low + up).unbind(-1)
            total += self._values[a, b, c, d] * torch.where(up > 0, share, 1 - share).prod(-1, keepdim=True)
        values = torch.tensor(self.mean, dtype=torch.float64) * (total.exp() - FLOOR).clamp_min(0)
        return values * ((wi[:, 2] >= 0) & (wo[:, 2] >= 0))[:, None]

    def glsl(self, prefix: str) -> str:
        """Return GLSL ES 3.00 with a 3D sampler `PREFIX_texture_0` and `vec3 PREFIX_evaluate(vec3 wi, vec3 wo)`."""
        return shader(self._program, GLSL, prefix)

    @property
    def _program(self) -> Program:
        """Return the shader's program: the place in the table, one fetch or two, and the decoding of the logarithms."""
        slices, theta_h, theta_d, phi_d = self.steps.shape[:4]
        statements, axes = _place_statements(self.symmetry, self.width)
        shape = (slices * theta_h, theta_d, phi_d)

        def texel(first: Expression | None = None) -> Expression:
            """Return the sampler coordinates in the slice that starts at row `first`, a fraction of the texture."""
            sides = [
                axis * ((n - 1) / m)
                for axis, n, m in zip(axes[:0:-1], (phi_d, theta_d, theta_h), shape[::-1], strict=True)
            ]
            half = constant(*(0.5 / m for m in shape[::-1]))
            return vector(sides[0], sides[1], sides[2] if first is None else sides[2] + first) + half

        statements = list(statements)
        if self.symmetry.isotropic:
            statements.append(Let("value", fetch(0, texel(), 3)))
        else:
            slice_, below = variable("slice", 1), variable("below", 1)
            statements.append(Let("slice", axes[0] * (slices - 1)))
            statements.append(Let("below", call("min", call("floor", slice_), slices - 2.0)))
            statements.append(Let("low", fetch(0, texel(below * (1 / slices)), 3)))
            statements.append(Let("high", fetch(0, texel((below + 1) * (1 / slices)), 3)))
            low, high = variable("low", 3), variable("high", 3)
            statements.append(Let("value", low + (high - low) * (slice_ - below)))
        wi, wo = variable("wi", 3), variable("wo", 3)
        statements.append(Let("above", call("step", 0.0, call("min", wi.z, wo.z)), "0 under the horizon"))
        mean = self.mean if len(self.mean) == 3 else self.mean * 3
        f = call("max", call("exp", variable("value", 3)) - FLOOR, 0.0) * constant(*mean)
        result = f * variable("above", 1)
        return Program(needed(statements, result), result, (shape,), ("R", "G", "B"), (_TITLE,))


def source_table(reflectance: Reflectance, *, pairs: int = 4096, seed: int = 0, budget: int = 150_000) -> SourceTable:
    """Return the table of a reflectance of 1 or 3 channels.

    The error at random pairs determines the warp and the size. The table grows until its error is within ENOUGH (median
    and 95th percentile), or until the next size would need more than `budget` bytes in the page. `pairs` of the pairs
    are cosine-weighted and define the stated error; as many more lie near highlights and only help to choose the warp.
    Raises BadInput for other channels and for values that are not finite. Negative values count as 0.
    """
    channels = len(reflectance.channels)
    if channels not in (1, 3):
        raise BadInput(where="source", found=f"{channels} channels", expected="1 or 3 to show")
    generator = torch.Generator().manual_seed(seed)
    symmetry = find_symmetry(reflectance, seed=seed)
    wi, wo = _pairs(pairs, generator)
    truth = _evaluate(reflectance, wi, wo)
    mean = truth[:pairs].mean(0).clamp_min(1e-12)

    def made(nodes: tuple[int, int, int, int], width: float) -> tuple[float, SourceTable]:
        steps = _tabulate(reflectance, symmetry, width, mean, nodes)
        table = SourceTable(steps, tuple(mean.tolist()), width, symmetry, TableError(0, 0, 0))
        found = table.evaluate(wi, wo)
        off = float(((found / mean + FLOOR).log() - (truth / mean + FLOOR).log()).abs().mean())
        relative = ((found - truth).abs() / torch.maximum(truth, mean / 1000))[:pairs].reshape(-1)
        error = TableError(float(relative.median()), float(torch.quantile(relative, 0.95)), pairs)
        return off, replace(table, error=error)

    ladder = ISOTROPIC if symmetry.isotropic else ANISOTROPIC
    # The mean over all pairs, not the error's median, chooses the warp: a highlight is few of the pairs.
    _, best = min((made(ladder[0], width) for width in WIDTHS), key=lambda pair: pair[0])
    for nodes in ladder[1:]:
        if best.error.median <= ENOUGH[0] and best.error.percentile_95 <= ENOUGH[1]:
            break
        _, finer = made(nodes, best.width)
        if len(pack(finer.differences())["data"]) > budget:
            break
        best = finer
    return best


def _tabulate(
    reflectance: Reflectance, symmetry: Symmetry, width: float, mean: Tensor, nodes: tuple[int, int, int, int]
) -> np.ndarray:
    """Return the logarithms at the nodes in steps of STEP, (φh, θh, θd, φd, C) int16."""
    x = [torch.linspace(0, 1, n, dtype=torch.float64) for n in nodes]
    turn, theta, share, around = torch.meshgrid(*x, indexing="ij")
    phi_h = turn * symmetry.period_h * (0.5 if symmetry.mirrored else 1)
    spread = around * symmetry.period_d * (0.5 if symmetry.isotropic and symmetry.mirrored else 1)
    theta_h = math.pi / 2 * width * torch.sinh(_share(theta, _CROWDED_H) * math.asinh(1 / width))
    theta_d = math.pi / 2 * _share(share, _CROWDED_D)
    cosine_d = torch.cos(spread) / (torch.tan(theta_h) * torch.tan(theta_d)).abs().clamp_min(1)
    sine_d = torch.copysign((1 - cosine_d**2).clamp_min(0).sqrt(), torch.sin(spread))
    (sine, cosine), (y, x) = ((torch.sin(angle), torch.cos(angle)) for angle in (theta_h, phi_h))
    h, a = torch.stack((sine * x, sine * y, cosine), -1), torch.stack((cosine * x, cosine * y, -sine), -1)
    b = torch.stack((-y, x, torch.zeros_like(phi_h)), -1)
    off = torch.sin(theta_d)[..., None] * (cosine_d[..., None] * a + sine_d[..., None] * b)
    on = torch.cos(theta_d)[..., None] * h
    values = _evaluate(reflectance, _raised(on + off), _raised(on - off))
    steps = ((values / mean + FLOOR).log() / STEP).round().clamp(-32768, 32767)
    return steps.to(torch.int16).reshape(*theta.shape, -1).numpy()


def _share(x: Tensor, crowded: float) -> Tensor:
    """Return the shares u of an axis at nodes x, the inverse of `_crowd`."""
    root = ((crowded**2 + 4 * (1 - crowded) * (1 - x)).sqrt() - crowded) / (2 * (1 - crowded))
    return 1 - root**2


def _crowd(u: Expression, crowded: float) -> Expression:
    """Return where the share u of an axis is among the nodes, which are crowded towards the end."""
    return u * (1 - crowded) + (1 - call("sqrt", call("max", 1 - u, 0.0))) * crowded


def _raised(w: Tensor) -> Tensor:
    """Return unit directions (N, 3) of (..., 3), those at the horizon a little above it."""
    return normalize(torch.cat((w[..., :2], w[..., 2:].clamp_min(_LOWEST)), -1).reshape(-1, 3))


def _place_statements(symmetry: Symmetry, width: float) -> tuple[tuple[Let, ...], list[Expression]]:
    """Return statements, and a pair's coordinates in [0, 1] on the four axes, φh first (0 if isotropic)."""
    wanted = {"theta_h", "theta_d"} | (set() if symmetry.isotropic else {"phi_h"})
    made = coordinates_of(frozenset(wanted))
    statements, axes = list(made.statements), made.axes
    wi, wo, s, e = (variable(name, 3) for name in ("wi", "wo", "s", "e"))
    span, across, most = variable("span", 1), variable("across", 1), variable("most", 1)
    statements.append(Let("span", call("sqrt", call("dot", s, s))))
    statements.append(Let("across", s.x * e.y - s.y * e.x, "of wi about h, across the plane of n and h"))
    above = call("sqrt", call("max", wi.z * wo.z, 0.0))
    statements.append(Let("most", span * above * 2, "as far across as both directions are above the horizon"))
    within = call("min", call("max", across, most * -1), most)
    around = call("atan2", within, e.z * span * -1 + _TINY) * (1 / symmetry.period_d)
    turn = variable("turn", 1)
    if symmetry.isotropic:
        statements.append(Let("turn", constant(0)))
    elif symmetry.mirrored:
        whole = variable("whole", 1)
        statements.append(Let("whole", call("fract", axes["phi_h"] * (1 / symmetry.period_h))))
        statements.append(Let("turn", call("min", whole, 1 - whole) * 2, "mirrored, phi_d with it"))
        around = around * (1 - call("step", 0.5, whole) * 2)
    else:
        statements.append(Let("turn", call("fract", axes["phi_h"] * (1 / symmetry.period_h))))
    x = variable("x", 1)
    if symmetry.isotropic and symmetry.mirrored:
        unfolded = variable("unfolded", 1)
        statements.append(Let("unfolded", call("fract", around)))
        statements.append(Let("x", call("min", unfolded, 1 - unfolded) * 2))
    else:
        statements.append(Let("x", call("fract", around)))
    statements.append(Let("y", _crowd(axes["theta_d"] * (2 / math.pi), _CROWDED_D)))
    stretch, half, factor = stretched("stretched", [axes["theta_h"]], width)
    statements += [*stretch, Let("z", _crowd(half[0] * factor, _CROWDED_H))]
    return tuple(statements), [turn, variable("z", 1), variable("y", 1), x]


def _place(wi: Tensor, wo: Tensor, symmetry: Symmetry, width: float) -> tuple[Tensor, Tensor, Tensor, Tensor]:
    """Return the coordinates in [0, 1] of pairs on the four axes, φh first, computed by the shader's statements."""
    statements, axes = _place_statements(symmetry, width)
    values = {"wi": list(wi.unbind(-1)), "wo": list(wo.unbind(-1))}
    interpret(statements, values, TORCH)
    turn, z, y, x = (torch.as_tensor(values[axis.text][0]).to(wi).expand(len(wi)) for axis in axes)
    return turn, z.clamp(0, 1), y, x


def _pairs(count: int, generator: torch.Generator) -> tuple[Tensor, Tensor]:
    """Return `count` cosine-weighted pairs, and as many near the mirror direction, where highlights are."""
    wi, wo = draw_cosine_weighted(2 * count, generator)
    slope = 10 ** (-3 * torch.rand(count, dtype=torch.float64, generator=generator))
    angle = torch.rand(count, dtype=torch.float64, generator=generator) * (2 * math.pi)
    h = normalize(torch.stack((slope * torch.cos(angle), slope * torch.sin(angle), torch.ones_like(slope)), -1))
    mirrored = 2 * (wi[count:] * h).sum(-1, keepdim=True) * h - wi[count:]
    wo = torch.cat((wo[:count], torch.where(mirrored[:, 2:] > 0, mirrored, wo[count:])))
    return wi, wo


def _evaluate(reflectance: Reflectance, wi: Tensor, wo: Tensor) -> Tensor:
    pairs = zip(wi.split(_BATCH), wo.split(_BATCH), strict=True)
    values = torch.cat([reflectance.evaluate(a, b).to(torch.float64) for a, b in pairs])
    if not bool(torch.isfinite(values).all()):
        wanted = "finite values at all directions above the horizon"
        raise BadInput("a value is not finite", where="source", expected=wanted)
    return values.clamp_min(0)


def _percent(value: float) -> str:
    return f"{100 * value:.2g}%"
