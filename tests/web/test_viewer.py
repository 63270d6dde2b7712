"""The page as text and data: arrays come back, text cannot break out, layers are what the fits are."""

import base64
import json
import re
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from shading_cases import CASES, SEPARABLE, factorization
from unpacked import unpack

from homofact.brdf.materials import material
from homofact.brdf.sampling import sample_model
from homofact.brdf.scattered import surface_of
from homofact.brdf.source import open_source
from homofact.errors import BadInput
from homofact.evaluation.bar.error_bar import BarKind, ErrorBar, ErrorBars
from homofact.factor.projection import fixed_projection
from homofact.factor.quantize import rounded
from homofact.geometry.directions import draw_uniform, to_spherical
from homofact.meshes.mesh import Mesh
from homofact.shading.cost import cost_of
from homofact.shading.encoding import encode_texture
from homofact.shading.program import program_of
from homofact.web.layers import fit_layer
from homofact.web.packing import TYPES, differences, pack
from homofact.web.page import _bytes, _verdict
from homofact.web.viewer import Layer, LayerTexture, source_layer, viewer_html, write_viewer

GLSL = "uniform sampler2D a_texture_0;\nvec3 a_evaluate(vec3 wi, vec3 wo) { return vec3(0.0); }"
PIXELS = np.zeros((2, 3, 4), np.float32)


class Parsed(HTMLParser):
    """Elements, and the text of those that hold some."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.elements: list[tuple[str, dict[str, str | None]]] = []
        self.text: dict[str, list[str]] = {}
        self.open = ""
        self.feed(page)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, dict(attrs)))
        self.open = str(dict(attrs).get("id") or tag)

    def handle_data(self, data: str) -> None:
        self.text.setdefault(self.open, []).append(data)


def data_of(page: str) -> Any:
    return json.loads("".join(Parsed(page).text["data"]))


@given(
    st.sampled_from(TYPES).flatmap(
        lambda kind: arrays.arrays(np.dtype(kind), arrays.array_shapes(min_dims=0, max_dims=4, min_side=0, max_side=7))
    )
)
def test_arrays_come_back_to_the_last_bit(array: np.ndarray) -> None:
    packed = json.loads(json.dumps(pack(array)))
    found = unpack(packed)
    assert (found.dtype, found.shape) == (array.dtype, array.shape)
    assert found.tobytes() == array.tobytes()


def test_bytes_are_grouped_by_significance() -> None:
    """As the page's own reader expects it: all lowest bytes, then all next ones, little-endian."""
    import zlib

    packed = pack(np.array([0x0102, 0x0304], np.uint16))
    assert zlib.decompress(base64.b64decode(packed["data"])) == bytes([2, 4, 1, 3])


@given(arrays.arrays(np.int16, (3, 4, 5)))
def test_differences_are_undone_by_sums(array: np.ndarray) -> None:
    found = differences(array, (1, 2))
    assert found.dtype == np.int16
    assert (found[:, 0, 0] == array[:, 0, 0]).all()
    assert (np.cumsum(np.cumsum(found, 2, dtype=np.int16), 1, dtype=np.int16) == array).all()


def test_other_types_are_not_packed() -> None:
    with pytest.raises(ValueError, match="an array of float64, expected one of float32"):
        pack(np.zeros(2))


HOSTILE = "</script><script>alert(1)</script><!-- {{data}} & \"' \\u003c \u2028 <b>"
SHOWN = HOSTILE.replace("\u2028", "\\u2028")


def test_no_text_breaks_out_of_its_place() -> None:
    layer = Layer(
        "a", HOSTILE, GLSL + f"\n// {HOSTILE}", (LayerTexture("a_texture_0", PIXELS, HOSTILE),), ((HOSTILE, HOSTILE),)
    )
    page = viewer_html([layer], title=HOSTILE, subtitle=HOSTILE, notes=[HOSTILE])
    plain = viewer_html([replace(layer, title="", facts=(), glsl=GLSL)], title="", notes=[])
    names = [name for name, _ in Parsed(page).elements]
    assert names == [name for name, _ in Parsed(plain).elements]
    assert names.count("script") == 2
    parsed, data = Parsed(page), data_of(page)
    assert "".join(parsed.text["h1"]).strip() == SHOWN
    assert "".join(parsed.text["title"]).strip() == SHOWN
    assert data["notes"] == [SHOWN]
    (shown,) = data["layers"]
    assert (shown["title"], shown["facts"], shown["textures"][0]["caption"]) == (SHOWN, [[SHOWN, SHOWN]], SHOWN)
    assert shown["glsl"].endswith(SHOWN)


def test_the_page_asks_for_nothing_from_anywhere() -> None:
    page = viewer_html([fit_layer(CASES["fixed h"], "fit", "Fit")], title="t")
    for _, attributes in Parsed(page).elements:
        for name in ("src", "href", "action", "data", "poster"):
            assert (attributes.get(name) or "data:").startswith("data:"), attributes
    policy = next(a["content"] for _, a in Parsed(page).elements if a.get("http-equiv") == "Content-Security-Policy")
    assert policy is not None
    assert policy.startswith("default-src 'none';")
    # The namespace of SVG names a language: nothing asks for that address.
    page = page.replace("http://www.w3.org/2000/svg", "")
    assert not re.search(r"https?://|@import|\bfetch\s*\(|XMLHttpRequest|WebSocket|importScripts", page)


@pytest.mark.parametrize("name", CASES)
def test_a_factorization_is_the_textures_that_its_program_reads(name: str) -> None:
    fitted = CASES[name]
    layer = fit_layer(fitted, "fit", "Fit", (("Verdict", "nothing found"),))
    assert len(layer.textures) == len(fitted.terms)
    for texture, term in zip(layer.textures, fitted.terms, strict=True):
        assert texture.pixels.dtype == np.float32
        expected = np.broadcast_to(term.flat().texture.astype(np.float32), (*term.flat().size, 3))
        assert (texture.pixels[..., :3] == expected).all()
        assert f"uniform highp sampler2D {texture.name};" in layer.glsl
        assert texture.quantity == "log"
    assert "#version" not in layer.glsl
    assert "precision highp float" not in layer.glsl
    facts = dict(layer.facts)
    cost = cost_of(program_of(fitted, [encode_texture(texture, "float32") for texture in fitted.textures]), 0)
    assert next(iter(facts)) == "Verdict"
    assert facts["Operations (scalar)"] == f"{cost.total} ({cost.scalar})"
    assert facts["Fetches"] == str(fitted.fetches)
    assert facts["Bytes"] == f"{fitted.nbytes:,}"


def test_captions_say_what_a_texture_is_indexed_by() -> None:
    def captions(name: str) -> list[str]:
        return [texture.caption for texture in fit_layer(CASES[name], "fit", "Fit").textures]

    assert captions("fixed theta_i-delta_phi") == ["θi, Δφ"]
    assert captions("searched in-out") == ["searched in ωi, ωo"]
    assert captions("five of all kinds")[:2] == ["searched in θh, θd, φd, warped", "searched in θi, θo, Δφ"]
    assert captions("McCool, one channel") == ["ωi", "h"]
    assert dict(fit_layer(CASES["five of all kinds"], "a", "").facts)["Textures"] == "4 of 9 × 12; 1 of 1 × 12"


def test_one_channel_is_grey() -> None:
    layer = fit_layer(CASES["McCool, one channel"], "fit", "Fit")
    assert "float fit_grey_evaluate(vec3 wi, vec3 wo)" in layer.glsl
    assert "vec3 fit_evaluate(vec3 wi, vec3 wo) {\n    return vec3(fit_grey_evaluate(wi, wo));" in layer.glsl


@pytest.mark.parametrize("name", SEPARABLE)
def test_a_separable_fit_is_its_factors(name: str) -> None:
    fitted = SEPARABLE[name]
    layer = fit_layer(fitted, "fit", "Fit")
    textures = [texture for term in fitted.terms for texture in term.textures]
    assert [t.quantity for t in layer.textures] == ["factor"] * len(textures)
    for found, expected in zip(layer.textures, textures, strict=True):
        assert (found.pixels[..., :3] == expected.astype(np.float32)).all()
    assert layer.textures[0].caption.startswith("term 1: ωi and ωo" if "shared" in name else "term 1: ")
    assert dict(layer.facts)["Fetches"] == "4"


def test_eight_bits_stay_eight_bits_and_sixteen_become_floats() -> None:
    fitted = CASES["fixed h"]
    for storage, kind in (("png8", "uint8"), ("png16", "float32")):
        whole = rounded(fitted, storage)
        (texture,) = fit_layer(whole, "fit", "Fit").textures
        assert texture.pixels.dtype == kind
        pixels = texture.pixels[..., :3].astype(np.float64)
        if texture.scale is not None and texture.bias is not None:
            pixels = pixels / 255 * texture.scale + texture.bias
        assert np.abs(pixels - whole.textures[0].texels).max() < 1e-6
    facts = dict(fit_layer(rounded(fitted, "png8"), "fit", "Fit").facts)
    assert facts["Bytes"] == f"{fitted.nbytes // 4:,}"
    assert facts["Textures"] == "1 of 9 × 12, 8 bit"


def test_a_name_with_a_line_break_does_not_end_its_comment() -> None:
    provenance = {"source": {"file": "a\n} syntax error"}}
    layer = fit_layer(replace(CASES["fixed h"], provenance=provenance), "fit", "Fit")
    assert "// BRDF of a } syntax error, by" in layer.glsl


@pytest.mark.parametrize(
    ("channels", "found"),
    [
        (("450nm", "550nm", "650nm"), "3 (450nm, 550nm, 650nm)"),
        (("A", "B"), "2 (A, B)"),
        (tuple("RGBA"), "4 (R, G, B …)"),
    ],
)
def test_other_channels_are_refused_with_a_remedy(channels: tuple[str, ...], found: str) -> None:
    fitted = replace(factorization(fixed_projection("h", True), channels=min(len(channels), 4)), channels=channels)
    with pytest.raises(BadInput) as refused:
        fit_layer(fitted, "fit", "Fit")
    assert str(refused.value) == f"channels: found {found}, expected 1 or RGB to show (fit with `channels='rgb'`)"


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        (
            {"pixels": np.zeros((2, 3, 3), np.float32)},
            r"t: pixels have shape \(2, 3, 3\), expected \(rows, columns, 4\)",
        ),
        ({"pixels": np.zeros((0, 3, 4), np.float32)}, r"t: pixels have shape \(0, 3, 4\), expected"),
        ({"pixels": np.zeros((2, 3, 4))}, "t: pixels are float64, expected float32, float16 or uint8"),
        ({"pixels": np.full((2, 3, 4), np.nan, np.float32)}, "t: a texel is not finite"),
        ({"mask": np.ones((3, 2), bool)}, r"t: the mask has shape \(3, 2\), expected \(2, 3\)"),
        ({"scale": (1.0, 1.0, 1.0)}, "t: scale without bias, expected both or none"),
    ],
)
def test_textures_that_cannot_be_are_refused(change: dict[str, Any], expected: str) -> None:
    with pytest.raises(BadInput, match=expected):
        LayerTexture(**({"name": "t", "pixels": PIXELS, "caption": ""} | change))


@pytest.mark.parametrize(
    ("key", "glsl", "expected"),
    [
        ("A b", GLSL, "layer: key is 'A b', expected small letters, digits and _"),
        ("b", GLSL, "layer b: its shader text has no vec3 b_evaluate, expected it to"),
        ("a", GLSL.replace("a_texture_0", "other"), "layer a: its shader text has no a_texture_0, expected it to"),
    ],
)
def test_layers_that_the_page_cannot_call_are_refused(key: str, glsl: str, expected: str) -> None:
    with pytest.raises(BadInput, match=f"^{expected}$"):
        Layer(key, "", glsl, (LayerTexture("a_texture_0", PIXELS, ""),))


@pytest.mark.parametrize(("count", "found"), [(0, "none"), (4, "a, b, c, d")])
def test_a_page_has_one_to_three_layers(count: int, found: str) -> None:
    layers = [Layer(key, "", GLSL.replace("a_", f"{key}_"), ()) for key in "abcd"[:count]]
    with pytest.raises(BadInput, match=rf"viewer: found the layers {found}, expected one to three different ones"):
        viewer_html(layers, title="")
    with pytest.raises(BadInput, match="viewer: found the layers a, a, expected"):
        viewer_html([Layer("a", "", GLSL, ())] * 2, title="")


def test_a_mesh_is_packed_to_within_its_steps() -> None:
    generator = torch.Generator().manual_seed(0)
    upper, lower = draw_uniform(500, generator)
    normals = torch.cat((upper, -lower)).numpy()
    triangles = np.arange(999).reshape(-1, 3)
    mesh = Mesh(normals * 0.9, normals, triangles, "ball.obj")
    packed = data_of(viewer_html([Layer("a", "", GLSL, ())], title="", mesh=mesh))["mesh"]
    positions = unpack(packed["positions"]) / 65535 * 2 - 1
    assert np.abs(positions - mesh.positions).max() <= 1 / 65535
    flat = unpack(packed["normals"]) / 32767
    n = np.concatenate((flat, 1 - np.abs(flat).sum(1, keepdims=True)), 1)
    folded = (1 - np.abs(n[:, 1::-1])) * np.where(n[:, :2] < 0, -1, 1)
    n[:, :2] = np.where(n[:, 2:] < 0, folded, n[:, :2])
    n /= np.linalg.norm(n, axis=1, keepdims=True)
    assert np.abs(n - normals).max() < 1e-4
    assert (np.cumsum(unpack(packed["triangles"])) == triangles.reshape(-1)).all()
    assert packed["name"] == "ball.obj"


def test_the_page_is_written_whole_or_not_at_all(tmp_path: Path) -> None:
    layer, path = Layer("a", "Fit", GLSL, ()), tmp_path / "p.html"
    size = write_viewer(path, [layer], title="ε")
    assert size == len(path.read_bytes())
    assert path.read_text(encoding="utf-8") == viewer_html([layer], title="ε")
    before = path.read_bytes()
    with pytest.raises(BadInput):
        write_viewer(path, [], title="")
    assert path.read_bytes() == before
    with pytest.raises(BadInput, match=r"none/p\.html: cannot be written .*expected a writable place"):
        write_viewer(tmp_path / "none" / "p.html", [layer], title="")
    assert [each.name for each in tmp_path.iterdir()] == ["p.html"]


def test_the_source_says_that_it_is_a_table() -> None:
    layer = source_layer(material("phong-10").model, facts=(("Bytes", "0"),))
    assert layer.table is not None
    assert layer.facts == (("Bytes", "0"), ("Textures", "none"))
    data = data_of(viewer_html([layer], title="", notes=["first"]))
    assert data["notes"][0] == "first"
    assert f"draws Source from a table of {layer.table.size} nodes" in data["notes"][1]
    assert f"differs from the source by {layer.table.error.words()}." in data["notes"][1]
    volume = data["layers"][0]["volume"]
    assert volume["name"] == "source_texture_0"
    assert (unpack(volume["steps"]) == layer.table.differences()).all()


def test_the_bytes_of_a_list_are_those_of_its_samples_as_float32() -> None:
    """Angles and values, as many bytes as a fit's textures are counted with; not what interpolation makes of them."""
    source = open_source("material:phong-10", count=300)
    assert _bytes(source) == "analytic"
    half = source.samples.select(torch.arange(150))
    for samples, numbers in ((half, 3 + 3), (replace(half, isotropic=False), 4 + 3), (half.channel("R"), 3 + 1)):
        measured = replace(source, kind="measurement", samples=samples, reflectance=surface_of(samples))
        assert _bytes(measured) == f"{150 * numbers * 4:,} (samples as float32)"
    assert dict(source_layer(surface_of(half)).facts)["Textures"] == "none (150 samples)"
    table = replace(source, kind="drawn")
    assert _bytes(table) == f"{source.reflectance.nbytes} (as stored)"


def test_the_source_of_a_list_knows_up_to_which_angle_it_was_measured() -> None:
    model = material("lafortune-clay").model
    full = sample_model(model, 1500, "discs", 0)
    theta = [to_spherical(w)[0].rad2deg() for w in (full.wi, full.wo)]
    samples = full.select(((theta[0] < 70) & (theta[1] < 62)).nonzero()[:, 0])
    layer = source_layer(surface_of(samples))
    assert layer.measured_to is not None
    assert 68 < layer.measured_to < 70
    html = viewer_html([layer], title="t")
    found = json.loads(re.search(r'"measuredTo":\s*([\d.]+)', html)[1])  # type: ignore[index]
    assert found == pytest.approx(layer.measured_to)
    assert source_layer(model).measured_to is None


def test_the_error_bars_by_angle_stand_beside_the_verdict() -> None:
    bar = ErrorBar("albedo", BarKind.RIGHT, 0.25, 0.9, (0.0, 75.0))
    at = (replace(bar, degrees=(5.0, 5.0)), replace(bar, degrees=(20.0, 20.0), kind=BarKind.WITHDRAWN, error=None))
    report = {"verdict": {"trusted": True, "summary": "as it is", "bars": ErrorBars((bar,), at).record()}}
    assert _verdict(report) == (
        ("Verdict", "trusted; as it is"),
        ("Total reflected light, source over fit", "5°: 0.8 to 1.25, 20°: unknown"),
    )
    grazing = ErrorBars((bar,), (replace(at[0], unmeasured=0.3),)).record()
    ((_, words),) = _verdict({"verdict": {"trusted": True, "summary": "as it is", "bars": grazing}})[1:]
    assert words == "5°: 0.8 to 1.25 (30% of it in directions without measurements)"
    # Reports of earlier versions have none.
    assert _verdict({"verdict": {"trusted": True, "summary": "as it was"}}) == (("Verdict", "trusted; as it was"),)
