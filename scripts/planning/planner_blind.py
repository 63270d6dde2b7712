"""Check plans in unseen views: whether those that meet their tolerance also meet it there.

Plans of one material are drawn by a seeded generator: a material, a lighting, a kind of error with its limit, sometimes
a distance; of the ladder they have the rungs of up to `TEXELS` texels, which take seconds. Materials and lightings are
split in two: the margins of `plan.tolerance` are set on plans of the tuning half alone, the test half has other
materials and other lightings. Every choice is rendered anew, by the program's pictures and not the planner's nodes:
`VIEWS` views drawn independently, `rendering.sphere` at `SIZE` pixels under lamps, full `rendering.filtered` at
`MAP_SIZE` under maps, exposed for these views. A plan holds where the error of these pictures is within the limit
itself, of CIEDE2000 in the worst view. `ratio` is that error over the planner's own.

    OMP_NUM_THREADS=1 python scripts/planning/planner_blind.py [--half tuning|test] [--cases 40] [--seed 0]
"""

import math
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import torch
from torch import Tensor

from homofact.brdf.analytic.lambert import Lambert
from homofact.brdf.reflectance import Reflectance
from homofact.evaluation.machine import machine
from homofact.linear.normal import warm_up
from homofact.planning.ladder import CONSTANT, FitOptions
from homofact.planning.material_fits import MaterialFits
from homofact.planning.measure import Picture, exposure, picture_errors
from homofact.planning.plan import MaterialPlan, plan_material
from homofact.planning.scene import Budget, SceneMaterial
from homofact.planning.stage import RIM, Stage
from homofact.planning.theory import colour_error
from homofact.planning.tolerance import MARGINS, Tolerance
from homofact.rendering.filtered import FilteredMaterial, Surroundings
from homofact.rendering.light import DirectionalLight, EnvironmentMap
from homofact.rendering.sphere import render_sphere
from homofact.rendering.surface import seen_surface
from homofact.scene.lighting import Lighting, named_lighting, texel_directions

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from scripts.shared.harness import data_folder, figure, markdown, parser_of

VIEWS, SIZE, MAP_SIZE = 6, 256, 96
# Of the limits, drawn evenly in their logarithm.
LIMITS = {"delta_e": (0.4, 5.0), "delta_e_p95": (1.5, 12.0), "delta_e_peak": (5.0, 40.0), "reflected": (0.03, 0.5)}
TEXELS = 1024
MODELS = {
    "tuning": ("lafortune-blue-paint", "phong-10", "cook-torrance-plastic", "lafortune-clay"),
    "test": ("blinn-phong-50", "torrance-sparrow-20", "lafortune-skin", "phong-30"),
}
RGL = {"tuning": ("aurora_white_rgb",), "test": ("vch_golden_yellow_rgb",)}
AFAR = 0.3  # of the plans, at 12 to 200 pixels
Direction = tuple[float, float, float]


@dataclass(frozen=True)
class Case:
    """One plan: what was planned, and the error of its choice by the planner and in new views."""

    material: str
    lighting: str
    kind: str
    limit: float
    pixels: int | None
    choice: str
    met: bool
    planned: float
    rendered: float
    theory: float | None

    @property
    def ratio(self) -> float:
        """Rendered over planned."""
        return self.rendered / self.planned if self.planned > 0 else math.inf if self.rendered > 0 else 1.0

    @property
    def holds(self) -> bool:
        """Whether the limit is kept in the new views."""
        return self.rendered <= self.limit


def lightings(half: str) -> tuple[Lighting, ...]:
    """The lightings of a half: named ones, lamps from other sides, and a sky with a small sun."""
    if half == "tuning":
        lamps = (
            DirectionalLight((-0.7, 0.3, 0.6), (3.0, 2.6, 2.0)),
            DirectionalLight((0.9, 0.4, -0.2), (0.6, 0.8, 1.2)),
        )
        return named_lighting("sun"), named_lighting("overcast"), Lighting("two lamps", lamps), sunny(1.0, 0.4)
    lamps = (DirectionalLight((0.1, 0.9, 0.3), (2.5, 2.5, 2.5)), DirectionalLight((-0.4, -0.2, 0.9), (1.2, 0.7, 0.5)))
    return named_lighting("studio"), named_lighting("uniform"), Lighting("key and fill", lamps), sunny(-0.6, 0.8)


def sunny(azimuth: float, height: float) -> Lighting:
    """A blue sky over dark ground, much of whose light comes from a sun 5° wide."""
    w = texel_directions(64, 128)
    towards = torch.tensor([math.sin(azimuth), height, math.cos(azimuth)], dtype=torch.float64)
    sky = torch.where(w[:, 1:2] > 0, w.new_tensor([0.3, 0.5, 0.9]), w.new_tensor([0.08, 0.07, 0.06]))
    sun = (w @ (towards / towards.norm()) > math.cos(math.radians(2.5)))[:, None] * w.new_tensor([300.0, 280.0, 240.0])
    return Lighting("sky with a sun", (EnvironmentMap((sky + sun).reshape(64, 128, 3), name="sky with a sun"),))


def views(seed: int) -> list[Direction]:
    """Unit directions drawn independently, uniform on the sphere."""
    generator = torch.Generator().manual_seed(seed)
    drawn = torch.randn(VIEWS, 3, dtype=torch.float64, generator=generator)
    x, y, z = (drawn / drawn.norm(dim=1, keepdim=True)).T.tolist()
    return list(zip(x, y, z, strict=True))


class Studio:
    """Independent pictures of materials under one lighting, from views of its own."""

    def __init__(self, lighting: Lighting, seed: int) -> None:
        self.lighting, self.views = lighting, views(seed)
        mapped = any(isinstance(each, EnvironmentMap) for each in lighting.lights)
        self.size = MAP_SIZE if mapped else SIZE
        self.surroundings = [
            [Surroundings.of(each, self.size, view) for each in lighting.lights if isinstance(each, EnvironmentMap)]
            for view in self.views
        ]
        self.lamps = [each for each in lighting.lights if isinstance(each, DirectionalLight)]

    def pictures(self, reflectance: Reflectance, pixels: int | None) -> list[Picture]:
        """What is seen of a material, of so many pixels across."""
        materials: list[FilteredMaterial] = []
        found = []
        for view, surroundings in zip(self.views, self.surroundings, strict=True):
            radiance = torch.zeros(self.size, self.size, 1, dtype=torch.float64)
            if self.lamps:
                radiance = radiance + render_sphere(reflectance, self.lamps, self.size, view=view).radiance
            if surroundings and (not materials or materials[0].lobe.flux.shape[1] > 1):
                materials = [FilteredMaterial.of(reflectance, view=view)]
            for each in surroundings:
                radiance = radiance + materials[0].under(each).radiance
            found.append(self._picture(radiance, view, pixels))
        return found

    def nine_terms(self, colour: Lambert, pixels: int | None) -> list[Picture]:
        """One colour under the 9 terms of the light."""
        albedo, found = torch.tensor(colour.diffuse, dtype=torch.float64) / math.pi, []
        for view in self.views:
            _, surface = seen_surface(self.size, view)
            lit = (self.lighting.irradiance(surface.frame[:, 2], 2) * albedo).clamp_min(0)
            radiance = torch.zeros(self.size**2, lit.shape[1], dtype=torch.float64)
            radiance[surface.pixels] = lit
            found.append(self._picture(radiance.reshape(self.size, self.size, -1), view, pixels))
        return found

    def _picture(self, radiance: Tensor, view: Direction, pixels: int | None) -> Picture:
        coverage, surface = seen_surface(self.size, view)
        if pixels is None:
            # What no picture resolves is no part of the planner's promise.
            coverage = coverage.clone()
            coverage.reshape(-1)[surface.pixels[surface.wo[:, 2] < RIM]] = 0
        block = 1 if pixels is None else max(1, round(self.size / pixels))
        if block > 1:
            side = self.size // block
            cut = slice(0, side * block)
            weighted = (radiance * coverage[..., None])[cut, cut].reshape(side, block, side, block, -1).sum((1, 3))
            coverage = coverage[cut, cut].reshape(side, block, side, block).sum((1, 3))
            radiance = weighted / coverage[..., None].clamp_min(1e-12)
        inside = coverage > 0
        weights = coverage[inside]
        return Picture(radiance[inside], weights / weights.sum())


def rendered(plan: MaterialPlan, studio: Studio, own: list[Picture], kind: str) -> float:
    """The error of a plan's choice in the studio's views."""
    choice, pixels = plan.walk.choice, plan.material.pixels
    assert choice is not None
    if plan.colour is not None:
        draw = studio.pictures if choice.method == CONSTANT else studio.nine_terms
        found = draw(plan.colour, pixels)
    else:
        found = studio.pictures(plan.fits.fitted(choice)[0], pixels)
    return picture_errors(own, found, exposure(own), (kind,))[kind]


def cases(half: str, count: int, seed: int, folder: Path, options: FitOptions) -> list[Case]:
    """`count` plans of a half, and what became of them."""
    lit = lightings(half)
    files = [folder / "rgl" / f"{name}.bsdf" for name in RGL[half]]
    texts = [*(f"material:{name}" for name in MODELS[half]), *(str(file) for file in files if file.is_file())]
    generator = torch.Generator().manual_seed(seed + (0 if half == "tuning" else 1_000_003))
    fits_by_source: dict[str, MaterialFits] = {}

    @cache
    def stage(number: int) -> Stage:
        return Stage.of(lit[number], seed)

    @cache
    def studio(number: int) -> Studio:
        return Studio(lit[number], 7919 * (seed + 1) + number)

    @cache
    def own(text: str, number: int, pixels: int | None) -> list[Picture]:
        return studio(number).pictures(fits_by_source[text].source.reflectance, pixels)

    def drawn(count: int) -> int:
        return int(torch.randint(count, (1,), generator=generator))

    found = []
    for _ in range(count):
        text, number = texts[drawn(len(texts))], drawn(len(lit))
        kind = tuple(LIMITS)[drawn(len(LIMITS))]
        part, afar, near = torch.rand(3, dtype=torch.float64, generator=generator).tolist()
        low, high = LIMITS[kind]
        limit = low * (high / low) ** part
        pixels = round(12 * (200 / 12) ** near) if afar < AFAR else None
        fits = fits_by_source.setdefault(text, MaterialFits(text, options))
        fits.rungs = tuple(each for each in fits.rungs if each.textures * each.size**2 <= TEXELS)
        tolerance = Tolerance(((kind, limit),))
        plan = plan_material(SceneMaterial(text, 1.0, pixels), fits, (stage(number),), tolerance, Budget())
        choice = plan.walk.choice
        assert choice is not None
        assert plan.outcome is not None
        error = rendered(plan, studio(number), own(text, number, pixels), kind)
        theory = None
        if choice.is_colour:
            theory = plan.errors[0].reflected / colour_error(choice, fits.lobes, lit[number])
        name, light = fits.source.name, lit[number].name
        found.append(
            Case(name, light, kind, limit, pixels, choice.label, plan.walk.met, plan.outcome.value, error, theory)
        )
        print(found[-1], flush=True)
    return found


def report(half: str, found: Sequence[Case]) -> str:
    """The tables in Markdown."""
    rows = []
    for kind in (*LIMITS, "all"):
        own = [each for each in found if kind in (each.kind, "all")]
        met = [each for each in own if each.met]
        ratios = torch.tensor([each.ratio for each in own] or [math.nan], dtype=torch.float64)
        tight = [each for each in met if each.ratio <= MARGINS[each.kind]]
        rows.append(
            (
                kind,
                "–" if kind == "all" else f"{MARGINS[kind]:g}",
                len(own),
                len(met),
                share([each.holds for each in met]),
                f"{len(tight)} of {len(met)}",
                figure(float(ratios.median())),
                figure(float(ratios.quantile(0.95))),
                figure(float(ratios.max())),
            )
        )
    theory = [each.theory for each in found if each.theory is not None]
    lines = [
        f"The {half} half: plans; how many meet their limit, and of these hold in new views, and would with all of the"
        " limit used (ratio within the margin); the ratio of the errors in new views to the planner's.",
        "",
        markdown(("kind", "margin", "plans", "met", "hold", "within margin", "median ratio", "95%", "most"), rows),
        "",
        *(
            f"- does not hold: {c.material}, {c.lighting}, {c.kind} {figure(c.limit)}, pixels {c.pixels}: {c.choice},"
            f" {figure(c.planned)} planned, {figure(c.rendered)} rendered"
            for c in found
            if c.met and not c.holds
        ),
        f"Of {len(theory)} single colours, theory (mean over all turnings) is within a factor of two of the planner's"
        f" reflected error in {sum(0.5 <= each <= 2 for each in theory)}.",
        "",
        machine(),
    ]
    return "\n".join(lines)


def share(flags: Sequence[bool]) -> str:
    """How many are true, of how many."""
    return f"{sum(flags)} of {len(flags)}" + (f" ({sum(flags) / len(flags):.0%})" if flags else "")


def main(argv: Sequence[str] | None = None) -> int:
    """Run it; exit code 0."""
    parser = parser_of(__doc__, "data")
    parser.add_argument("--half", choices=tuple(MODELS), default="test")
    parser.add_argument("--cases", type=int, default=40, help="plans to draw")
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args(argv)
    warm_up()
    options = FitOptions(effort=20, count=6000)
    folder, count = data_folder(given.data), given.cases
    if given.short:
        options, folder, count = FitOptions(effort=1, budget=0.05, count=400), Path("nowhere"), 2
    print(report(given.half, cases(given.half, count, given.seed, folder, options)))
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
