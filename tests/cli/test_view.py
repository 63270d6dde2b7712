"""`homofact view`: what it finds by itself, what it leaves, what it says where something is missing."""

import json
import re
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from ran import Ran

import homofact
from homofact.cli.main import main
from homofact.evaluation.reopening import NotReopened, reopen, settings_of
from homofact.factor.factorization import Factorization

SMALL = ["material:blinn-phong-50", "--count", "700", "--seed", "3"]
SIZE = ["--size", "6"]
COLE = ["--method", "cole", "--textures", "1", "--restarts", "1", "--search-size", "4", "--search-samples", "200"]
FAST = ["--size", "6", "--textures", "1", "--restarts", "1", "--search-size", "4", "--search-samples", "200"]
SYNTHETIC = Path(__file__).resolve().parents[2] / "data_synthetic" / "synthetic_cornell.brdf"
CUBE = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("results") / "blinn"
    assert main(["factorize", *SMALL, *FAST, "--method", "cole", "--out", str(folder), "-q"]) == 0
    return folder


@pytest.fixture
def result(made: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(made, tmp_path / "blinn"))


def data_of(page: Path) -> Any:
    found = re.search(r'id="data">(.*?)</script>', page.read_text(encoding="utf-8"), re.DOTALL)
    assert found is not None
    return json.loads(found[1])


def numbers(page: Path) -> dict[str, dict[str, str]]:
    return {layer["key"]: dict(layer["facts"]) for layer in data_of(page)["layers"]}


def test_a_page_is_left_with_fit_mccool_and_source(run: Callable[..., Ran], result: Path) -> None:
    ran = run("view", result)
    page = result / "view.html"
    size = len(page.read_bytes())
    assert ran == (0, f"The page: {page} ({size / 1000:.0f} kB): Cole's fit | McCool | Source\n", "")
    assert list(numbers(page)) == ["fit", "mccool", "source"]


def test_its_numbers_are_those_of_the_fit_s_own_report(run: Callable[..., Ran], result: Path) -> None:
    ran = run("view", result, "--json")
    record, report = json.loads(ran.out), json.loads((result / "report.json").read_text())
    assert (ran.code, ran.err) == (0, "")
    assert record["split_known"] is True
    assert record["source"] == "blinn-phong-50"
    for name, theirs in (("fit", report), ("mccool", report["mccool"])):
        for part in ("train", "held_out"):
            for metric, value in theirs["error"][part].items():
                assert record["error"][name][part][metric] == pytest.approx(value, rel=1e-9), (name, part, metric)
    assert record["file_bytes"] == len((result / "view.html").read_bytes())
    shown = numbers(result / "view.html")
    assert shown["fit"]["Log MSE, held out"] == f"{report['error']['held_out']['log_mse']:.3g}"
    assert shown["source"]["Bytes"] == "analytic"
    assert data_of(result / "view.html")["notes"][0].startswith("Errors are on 140 of 700 samples (seed 3)")


@pytest.mark.slow
@pytest.mark.parametrize(
    "options", [[*COLE, "--held-out", "0.4"], [*COLE, "--subset", "300"], ["--method", "mccool"], ["--method", "svd"]]
)
def test_the_split_is_found_again(options: list[str], run: Callable[..., Ran], tmp_path: Path) -> None:
    folder = tmp_path / "o"
    assert run("factorize", SYNTHETIC, *SIZE, *options, "--out", folder, "-q").code == 0
    record = json.loads(run("view", folder, "--source", SYNTHETIC, "--json").out)
    report = json.loads((folder / "report.json").read_text())
    assert record["split_known"] is True
    assert record["error"]["fit"]["held_out"]["log_mse"] == pytest.approx(report["error"]["held_out"]["log_mse"])
    # The fit that is McCool's has nothing beside it.
    assert record["layers"] == (["fit", "source"] if "mccool" in options else ["fit", "mccool", "source"])


def test_a_saved_file_alone_will_do(run: Callable[..., Ran], made: Path, tmp_path: Path) -> None:
    shutil.copy(made / "factorization.npz", tmp_path / "paint.npz")
    assert run("view", tmp_path / "paint.npz", "-q") == (0, "", "")
    assert "Both fits have not seen these samples." in data_of(tmp_path / "paint.html")["notes"][0]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["paint.html", "paint.npz"]


@pytest.mark.slow
def test_a_file_is_found_beside_the_result_or_in_the_working_folder(
    run: Callable[..., Ran], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder, file, elsewhere = tmp_path / "deep" / "o", tmp_path / "deep" / "paint.brdf", tmp_path / "elsewhere"
    file.parent.mkdir()
    elsewhere.mkdir()
    shutil.copy(SYNTHETIC, file)
    assert run("factorize", file, *SIZE, "--method", "mccool", "--out", folder, "-q").code == 0
    assert json.loads(run("view", folder, "--json").out)["source"] == "paint.brdf"
    shutil.move(file, elsewhere)
    ran = run("view", folder, "--json", "--force")
    assert json.loads(ran.out)["source"] is None
    words = "its source, paint.brdf, is neither where it was nor in the working folder nor beside the result"
    assert ran.err.startswith(f"homofact: the page shows the fit alone: {words} (an export keeps")
    assert ran.err.endswith("; --source names it\n")
    shown = data_of(folder / "view.html")
    assert shown["notes"][0].startswith(f"The fit alone: {words}")
    report = json.loads((folder / "report.json").read_text())
    # What was measured when it was fitted is still said.
    assert numbers(folder / "view.html")["fit"]["Log MSE, held out"] == f"{report['error']['held_out']['log_mse']:.3g}"
    assert run("view", folder, "--force", "-q") == (0, "", "")
    monkeypatch.chdir(elsewhere)
    assert json.loads(run("view", folder, "--json", "--force").out)["source"] == "paint.brdf"


@pytest.mark.slow
def test_samples_that_the_fit_has_seen_are_not_called_held_out(run: Callable[..., Ran], tmp_path: Path) -> None:
    fitted = homofact.fit(homofact.read("material:phong-10", count=400), homofact.Cole(size=6, restarts=1))
    fitted.save(tmp_path / "all.npz")
    ran = run("view", tmp_path / "all.npz")
    words = "the fit has, or may have, seen the samples that its errors are on: see the page's notes"
    assert ran.err == f"homofact: {words}\n"
    facts = numbers(tmp_path / "all.html")["fit"]
    assert not any("held out" in name for name in facts)
    assert "Log MSE, of the source" in facts
    note = data_of(tmp_path / "all.html")["notes"][0]
    assert note.startswith("Errors are on 400 of 400 samples (seed 0)")
    assert "Nothing was held out: both fits were made from these samples." in note


@pytest.mark.slow
def test_a_spectral_source_is_shown_as_the_fit_s_rgb_or_its_one_wavelength(
    run: Callable[..., Ran], tmp_path: Path
) -> None:
    for channels, expected in (("rgb", "RGB"), ("luminance", ["Y"])):
        folder = tmp_path / channels
        command = ["factorize", SYNTHETIC, *SIZE, "--method", "mccool", "--channels", channels]
        assert run(*command, "--out", folder, "-q").code == 0
        assert run("view", folder, "--source", SYNTHETIC, "-q").code == 0
        assert list(homofact.load(str(folder)).channels) == list(expected)
    assert "Y shown as grey" in (tmp_path / "luminance" / "view.html").read_text(encoding="utf-8")


def test_a_mesh_is_put_into_the_page(run: Callable[..., Ran], result: Path, tmp_path: Path) -> None:
    (tmp_path / "cube.obj").write_text(CUBE)
    assert json.loads(run("view", result, "--mesh", tmp_path / "cube.obj", "--json").out)["mesh"] == "cube.obj"
    assert data_of(result / "view.html")["mesh"]["name"] == "cube.obj"


def test_a_second_page_needs_force(run: Callable[..., Ran], result: Path) -> None:
    page = result / "view.html"
    page.write_text("mine")
    ran = run("view", result)
    assert ran == (2, "", f"homofact: {page}: found an existing file, expected a new name or --force\n")
    assert page.read_text() == "mine"
    assert run("view", result, "--force", "-q").code == 0
    assert page.read_text(encoding="utf-8").startswith("<!doctype html>")
    assert run("view", result, "--out", result.parent / "new" / "place.html", "-q").code == 0
    assert (result.parent / "new" / "place.html").is_file()


def newer(folder: Path) -> None:
    with np.load(folder / "factorization.npz") as archive:
        data = dict(archive)
    header = json.loads(str(data["header"])) | {"format_version": 99}
    changed: dict[str, Any] = data | {"header": np.array(json.dumps(header))}
    np.savez(folder / "factorization.npz", **changed)


def spectral(folder: Path) -> None:
    """Leaves a fit of two channels."""
    fitted = homofact.load(str(folder)).factorization
    assert isinstance(fitted, Factorization)
    terms = tuple(replace(t, texture=t.texture[..., :2]) for t in fitted.terms)
    transform = replace(fitted.transform, mean=fitted.transform.mean[:2])
    replace(fitted, terms=terms, channels=("450nm", "550nm"), transform=transform).save(folder / "factorization.npz")


BAD: dict[str, tuple[list[str], Callable[[Path], object] | None, str]] = {
    "no result": (["{here}/none"], None, r"none: no such file, expected a saved factorization"),
    "a folder without one": (["{here}"], None, r"found no factorization\.npz in the folder"),
    "a result of a newer version": (["{result}"], newer, r"format version 99, expected at most 1 \(update homofact\)"),
    "a damaged result": (
        ["{result}"], lambda f: (f / "factorization.npz").write_bytes(b"no"), r"not a saved factorization",
    ),
    "two channels": (["{result}"], spectral, r"channels: found 2 \(450nm, 550nm\), expected 1 or RGB to show"),
    "a missing source": (["{result}", "--source", "{here}/none.brdf"], None, r"none\.brdf.*expected"),
    "an unknown material": (["{result}", "--source", "material:phong-11"], None, r"material: found 'phong-11'"),
    "a missing mesh": (["{result}", "--mesh", "{here}/none.obj"], None, r"none\.obj: no such file, expected an OBJ"),
    "no mesh": (["{result}", "--mesh", "{result}/compare.png"], None, r"compare\.png: neither text nor a PLY file"),
    "another ending": (["{result}", "--out", "{here}/a.png"], None, r"a\.png: ends in '\.png', expected \.html"),
    "a folder as the page": (["{result}", "--out", "{result}"], None, r"is a folder, expected a file's name"),
    "a page in a file": (["{result}", "--out", "{result}/compare.png/a.html"], None, r"compare\.png is a file"),
    "nothing": ([], None, r"Missing argument.*RESULT"),
}  # fmt: skip


@pytest.mark.parametrize("name", BAD)
def test_one_line_names_what_is_wrong(name: str, run: Callable[..., Ran], result: Path) -> None:
    arguments, spoil, expected = BAD[name]
    if spoil is not None:
        spoil(result)
    before = {path.name for path in result.iterdir()}
    here = result.parent
    code, out, err = run("view", *(each.format(here=here, result=result) for each in arguments))
    assert (code, out) == (2, "")
    assert re.fullmatch(r"homofact: [^\n]+\n", err), err
    assert re.search(expected, err), err
    assert {path.name for path in result.iterdir()} == before
    assert [path.name for path in here.iterdir()] == ["blinn"]


@pytest.mark.slow
def test_a_source_of_other_channels_is_refused(run: Callable[..., Ran], tmp_path: Path) -> None:
    assert (
        run(
            "factorize", SYNTHETIC, *SIZE, "--method", "mccool", "--channels", "550nm", "--out", tmp_path / "o", "-q"
        ).code
        == 0
    )
    ran = run("view", tmp_path / "o", "--source", "material:phong-10")
    assert ran.code == 2
    assert "expected" in ran.err
    assert run("view", tmp_path / "o", "--source", SYNTHETIC, "-q").code == 0


@pytest.mark.parametrize(
    "content", ["{", "[]", '{"error": 3, "verdict": {"trusted": false, "findings": 7}, "samples": "x"}']
)
def test_a_report_edited_into_nonsense_is_passed_over(content: str, run: Callable[..., Ran], result: Path) -> None:
    (result / "report.json").write_text(content)
    assert run("view", result, "-q") == (0, "", "")


def test_provenance_edited_into_nonsense_is_passed_over(made: Path) -> None:
    fitted = homofact.load(str(made)).factorization
    assert isinstance(fitted, Factorization)
    for provenance in ({}, {"source": 3, "settings": []}, {"source": {"file": 5}, "settings": {"size": "x", "y": 1}}):
        odd = replace(fitted, provenance=provenance)
        with pytest.raises(NotReopened, match=r"^the result does not say what it was made from$"):
            reopen(odd)
        settings = settings_of(odd)
        assert (settings.size, settings.epsilon) == (6, fitted.transform.epsilon)
    assert not reopen(replace(fitted, provenance={"samples": "many"}), "material:blinn-phong-50").known
    # Another fit's A is not this source's.
    mean = fitted.transform.mean * [1, 1, 1.01]
    assert not reopen(replace(fitted, transform=replace(fitted.transform, mean=mean))).known
