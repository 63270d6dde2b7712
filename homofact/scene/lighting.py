"""The light of a scene: lights for pictures, and energies by order for theory.

The theory averages over all rotations of the lighting against the surface. For a lobe g(ωi) = f cosθi of one view, B =
∫ L g has the mean square Σ_l E_l e_l/(2l+1). Here E_l = Σ_m L_lm² is the energy of the lighting and e_l = Σ_m g_lm²
that of the lobe: the cross terms of (3.5) vanish and every m has equal weight. An order that is absent from the
lighting costs nothing, however sharp the lobe is. Orders up to `ORDER` are used; a directional light has equal energy
in all of them (3.13).
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import torch
from torch import Tensor

from homofact.errors import BadInput
from homofact.rendering.environment import read_environment
from homofact.rendering.light import DirectionalLight, EnvironmentMap, Light
from homofact.settings.options import option
from homofact.theory.harmonics import energy_by_order, harmonics, orders
from homofact.theory.reflection import directional_lighting, lambertian_filter

ORDER = 32
UNEXCITED_SHARE = 0.01
IRRADIANCE_ORDER = 2
_ROWS = 64


@dataclass(frozen=True)
class Lighting:
    """Distant light: `lights` in the frame of `rendering.light` (y up), described by `words`.

    Raises BadInput if there is no light or all radiance is 0.
    """

    name: str
    lights: tuple[Light, ...]
    words: str = ""

    def __post_init__(self) -> None:
        """Refuse darkness: a relative error has no meaning in it."""
        lit = any(isinstance(each, EnvironmentMap) or any(each.levels()) for each in self.lights)
        if not lit:
            found = "no lights" if not self.lights else "only lights of radiance 0"
            raise BadInput(where="lighting", found=found, expected="some light")

    @property
    def has_directional(self) -> bool:
        """Return whether it contains a directional light, whose spectrum does not decay."""
        return any(isinstance(each, DirectionalLight) and any(each.levels()) for each in self.lights)

    @property
    def reads(self) -> int:
        """Return the number of directions in the light's sum at one point: the lights, or the texels of a map."""
        sizes = (each.radiance[..., 0].numel() if isinstance(each, EnvironmentMap) else 1 for each in self.lights)
        return sum(sizes)

    @cached_property
    def _of_maps(self) -> tuple[Tensor, ...]:
        """L_lm up to `ORDER` of each light that is a map, in their order."""
        return tuple(environment_coefficients(each, ORDER) for each in self.lights if isinstance(each, EnvironmentMap))

    @cached_property
    def coefficients(self) -> Tensor:
        """L_lm up to `ORDER` in the frame of the lights: ((ORDER+1)², C), C 1 or 3."""
        channels = max(len(_levels(each)) for each in self.lights)
        total = torch.zeros((ORDER + 1) ** 2, channels, dtype=torch.float64)
        of_maps = iter(self._of_maps)
        for each in self.lights:
            if isinstance(each, EnvironmentMap):
                total = total + next(of_maps)
            else:
                levels = torch.tensor(each.levels(), dtype=torch.float64)
                total = total + directional_lighting(ORDER, each.unit())[:, None] * levels
        return total

    @cached_property
    def energies(self) -> Tensor:
        """E_l = Σ_m L_lm², mean over channels: (ORDER+1,)."""
        return energy_by_order(self.coefficients).mean(1)

    @property
    def last_excited(self) -> int | None:
        """Return the order l above which less than 1% of the energy lies; None if it is above `ORDER`."""
        if self.has_directional:
            return None
        above = 1 - self.energies.cumsum(0) / self.energies.sum()
        # What lies past ORDER is not seen: the last order itself is no evidence of an end.
        found = int((above < UNEXCITED_SHARE).nonzero()[0, 0])
        return found if found < ORDER - 1 else None

    def describe_spectrum(self) -> str:
        """Describe which orders the lighting cannot excite."""
        if self.last_excited is None:
            return f"has energy in every order up to {ORDER}"
        return f"has less than 1% of its energy above order {self.last_excited}, so finer detail of a lobe is invisible"

    def irradiance(self, normals: Tensor, order: int | None) -> Tensor:
        """Return ∫ L max(n·ω, 0) dω (N, C) at unit normals (N, 3), by orders up to `order` (3.10), or by all.

        With all orders, the result is exact for directional lights. For maps it is computed up to `ORDER`, since
        Lambert's filter falls like l^−5/2.
        """
        if order is not None:
            gains = lambertian_filter(order)[orders(order)[0]]
            return harmonics(order, normals) @ (gains[:, None] * self.coefficients[: len(gains)])
        total = torch.zeros(len(normals), self.coefficients.shape[1], dtype=torch.float64)
        of_maps = iter(self._of_maps)
        for each in self.lights:
            if isinstance(each, EnvironmentMap):
                gains = lambertian_filter(ORDER)[orders(ORDER)[0]]
                total = total + harmonics(ORDER, normals) @ (gains[:, None] * next(of_maps))
            else:
                cosine = (normals @ each.unit()).clamp_min(0)[:, None]
                total = total + cosine * torch.tensor(each.levels(), dtype=torch.float64)
        return total


@dataclass(frozen=True)
class LightTable:
    """[lighting] of a scene's file: an environment map's file, or a name of `NAMED`; `turn` in degrees about y."""

    environment: str | None = None
    named: str | None = None
    turn: float = option(0.0, "Degrees about y")

    def __post_init__(self) -> None:
        """Refuse none and both. Raises BadInput."""
        if (self.environment is None) is (self.named is None):
            raise BadInput(found="none or both", expected="exactly one of environment, named")
        check_file(self.environment)

    def map(self, folder: Path) -> EnvironmentMap:
        """Return the environment map, its file relative to `folder`.

        Raises BadInput for a file that cannot be read and for a named lighting that is not a map.
        """
        turn = math.radians(self.turn)
        if self.environment is not None:
            return read_environment(folder / self.environment, turn)
        try:
            return named_environment(str(self.named)).turned(turn)
        except BadInput as error:
            raise error.at("lighting.named") from error

    def lighting(self, folder: Path) -> Lighting:
        """Return the light, a map or directional.

        Raises BadInput as `map`, and for a directional light that is turned.
        """
        if self.environment is not None:
            light = self.map(folder)
            return Lighting(light.name, (light,), light.describe())
        named = named_lighting(str(self.named))
        if not self.turn:
            return named
        turn = math.radians(self.turn)
        lights = [light.turned(turn) for light in named.lights if isinstance(light, EnvironmentMap)]
        if len(lights) < len(named.lights):
            raise BadInput(f"{self.named} is no environment map", where="lighting.turn", expected="one, or no turn")
        return Lighting(named.name, tuple(lights), named.words)


def environment_coefficients(light: EnvironmentMap, order: int) -> Tensor:
    """Return L_lm ((order+1)², C) of a map, sampled at texel centres of a version with about 64 rows."""
    radiance = _resized(light.radiance)
    rows, columns, channels = radiance.shape
    w = texel_directions(rows, columns, light.turn)
    weighted = radiance.reshape(-1, channels) * solid_angles(rows, columns)[:, None]
    total = torch.zeros((order + 1) ** 2, channels, dtype=torch.float64)
    for part in torch.arange(len(w)).split(2048):
        total += harmonics(order, w[part]).T @ weighted[part]
    return total


def texel_directions(rows: int, columns: int, turn: float = 0.0, which: Tensor | None = None) -> Tensor:
    """Return unit directions (rows·columns, 3) of a lat-long map's texel centres, laid out as `rendering.light` says.

    `which` lists the indices of the rows. Default: all.
    """
    own = torch.arange(rows) if which is None else which
    polar = (own.double() + 0.5) * (math.pi / rows)
    return ring_directions(torch.cos(polar), torch.sin(polar), columns, turn)


def ring_directions(y: Tensor, around: Tensor, columns: int, turn: float) -> Tensor:
    """Return unit directions (R·columns, 3) of points on R rings at heights `y` (R,) with radii `around` (R,).

    Azimuths are those of a lat-long map's columns.
    """
    azimuth = ((torch.arange(columns, dtype=torch.float64) + 0.5) / columns - 0.5) * (2 * math.pi) - turn
    up, out = y[:, None].expand(-1, columns), around[:, None]
    return torch.stack((out * torch.sin(azimuth), up, -out * torch.cos(azimuth)), -1).reshape(-1, 3)


def check_file(environment: str | None) -> None:
    """Raise BadInput for the name of a built-in lighting where a file of an environment map is expected."""
    if environment in NAMED:
        expected = f'a .hdr or .exr file, or named = "{environment}" for the built-in one'
        raise BadInput(where="environment", found=repr(environment), expected=expected)


def named_lighting(name: str) -> Lighting:
    """Return the lighting called `name`. Raises BadInput that lists the names."""
    if name not in NAMED:
        raise BadInput(where="lighting.named", found=repr(name), expected=f"one of {', '.join(NAMED)}")
    make, words = NAMED[name]
    return Lighting(name, make(), words)


def named_environment(name: str) -> EnvironmentMap:
    """Return the map called `name`. Raises BadInput, which lists the names of maps, for any other name."""
    maps = {key: found for key, (make, _) in NAMED.items() if isinstance(found := make()[0], EnvironmentMap)}
    if name not in maps:
        raise BadInput(found=repr(name), expected=f"an environment map or one of {', '.join(maps)}")
    return maps[name]


def open_environment(place: str | Path, where: str = "light") -> EnvironmentMap:
    """Return a named lighting that is a map, or the map in a .hdr or .exr file.

    Raises BadInput, at `where`, for neither.
    """
    if Path(place).suffix or Path(place).is_file():
        return read_environment(place)
    try:
        return named_environment(str(place))
    except BadInput as error:
        raise error.at(where) from error


def _sky(ground: float, level: Callable[[Tensor], Tensor], name: str) -> EnvironmentMap:
    """A sky of radiance level(sin of the elevation) over ground that reflects `ground` of it, Lambertian."""
    sine = texel_directions(_ROWS, 2 * _ROWS)[:, 1]
    above = torch.where(sine > 0, level(sine.clamp_min(0)), torch.zeros_like(sine))
    irradiance = float((above * sine.clamp_min(0) * solid_angles(_ROWS, 2 * _ROWS)).sum())
    values = torch.where(sine > 0, above, torch.full_like(sine, ground * irradiance / math.pi))
    return EnvironmentMap((values / irradiance * math.pi).reshape(_ROWS, 2 * _ROWS, 1), name=name)


def _studio() -> tuple[Light, ...]:
    w = texel_directions(_ROWS, 2 * _ROWS)
    values = torch.full((len(w),), 0.05, dtype=torch.float64)
    for direction, degrees, radiance in (
        ((0.6, 0.6, 0.6), 25, 8.0),
        ((-0.8, 0.2, 0.5), 35, 1.5),
        ((0, 0.5, -1), 20, 4),
    ):
        axis = torch.tensor(direction, dtype=torch.float64)
        values = torch.where(w @ (axis / axis.norm()) > math.cos(math.radians(degrees)), radiance, values)
    return (EnvironmentMap(values.reshape(_ROWS, 2 * _ROWS, 1), name="studio"),)


# Spectra: the sun's E_l = (2l+1)/4π times its flux squared (3.13); uniform L_00 alone (3.19); the others by quadrature.
NAMED: dict[str, tuple[Callable[[], tuple[Light, ...]], str]] = {
    "sun": (
        lambda: (DirectionalLight((0.5, 0.5, math.sqrt(0.5)), math.pi),),
        "one directional light 45° from the viewer, irradiance π: every order alike (eq. 3.13)",
    ),
    "overcast": (
        lambda: (_sky(0.2, lambda sine: (1 + 2 * sine) / 3, "overcast"),),
        "the CIE overcast sky (Moon and Spencer 1942), (1 + 2 sin elevation)/3 of its zenith, irradiance π, over"
        " ground that reflects 20%: axial (eq. 3.18)",
    ),
    "studio": (
        _studio,
        "three soft boxes of 25°, 35° and 20° half width, radiance 8, 1.5 and 4, in a room of .05: our choice",
    ),
    "uniform": (
        lambda: (EnvironmentMap(torch.ones(_ROWS, 2 * _ROWS, 1, dtype=torch.float64), name="uniform"),),
        "radiance 1 from everywhere: order 0 alone (eq. 3.19)",
    ),
}


def _levels(light: Light) -> tuple[float, ...]:
    return (0.0,) * int(light.radiance.shape[2]) if isinstance(light, EnvironmentMap) else light.levels()


def solid_angles(rows: int, columns: int) -> Tensor:
    """Return steradians of each texel (rows·columns,)."""
    return band_angles(rows, columns).repeat_interleave(columns)


def band_angles(rows: int, columns: int) -> Tensor:
    """Return steradians of a texel of each row (rows,)."""
    edges = torch.cos(torch.arange(rows + 1, dtype=torch.float64) * (math.pi / rows))
    return (edges[:-1] - edges[1:]) * (2 * math.pi / columns)


def _resized(radiance: Tensor) -> Tensor:
    """A map at 64 rows or more, averaged over blocks or its texels divided: enough for every order up to `ORDER`."""
    rows, columns, channels = radiance.shape
    times = -(-_ROWS // rows)
    if times > 1:
        return radiance.repeat_interleave(times, 0).repeat_interleave(times, 1)
    block = rows // _ROWS
    if block < 2 or rows % block or columns % block:
        return radiance
    weights = solid_angles(rows, columns).reshape(rows, columns, 1)

    def summed(values: Tensor) -> Tensor:
        return values.reshape(rows // block, block, columns // block, block, -1).sum((1, 3))

    return summed(radiance * weights) / summed(weights.expand(-1, -1, channels))
