"""What engines get of hostile names: scripts that run, pages that parse, texts that show them, and no other code."""

import ast
import importlib.util
import json
import os
import re
import shutil
import struct
import subprocess
import sys
from collections.abc import Callable
from functools import cache
from html.parser import HTMLParser
from pathlib import Path
from types import ModuleType
from unittest.mock import MagicMock
from xml.etree import ElementTree

import pytest
from engine_cases import LOOK, fit_no_looks, isotropic
from hostile import FORBIDDEN, NAMES

from homofact.brdf.adaptive import tabulated
from homofact.brdf.formats import rgl
from homofact.brdf.reflectance import Exchanged
from homofact.brdf.rgl import AdaptiveTable
from homofact.containers.formats import format_named
from homofact.exporting.engines import gltf, pbrt
from homofact.exporting.engines.base import template
from homofact.exporting.engines.table import ENGINES
from homofact.exporting.exported import exported
from homofact.factor.factorization import Factorization
from homofact.files.template import AT, BRACES, filled
from homofact.files.words import on_one_line
from homofact.shading.program import name_of

# Every text of a fit's own record that an export may show, and what it then holds.
FIELDS: dict[str, Callable[[str], dict[str, object]]] = {
    "material": lambda name: {"source": {"material": name}},
    "file": lambda name: {"source": {"file": name}},
    "version": lambda name: {"source": {"material": "paint"}, "homofact_version": name, "method": name},
}


@pytest.fixture(autouse=True)
def look(monkeypatch: pytest.MonkeyPatch) -> None:
    fit_no_looks(monkeypatch)
    monkeypatch.setattr(gltf, "fit_metallic_roughness", lambda *args, **kwargs: LOOK)


def named(field: str, name: str) -> Factorization:
    fit = isotropic()
    fit.provenance.update(FIELDS[field](name))
    return fit


def texts(fit: Factorization, engine: str) -> dict[str, str]:
    """The texts that an engine adds to a folder, by name; nothing in them is what no text may hold."""
    added = ENGINES[engine].add(exported(fit, format_named(ENGINES[engine].formats[0])))
    found = {name: text for name, text in added.files.items() if isinstance(text, str)}
    for name, text in found.items():
        assert not set(text) & set(FORBIDDEN), name
        text.encode("utf-8")
    return found


@cache
def plain(engine: str) -> dict[str, str]:
    return texts(named("material", "paint"), engine)


def uncommented(text: str) -> str:
    joined = re.sub(r"\\[ \t]*\r?\n", "", text)
    return re.sub(r"/\*.*?\*/|//[^\n]*", "", joined, flags=re.DOTALL)


class Elements(HTMLParser):
    """The tags of a page with the attributes that act."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.tags: list[tuple[str, tuple[tuple[str, str | None], ...]]] = []
        self.scripts: list[str] = []
        self.feed(page)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, tuple(attrs)))

    def handle_data(self, data: str) -> None:
        if self.tags and self.tags[-1][0] == "script":
            self.scripts.append(data)


def rendered(markdown: str) -> list[tuple[str, tuple[tuple[str, str | None], ...]]]:
    """The elements of a Markdown text, raw HTML and bare addresses among them."""
    module = pytest.importorskip("markdown_it")
    return Elements(module.MarkdownIt("commonmark", {"html": True}).render(markdown)).tags


def check_readme(hostile: str, harmless: str) -> None:
    assert rendered(hostile) == rendered(harmless)


@pytest.mark.parametrize("field", FIELDS)
@pytest.mark.parametrize("name", NAMES)
def test_blenders_script_runs_and_holds_the_name(
    name: str, field: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("HOMOFACT_EVIL", raising=False)
    fit = named(field, name)
    text = texts(fit, "blender")["brdf_blender.py"]
    (tmp_path / "brdf_blender.py").write_text(text, encoding="utf-8")
    monkeypatch.setitem(sys.modules, "bpy", MagicMock(spec=ModuleType("bpy")))
    specification = importlib.util.spec_from_file_location("brdf_blender", tmp_path / "brdf_blender.py")
    assert specification is not None
    assert specification.loader is not None
    script = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(script)
    assert "HOMOFACT_EVIL" not in os.environ
    assert f"homofact {name_of(fit.provenance)}" == script.NAME
    expected = ast.parse(plain("blender")["brdf_blender.py"])
    changed = ast.parse(text)
    for tree in (expected, changed):
        tree.body = [
            each for each in tree.body[1:] if not (isinstance(each, ast.Assign) and ast.unparse(each)[:5] == "NAME ")
        ]
    assert ast.dump(changed) == ast.dump(expected)


@pytest.mark.parametrize("field", FIELDS)
@pytest.mark.parametrize("name", NAMES)
def test_threes_module_page_and_package_are_the_same_but_for_the_name(name: str, field: str) -> None:
    found, harmless = texts(named(field, name), "three"), plain("three")
    data = [re.search(r"^const DATA = (\{.*?^\});$", each["index.js"], re.M | re.S) for each in (found, harmless)]
    (module, glsl), (plain_module, plain_glsl) = (
        (each["index.js"].replace(match[1], ""), json.loads(match[1])["glsl"])
        for each, match in zip((found, harmless), data, strict=True)
        if match is not None
    )
    assert module == plain_module
    assert uncommented(glsl) == uncommented(plain_glsl)
    page, plain_page = (Elements(each["index.html"]) for each in (found, harmless))
    assert (page.tags, page.scripts) == (plain_page.tags, plain_page.scripts)
    package = json.loads(found["package.json"])
    assert re.fullmatch("homofact-[a-z0-9-]{1,100}", package["name"])
    # The import of the package's own name is a line of the README's code.
    own, other = package["name"], json.loads(harmless["package.json"])["name"]
    check_readme(found["README.md"].replace(own, other), harmless["README.md"])


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("node") is None, reason="no node")
def test_threes_module_is_one_to_node(tmp_path: Path) -> None:
    for k, name in enumerate(NAMES):
        (tmp_path / f"{k}.mjs").write_text(texts(named("material", name), "three")["index.js"], encoding="utf-8")
        made = subprocess.run(["node", "--check", tmp_path / f"{k}.mjs"], capture_output=True, text=True)
        assert made.returncode == 0, made.stderr


@pytest.mark.skipif(shutil.which("node") is None, reason="no node")
def test_a_name_brings_nothing_of_threes_shader_into_the_fits(tmp_path: Path) -> None:
    """What `String.replace` reads in its second text: $' is all that follows."""
    for k, name in enumerate(("$' $` $&", "paint")):
        module = texts(named("material", name), "three")["index.js"]
        stub = "const THREE = { HalfFloatType: 1, FloatType: 2, UnsignedByteType: 3, MeshPhysicalMaterial: class {\n"
        chunk = "ShaderChunk: { envmap_physical_pars_fragment: 'ENVMAP_TYPE_PMREM' }"
        stub += "color = { setRGB() {} }; setValues() {} }, DataTexture: class {}, " + chunk + " };\n"
        module = module.replace('import * as THREE from "three";', stub)
        module += "const shader = { uniforms: {}, vertexShader: '', fragmentShader: `before ${CHUNK} after` };\n"
        module += "new BrdfMaterial().onBeforeCompile(shader);\nconsole.log(shader.fragmentShader);\n"
        (tmp_path / f"{k}.mjs").write_text(module)
    shaders = [
        subprocess.run(["node", tmp_path / f"{k}.mjs"], capture_output=True, text=True, check=True).stdout
        for k in (0, 1)
    ]
    assert uncommented(shaders[0]) == uncommented(shaders[1])


@pytest.mark.parametrize("field", FIELDS)
@pytest.mark.parametrize("name", NAMES)
def test_materialx_documents_are_well_formed(name: str, field: str) -> None:
    fit = named(field, name)
    found, harmless = texts(fit, "materialx"), plain("materialx")
    root = ElementTree.fromstring(found["brdf.mtlx"])
    definition = root.find("nodedef")
    assert definition is not None
    assert definition.get("doc") == f"The BRDF of {name_of(fit.provenance)}."
    called = definition.get("node")
    assert called is not None
    assert re.fullmatch("homofact(_[A-Za-z0-9]+)+", called)
    assert len(called) < 256
    code = found["brdf_materialx.glsl"].replace(called, "homofact_paint")
    assert uncommented(code) == uncommented(harmless["brdf_materialx.glsl"])
    assert [each.tag for each in root.iter() if each.tag != called] == [
        each.tag for each in ElementTree.fromstring(harmless["brdf.mtlx"]).iter() if each.tag != "homofact_paint"
    ]
    check_readme(found["README.md"].replace(called, "homofact_paint"), harmless["README.md"])


@pytest.mark.parametrize("field", FIELDS)
@pytest.mark.parametrize("name", NAMES)
def test_godots_shader_is_the_same_but_for_comments(name: str, field: str) -> None:
    found, harmless = texts(named(field, name), "godot"), plain("godot")
    assert uncommented(found["brdf.gdshader"]) == uncommented(harmless["brdf.gdshader"])
    assert found["brdf.tres"] == harmless["brdf.tres"]
    check_readme(found["README.md"], harmless["README.md"])


@pytest.mark.parametrize("name", NAMES)
def test_gltf_holds_the_name(name: str) -> None:
    fit = named("material", name)
    data = gltf.glb(LOOK, name_of(fit.provenance), rings=4)
    size = struct.unpack("<I", data[12:16])[0]
    document = json.loads(data[20 : 20 + size].decode("utf-8"))
    assert document["materials"][0]["name"] == name_of(fit.provenance) == on_one_line(name)


@cache
def small_table() -> AdaptiveTable:
    """A table as pbrt gets one, of few nodes."""
    return tabulated(Exchanged(isotropic()), True, whole_turn=True)


@pytest.mark.parametrize("name", NAMES)
def test_pbrts_scene_is_the_same_but_for_comments_and_the_materials_name(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(pbrt, "tabulated", lambda *args, **kwargs: small_table())
    monkeypatch.setattr(pbrt, "relative_differences", lambda *args: (0.01, 0.1))
    # Weights and spectra know no name; tests of rgl.write and of pbrt have them.
    monkeypatch.setattr(rgl, "importance", lambda table: table.table.mean(-1))
    monkeypatch.setattr(pbrt, "with_spectra", lambda table: table)
    found, harmless = texts(named("material", name), "pbrt"), plain("pbrt")
    for file in ("scene.pbrt", "material.pbrt"):
        lines, expected = (
            [line for line in each[file].splitlines() if not line.startswith("#")] for each in (found, harmless)
        )
        (own,) = {*re.findall(r'NamedMaterial "([^"]*)"', "\n".join(lines))}
        assert re.fullmatch("[A-Za-z0-9-]+", own)
        assert [line.replace(f'"{own}"', '"paint"') for line in lines] == expected


@pytest.mark.parametrize("mark", [AT, BRACES])
@pytest.mark.parametrize("name", NAMES)
def test_what_is_filled_in_is_never_filled_in_itself(name: str, mark: re.Pattern[str]) -> None:
    begin, end = ("@", "@") if mark is AT else ("{{", "}}")
    values = {"A": f"{name}{begin}B{end}", "B": f"{begin}A{end}"}
    assert filled(f"{begin}A{end}|{begin}B{end}", mark, values) == f"{values['A']}|{values['B']}"
    with pytest.raises(KeyError):
        filled(f"{begin}NOPE{end}", mark, values)


def test_a_template_says_what_it_has_no_place_for() -> None:
    with pytest.raises(AssertionError, match="@MORE@"):
        template("godot.md", NAME="a", VERSION="1", MORE="")
