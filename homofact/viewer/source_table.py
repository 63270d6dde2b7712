"""The source itself in the page: a table of its reflectance in a 3D texture, and the shader text that reads it.

A pair of directions is its half vector h = (θh, φh) and the direction of ωi about it, (θd, φd):

    ωi = cosθd h + sinθd (cosφd a + sinφd b),    a = ∂h/∂θh,  b = z × h / |z × h|,    ωo with φd + π.

Both are above the horizon where tan θd ≤ cosθh / (sinθh |cosφd|). The table's axes are

    θh    warped: θh = π/2 · w sinh(x asinh(1/w)), x in [0, 1], so that a highlight gets nodes (w is chosen)
    θd    as its share of the largest that is possible there: no node is wasted under the horizon
    φd    over its period, π where the source is reciprocal and 2π where not; folded in half where it is isotropic
          and left-right symmetric
    φh    for an anisotropic source only: slices one above the other along θh, two fetches and a mix; folded by the
          half turn and by the mirror (φh, φd) ~ (−φh, −φd) where the source has these symmetries

with nodes at both ends of each. Symmetries are not declared but tried, on random pairs. The texels hold
x = log(f/A + δ) in whole steps of 1/256, A the mean, f = A max(0, exp(x) − δ): interpolation in logarithms
follows a lobe over decades.

What the table is off from the source is measured on directions that are no nodes, and stated in the page: the table
is a picture of the source, not the source.
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
from homofact.geometry.directions import draw_cosine_weighted, normalize
from homofact.viewer.packing import differences, pack

STEP = 1 / 256
FLOOR = 1e-5
WIDTHS = (0.005, 0.02, 0.08, 0.3, 1.0)
# Nodes of φh, θh, θd, φd, from small to large: the first that is close enough is taken.
ISOTROPIC = ((1, 48, 24, 12), (1, 64, 32, 24), (1, 96, 32, 24), (1, 160, 32, 24))
ANISOTROPIC = ((9, 24, 12, 17), (17, 32, 16, 25))
ENOUGH = (0.003, 0.02)
# The outermost node of θd: many models and all measurements are at a loss at the horizon itself.
_REACH = 0.99
_BATCH = 1 << 15


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
    """The table.

    `steps` is (slices, θh, θd, φd, C) int16, logarithms in steps of STEP; `mean` is A (C,) in sr⁻¹; `width` the
    warp's w.
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
        """(3, slices · θh, θd, φd) int16 for the page: green, red less green, blue less green.

        Along φd and θd each node is less the one before it. One channel is three equal ones.
        """
        steps = self.steps.reshape(-1, *self.steps.shape[2:])
        red, green, blue = (steps[..., min(k, steps.shape[-1] - 1)] for k in range(3))
        return differences(np.stack((green, red - green, blue - green)), (2, 3))

    @cached_property
    def _values(self) -> Tensor:
        return torch.from_numpy(self.steps.astype(np.float64)) * STEP

    def evaluate(self, wi: Tensor, wo: Tensor) -> Tensor:
        """What the shader gives, in float64: (N, C) in sr⁻¹ without the cosine, 0 under the horizon."""
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
        """GLSL ES 3.00: declares `PREFIX_table` (a 3D sampler), defines `vec3 PREFIX_evaluate(vec3 wi, vec3 wo)`."""
        slices, theta_h, theta_d, phi_d = self.steps.shape[:4]
        symmetry = self.symmetry
        mean = self.mean if len(self.mean) == 3 else self.mean * 3
        fold_h = f"    float turn = fract(atan(h.y, h.x) / {_f(symmetry.period_h)});\n"
        if symmetry.mirrored:
            fold_h += "    if (turn > 0.5) {{ turn = 1.0 - turn; across = -across; }}\n    turn *= 2.0;\n"
        fold_d = f"    float x = fract(atan(across, along) / {_f(symmetry.period_d)});\n"
        if symmetry.isotropic and symmetry.mirrored:
            fold_d += "    x = 2.0 * min(x, 1.0 - x);\n"
        read = (
            "    vec3 value = texture({p}_table, ({p}_SIZE - 1.0) * vec3(x, y, z) / {p}_SIZE + 0.5 / {p}_SIZE).rgb;\n"
        )
        if not symmetry.isotropic:
            read = (
                "    float slice = turn * {last:.1f};\n"
                "    float below = min(floor(slice), {last:.1f} - 1.0);\n"
                "    vec3 at = vec3((x * ({p}_SIZE.x - 1.0) + 0.5) / {p}_SIZE.x,"
                " (y * ({p}_SIZE.y - 1.0) + 0.5) / {p}_SIZE.y,\n"
                "        (below * {p}_SIZE.z + z * ({p}_SIZE.z - 1.0) + 0.5) / ({slices:.1f} * {p}_SIZE.z));\n"
                "    vec3 value = mix(texture({p}_table, at).rgb,"
                " texture({p}_table, at + vec3(0.0, 0.0, 1.0 / {slices:.1f})).rgb, slice - below);\n"
            )
        text = (
            "// The source as a table over the angles of the half vector; logarithms, linear between its nodes.\n"
            "uniform highp sampler3D {p}_table;\n"
            "const vec3 {p}_SIZE = vec3({phi_d:.1f}, {theta_d:.1f}, {theta_h:.1f});\n\n"
            "vec3 {p}_evaluate(vec3 wi, vec3 wo) {{\n"
            "    if (wi.z < 0.0 || wo.z < 0.0) return vec3(0.0);\n"
            "    vec3 h = wi + wo;\n"
            "    h = dot(h, h) > 0.0 ? normalize(h) : vec3(0.0, 0.0, 1.0);\n"
            "    float sine = length(h.xy);\n"
            "    float towards = dot(wi, h);\n"
            "    // The tiny numbers keep atan away from (0, 0), where it is not defined.\n"
            "    float along = towards * h.z - wi.z + 1e-20;\n"
            "    float across = h.x * wi.y - h.y * wi.x;\n"
            "    float theta_h = atan(sine, h.z);\n"
            "    float theta_d = atan(0.5 * length(wi - wo), towards);\n"
            "    float reach = atan(h.z + 1e-6, sine * abs(along) * inversesqrt(along * along + across * across"
            " + 1e-30));\n" + ("" if symmetry.isotropic else fold_h) + fold_d + "    float y ="
            " min(theta_d / ({reach} * reach), 1.0);\n"
            "    float z = asinh(theta_h * {per_width}) * {per_range};\n"
            + read
            + "    return {mean} * max(exp(value) - {floor}, 0.0);\n}}\n"
        )
        return text.format(
            p=prefix,
            phi_d=phi_d,
            theta_d=theta_d,
            theta_h=theta_h,
            slices=slices,
            last=slices - 1,
            reach=_f(_REACH),
            per_width=_f(2 / math.pi / self.width),
            per_range=_f(1 / math.asinh(1 / self.width)),
            mean="vec3(" + ", ".join(_f(value) for value in mean) + ")",
            floor=_f(FLOOR),
        )


def source_table(reflectance: Reflectance, *, pairs: int = 4096, seed: int = 0, budget: int = 150_000) -> SourceTable:
    """The table of a reflectance of 1 or 3 channels.

    `pairs` random pairs choose its warp and measure its error; it grows until it is within ENOUGH (median and 95th
    percentile) or its text in the page would be longer than `budget` bytes. Raises BadInput for other channels and for
    values that are not finite. Negative values count as 0.
    """
    channels = len(reflectance.channels)
    if channels not in (1, 3):
        raise BadInput(f"source: found {channels} channels, expected 1 or 3 to show")
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
    """(φh, θh, θd, φd, C) int16: the logarithms at the nodes in steps."""
    x = [torch.linspace(0, 1, n, dtype=torch.float64) for n in nodes]
    turn, theta, share, around = torch.meshgrid(*x, indexing="ij")
    phi_h = turn * symmetry.period_h * (0.5 if symmetry.mirrored else 1)
    phi_d = around * symmetry.period_d * (0.5 if symmetry.isotropic and symmetry.mirrored else 1)
    theta_h = (math.pi / 2 - 1e-4) * width * torch.sinh(theta * math.asinh(1 / width))
    theta_d = _REACH * share * torch.atan2(torch.cos(theta_h), torch.sin(theta_h) * torch.cos(phi_d).abs())
    h = torch.stack(
        (torch.sin(theta_h) * torch.cos(phi_h), torch.sin(theta_h) * torch.sin(phi_h), torch.cos(theta_h)), -1
    )
    a = torch.stack(
        (torch.cos(theta_h) * torch.cos(phi_h), torch.cos(theta_h) * torch.sin(phi_h), -torch.sin(theta_h)), -1
    )
    b = torch.stack((-torch.sin(phi_h), torch.cos(phi_h), torch.zeros_like(phi_h)), -1)
    off = torch.sin(theta_d)[..., None] * (torch.cos(phi_d)[..., None] * a + torch.sin(phi_d)[..., None] * b)
    on = torch.cos(theta_d)[..., None] * h
    values = _evaluate(reflectance, (on + off).reshape(-1, 3), (on - off).reshape(-1, 3))
    steps = ((values / mean + FLOOR).log() / STEP).round().clamp(-32768, 32767)
    return steps.to(torch.int16).reshape(*theta.shape, -1).numpy()


def _place(wi: Tensor, wo: Tensor, symmetry: Symmetry, width: float) -> tuple[Tensor, Tensor, Tensor, Tensor]:
    """Where pairs are along the four axes, φh first, each in [0, 1]: the shader's own steps."""
    h = normalize(wi + wo)
    sine = torch.hypot(h[:, 0], h[:, 1])
    towards = (wi * h).sum(-1)
    along = towards * h[:, 2] - wi[:, 2]
    across = h[:, 0] * wi[:, 1] - h[:, 1] * wi[:, 0]
    theta_h = torch.atan2(sine, h[:, 2])
    theta_d = torch.atan2((wi - wo).norm(dim=-1) / 2, towards)
    reach = torch.atan2(h[:, 2] + 1e-6, sine * along.abs() / torch.hypot(along, across).clamp_min(1e-15))
    turn = torch.zeros_like(sine)
    if not symmetry.isotropic:
        turn = torch.remainder(torch.atan2(h[:, 1], h[:, 0]) / symmetry.period_h, 1)
        if symmetry.mirrored:
            across = torch.where(turn > 0.5, -across, across)
            turn = 2 * torch.minimum(turn, 1 - turn)
    x = torch.remainder(torch.atan2(across, along) / symmetry.period_d, 1)
    if symmetry.isotropic and symmetry.mirrored:
        x = 2 * torch.minimum(x, 1 - x)
    z = torch.asinh(theta_h * (2 / math.pi / width)) / math.asinh(1 / width)
    return turn, z.clamp(0, 1), (theta_d / (_REACH * reach)).clamp(0, 1), x


def _pairs(count: int, generator: torch.Generator) -> tuple[Tensor, Tensor]:
    """`count` cosine-weighted pairs, and as many that are near the mirror direction, where highlights are."""
    wi, wo = draw_cosine_weighted(2 * count, generator)
    slope = 10 ** (-3 * torch.rand(count, dtype=torch.float64, generator=generator))
    angle = torch.rand(count, dtype=torch.float64, generator=generator) * (2 * math.pi)
    h = normalize(torch.stack((slope * torch.cos(angle), slope * torch.sin(angle), torch.ones_like(slope)), -1))
    mirrored = 2 * (wi[count:] * h).sum(-1, keepdim=True) * h - wi[count:]
    wo = torch.cat((wo[:count], torch.where(mirrored[:, 2:] > 0, mirrored, wo[count:])))
    return wi, wo


def _evaluate(reflectance: Reflectance, wi: Tensor, wo: Tensor) -> Tensor:
    values = torch.cat(
        [reflectance.evaluate(a, b).to(torch.float64) for a, b in zip(wi.split(_BATCH), wo.split(_BATCH), strict=True)]
    )
    if not bool(torch.isfinite(values).all()):
        raise BadInput("source: a value is not finite, expected finite values at all directions above the horizon")
    return values.clamp_min(0)


def _f(value: float) -> str:
    """A GLSL float literal."""
    text = f"{value:.9g}"
    return text if "." in text or "e" in text else text + ".0"


def _percent(value: float) -> str:
    return f"{100 * value:.2g} %"
