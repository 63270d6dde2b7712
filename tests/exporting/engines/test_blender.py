"""Blender's script: what is in it; and in a real Blender the pixels of our own renderer, and of Blender's own lamps."""

import ast
import base64
import importlib
import math
import subprocess
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from engine_cases import brushed, closures_like, engine_folder, isotropic
from hostile import FORBIDDEN, NAMES
from mitsuba_cases import factorization, random_texture
from node_graph_cases import run
from skies import lamps

from homofact.containers.formats import format_named
from homofact.errors import BadInput
from homofact.exporting.engines import blender
from homofact.exporting.engines.blender import BLENDER, NAME, README, script, tables_of
from homofact.exporting.exported import Exported, exported
from homofact.factor.factorization import Factorization
from homofact.factor.projection import fixed_projection
from homofact.files.kinds import is_ours
from homofact.geometry.directions import draw_uniform
from homofact.rendering.filtered import render_filtered
from homofact.rendering.light import DEFAULT_LIGHT, DirectionalLight, EnvironmentMap
from homofact.rendering.sphere import render_sphere
from homofact.rendering.surface import RADIUS
from homofact.shading.node_graph import NodeGraph

LIGHTS = [DEFAULT_LIGHT, DirectionalLight((0.9, -0.1, 0.3), 1.5)]
MEAN = (0.1, 0.2, 0.3)


@pytest.fixture(autouse=True)
def made_up(monkeypatch: pytest.MonkeyPatch) -> None:
    """No closures are fitted here: that has tests of its own, and takes seconds."""
    monkeypatch.setattr(blender, "closure_light", closures_like)


def grey() -> Factorization:
    return factorization((fixed_projection("h", True), random_texture(6, 5, 1, 1)), mean=(0.3,))


def constants(text: str) -> dict[str, Any]:
    """The data of a script: its top-level names of literals."""
    found = {}
    for each in ast.parse(text).body:
        if isinstance(each, ast.Assign) and isinstance(each.targets[0], ast.Name):
            found[each.targets[0].id] = ast.literal_eval(each.value)
    return found


@pytest.mark.parametrize("fit", [isotropic(), brushed(), grey()], ids=["isotropic", "brushed", "one channel"])
@pytest.mark.parametrize("form", ["exr", "png8"])
def test_the_script_holds_the_stored_fit(fit: Factorization, form: str, tmp_path: Path) -> None:
    made = engine_folder(tmp_path / "fit", fit, "blender", form)
    text = (tmp_path / "fit" / NAME).read_text(encoding="utf-8")
    compile(text, NAME, "exec")
    words = (tmp_path / "fit" / README).read_text(encoding="utf-8")
    assert words.startswith("# samples for Blender\n")
    assert closures_like(fit).off() in words
    found = constants(text)
    textures = decoded(found["TEXTURES"])
    for texels, stored in zip(textures, made.stored.textures, strict=True):
        assert np.array_equal(texels, stored.texels.astype(np.float32))
    wi, wo = draw_uniform(500, torch.Generator().manual_seed(1))
    graph = NodeGraph(tuple(found["PROGRAM"]), found["RESULT"])
    values = run(graph, {"wi": wi.numpy().T, "wo": wo.numpy().T}, textures).reshape(-1, len(wi)).T
    assert values == pytest.approx(made.stored.evaluate(wi, wo).numpy(), rel=1e-4, abs=1e-6)
    assert found["NAME"] == "homofact samples"


@pytest.mark.parametrize("fit", [isotropic(), brushed(), grey()], ids=["isotropic", "brushed", "one channel"])
def test_the_script_holds_the_closures(fit: Factorization) -> None:
    """The tables of a sum that is read as its nodes read it are the sum's."""
    light = closures_like(fit)
    found = constants(script(exported(fit, format_named("exr")), light))
    assert found["TURN"] == light.closures.turn
    matte, *lobes = decoded(found["CLOSURES"])
    assert len(lobes) == 4
    assert matte == pytest.approx(light.closures.weights[:, :, 0].numpy(), rel=1e-6)
    for k in range(2):
        assert lobes[2 * k][0] == pytest.approx(light.closures.lobes[:, k].numpy(), abs=1e-6)
        assert lobes[2 * k + 1] == pytest.approx(light.closures.weights[:, :, k + 1].numpy(), rel=1e-6)
    assert [each.shape for each in tables_of(light.closures)] == [each.shape for each in (matte, *lobes)]


def decoded(tables: list[tuple[int, int, str]]) -> list[np.ndarray]:
    """The texels (rows, columns, channels) of the data of a script."""
    return [
        np.frombuffer(base64.b64decode(texels), "<f4").astype(float).reshape(rows, columns, -1)
        for columns, rows, texels in tables
    ]


def body(text: str) -> str:
    """The code without docstrings, as Python reads it, and without the name."""
    tree = ast.parse(text)
    tree.body = [each for each in tree.body[1:] if "NAME" not in ast.unparse(each).split(" = ")[0]]
    return ast.dump(tree)


@pytest.mark.parametrize("name", NAMES)
def test_hostile_names_stay_names(name: str) -> None:
    fit = isotropic()
    plain = script(exported(fit, format_named("exr")), closures_like(fit))
    fit.provenance["source"] = {"material": name}
    hostile = script(exported(fit, format_named("exr")), closures_like(fit))
    assert not set(hostile) & set(FORBIDDEN)
    assert body(hostile) == body(plain)
    assert constants(hostile)["NAME"].startswith("homofact ")


def test_the_engine_and_what_it_refuses() -> None:
    made = exported(isotropic(), format_named("exr"))
    added = BLENDER.add(made)
    assert list(added.files) == [NAME, "README.md"]
    assert not added.looks
    assert added.light is not None
    assert added.light.errors == {"a sky": 0.02}
    head = ast.get_docstring(ast.parse(str(added.files[NAME]))) or ""
    assert "one Diffuse BSDF and two Glossy BSDFs" in head
    assert "\nA sphere under a sky differs from the fit by 2.0% (a sky), relative RMS;" in head
    texture = random_texture(6, 5, 1, 2)
    two = factorization((fixed_projection("h", True), texture), mean=(0.3, 0.2))
    with pytest.raises(BadInput, match="blender: found channels 0, 1, expected R, G, B or one alone"):
        BLENDER.add(exported(two, format_named("exr")))


def test_an_export_made_anew_takes_its_script_away(tmp_path: Path) -> None:
    engine_folder(tmp_path / "fit", isotropic(), "blender")
    assert is_ours(tmp_path / "fit" / NAME)
    (tmp_path / NAME).write_text("mine", encoding="utf-8")
    assert not is_ours(tmp_path / NAME)


def test_without_blender_the_script_says_so(tmp_path: Path) -> None:
    engine_folder(tmp_path / "fit", isotropic(), "blender")
    done = subprocess.run([sys.executable, "-S", str(tmp_path / "fit" / NAME)], capture_output=True, text=True)
    assert "No module named 'bpy'" in done.stderr


# In a real Blender.


@pytest.fixture
def drawn(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Callable[[Sequence[dict[str, Any]]], list[np.ndarray]]:
    """Pictures of requests of scripts/engines/in_blender.py; skips without a Blender."""
    module = importlib.import_module("scripts.engines.with_blender")
    if module.command() is None:
        pytest.skip("Blender is missing: name it by HOMOFACT_BLENDER, or pip install 'homofact[blender]'")
    return lambda requests: module.drawn(tmp_path, requests)


def helper() -> Any:
    return importlib.import_module("scripts.engines.with_blender")


def request(folder: Path, fit: Factorization, **more: Any) -> tuple[dict[str, Any], Exported]:
    made = engine_folder(folder, fit, "blender")
    lamps = [helper().sun(light) for light in LIGHTS]
    return {"script": str(folder / NAME), "lamps": lamps, "rings": 64} | more, made


def flat() -> Factorization:
    """The same in all directions: f = A, but for rounding."""
    texture = random_texture(1, 8) * 0
    return factorization((fixed_projection("theta_h", True), texture), mean=MEAN)


@pytest.mark.slow
def test_cycles_draws_what_we_draw(drawn: Callable[..., list[np.ndarray]], tmp_path: Path) -> None:
    cases = {"isotropic": isotropic(), "brushed": brushed(), "grey": grey()}
    made = {name: request(tmp_path / name, fit) for name, fit in cases.items()}
    more = [
        # Whatever else is done to the scene: the same pixels.
        made["brushed"][0] | {"again": True},
        made["brushed"][0] | {"reopened": True},
        made["brushed"][0] | {"osl": True},
    ]
    for which, found in zip([*cases, *["brushed"] * 3], drawn([each for each, _ in made.values()] + more), strict=True):
        ours = render_sphere(made[which][1].stored, LIGHTS, 64).radiance.numpy()
        off = helper().differences(found, np.broadcast_to(ours, (64, 64, 3)))
        assert np.median(off) < 1e-3, which
        assert np.quantile(off, 0.99) < 0.02, which
        assert (found[0, 0] == 0).all()


@pytest.mark.slow
def test_there_is_room_for_many_lamps(drawn: Callable[..., list[np.ndarray]], tmp_path: Path) -> None:
    """Cycles holds few numbers of a shader at a time: those of one lamp, not of all."""
    asked, made = request(tmp_path / "fit", brushed())
    lights = [DirectionalLight((math.cos(k), math.sin(k), 0.3 + 0.1 * k), 0.5) for k in range(12)]
    (found,) = drawn([asked | {"lamps": [helper().sun(light) for light in lights]}])
    off = helper().differences(found, render_sphere(made.stored, lights, 64).radiance.numpy())
    assert np.median(off) < 1e-3
    assert np.quantile(off, 0.99) < 0.02


@pytest.mark.slow
def test_lamps_are_followed(drawn: Callable[..., list[np.ndarray]], tmp_path: Path) -> None:
    """Moved, dimmed and coloured once the material is there."""
    asked, made = request(tmp_path / "fit", brushed())
    asked |= {"moved": {"0": helper().placed((-0.6, 0.2, 0.7))}, "set": {"1": {"energy": 0.5, "color": (1, 0.5, 0.25)}}}
    (found,) = drawn([asked])
    lights = [DirectionalLight((-0.6, 0.2, 0.7)), DirectionalLight((0.9, -0.1, 0.3), (0.5, 0.25, 0.125))]
    off = helper().differences(found, render_sphere(made.stored, lights, 64).radiance.numpy())
    assert np.median(off) < 1e-3
    assert np.quantile(off, 0.99) < 0.02


@pytest.mark.slow
def test_lamps_shine_as_blenders_own_do(drawn: Callable[..., list[np.ndarray]], tmp_path: Path) -> None:
    """What is the same in all directions is a matte surface, which Blender lights by itself: sizes, cones, distance."""
    placed = helper().placed
    lamps = {
        "sun": {"kind": "SUN", "matrix": placed((1, 1, 1)), "energy": 2.0, "angle": 0.2, "color": (1, 0.5, 0.2)},
        "warm": {"kind": "SUN", "matrix": placed((1, 1, 1)), "use_temperature": True, "temperature": 3000.0,
                 "exposure": 1.5},
        "point": {"kind": "POINT", "matrix": placed((0.4, 0.4, 0.8), 2.4), "energy": 100.0, "shadow_soft_size": 0.2},
        "spot": {"kind": "SPOT", "matrix": placed((0.3, 0.3, 0.9), 3.2), "energy": 300.0, "shadow_soft_size": 0.02,
                 "spot_size": 0.5, "spot_blend": 0.4},
        "area": {"kind": "AREA", "matrix": placed((0.3, 0.5, 0.7), 2.2), "energy": 100.0, "shape": "RECTANGLE",
                 "size": 1.5, "size_y": 0.4},
        "disc": {"kind": "AREA", "matrix": placed((-0.5, 0.5, 0.7), 2.4), "energy": 100.0, "shape": "DISK",
                 "size": 1.0},
    }  # fmt: skip
    asked, _ = request(tmp_path / "fit", flat(), size=32, samples=256)
    requests = [asked | {"lamps": [lamp], "white": white} for lamp in lamps.values() for white in (False, True)]
    pictures = drawn(requests)
    for k, name in enumerate(lamps):
        found, white = pictures[2 * k][..., :3], pictures[2 * k + 1][..., :3] * math.pi * np.array(MEAN)
        lit = white.max(-1) > 0.1 * white.max()
        assert lit.sum() > 60, name
        off = np.abs(found - white)[lit] / white[lit]
        assert np.median(off) < 0.02, name
        assert found[lit].mean() == pytest.approx(white[lit].mean(), rel=0.01), name


@pytest.mark.slow
def test_lamps_throw_shadows(drawn: Callable[..., list[np.ndarray]], tmp_path: Path) -> None:
    """A square before one of two suns: what it shades is lit by the other alone."""
    asked, made = request(tmp_path / "fit", flat(), osl=True)
    lights = [DirectionalLight((0.0, 1.0, 0.4)), DirectionalLight((0.0, 0.0, 1.0), 0.5)]
    lamps = [helper().sun(light) for light in lights]
    shaded = asked | {"lamps": lamps, "blocker": [[0, -1.2, 3], 0.8, [0, 0, 0]]}
    unshaded = shaded | {"set": {"0": {"use_shadow": False}}}
    found, free = drawn([shaded, unshaded])
    both, second = (render_sphere(made.stored, each, 64).radiance.numpy() for each in (lights, lights[1:]))
    # What is seen of the sphere, in Blender's axes, and where the ray to the sun goes through the square's plane.
    z, x = (np.mgrid[:64, :64] + 0.5 - 32) / (32 * RADIUS) * np.array([-1, 1])[:, None, None]
    y = -np.sqrt(np.maximum(1 - x**2 - z**2, 0))
    across, along = np.abs(x) - 0.4, np.abs(y - 0.4 * (3 - z) + 1.2) - 0.4
    inner, shade = np.hypot(x, z) < 0.85, np.maximum(across, along)
    for place, expected in ((inner & (shade < -0.03), second), (inner & (shade > 0.03), both)):
        assert place.sum() > 60
        assert np.abs(found[place, :3] - expected[place]).max() < 0.02 * both.max()
    off = helper().differences(free, both)
    assert np.median(off) < 2e-3


@pytest.mark.slow
def test_the_closures_are_ours(drawn: Callable[..., list[np.ndarray]], tmp_path: Path) -> None:
    """The closures alone under one sun, of which Cycles makes no noise: weights, lengths, leans and tangents."""
    cases = [
        (name, fit, light) for name, fit in {"plain": isotropic(), "brushed": brushed()}.items() for light in LIGHTS
    ]
    asked = [
        request(tmp_path / f"{name} {k}", fit)[0] | {"lamps": [helper().sun(light)], "closures": True, "rings": 128}
        for k, (name, fit, light) in enumerate(cases)
    ]
    for found, (name, fit, light) in zip(drawn(asked), cases, strict=True):
        off = helper().differences(found, render_sphere(closures_like(fit).closures, light, 64).radiance.numpy())
        assert np.median(off) < 2e-3, name
        assert np.quantile(off, 0.99) < 0.03, name


@pytest.mark.slow
def test_the_world_is_reflected_by_the_closures(drawn: Callable[..., list[np.ndarray]], tmp_path: Path) -> None:
    """A sky of one level, one with a gradient and a lamp, and beside it a lamp that adds f cosθ and nothing else."""
    for name, fit in {"isotropic": isotropic(), "brushed": brushed()}.items():
        asked, _ = request(tmp_path / name, fit, size=24, samples=256, rings=64)
        dark = asked | {"lamps": []}
        even, sky = EnvironmentMap.constant(0.5), lamps()
        np.save(tmp_path / "sky.npy", helper().sky_of(sky))
        one, other, lit, both = drawn(
            [dark | {"world": 0.5}, dark | {"sky": str(tmp_path / "sky.npy")}, asked, asked | {"world": 0.5}]
        )
        closures = closures_like(fit).closures
        for found, light, most in ((one, even, 0.03), (other, sky, 0.05)):
            ours = render_filtered(closures, light, 24).radiance.numpy()
            off = helper().differences(found, ours)
            assert np.median(off) < most, name
            middle = (slice(6, 18), slice(6, 18), slice(0, 3))
            assert found[middle].mean((0, 1)) == pytest.approx(ours[middle].mean((0, 1)), rel=0.01), name
        assert (both - one)[middle] == pytest.approx(lit[middle], rel=0.05, abs=0.01), name


@pytest.mark.slow
def test_eevee_draws_what_we_draw(drawn: Callable[..., list[np.ndarray]], tmp_path: Path) -> None:
    asked, made = request(tmp_path / "fit", isotropic(), engine="BLENDER_EEVEE", samples=8, rings=32)
    try:
        drawn([asked | {"white": True}])
    except RuntimeError:
        pytest.skip("EEVEE does not run here: it needs a GPU, or Mesa's stand-in (libegl1, libgl1-mesa-dri)")
    (found,) = drawn([asked])
    off = helper().differences(found, render_sphere(made.stored, LIGHTS, 64).radiance.numpy())
    assert np.median(off) < 0.01
    assert np.quantile(off, 0.99) < 0.1
