"""The MaterialX node: a valid document, shaders that its generators make and glslang compiles; and Godot's shader."""

import re
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path
from xml.etree import ElementTree

import pytest
from engine_cases import brushed, engine_folder, fit_no_looks, isotropic
from webgpu import glslang

from homofact.containers.formats import format_named
from homofact.exporting.exported import exported
from homofact.factor.factorization import Factorization
from homofact.shading.languages import GLSL, GODOT, MATERIALX, shader

FITS = {"isotropic": isotropic(), "brushed": brushed()}


@pytest.fixture(autouse=True)
def look(monkeypatch: pytest.MonkeyPatch) -> None:
    fit_no_looks(monkeypatch)


def statements(text: str) -> list[str]:
    """The lines of the one function."""
    return re.findall(r"^    .*;$", text, re.MULTILINE)


@pytest.mark.parametrize("name", FITS)
def test_the_dialects_print_one_program(name: str) -> None:
    program = exported(FITS[name], format_named("exr16")).program
    expected = statements(shader(program, GLSL, "fit"))
    assert len(expected) > 5
    # MaterialX's v runs upwards, and its function turns it over where images are loaded from the top.
    turned = r"mx_transform_uv\((\w+), vec2\(1.0, -1.0\), vec2\(0.0, 1.0\)\)"
    assert statements(re.sub(turned, r"\1", shader(program, MATERIALX, "fit"))) == expected
    assert statements(shader(program, GODOT, "fit")) == expected


def generated(folder: Path, target: str) -> dict[str, str]:
    """What MaterialX's own command makes of the folder's document, by stage."""
    found = find_spec("MaterialX")
    if found is None or found.origin is None:
        pytest.skip("MaterialX is missing: pip install 'homofact[materialx]'")
    command = Path(found.origin).parent / "_scripts" / "generateshader.py"
    out = folder / target
    out.mkdir()
    # A process of its own: the library ends it where something is missing.
    asked = [sys.executable, str(command), "--target", target, "--outputPath", str(out), str(folder / "brdf.mtlx")]
    done = subprocess.run(asked, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "Validation warnings" not in done.stdout, done.stdout
    return {stage: next(out.glob(f"*.{stage}")).read_text() for stage in ("frag", "vert")}


@pytest.mark.parametrize(("name", "target"), [("isotropic", "glsl"), ("brushed", "glsl"), ("isotropic", "essl")])
def test_generated_shaders_compile(name: str, target: str, tmp_path: Path) -> None:
    made = engine_folder(tmp_path / "fit", FITS[name], "materialx")
    stages = generated(tmp_path / "fit", target)
    for stage, code in stages.items():
        glslang(code, tmp_path, stage)
    assert "homofact_samples_evaluate(wi, wo, homofact_samples_texture_0" in stages["frag"]
    body = statements(shader(made.program, MATERIALX, "homofact_samples"))
    assert "\n".join(body[-2:]) in stages["frag"]
    with pytest.raises(AssertionError, match="ERROR"):
        glslang(stages["frag"].replace("closureData.L", "closureData.W", 1), tmp_path, "frag")


def test_the_document_names_what_lies_beside_it(tmp_path: Path) -> None:
    engine_folder(tmp_path / "fit", isotropic(), "materialx")
    root = ElementTree.parse(tmp_path / "fit" / "brdf.mtlx").getroot()
    files = [each.get("value") for each in root.iter("input") if each.get("type") == "filename"]
    files += [each.get("file") for each in root.iter("implementation")]
    assert files == ["texture_0.exr", "texture_1.exr", "light_table.exr", "brdf_materialx.glsl"]
    assert all((tmp_path / "fit" / str(name)).is_file() for name in files)


@pytest.mark.parametrize("fit", FITS.values(), ids=list(FITS))
def test_godots_shader_is_glsl_but_for_its_frame(fit: Factorization, tmp_path: Path) -> None:
    """Where there is no Godot (test_godot.py): through glslang, Godot's own words declared as in GLSL."""
    engine_folder(tmp_path / "fit", fit, "godot")
    text = (tmp_path / "fit" / "brdf.gdshader").read_text(encoding="utf-8")
    assert text.count("shader_type spatial;") == 1
    assert re.findall(r"uniform sampler2D (\w+) : filter_linear, repeat_disable;", text) == [
        "homofact_texture_0", "homofact_texture_1"
    ]  # fmt: skip
    plain = text.replace("shader_type spatial;", "").replace(" : filter_linear, repeat_disable;", ";")
    plain = plain.replace("varying vec3", "vec3")
    words = "vec3 ALBEDO, TANGENT, NORMAL, LIGHT, VIEW, LIGHT_COLOR, SPECULAR_LIGHT;\n"
    words += "float METALLIC, ROUGHNESS, ATTENUATION;\nbool OUTPUT_IS_SRGB;\n"
    head = "#version 300 es\nprecision highp float;\nprecision highp sampler2D;\n"
    main = (
        "out vec4 colour;\nvoid main() {\n    fragment();\n    light();\n    colour = vec4(SPECULAR_LIGHT, 1.0);\n}\n"
    )
    glslang(head + words + plain + main, tmp_path, "frag")
