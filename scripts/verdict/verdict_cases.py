"""The cases of `verdict_blind.py`: materials, what is done to their samples, and settings that fit them badly.

Two halves, "tuning" and "test", share no material and no stressor; thresholds are set on both since both have been
looked at. "fresh" is drawn from stressors that neither has and from materials that no draw of theirs has touched: the
networks of `UNTOUCHED`, mixtures of two networks, and analytic models of drawn parameters, measured at random pairs or
on a goniometer's rings, a quarter of them without any fault.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import torch
from torch import Tensor

from homofact.brdf.analytic import BlinnPhong, CookTorrance, Ward
from homofact.brdf.formats.nbrdf import load, material_names
from homofact.brdf.reflectance import Reflectance
from homofact.brdf.samples import Samples
from homofact.brdf.sampling import Drawable
from homofact.brdf.source import open_source
from homofact.geometry.coordinates import rusinkiewicz_angles
from homofact.geometry.directions import from_spherical, normalize, to_spherical
from homofact.methods.mccool import McCool
from homofact.methods.method import Method
from homofact.methods.search import Search

NETWORKS = Path("nbrdf") / "merl_nbrdf_weights.npz"
MODELS = {
    "tuning": ("lafortune-blue-paint", "phong-10", "cook-torrance-plastic"),
    "test": ("blinn-phong-50", "torrance-sparrow-20", "lafortune-skin"),
}
RGL = {"tuning": ("aurora_white", "vch_golden_yellow"), "test": ("chm_light_blue", "irid_flake_paint1")}
UNTOUCHED = (
    "aluminium", "black-obsidian", "chrome-steel", "dark-red-paint", "dark-specular-fabric",
    "delrin", "light-brown-fabric", "maroon-plastic", "natural-209", "white-acrylic", "white-fabric",
)  # fmt: skip

Stress = Callable[[Samples, float, torch.Generator], Samples]
Map = Callable[[Tensor], Tensor]
MapOf = Callable[[Samples, float], Map]


@dataclass(frozen=True)
class Stressor:
    """What is done to samples, and its strengths.

    `another` is there where the values alone are changed, the same way in all directions: it says how, of the clean
    samples and a strength, and so which other material the stressed samples would be of.
    """

    name: str
    strengths: tuple[float, ...]
    stress: Stress
    another: MapOf | None = None


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


def _values(change: Callable[[Samples, Tensor, float, torch.Generator], Tensor]) -> Stress:
    def stress(samples: Samples, strength: float, generator: torch.Generator) -> Samples:
        return replace(samples, values=change(samples, samples.values, strength, generator).clamp_min(0))

    return stress


def _mapped(name: str, strengths: tuple[float, ...], another: MapOf) -> Stressor:
    """A stressor of the values alone."""
    return Stressor(name, strengths, _values(lambda s, v, x, g: another(s, x)(v)), another)


def _normal(like: Tensor, generator: torch.Generator) -> Tensor:
    return torch.randn(like.shape, dtype=torch.float64, generator=generator)


def _struck(samples: Samples, share: float, generator: torch.Generator) -> Tensor:
    return torch.rand(len(samples), dtype=torch.float64, generator=generator)[:, None] < share


def _hole(samples: Samples, strength: float, generator: torch.Generator) -> Samples:
    degrees = torch.rad2deg(to_spherical(samples.wo)[0])
    return samples.select((degrees - 40).abs() >= strength)


def _no_highlight(samples: Samples, strength: float, generator: torch.Generator) -> Samples:
    degrees = torch.rad2deg(to_spherical(normalize(samples.wi + samples.wo))[0])
    return samples.select(degrees >= strength)


def _few(samples: Samples, strength: float, generator: torch.Generator) -> Samples:
    return samples.subset(int(strength), 0)


def _not_grazing(samples: Samples, strength: float, generator: torch.Generator) -> Samples:
    limit = math.cos(math.radians(strength))
    return samples.select((samples.wi[:, 2] > limit) & (samples.wo[:, 2] > limit))


def _tilted(samples: Samples, strength: float, generator: torch.Generator) -> Samples:
    angle = math.radians(strength)
    turn = torch.tensor(
        [[math.cos(angle), 0, math.sin(angle)], [0, 1, 0], [-math.sin(angle), 0, math.cos(angle)]], dtype=torch.float64
    )
    wi, wo = samples.wi @ turn.T, samples.wo @ turn.T
    above = (wi[:, 2] > 0.02) & (wo[:, 2] > 0.02)
    return replace(samples.select(above), wi=wi[above], wo=wo[above])


def _from_the_surface(w: Tensor) -> Tensor:
    theta, phi = to_spherical(w)
    return from_spherical(math.pi / 2 - theta, phi)


def _turned(change_i: Map, change_o: Map) -> Stress:
    def stress(samples: Samples, strength: float, generator: torch.Generator) -> Samples:
        wi, wo = change_i(samples.wi), change_o(samples.wo)
        above = (wi[:, 2] > 0.02) & (wo[:, 2] > 0.02)
        return replace(samples.select(above), wi=wi[above], wo=wo[above])

    return stress


def _again(samples: Samples, strength: float, generator: torch.Generator) -> Samples:
    """Half of the samples once more, `strength` times as bright."""
    half = samples.subset(len(samples) // 2, 0)
    parts = (samples, replace(half, values=half.values * strength))
    joined = {name: torch.cat([getattr(each, name) for each in parts]) for name in ("wi", "wo", "values", "weights")}
    return replace(samples, **joined)


def _gamma(samples: Samples, strength: float) -> Map:
    largest = samples.values.max()
    return lambda v: (v / largest).clamp_min(0) ** (1 / strength)


def _offset(samples: Samples, strength: float) -> Map:
    by = strength * samples.values.mean(0)
    return lambda v: v + by


TUNING = (
    Stressor("noise", (0.03, 0.2, 0.6), _values(lambda s, v, x, g: v * torch.exp(x * _normal(v, g)))),
    Stressor("outliers", (0.002, 0.02), _values(lambda s, v, x, g: torch.where(_struck(s, x, g), 300 * v, v))),
    Stressor("zeros", (0.005, 0.05, 0.3), _values(lambda s, v, x, g: v * ~_struck(s, x, g))),
    Stressor("hole", (5.0, 15.0, 30.0), _hole),
    Stressor("few", (2000.0, 300.0, 60.0), _few),
    Stressor("cosine", (1.0, 2.0), _values(lambda s, v, x, g: v * s.wo[:, 2:] ** x)),
    _mapped("gamma", (2.2,), _gamma),
    Stressor("drift", (0.2, 0.8), _values(lambda s, v, x, g: v * torch.linspace(1, 1 - x, len(v))[:, None])),
    Stressor("clipped", (0.999, 0.98), _values(lambda s, v, x, g: v.minimum(v.quantile(x, 0)))),
    _mapped("scaled", (0.5, 1.5), lambda s, x: lambda v: v * x),
)
TEST = (
    Stressor("additive", (0.002, 0.05, 0.5), _values(lambda s, v, x, g: v + x * v.mean(0) * _normal(v, g))),
    Stressor("no highlight", (3.0, 15.0, 30.0), _no_highlight),
    Stressor("not grazing", (80.0, 65.0, 50.0), _not_grazing),
    Stressor("repeated", (1.0, 1.5, 4.0), _again),
    Stressor("tilted", (0.3, 3.0, 10.0), _tilted),
    Stressor("elevation", (1.0,), _turned(_from_the_surface, _from_the_surface)),
    _mapped("π", (math.pi,), lambda s, x: lambda v: v * x),
    _mapped("offset", (0.01, 0.2), _offset),
    _mapped("dark frame", (0.05, 0.3), lambda s, x: _offset(s, -x)),
    Stressor("levels", (4096.0, 64.0), _values(lambda s, v, x, g: (v / v.max() * x).round() / x * v.max())),
    _mapped("channels swapped", (1.0,), lambda s, x: lambda v: v.flip(1)),
)


def _of_theta(direction: str, gain: Callable[[Tensor, float], Tensor]) -> Stress:
    """A gain over θ of one direction, in radians."""
    return _values(lambda s, v, x, g: v * gain(to_spherical(getattr(s, direction))[0], x)[:, None])


def _near_the_light(samples: Samples, degrees: float) -> Tensor:
    return (samples.wi * samples.wo).sum(1, keepdim=True) > math.cos(math.radians(degrees))


def _region(samples: Samples) -> Tensor:
    """A patch off the highlight."""
    theta_h, theta_d, _ = (torch.rad2deg(each)[:, None] for each in rusinkiewicz_angles(samples.wi, samples.wo))
    return ((theta_h - 30).abs() < 5) & ((theta_d - 30).abs() < 10)


def _late_rows(samples: Samples, strength: float, generator: torch.Generator) -> Samples:
    """The first channel of the last `strength` of the rows is a row late."""
    values = samples.values.clone()
    first = round((1 - strength) * len(values))
    values[first:, 0] = values[first:, 0].roll(1)
    return replace(samples, values=values)


FRESH = (
    Stressor(
        "gain of a ring", (0.7, 1.5),
        _of_theta("wi", lambda t, x: torch.where((t - math.radians(40)).abs() < math.radians(4), x, 1.0)),
    ),
    Stressor("arm's shadow", (0.5, 0.95), _values(
        lambda s, v, x, g: torch.where(_near_the_light(s, 10.0), (1 - x) * v, v))),
    Stressor("drift with angle", (0.2, 0.7), _of_theta("wi", lambda t, x: 1 - x * t / (math.pi / 2))),
    Stressor("vignetting", (0.2, 0.7), _of_theta("wo", lambda t, x: 1 - x * torch.sin(t) ** 2)),
    Stressor("stray light", (0.02, 0.2), _values(
        lambda s, v, x, g: v + x * v.median(0).values / s.wo[:, 2:].clamp_min(0.02))),
    Stressor("saturated", (0.95, 0.8), _values(lambda s, v, x, g: v.minimum(v.quantile(x, 0)))),
    Stressor("late rows", (0.3, 1.0), _late_rows),
    Stressor("azimuth", (180.0,), _turned(lambda w: w, lambda w: w * w.new_tensor([-1.0, -1.0, 1.0]))),
    Stressor("elevation of one", (1.0, 2.0), lambda s, x, g: (
        _turned(_from_the_surface, lambda w: w) if x == 1 else _turned(lambda w: w, _from_the_surface))(s, x, g)),
    Stressor("spikes", (3.0, 30.0), _values(lambda s, v, x, g: torch.where(_region(s), x * v, v))),
    Stressor("float16", (1.0,), _values(lambda s, v, x, g: v.clamp_max(65504.0).half().double())),
    Stressor("subset", (120.0, 500.0), _few),
)  # fmt: skip
STRESSORS = {"tuning": TUNING, "test": TEST, "fresh": FRESH}
_TWO = ("theta_h-theta_d", "theta_d-phi_d")
SETTINGS: dict[str, tuple[Method, ...]] = {
    "tuning": (
        Search(textures=2, size=16, effort="quick"),
        Search(textures=1, size=8, effort="quick"),
        McCool(size=16),
    ),
    "test": (
        Search(textures=2, size=12, effort="quick"),
        Search(textures=2, size=4, effort="quick"),
        McCool(size=10, projections=_TWO),
    ),
    "fresh": (
        Search(textures=2, size=20, effort="quick"),
        Search(textures=2, size=12, effort="quick", smoothing=1.0),
        Search(textures=2, size=20, effort="quick", smoothing=1e-9),
        Search(textures=1, size=24, effort="quick"),
        McCool(size=20, projections=_TWO),
        McCool(size=20, projections=_TWO, smoothing=10.0),
    ),
}
FITTED = Search(textures=2, size=12, effort="quick")


def materials(half: str, folder: Path) -> list[tuple[str, str]]:
    """(name, source) of a half: models, and what is there of paints and surrogates (even numbers tune)."""
    found = [(name, f"material:{name}") for name in MODELS[half]]
    found += [(name, str(folder / "rgl" / f"{name}_rgb.bsdf")) for name in RGL[half]]
    networks = folder / NETWORKS
    if networks.is_file():
        names = material_names(networks)[("tuning", "test").index(half) :: 2]
        found += [(name, f"{networks}#{name}") for name in names]
    return [(name, path) for name, path in found if path.startswith("material:") or Path(path.split("#")[0]).is_file()]


def of_a_half(half: str, folder: Path, pick: Callable[[int], int]) -> tuple[str, Drawable]:
    """(name, reflectance) of a material of a half, the number of which `pick` draws."""
    found = materials(half, folder)
    name, path = found[pick(len(found))]
    return name, open_source(path, count=1).reflectance  # type: ignore[return-value]


def fresh_material(folder: Path, pick: Callable[[int], int]) -> tuple[str, Drawable]:
    """(name, reflectance) of a drawn material of the module's head."""
    networks, kind = folder / NETWORKS, pick(10)
    if kind < 3 or not networks.is_file():
        return _drawn_model(pick)
    if kind < 7:
        name = UNTOUCHED[pick(len(UNTOUCHED))]
        return name, load(f"{networks}#{name}")
    names = material_names(networks)
    one, two = names[pick(len(names))], names[pick(len(names))]
    share = (1 + pick(9)) / 10
    first, second = (load(f"{networks}#{name}") for name in (one, two))
    return f"{share:g} {one} + {1 - share:g} {two}", Mixture(first, second, share)


def _drawn_model(pick: Callable[[int], int]) -> tuple[str, Drawable]:
    def colour(most: float) -> tuple[float, float, float]:
        return tuple(most * (1 + pick(100)) / 100 for _ in range(3))  # type: ignore[return-value]

    kind, width = pick(3), 10 ** (-0.3 - 0.9 * pick(100) / 100)
    if kind == 0:
        exponent = round(2 / width**2)
        return f"blinn-phong {exponent}", BlinnPhong(colour(0.6), colour(0.3), exponent)
    if kind == 1:
        return f"cook-torrance {width:.2f}", CookTorrance(colour(0.5), (0.4, 0.4, 0.4), width, 0.05 + pick(10) / 20)
    return f"ward {width:.2f}", Ward(colour(0.6), colour(0.3), alpha_x=width, alpha_y=width)


def on_rings(model: Reflectance) -> Samples:
    """As a goniometer takes them: twelve angles of the light, 17 of θo and 30 of Δφ, both out to 80°."""
    angles = (torch.linspace(0, 80, count + 1, dtype=torch.float64)[1:].deg2rad() for count in (12, 17))
    turn = torch.linspace(0, math.pi, 30, dtype=torch.float64)
    i, o, phi = (each.reshape(-1) for each in torch.meshgrid(*angles, turn, indexing="ij"))
    wi, wo = from_spherical(i, i * 0), from_spherical(o, phi)
    return Samples(wi, wo, model.evaluate(wi, wo), channels=model.channels, isotropic=True)
