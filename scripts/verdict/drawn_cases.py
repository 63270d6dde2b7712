"""Randomly choose the cases of `calibrate.py`. A case is a material, its simulated measurement, a fault, and the
methods that fit it.

Three parts share no material, no kind of fault (`stability.faults`) and no settings but the searches': the error bars'
table is made of the first two, and the third is drawn once, to be reported. Materials are neural surrogates of MERL and
RGL materials, mixtures of two of them, and analytic
models of drawn parameters. Three of five cases have the right data: clean, fewer, or with a little noise.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

import torch
from torch import Tensor

from homofact.brdf.analytic import BlinnPhong, CookTorrance, Ward
from homofact.brdf.formats.nbrdf import load, material_names
from homofact.brdf.reflectance import Reflectance
from homofact.brdf.samples import Samples
from homofact.brdf.sampling import Drawable, sample_model
from homofact.geometry.directions import from_spherical
from homofact.methods.mccool import McCool
from homofact.methods.method import Method
from homofact.methods.search import Search
from homofact.stability.fault import CasePart, Fault
from homofact.stability.faults import FAULTS

NETWORKS = Path("nbrdf") / "merl_nbrdf_weights.npz"
MORE_NETWORKS = Path("nbrdf") / "rgl_nbrdf_weights.npz"
# Surrogates on which no threshold of the suspicions was set.
UNTOUCHED = (
    "aluminium", "black-obsidian", "chrome-steel", "dark-red-paint", "dark-specular-fabric",
    "delrin", "light-brown-fabric", "maroon-plastic", "natural-209", "white-acrylic", "white-fabric",
)  # fmt: skip
LAYOUTS = ("discs", "lobe", "rings")
COUNTS = (2500, 5000)
HIGHEST = (65.0, 70.0, 75.0, 80.0, 85.0)  # degrees at which rings end, as goniometers do
_TWO = ("theta_h-theta_d", "theta_d-phi_d")
_SEARCHES = (Search(textures=2, size=12, effort="quick"), Search(textures=1, size=16, effort="quick"))
_OTHERS: dict[CasePart, tuple[Method, ...]] = {
    CasePart.FIRST: (
        McCool(size=12),
        McCool(size=16, projections=_TWO, smoothing=0.1),
        McCool(size=12, smoothing=10.0),
    ),
    CasePart.SECOND: (McCool(size=16), McCool(size=10, projections=_TWO), McCool(size=24, smoothing=1e-7)),
    CasePart.REPORT: (McCool(size=20), McCool(size=20, projections=_TWO), McCool(size=8, smoothing=1.0)),
}


@dataclass(frozen=True)
class Mixture:
    """`share` of one isotropic reflectance and the rest of another: a material of its own."""

    one: Reflectance
    two: Reflectance
    share: float
    isotropic: bool = True
    nbytes: int = 0
    fetches: int = 0

    @property
    def channels(self) -> tuple[str, ...]:
        """Those of both."""
        return self.one.channels

    def evaluate(self, wi: Tensor, wo: Tensor) -> Tensor:
        """The mean of both, weighted."""
        return self.share * self.one.evaluate(wi, wo) + (1 - self.share) * self.two.evaluate(wi, wo)


@dataclass(frozen=True)
class DrawnCase:
    """One material, measured in one way; `fault` None where nothing is done to its samples."""

    part: CasePart
    number: int
    name: str
    material: Drawable
    layout: str
    samples: Samples
    fault: Fault | None
    strength: float
    methods: tuple[Method, ...]

    @property
    def right(self) -> bool:
        """Whether the samples are of this material."""
        return self.fault is None or self.fault.right


def drawn_case(part: CasePart, number: int, folder: Path, seed: int = 0) -> DrawnCase:
    """Draw case `number` of a part, the same whenever it is drawn."""
    chance = torch.Generator().manual_seed(1_000_000 * (seed + 1) + 10_000 * list(CasePart).index(part) + number)

    def pick(count: int) -> int:
        return int(torch.randint(count, (1,), generator=chance))

    name, material = _material(part, folder, pick)
    layout, count = LAYOUTS[pick(len(LAYOUTS))], COUNTS[pick(len(COUNTS))]
    faults = [fault for fault in FAULTS.values() if fault.part is part]
    # Three of five have right data, the first of them clean; the kinds of either sort come in turn.
    turn, place = divmod(number, 5)
    kinds = [each for each in faults if each.right is (place < 3)]
    fault = None if place == 0 else kinds[(2 * turn + place) % len(kinds)]
    strength = 0.0 if fault is None else float(fault.strengths[pick(len(fault.strengths))])
    samples = measured(material, layout, count, number, HIGHEST[pick(len(HIGHEST))])
    if fault is not None:
        samples = fault.plant(samples, strength, number)
    others = _OTHERS[part]
    methods = (*_SEARCHES, others[number % len(others)])
    return DrawnCase(part, number, name, material, layout, samples, fault, strength, methods)


def measured(material: Drawable, layout: str, count: int, seed: int, highest: float = 80.0) -> Samples:
    """About `count` clean samples in one of `LAYOUTS`, without a word on how they were drawn.

    Rings end at `highest` degrees, of light and view.
    """
    if layout == "rings":
        return on_rings(material, count, highest)
    return replace(sample_model(material, count, layout, seed), provenance={})


def on_rings(model: Reflectance, count: int, highest: float = 80.0) -> Samples:
    """As a goniometer takes them: twelve angles of the light, rings of θo and Δφ, the angles out to the `highest`."""
    side = max(round((count / 24) ** 0.5), 4)
    angles = (torch.linspace(0, highest, steps + 1, dtype=torch.float64)[1:].deg2rad() for steps in (12, side))
    turn = torch.linspace(0, torch.pi, 2 * side, dtype=torch.float64)
    i, o, phi = (each.reshape(-1) for each in torch.meshgrid(*angles, turn, indexing="ij"))
    wi, wo = from_spherical(i, i * 0), from_spherical(o, phi)
    return Samples(wi, wo, model.evaluate(wi, wo), channels=model.channels, isotropic=True)


@lru_cache(maxsize=8)
def networks(part: CasePart, folder: Path) -> tuple[str, ...]:
    """The surrogates of a part as sources "FILE#NAME"; none where the files are not there."""
    place = list(CasePart).index(part)
    found: list[str] = []
    file = folder / NETWORKS
    if file.is_file():
        names = [name for name in material_names(file) if name not in UNTOUCHED]
        found += [f"{file}#{name}" for name in (UNTOUCHED if part is CasePart.REPORT else names[place::2])]
    file = folder / MORE_NETWORKS
    if file.is_file():
        found += [f"{file}#{name}" for name in material_names(file)[place::3]]
    return tuple(found)


def _material(part: CasePart, folder: Path, pick: Callable[[int], int]) -> tuple[str, Drawable]:
    known, kind = networks(part, folder), pick(10)
    if kind < 3 or not known:
        return _drawn_model(part, pick)
    one = known[pick(len(known))]
    if kind < 8:
        return one.split("#")[1], load(one)
    two, share = known[pick(len(known))], (1 + pick(9)) / 10
    names = [each.split("#")[1] for each in (one, two)]
    return f"{share:g} {names[0]} + {1 - share:g} {names[1]}", Mixture(load(one), load(two), share)


def _drawn_model(part: CasePart, pick: Callable[[int], int]) -> tuple[str, Drawable]:
    def colour(most: float) -> tuple[float, float, float]:
        return tuple(most * (1 + pick(100)) / 100 for _ in range(3))  # type: ignore[return-value]

    width = 10 ** (-0.3 - 0.9 * pick(100) / 100)
    if part is CasePart.FIRST:
        exponent = round(2 / width**2)
        return f"blinn-phong {exponent}", BlinnPhong(colour(0.6), colour(0.3), exponent)
    if part is CasePart.SECOND:
        return f"ward {width:.2f}", Ward(colour(0.6), colour(0.3), alpha_x=width, alpha_y=width)
    return f"cook-torrance {width:.2f}", CookTorrance(colour(0.5), (0.4, 0.4, 0.4), width, 0.05 + pick(10) / 20)


def in_turn(counts: dict[CasePart, int]) -> Iterator[tuple[CasePart, int]]:
    """(part, number) of so many cases of each part: the first two parts by turns, the report last."""
    first = [part for part in counts if part is not CasePart.REPORT]
    for number in range(max((counts[part] for part in first), default=0)):
        yield from ((part, number) for part in first if number < counts[part])
    yield from ((CasePart.REPORT, number) for number in range(counts.get(CasePart.REPORT, 0)))
