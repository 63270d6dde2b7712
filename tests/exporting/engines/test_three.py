"""The npm folder for three.js: what is in it, and in a browser with the real three the pixels of our own renderer."""

import json
import re
import shutil
import subprocess
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from browser import browser, complaints, headless
from engine_cases import brushed, engine_folder, fit_no_looks, isotropic, npm_package, script, served

from homofact.containers.formats import format_named
from homofact.errors import BadInput
from homofact.exporting.engines.base import template
from homofact.exporting.engines.table import engine_named
from homofact.exporting.engines.three import THREE, package_name
from homofact.exporting.exported import exported
from homofact.factor.factorization import Factorization
from homofact.rendering.light import DEFAULT_LIGHT, DirectionalLight
from homofact.rendering.sphere import render_sphere
from homofact.rendering.surface import RADIUS

SIZE = 96


@pytest.fixture(autouse=True)
def look(monkeypatch: pytest.MonkeyPatch) -> None:
    fit_no_looks(monkeypatch)


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Any, Path, str]]:
    """(driver, the served folder, its address) with three in it."""
    three = npm_package("three")
    folder = tmp_path_factory.mktemp("three")
    (folder / "three").symlink_to(three)
    (folder / "page.html").write_text(script("engines.draw_three").PAGE, encoding="utf-8")
    with browser() as driver, served(folder) as address:
        yield driver, folder, address


def opened(driver: Any, address: str) -> None:
    driver.get(address)
    driver.execute_async_script(
        "const done = arguments[0]; (function wait() {"
        " document.documentElement.dataset.ready ? done(0) : setTimeout(wait, 20); })();"
    )


def troubles(driver: Any) -> list[str]:
    """What the page has said, but of the site's picture, which browsers ask for by themselves."""
    return [line for line in complaints(driver) if "favicon" not in line]


def pixels(page: tuple[Any, Path, str], folder: str, lights: list[Any], **parameters: Any) -> np.ndarray:
    """(SIZE, SIZE, 3) linear radiance, the first row on top."""
    driver, _, address = page
    opened(driver, f"{address}/page.html")
    found = driver.execute_async_script(
        "const done = arguments[5]; window.drawn(...[...arguments].slice(0, 5)).then(done, (e) => done(String(e)));",
        folder, SIZE, RADIUS, lights, parameters,
    )  # fmt: skip
    assert not isinstance(found, str), found
    assert troubles(driver) == [], folder
    return np.array(found).reshape(SIZE, SIZE, 4)[::-1, :, :3]


@pytest.mark.parametrize(
    ("name", "fit", "form", "tangents"),
    [
        ("halves", isotropic(), None, False),
        ("floats", brushed(), "exr", False),
        ("tangents", brushed(), None, True),
        ("bytes", isotropic(), "png8", False),
    ],
)
def test_three_draws_what_we_draw(
    page: tuple[Any, Path, str], name: str, fit: Factorization, form: str | None, tangents: bool
) -> None:
    made = engine_folder(page[1] / name, fit, "three", form)
    lights = [DEFAULT_LIGHT, DirectionalLight((0.9, -0.1, 0.3), 1.5)]
    given = [[*light.direction, float(light.levels()[0])] for light in lights]
    found = pixels(page, name, given, vertexTangents=tangents)
    image = render_sphere(made.stored, lights, SIZE)
    # Towards the silhouette a pixel's mean and its middle differ, and the mesh's facets show.
    y, x = np.mgrid[:SIZE, :SIZE] + 0.5 - SIZE / 2
    inner = np.hypot(x, y) < 0.85 * RADIUS * SIZE / 2
    expected = image.radiance.numpy()[inner]
    off = np.abs(found[inner] - expected) / np.maximum(expected, 0.05 * expected.mean())
    assert np.median(off) < (5e-3 if form == "png8" else 2e-3)
    assert np.quantile(off, 0.99) < (0.05 if form == "png8" else 0.02)
    assert (found[np.hypot(x, y) > RADIUS * SIZE / 2 + 1] == 0).all()


@pytest.mark.slow
def test_the_example_page_draws(page: tuple[Any, Path, str], tmp_path: Path) -> None:
    driver, folder, address = page
    engine_folder(folder / "example", isotropic(), "three")
    (folder / "example" / "node_modules").mkdir()
    (folder / "example" / "node_modules" / "three").symlink_to(npm_package("three"))
    headless.resize(driver, (400, 240))
    opened(driver, f"{address}/example/index.html")
    assert driver.execute_script("return document.querySelector('output').textContent") == ""
    assert driver.execute_script("return document.documentElement.dataset.ready") == "yes"
    assert troubles(driver) == []
    shown = tmp_path / "page.png"
    driver.save_screenshot(str(shown))
    from PIL import Image

    with Image.open(shown) as picture:
        grey = np.asarray(picture.convert("L")).astype(float)
    assert grey.std() > 10
    engine_folder(folder / "without three", isotropic(), "three")
    opened(driver, f"{address}/without%20three/index.html")
    assert "npm install three" in driver.execute_script("return document.querySelector('output').textContent")
    complaints(driver)


def test_npm_takes_the_folder(tmp_path: Path) -> None:
    npm = shutil.which("npm")
    if npm is None:
        pytest.skip("npm is missing")
    engine_folder(tmp_path / "paint", isotropic(), "three")
    done = subprocess.run(
        [npm, "pack", "--dry-run", "--json", "--offline"], cwd=tmp_path / "paint", capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    packed = json.loads(done.stdout)[0]
    assert (packed["name"], packed["version"]) == ("homofact-samples", "1.0.0")
    assert {each["path"] for each in packed["files"]} == {"index.js", "package.json", "README.md"}
    text = (tmp_path / "paint" / "README.md").read_text(encoding="utf-8")
    assert "homofact-samples" in text
    assert re.search("@[A-Z]+@", text) is None


def test_names_are_npms_and_texts_are_harmless() -> None:
    assert package_name("Größe </script> *Blue*") == "homofact-gr-e-script-blue"
    assert package_name("§") == "homofact-brdf"
    # Exports of two methods can be installed side by side.
    assert package_name("paint.csv", "ggx") == "homofact-paint-csv-ggx"
    assert package_name("paint.csv", "search") == "homofact-paint-csv"
    fit = isotropic()
    fit.provenance["source"] = {"file": "a`${b}</script><b>.brdf"}
    files = THREE.add(exported(fit, format_named("exr16"))).files
    assert "</script" not in str(files["index.js"]).lower()
    assert str(files["index.html"]).count("</script>") == 2
    with pytest.raises(AssertionError, match=r"three\.md: no @NONE@"):
        template("three.md", NONE="x")


def test_what_three_does_not_take_is_refused() -> None:
    with pytest.raises(BadInput, match=r"found 'unreal', expected one of three, gltf, .*; other engines read brdf"):
        engine_named("unreal", None)
    with pytest.raises(BadInput, match=r"engine: found 'godo', expected .* \(nearest: godot\)"):
        engine_named("godo", None)
    with pytest.raises(BadInput, match="format: found 'bc6h' with engine three, expected one of exr16, exr, png8"):
        engine_named("three", "bc6h")
    assert engine_named("three", None)[1] == "exr16"
    spectral = replace(isotropic(), channels=("400nm", "500nm", "600nm"))
    four = replace(
        spectral, terms=tuple(replace(t, texture=np.tile(t.texture, 2)[..., :4]) for t in spectral.terms),
        transform=replace(spectral.transform, mean=np.tile(spectral.transform.mean, 2)[:4]), channels=tuple("abcd"),
    )  # fmt: skip
    with pytest.raises(BadInput, match="three: found channels a, b, c, d, expected R, G, B or one alone"):
        THREE.add(exported(four, format_named("exr16")))


def test_a_three_of_other_environments_shows_the_look_alike_and_says_so(page: tuple[Any, Path, str]) -> None:
    driver, folder, address = page
    engine_folder(folder / "other", isotropic(), "three")
    opened(driver, f"{address}/page.html")
    found = driver.execute_async_script(
        "const done = arguments[0]; (async () => { const THREE = await import('three');"
        " const chunk = 'envmap_physical_pars_fragment', words = [];"
        " THREE.ShaderChunk[chunk] = THREE.ShaderChunk[chunk].replaceAll('ENVMAP_TYPE_PMREM', 'ENVMAP_TYPE_CUBE_UV');"
        " const warn = console.warn; console.warn = (text) => words.push(text);"
        " const { BrdfMaterial } = await import('./other/index.js'); console.warn = warn;"
        " const fragmentShader = '#include <lights_physical_pars_fragment>';"
        " const shader = { uniforms: {}, vertexShader: '', fragmentShader };"
        " new BrdfMaterial().onBeforeCompile(shader);"
        " return [words, Object.keys(shader.uniforms), shader.fragmentShader.includes('RE_Direct_Homofact'),"
        " shader.fragmentShader.includes('RE_IndirectSpecular_Homofact')]; })().then(done, (e) => done(String(e)));"
    )
    words, uniforms, direct, indirect = found
    assert len(words) == 1
    assert "look-alike" in words[0]
    assert uniforms == ["homofact_texture_0", "homofact_texture_1"]
    assert (direct, indirect) == (True, False)
