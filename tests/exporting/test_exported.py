"""An export's folder: it reads back as what its textures hold, in every format, and refuses what was spoilt."""

import json
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from shading_cases import CASES, SEPARABLE, factorization, searched, separable

import homofact
from homofact.brdf.reflectance import Derived
from homofact.containers.exr import exr_channel_names, write_channels
from homofact.containers.formats import FORMATS, format_named
from homofact.errors import BadInput
from homofact.exporting.exported import (
    Exported,
    exported,
    log_difference,
    write_exported,
)
from homofact.exporting.exported_reader import open_exported, whole_format
from homofact.factor.factorization import Factorization, Term
from homofact.factor.fitted import Fitted
from homofact.factor.projection import Warp, fixed_projection
from homofact.files.folder import check_new_folder
from homofact.files.kinds import EXPORT
from homofact.geometry.directions import draw_cosine_weighted
from homofact.shading.lobe_mixture import restored
from homofact.shading.mixture_fit import fitted_mixture
from homofact.shading.noise import noise_at_angles

pytestmark = pytest.mark.usefixtures("unseen")

EVERY = CASES | SEPARABLE


def write(folder: Path, fitted: Fitted, name: str = "exr", force: bool = False) -> Exported:
    made = exported(fitted, format_named(name))
    write_exported(folder, made, {"as fitted": {"log_difference": 0.0}}, force)
    return made


def values(fitted: Fitted) -> np.ndarray:
    return fitted.evaluate(*draw_cosine_weighted(500, torch.Generator().manual_seed(5))).numpy()


@pytest.mark.parametrize("name", EVERY)
def test_what_is_read_back_is_what_was_stored(name: str, tmp_path: Path) -> None:
    made = write(tmp_path / "out", EVERY[name])
    again = open_exported(tmp_path / "out")
    assert np.array_equal(values(again), values(made.stored))
    assert np.allclose(values(again), values(EVERY[name]), rtol=1e-5, atol=1e-7)


@pytest.mark.parametrize("name", FORMATS)
def test_every_format_gives_what_it_said_it_would(name: str, tmp_path: Path) -> None:
    fitted = factorization(searched("isotropic-half-diff", 1, Warp(0.1)), fixed_projection("theta_h-theta_d", True))
    cut = tuple(replace(t, texture=t.texture[:8, :12], mask=t.mask[:8, :12]) for t in fitted.terms)
    fitted = replace(fitted, terms=cut)
    made = write(tmp_path / "out", fitted, name)
    again = open_exported(tmp_path / "out")
    assert np.array_equal(values(again), values(made.stored))
    steps = {"exr": 1e-6, "exr16": 1e-3, "png8": 5e-3, "png16": 3e-5, "ktx2": 1e-3, "dds": 1e-3, "bc6h": 0.6}
    assert log_difference(fitted, again) < steps[name]
    assert made.cost.nbytes == 2 * FORMATS[name].bytes_of(8, 12, 3)
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == sorted(
        [*made.names, "brdf.c", "brdf.glsl", "brdf.hlsl", "brdf.wgsl", "brdf_check.csv", "manifest.json"]
    )


def test_whole_texels_survive_to_the_bit(tmp_path: Path) -> None:
    source = homofact.read("material:lafortune-blue-paint", count=3000)
    fitted = homofact.fit(source, homofact.McCool(size=8, quantize="png8")).factorization
    write(tmp_path / "out", fitted, "png8")
    assert np.allclose(values(open_exported(tmp_path / "out")), values(fitted), rtol=1e-12)


@pytest.mark.parametrize("name", ["png8", "png16"])
@pytest.mark.parametrize("method", [homofact.McCool(size=6), homofact.Svd(size=6, textures=2)], ids=lambda m: m.name)
def test_an_export_of_an_export_has_the_same_numbers(method, name: str, tmp_path: Path) -> None:
    # Solved texels do not use the whole range of numbers: a range of their own would round them once more.
    source = homofact.read("material:lafortune-blue-paint", count=2000)
    write(tmp_path / "one", homofact.fit(source, replace(method, quantize=name)).factorization, name)
    again = open_exported(tmp_path / "one")
    levels = {each.grid.levels if each.grid else 0 for each in again.textures}
    assert levels == {2 ** int(name[3:]) - 1}
    write(tmp_path / "two", again, name)
    for texture in (tmp_path / "one").glob("*.png"):
        assert texture.read_bytes() == (tmp_path / "two" / texture.name).read_bytes()
    assert np.allclose(
        values(open_exported(tmp_path / "two")), values(open_exported(tmp_path / "one")), rtol=1e-12, atol=1e-15
    )


def test_whole_texels_name_their_format(tmp_path: Path) -> None:
    assert whole_format(tmp_path) is None
    for name, expected in (("exr", None), ("exr16", None), ("png8", "png8"), ("png16", "png16"), ("dds", None)):
        write(tmp_path / name, CASES["fixed h"], name)
        assert whole_format(tmp_path / name) == expected


def test_one_and_four_channels(tmp_path: Path) -> None:
    for channels in (1, 4):
        fitted = factorization(fixed_projection("h", True), fixed_projection("wi", True), channels=channels)
        for name in ("exr", "png8", "ktx2", "dds"):
            made = write(tmp_path / f"{name}{channels}", fitted, name)
            assert np.array_equal(values(open_exported(tmp_path / f"{name}{channels}")), values(made.stored))


def test_the_shaders_name_their_textures_and_how_they_are_stored(tmp_path: Path) -> None:
    write(tmp_path / "out", CASES["five of all kinds"], "png8")
    for suffix in ("glsl", "hlsl", "wgsl"):
        text = (tmp_path / "out" / f"brdf.{suffix}").read_text()
        assert "Texture 4: texture_4.png, 12 x 9, 8-bit UNORM, not sRGB." in text
    assert "those of texture_0.png, texture_1.png" in (tmp_path / "out" / "brdf.c").read_text()


@pytest.mark.slow
def test_the_shaders_draw_and_the_manifest_says_how_well(tmp_path: Path) -> None:
    fitted = CASES["fixed h"]
    plain = exported(fitted, format_named("exr"))
    assert "sampling" not in write_exported(tmp_path / "plain", plain, {})
    made = replace(plain, sampling=fitted_mixture(fitted))
    description = write_exported(tmp_path / "out", made, {})
    for suffix in ("c", "glsl", "hlsl", "wgsl"):
        text = (tmp_path / "out" / f"brdf.{suffix}").read_text()
        before = (tmp_path / "plain" / f"brdf.{suffix}").read_text()
        assert text.startswith(before)
        for name in ("homofact_sample(", "homofact_density("):
            assert name in text
            assert name not in before
    said = description["sampling"]
    assert made.sampling is not None
    assert description["code"]["sampling"] == ["homofact_sample", "homofact_density"]
    again = restored(said)
    assert torch.equal(again.rows(), made.sampling.rows())
    assert [each["variance"] for each in said["measured"]] == pytest.approx(
        [each.variance for each in noise_at_angles(made.stored, again)]
    )
    assert np.array_equal(values(open_exported(tmp_path / "out")), values(made.stored))


def test_a_result_is_opened_from_its_export_too(tmp_path: Path) -> None:
    made = write(tmp_path / "out", CASES["fixed h"])
    assert np.array_equal(values(homofact.load(str(tmp_path / "out"))), values(made.stored))


def test_more_channels_than_a_texture_has(tmp_path: Path) -> None:
    term = CASES["fixed h"].terms[0]
    five = np.repeat(term.texture.mean(2, keepdims=True), 5, 2)
    transform = type(CASES["fixed h"].transform)(1e-3, torch.ones(5, dtype=torch.float64))
    fitted = Factorization((Term(term.projection, five, term.mask),), transform, tuple("abcde"))
    with pytest.raises(BadInput, match=r"channels: found 5, expected at most the 4 .* `channels='rgb'`"):
        exported(fitted, format_named("exr"))


def test_sizes_that_a_format_cannot_hold() -> None:
    expected = r"texture 0: 12 x 9 texels of 3 channels, expected sides that are multiples of 4 for bc6h"
    with pytest.raises(BadInput, match=expected):
        exported(CASES["fixed h"], format_named("bc6h"))


def test_unknown_formats_are_refused_with_the_list() -> None:
    with pytest.raises(BadInput, match="'tga', expected one of exr, exr16, png8, png16, ktx2, dds, bc6h"):
        format_named("tga")


def test_a_folder_that_is_no_export_is_left_alone(tmp_path: Path) -> None:
    (tmp_path / "photo.jpg").write_bytes(b"")
    with pytest.raises(BadInput, match=r"found photo\.jpg in it and no export"):
        check_new_folder(tmp_path, EXPORT, force=True)
    write(tmp_path / "out", CASES["fixed h"])
    before = {path.name: path.read_bytes() for path in (tmp_path / "out").iterdir()}
    with pytest.raises(BadInput, match="found an existing export, expected a new folder or `force=True`"):
        write(tmp_path / "out", CASES["fixed d"])
    assert {path.name: path.read_bytes() for path in (tmp_path / "out").iterdir()} == before
    write(tmp_path / "out", CASES["fixed d"], force=True)
    assert (tmp_path / "out" / "brdf.glsl").read_bytes() != before["brdf.glsl"]


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Exports of a product and of a sum."""
    folder = tmp_path_factory.mktemp("exports")
    write(folder / "product", CASES["five of all kinds"], "png8")
    write(folder / "sum", separable("in-out", "parabolic", False), "png8")
    return folder


def spoil(whole: Path, to: Path, kind: str, path: tuple[Any, ...], value: Any) -> Path:
    """A copy of an export with one entry of its manifest replaced, or deleted where `value` is ...."""
    shutil.copytree(whole / kind, to)
    manifest = json.loads((to / "manifest.json").read_text())
    at = manifest
    for step in path[:-1]:
        at = at[step]
    if value is ...:
        del at[path[-1]]
    else:
        at[path[-1]] = value
    (to / "manifest.json").write_text(json.dumps(manifest))
    return to


NONSENSE = [
    ("product", ("format",), "homofact dreams", "format: found \"homofact dreams\", expected one of homofact export"),
    ("product", ("format_version",), 2, "format version 2, expected at most 1 (update homofact)"),
    ("product", ("format_version",), "one", "format_version: found \"one\", expected a whole number from 1 to 1"),
    ("product", ("channels",), [], "channels: found [], expected 1 to 4 different texts"),
    ("product", ("channels",), ["R", "R", "B"], "expected 1 to 4 different texts"),
    ("product", ("epsilon",), -1, "epsilon: found -1, expected a finite number above 0"),
    ("product", ("A", "values"), [1, 2], "A.values: found [1, 2], expected 3 finite numbers above 0"),
    ("product", ("A",), ..., "A: found nothing, expected an object"),
    ("product", ("kind",), "quotient", "kind: found \"quotient\", expected one of product, sum of products"),
    ("product", ("texture_format",), "tga", "texture_format: found \"tga\", expected one of exr"),
    ("product", ("textures",), {}, "textures: found {}, expected 1 to 2000 objects"),
    ("product", ("textures", 1, "file"), "none.png", "none.png: no such file, expected a PNG file"),
    ("product", ("textures", 1, "file"), "../x.png", "textures[1].file: found \"../x.png\", expected a file's name"),
    ("product", ("textures", 1, "rows"), 7, "found 12 x 9 texels, expected 12 x 7 as in manifest.json"),
    ("product", ("textures", 1, "rows"), True, "rows: found true, expected a whole number from 1 to 16384"),
    ("product", ("textures", 1, "storage"), "float32", "storage: found \"float32\", expected one of unorm8"),
    ("product", ("textures", 1, "scale", 0), 0, "textures[1].scale: found [0, "),
    ("product", ("textures", 1, "bias", 2), None, "textures[1].bias: found ["),
    ("product", ("textures", 1, "bias", 2), -1e300, "manifest.json make a texel 1e+300, expected at most 1e+30"),
    ("product", ("textures", 1, "scale"), [1e308] * 3, "manifest.json make a texel "),
    ("product", ("terms", 0, "texture"), 5, "terms[0].texture: found 5, expected a whole number from 0 to 4"),
    ("product", ("terms", 0, "mask", 0), "01", "terms[0].mask: found [\"01\""),
    ("product", ("terms", 0, "projection"), 3, "terms[0].projection: found 3, expected an object"),
    ("product", ("terms", 0, "projection", "matrix"), [[1, 0], [0, 1]], "expected 2 rows of 3 finite numbers"),
    ("product", ("terms", 0, "projection", "coordinates"), "polar", "coordinates: found \"polar\", expected one of"),
    ("product", ("terms", 0, "projection", "reciprocal"), 1, "reciprocal: found 1, expected true or false"),
    ("product", ("terms", 0, "projection", "warp"), {"width": 0}, "warp.width: found 0, expected a finite number"),
    ("product", ("terms", 1, "projection", "warp"), {"width": 1}, "expected null on isotropic-in-out"),
    ("product", ("terms", 0, "projection", "rotation", "kind"), "pair", "kind: found \"pair\", expected one of single"),
    ("sum", ("map",), "mercator", "map: found \"mercator\", expected one of parabolic"),
    ("sum", ("parameterization",), "wi", "parameterization: found \"wi\", expected one of in-out, half-diff"),
    ("sum", ("terms", 0, "textures"), [9], "terms[0].textures: found [9], expected one or two numbers from 0 to 3"),
    ("sum", ("terms", 0, "textures"), [0], "terms: found [{"),
    ("sum", ("terms", 1, "textures"), [2, 1.0], "terms[1].textures: found [2, 1.0], expected one or two numbers"),
    ("sum", ("terms", 1, "textures"), [True, 2], "terms[1].textures: found [true, 2], expected one or two numbers"),
    ("sum", ("terms", 0, "signs"), [1, 2, 1], "signs: found [1, 2, 1], expected 1 or -1 a channel"),
    ("sum", ("read",), "all", "read: found \"all\", expected 8 texts of 8 characters 0 and 1"),
]  # fmt: skip


@pytest.mark.parametrize(("kind", "path", "value", "message"), NONSENSE)
def test_manifests_edited_into_nonsense(whole: Path, tmp_path: Path, kind, path, value, message) -> None:
    folder = spoil(whole, tmp_path / "out", kind, path, value)
    with pytest.raises(BadInput) as caught:
        open_exported(folder)
    assert message in str(caught.value)
    assert str(folder) in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("text", ["", "{", "[]", "{}", '{"format": "homofact export"}', "[" * 100_000])
def test_manifests_that_are_none(whole: Path, tmp_path: Path, text: str) -> None:
    shutil.copytree(whole / "product", tmp_path / "out")
    (tmp_path / "out" / "manifest.json").write_text(text)
    with pytest.raises(BadInput, match=r"manifest\.json: "):
        open_exported(tmp_path / "out")


def test_a_folder_without_a_manifest(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match=r"manifest\.json: no such file"):
        open_exported(tmp_path)


def test_textures_that_are_cut_or_of_another_kind(whole: Path, tmp_path: Path) -> None:
    for number, spoilt in enumerate((b"", (whole / "product" / "texture_0.png").read_bytes()[:-60], b"not a picture")):
        folder = tmp_path / str(number)
        shutil.copytree(whole / "product", folder)
        (folder / "texture_0.png").write_bytes(spoilt)
        with pytest.raises(BadInput, match=r"texture_0\.png: "):
            open_exported(folder)


def test_a_signalling_nan_is_a_texel_that_is_not_finite(tmp_path: Path) -> None:
    folder = tmp_path / "out"
    write(folder, CASES["fixed h"], "exr")
    texture = folder / "texture_0.exr"
    size = json.loads((folder / "manifest.json").read_text())["textures"][0]
    texels = np.full((size["rows"], size["columns"], 3), np.uint32(0x7F800001)).view(np.float32)
    write_channels(texture, texels, exr_channel_names(CASES["fixed h"].channels))
    with pytest.raises(BadInput, match=r"texture_0\.exr: a texel is not finite"):
        open_exported(folder)


def test_the_difference_of_logarithms_is_a_root_mean_square() -> None:
    fitted = CASES["fixed h"]

    class Brighter(Derived):
        """Brighter in light from one side alone."""

        def evaluate(self, wi: torch.Tensor, wo: torch.Tensor) -> torch.Tensor:
            return fitted.transform.inverse(fitted.transform.forward(fitted.evaluate(wi, wo)) + (wi[:, :1] > 0) * 0.2)

    assert log_difference(fitted, Brighter(fitted)) == pytest.approx(0.2 / 2**0.5, rel=0.02)
