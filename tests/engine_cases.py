"""What the tests of exports for engines share: exported fits, packages of npm, the scripts that draw."""

import math
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from browser import headless
from mitsuba_cases import factorization, random_texture

from homofact.brdf.analytic.metallic_roughness import MetallicRoughness
from homofact.brdf.reflectance import Reflectance
from homofact.brdf.symmetry import find_symmetry
from homofact.containers.formats import format_named
from homofact.exporting.engine_light import ClosureLight, EngineLight
from homofact.exporting.engines import blender, godot, materialx, three
from homofact.exporting.engines.table import ENGINES
from homofact.exporting.exported import Exported, exported, write_exported
from homofact.exporting.prefiltered import PrefilteredExport
from homofact.factor.factorization import Factorization
from homofact.factor.projection import Warp, fixed_projection
from homofact.rendering.chain_kernels import ChainKernels
from homofact.rendering.closures import Closures
from homofact.rendering.prefilter import LevelTable, Prefiltered
from homofact.rendering.sky_chain import SkyChain

served = headless.served
NODE = Path(__file__).parent / "containers" / "node"
LOOK = MetallicRoughness((0.4, 0.3, 0.2), 0.25, 0.5)


def script(name: str) -> Any:
    """A module of scripts/, which programs of figures use too."""
    return import_module(f"scripts.{name}")


def light_of(reflectance: Reflectance, kernels: ChainKernels) -> EngineLight:
    """A table made up: a matte part and three lobes, one of a share below 0; with a grain where there are azimuths."""
    table = torch.zeros(6, 64, 4, dtype=torch.float64)
    table[3, :, :3] = table.new_tensor((0.2, 0.1, 0.05))
    last = len(kernels.alphas) - 1
    for k, (share, level) in enumerate(((0.5, 0.3), (0.3, 0.6), (-0.1, 0.75))):
        table[k, :, :3] = share * table.new_tensor((1.0, 0.9, 0.8))
        table[k, :, 3] = level * last
    table[4, :, :3] = torch.linspace(0.4, 0.0, 64, dtype=torch.float64)[:, None] * table.new_tensor((1.0, -0.5, 0.2))
    table[5, :, :3] = table.new_tensor((0.0, 0.3, -0.3))
    across = None if find_symmetry(reflectance).isotropic else 0.5
    return EngineLight(LevelTable(table if across else table[:5], across), kernels, {"a sky": 0.02})


def closures_like(reflectance: Reflectance) -> ClosureLight:
    """Closures made up, which depend on the viewer's angle; on the azimuth, too, where the reflectance does."""
    isotropic = find_symmetry(reflectance).isotropic
    u = torch.linspace(0, 1, 64, dtype=torch.float64)
    one = torch.stack((0.35 + 0.1 * u, 0.4 * (1 - u), 0.1 - 0.1 * u), 1)
    two = torch.stack((0.7 - 0.2 * u, -0.3 * (1 - u), torch.zeros_like(u)), 1)
    phi = torch.linspace(-math.pi, math.pi, 1 if isotropic else 9, dtype=torch.float64)
    shade = (1 + 0.3 * torch.cos(2 * phi + 0.5) * (not isotropic))[:, None, None, None]
    parts = torch.stack((0.1 + 0.2 * u, 0.5 - 0.2 * u, 0.2 + 0.1 * u), 1)[..., None] * u.new_tensor((1.0, 0.7, 0.4))
    weights = (shade * parts)[..., : len(reflectance.channels)]
    made = Closures(torch.stack((one, two), 1), weights, None if isotropic else 0.4, reflectance.channels)
    return ClosureLight(made, {"a sky": 0.02})


def fit_no_looks(patch: pytest.MonkeyPatch) -> None:
    """Have exports show environments LOOK, `light_of` or `closures_like`: fits of these have tests of their own."""
    patch.setattr(blender, "closure_light", closures_like)
    for module in (three, godot):
        patch.setattr(module, "fit_metallic_roughness", lambda *args, **kwargs: LOOK)
    for module in (three, materialx):
        patch.setattr(module, "engine_light", light_of)


def isotropic() -> Factorization:
    """A lobe with a colour of its own over a base, in two textures."""
    lobe = random_texture(1, 16, 1)[:1] * 0.2
    lobe[0, :, :] += 2.5 * (-(((lobe.new_tensor(range(16))[:, None]) / 3) ** 2)).exp()
    base = random_texture(1, 8, 2) * 0.1
    return factorization(
        (fixed_projection("theta_h", True, Warp(0.1)), lobe), (fixed_projection("theta_d", True), base)
    )


def brushed() -> Factorization:
    """A random product over h and the light, which knows azimuths."""
    return factorization(
        (fixed_projection("h", True, Warp(0.1)), random_texture(12, 9, 3)),
        (fixed_projection("wi", True), random_texture(8, 8, 4) * 0.3),
    )


def combed() -> Factorization:
    """A wide lobe, twice as long one way as the other."""
    y, x = torch.meshgrid(torch.linspace(-1, 1, 31), torch.linspace(-1, 1, 31), indexing="ij")
    lobe = 3.0 * (-((x / 0.3) ** 2) - (y / 0.15) ** 2).exp().to(torch.float64)[..., None]
    return factorization((fixed_projection("h", True), lobe + lobe.new_tensor((0.1, 0.0, -0.1))))


def under(made: Exported, chain: SkyChain) -> Exported:
    """With a filtered sky, and a table made up."""
    table = light_of(made.stored, chain.kernels).table.rounded(np.float16)
    data = Prefiltered(replace(table, factor=chain.factor), chain)
    return replace(made, prefiltered=PrefilteredExport(data, format_named("exr16"), False, 0.02))


def engine_folder(
    place: Path, fit: Factorization, engine: str, form: str | None = None, chain: SkyChain | None = None
) -> Exported:
    """An export with an engine's files at `place`; with a `chain` as by `under`."""
    made = exported(fit, format_named(form or ENGINES[engine].formats[0]))
    made = made if chain is None else under(made, chain)
    write_exported(place, made, {}, engine=engine, files=ENGINES[engine].add(made).files)
    return made


def npm_package(name: str) -> Path:
    """The folder of an installed package; skips where there is none."""
    place = NODE / "node_modules" / name
    if not place.is_dir():
        pytest.skip(f"npm's package {name} is missing: npm ci --prefix tests/containers/node")
    return place
