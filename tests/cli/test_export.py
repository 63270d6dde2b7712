"""`homofact export` from the command line: what it leaves, what it says, what it refuses."""

import json
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from cube_maps import read_ktx2_cube
from engine_cases import closures_like

import homofact
from homofact.brdf import adaptive
from homofact.brdf.analytic.metallic_roughness import MetallicRoughness
from homofact.cli.main import main
from homofact.containers.exr import write_exr
from homofact.containers.formats import FORMATS
from homofact.exporting.engines import blender, gltf
from homofact.exporting.engines.base import Added, Engine
from homofact.exporting.engines.table import ENGINES
from homofact.exporting.prefiltered import relative_rms, write_sky
from homofact.factor.factorization import Factorization
from homofact.files.archive import write_arrays
from homofact.rendering import split_sum
from homofact.rendering.environment import read_environment
from homofact.rendering.prefilter import LevelTable, Prefiltered
from homofact.rendering.sky_chain import SkyChain, chain_of, own_kernels

MODEL = ["material:lafortune-blue-paint", "--count", "3000"]


@pytest.fixture(scope="module")
def result(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("results") / "paint"
    assert main(["factorize", *MODEL, "--method", "mccool", "--size", "8", "--out", str(out), "-q"]) == 0
    return out


def coarse_table(monkeypatch: pytest.MonkeyPatch) -> None:
    """pbrt's table with few nodes: for tests of what else an export holds."""
    for isotropy in (True, False):
        monkeypatch.setitem(adaptive.SIDE, isotropy, 24)
        monkeypatch.setitem(adaptive.THETAS, isotropy, 8)
    monkeypatch.setattr(adaptive, "_AZIMUTHS", 8)


@pytest.mark.slow
def test_an_export_ends_with_what_to_do_next(result: Path, tmp_path: Path, monkeypatch, capsys) -> None:
    coarse_table(monkeypatch)
    monkeypatch.setattr(blender, "closure_light", closures_like)
    monkeypatch.setenv("COLUMNS", "80")
    last = []
    for engine in ([], ["--engine", "blender"], ["--engine", "pbrt"]):
        to = tmp_path / f"to{len(last)}"
        assert main(["export", str(result), "--out", str(to), *engine]) == 0
        last.append(capsys.readouterr().out.rstrip().split("\n\n")[-1])
    assert last[0].startswith("Call homofact_evaluate(wi, wo)")
    # Words wrap; a place never does.
    assert 2 <= len(last[0].splitlines()) == sum(len(line) <= 80 for line in last[0].splitlines())
    assert last[1] == f"Load it: {tmp_path / 'to1' / 'README.md'} explains how"
    assert (tmp_path / "to1" / "README.md").is_file()
    assert last[2] == f"Render it: pbrt {tmp_path / 'to2' / 'scene.pbrt'}"
    assert (tmp_path / "to2" / "scene.pbrt").is_file()


def errors(text: str) -> dict:
    return json.loads(text)["errors"]


def test_an_export_says_what_storing_cost_and_reads_back(result: Path, tmp_path: Path, capsys) -> None:
    assert main(["export", str(result), "--out", str(tmp_path / "out"), "--format", "png8", "--json"]) == 0
    found = errors(capsys.readouterr().out)
    report = json.loads((result / "report.json").read_text())
    assert found["as fitted"]["held_out"] == pytest.approx(report["error"]["held_out"])
    assert found["as fitted"]["train"] == pytest.approx(report["error"]["train"])
    stored = found["stored as png8"]
    assert stored["held_out"]["log_mse"] != found["as fitted"]["held_out"]["log_mse"]
    assert 1e-4 < stored["log_difference"] < 0.05
    manifest = json.loads((tmp_path / "out" / "manifest.json").read_text())
    assert manifest["errors"] == found
    for each in manifest["sampling"]["measured"]:
        assert each["variance"] < max(0.05, each["cosine"])
    assert "homofact_density(" in (tmp_path / "out" / "brdf.c").read_text()
    assert isinstance(homofact.load(str(tmp_path / "out")).factorization, Factorization)


def sky(path: Path) -> Path:
    """A small lat-long map with a lamp."""
    radiance = np.full((16, 32, 3), 0.5, np.float32)
    radiance[3:5, 20:24] = 20
    write_exr(path, radiance, ("R", "G", "B"))
    return path


@pytest.mark.slow
def test_a_sky_is_filtered_beside_the_material(
    result: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys
) -> None:
    # A rough search for the lobes; how near the search comes is test_split_sum.py's.
    monkeypatch.setattr(split_sum, "_FIRST_STEPS", 12)
    monkeypatch.setattr(split_sum, "_STEPS", 4)
    place, out = sky(tmp_path / "sky.exr"), tmp_path / "out"
    command = ["export", str(result), "--out", str(out), "--format", "png8", "--prefilter", str(place)]
    assert main([*command, "--prefilter-side", "32"]) == 0
    shown = " ".join(capsys.readouterr().out.split())
    chain = "a cube map of 32 texels per side with 3 levels, 0.11 MiB for all materials"
    assert f"Split sum under sky.exr: {chain}" in shown
    assert "and 3072 bytes for this one; the sphere is off by" in shown
    assert "prefiltered.c" in shown
    manifest = json.loads((out / "manifest.json").read_text())
    said = manifest["prefiltered"]
    assert 0 < said["relative_rms"] < 0.1
    assert set(said["files"]) <= {path.name for path in out.iterdir()}
    # PNG holds no light: half floats do.
    table = torch.from_numpy(FORMATS["exr16"].read(out / said["table"]["file"], 4).astype(np.float64))
    levels = read_ktx2_cube(out / said["sky"]["file"])
    assert [each["side"] for each in said["sky"]["levels"]] == [len(level[0]) for level in levels] == [32, 16, 8]
    assert said["sky"]["levels"][-1]["power"] == 1
    assert tuple(table.shape) == (len(said["table"]["rows"]), 64, 4)
    light = tuple(torch.from_numpy(level[..., :3].astype(np.float64)) for level in levels)
    (irradiance,) = read_ktx2_cube(out / said["irradiance_over_pi"]["file"])
    lit = torch.from_numpy(irradiance[..., :3].astype(np.float64))
    kernels, factor = own_kernels(32), said["sky"]["factor"]
    chain = SkyChain(light, lit, torch.zeros(9, 3), factor, "sky", kernels)
    data = Prefiltered(LevelTable(table, said["table"]["across"], factor), chain)
    again = relative_rms(data, homofact.load(str(out)), read_environment(place))
    assert again == pytest.approx(said["relative_rms"], rel=1e-6)
    assert isinstance(homofact.load(str(out)).factorization, Factorization)
    for language, place_of_table in (("hlsl", "register(t3)"), ("wgsl", "@binding(3)"), ("c", "[1536] = {")):
        text = (out / f"prefiltered.{language}").read_text()
        assert "homofact_light_reflected(" in text
        assert place_of_table in text
    # The sky knows nothing of the material: it is the same for all, bit for bit.
    write_sky(tmp_path / "again.ktx2", chain_of(read_environment(place), 32).levels)
    assert (tmp_path / "again.ktx2").read_bytes() == (out / "prefiltered.ktx2").read_bytes()
    # A new export takes away what the old one left, and no sky of its owner's.
    shutil.copy(place, out / "sky.exr")
    assert main(["export", str(result), "--out", str(out), "--force", "-q"]) == 0
    assert not list(out.glob("prefiltered*"))
    assert (out / "sky.exr").exists()


@pytest.mark.slow
def test_solved_texels_are_nearer_than_rounded_ones(result: Path, tmp_path: Path, capsys) -> None:
    assert main(["export", str(result), "--out", str(tmp_path / "out"), "--quantize", "png8", "--json"]) == 0
    found = errors(capsys.readouterr().out)
    assert list(found) == ["as fitted", "each texel rounded", "solved for png8"]
    assert found["solved for png8"]["log_difference"] < 0.95 * found["each texel rounded"]["log_difference"]


@pytest.mark.slow
def test_an_export_of_8_bits_stays_as_it_is(result: Path, tmp_path: Path) -> None:
    first, again, wider = (tmp_path / name for name in ("first", "again", "wider"))
    assert main(["export", str(result), "--out", str(first), "--quantize", "png8", "-q"]) == 0
    assert main(["export", str(first), "--out", str(again), "-q"]) == 0
    assert main(["export", str(first), "--out", str(wider), "--format", "exr16", "-q"]) == 0
    for texture in ("texture_0.png", "texture_1.png"):
        assert (again / texture).read_bytes() == (first / texture).read_bytes()
    assert sorted(path.name for path in wider.glob("texture_*")) == ["texture_0.exr", "texture_1.exr"]


@pytest.mark.slow
def test_an_engine_keeps_8_bits_if_it_reads_them(monkeypatch: pytest.MonkeyPatch, result: Path, tmp_path: Path) -> None:
    assert main(["export", str(result), "--out", str(tmp_path / "first"), "--format", "png8", "-q"]) == 0
    for name, formats, ending in (("reads", ("exr16", "png8"), ".png"), ("reads-not", ("exr16", "exr"), ".exr")):
        monkeypatch.setitem(ENGINES, name, Engine(name, formats, lambda _: Added({"README.md": "Read it."}), "a file"))
        assert main(["export", str(tmp_path / "first"), "--out", str(tmp_path / name), "--engine", name, "-q"]) == 0
        assert (tmp_path / name / f"texture_0{ending}").exists()


@pytest.mark.slow
def test_the_table_and_the_files_are_on_the_screen(result: Path, tmp_path: Path, capsys) -> None:
    assert main(["export", str(result), "--out", str(tmp_path / "out"), "--format", "exr16"]) == 0
    shown = capsys.readouterr().out
    for words in (
        "held out",
        "stored as exr16",
        "fetches",
        "brdf.wgsl",
        "texture_1.exr",
        "bytes of textures in graphics memory",
        "homofact_sample",
    ):
        assert words in shown, words


@pytest.mark.slow
def test_a_file_that_is_gone_leaves_the_difference_alone(result: Path, tmp_path: Path, capsys) -> None:
    fitted = homofact.load(str(result))
    fitted.provenance["source"] = {"file": "gone.brdf"}
    fitted.save(tmp_path / "fit.npz")
    assert main(["export", str(tmp_path / "fit.npz"), "--out", str(tmp_path / "out"), "--json"]) == 0
    streams = capsys.readouterr()
    assert set(errors(streams.out)["as fitted"]) == {"log_difference"}
    assert "gone.brdf, is neither in the working folder nor beside" in streams.err
    refused = ["export", str(tmp_path / "fit.npz"), "--out", str(tmp_path / "two"), "--quantize", "png8"]
    assert main(refused) == 2
    assert "expected the samples to solve on" in capsys.readouterr().err
    assert not (tmp_path / "two").exists()
    assert main([*refused, "--source", "material:lafortune-blue-paint"]) == 0


def test_html_is_the_page_of_view(result: Path, tmp_path: Path, capsys) -> None:
    assert main(["export", str(result), "--out", str(tmp_path), "--format", "html", "-q"]) == 0
    assert (tmp_path / "view.html").read_text(encoding="utf-8").startswith("<!doctype html>")


@pytest.mark.slow
def test_sums_of_products_go_the_same_way(tmp_path: Path, capsys) -> None:
    out = tmp_path / "svd"
    assert main(["factorize", *MODEL, "--method", "svd", "--size", "8", "--out", str(out), "-q"]) == 0
    assert main(["export", str(out), "--out", str(tmp_path / "e"), "--format", "png16", "--json"]) == 0
    assert errors(capsys.readouterr().out)["stored as png16"]["log_difference"] < 0.05
    again, before = homofact.load(str(tmp_path / "e")), homofact.load(str(out))
    source = homofact.read("material:lafortune-blue-paint", count=100)
    pairs = source.samples.wi, source.samples.wo
    assert np.allclose(again.evaluate(*pairs), before.evaluate(*pairs), atol=1e-3)
    assert main(["export", str(out), "--out", str(tmp_path / "q"), "--quantize", "png8", "--json"]) == 0
    assert set(errors(capsys.readouterr().out)) == {"as fitted", "each texel rounded"}


@pytest.mark.parametrize(
    ("more", "message"),
    [
        (["--format", "tga"], "format: found 'tga', expected one of exr, exr16, png8, png16, ktx2, dds, bc6h"),
        (["--quantize", "png4"], "quantize: found 'png4', expected png8 or png16"),
        (["--format", "exr", "--quantize", "png8"], "format: found 'exr' beside quantize png8, expected png8"),
        (["--source", "none.brdf"], "none.brdf: "),
        (["--prefilter", "none.hdr"], "none.hdr: no such file, expected a .hdr or .exr picture"),
        (["--prefilter", __file__], "expected a Radiance .hdr or an OpenEXR file"),
        (
            ["--prefilter", "x.hdr", "--format", "html"],
            "prefilter: found x.hdr with the format html, expected a format of textures",
        ),
        (["--prefilter-side", "64"], "prefilter-side: found it without a sky, expected prefilter"),
        (["--prefilter", "x.hdr", "--prefilter-side", "100"], "100 texels per side, expected a power of two from"),
    ],
)
def test_what_cannot_be_meant_is_refused_and_leaves_nothing(result, tmp_path, capsys, more, message) -> None:
    assert main(["export", str(result), "--out", str(tmp_path / "out"), *more]) == 2
    streams = capsys.readouterr()
    assert message in streams.err
    assert streams.err.count("\n") == 1
    assert not (tmp_path / "out").exists()


def test_the_result_itself_is_no_place_for_its_export(result: Path, capsys) -> None:
    before = {path.name: path.read_bytes() for path in result.iterdir()}
    assert main(["export", str(result), "--out", str(result), "--force"]) == 2
    assert "and no export, expected a new or empty folder" in capsys.readouterr().err
    assert {path.name: path.read_bytes() for path in result.iterdir()} == before


def test_results_of_a_newer_version(result: Path, tmp_path: Path, capsys) -> None:
    shutil.copytree(result, tmp_path / "newer")
    path = tmp_path / "newer" / "factorization.npz"
    with np.load(path) as archive:
        arrays = {name: archive[name] for name in archive.files}
    header = json.loads(str(arrays["header"])) | {"format_version": 99}
    write_arrays(path, arrays | {"header": np.array(json.dumps(header))})
    assert main(["export", str(tmp_path / "newer"), "--out", str(tmp_path / "out")]) == 2
    assert "format version 99, expected at most 1 (update homofact)" in capsys.readouterr().err
    assert main(["export", str(tmp_path / "none"), "--out", str(tmp_path / "out")]) == 2
    assert "no such file" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


@pytest.mark.slow
def test_a_file_is_found_where_the_fit_was_given_it(tmp_path: Path, monkeypatch, capsys) -> None:
    (tmp_path / "far").mkdir()
    shutil.copy(Path(__file__).parents[2] / "data_synthetic" / "synthetic_cornell.brdf", tmp_path / "far" / "p.brdf")
    monkeypatch.chdir(tmp_path)
    fit = ["factorize", "far/p.brdf", "--method", "mccool", "--size", "8", "--out", "results/p", "-q"]
    assert main(fit) == 0
    assert main(["export", "results/p", "--out", "e", "--quantize", "png8", "--json"]) == 0
    assert "held_out" in errors(capsys.readouterr().out)["solved for png8"]


@pytest.mark.slow
def test_an_engine_gets_its_files_and_the_likeness_of_a_look_alike_is_said(
    result: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    look = MetallicRoughness((0.3, 0.4, 0.7), 0.0, 0.65)
    monkeypatch.setattr(gltf, "fit_metallic_roughness", lambda *args, **kwargs: look)
    asked = ["export", str(result), "--out", str(tmp_path / "out"), "--engine", "gltf"]
    assert main([*asked, "--json"]) == 0
    answer = json.loads(capsys.readouterr().out)
    fit, alike = answer["looks"]["fit"], answer["looks"]["look-alike"]
    # Eight texels per side are no better than these few numbers, of a paint that is nearly of their kind.
    assert fit["against"] == alike["against"] == "lafortune-blue-paint"
    assert 25 < fit["appearance"]["psnr_sky"] < 60
    assert 25 < alike["appearance"]["psnr_sky"] < 60
    assert 0 < fit["errors"]["log_mse"] < 1
    assert fit["errors"]["log_difference"] == 0 < alike["errors"]["log_difference"]
    manifest = json.loads((tmp_path / "out" / "manifest.json").read_text())
    assert manifest["errors"]["look-alike"] == alike["errors"]
    assert json.loads((tmp_path / "out" / "engine.json").read_text()) == {
        "engine": "gltf",
        "files": ["README.md", "lookalike.glb"],
    }
    # The same phrase in the report, in the file, in its README and on the terminal.
    said = answer["likeness"]["said"]
    assert said.startswith("look-alike only: ")
    assert f"({said})".encode() in (tmp_path / "out" / "lookalike.glb").read_bytes()
    assert f"**{said}**" in (tmp_path / "out" / "README.md").read_text(encoding="utf-8")
    assert isinstance(homofact.load(str(tmp_path / "out")).factorization, Factorization)
    # Another's file stays; ours, of another engine, goes.
    (tmp_path / "out" / "notes.txt").write_text("mine")
    bad = replace(look, roughness=0.1)
    monkeypatch.setattr(gltf, "fit_metallic_roughness", lambda *args, **kwargs: bad)
    assert main([*asked, "--force"]) == 0
    streams = capsys.readouterr()
    shown = " ".join(streams.out.split())
    assert "look-alike: baseColor (0.300, 0.400, 0.700), metallic 0.000, roughness 0.100; log_mse" in shown
    assert "look-alike only: " in shown
    assert "homofact: the look-alike differs visibly from the fit: " in streams.err
    assert "; --engine three shows the fit itself, and --prefilter SKY writes it" in streams.err
    off = replace(closures_like(look), errors={"a sky": 0.02, "a sun": 0.17})
    monkeypatch.setattr(blender, "closure_light", lambda *args: off)
    assert main([*asked[:-1], "blender", "--force"]) == 0
    streams = capsys.readouterr()
    shown = " ".join(streams.out.split())
    assert f"a sum of 3 closures with tables of {off.closures.nbytes} bytes." in shown
    assert "A sphere under a sky differs from the fit by 2.0% (a sky), 17.0% (a sun), relative RMS" in shown
    assert "the closures hold this material's lobes within 17% only; the Mitsuba plugin shows" in streams.err
    names = {path.name for path in (tmp_path / "out").iterdir()}
    assert {"brdf_blender.py", "notes.txt"} <= names
    # What is said to be in the folder is all that was written to it.
    listed = {word.strip(",") for word in shown.split() if word.strip(",") in names}
    assert listed == names - {"notes.txt"}
    assert "lookalike.glb" not in names


@pytest.mark.slow
def test_pbrt_gets_a_scene_and_the_table_is_compared(
    result: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    coarse_table(monkeypatch)
    assert main(["export", str(result), "--out", str(tmp_path / "out"), "--engine", "pbrt"]) == 0
    shown = " ".join(capsys.readouterr().out.split())
    assert "brdf.bsdf: log_mse" in shown
    assert "manifest.json, scene.pbrt, material.pbrt, brdf.bsdf" in shown
    marked = json.loads((tmp_path / "out" / "engine.json").read_text())
    assert marked == {"engine": "pbrt", "files": ["brdf.bsdf", "material.pbrt", "scene.pbrt"]}
    assert 'NamedMaterial "lafortune-blue-paint"' in (tmp_path / "out" / "scene.pbrt").read_text()
    errors = json.loads((tmp_path / "out" / "manifest.json").read_text())["errors"]
    # Cosine-weighted pairs, few of them at the horizon, where a table of few nodes is off by factors.
    assert 0 < errors["brdf.bsdf"]["log_difference"] < 0.2
    assert isinstance(homofact.load(str(tmp_path / "out")).factorization, Factorization)


def test_engines_refuse_what_they_do_not_take(result: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    asked = ["export", str(result), "--out", str(tmp_path / "out"), "--engine"]
    for more, said in (
        (["unity"], "engine: found 'unity', expected one of three"),
        (["three", "--format", "bc6h"], "format: found 'bc6h' with engine three, expected one of exr16, exr, png8"),
        (["three", "--format", "html"], "engine: found three with the format html, expected a format of textures"),
        (["three", "--quantize", "png16"], "format: found 'png16' with engine three"),
    ):
        assert main([*asked, *more]) == 2
        assert said in " ".join(capsys.readouterr().err.split())
        assert not (tmp_path / "out").exists()
