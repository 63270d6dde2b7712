"""Saved fits of one source beside each other: on the same samples, seen by none or by all, and never of two sources."""

import json
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from refusals import refused

import homofact
from homofact.brdf.formats.csv import write as write_csv
from homofact.cli.main import main
from homofact.evaluation.metrics import measure

SOURCE = "material:phong-10"


@pytest.fixture(scope="module")
def fits(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folders of fits of two sizes, of another split, of another source, and of all samples."""
    place = tmp_path_factory.mktemp("fits")
    for name, source, more in (
        ("small", SOURCE, ["--size", "4"]),
        ("large", SOURCE, ["--size", "8"]),
        ("other split", SOURCE, ["--size", "8", "--seed", "3", "--channels", "rgb"]),
        ("all", SOURCE, ["--size", "8", "--held-out", "0"]),
        ("clay", "material:lafortune-clay", ["--size", "4"]),
    ):
        out = str(place / name)
        assert main(["factorize", source, "--count", "600", "--method", "mccool", *more, "--out", out, "-q"]) == 0
    return place


def test_errors_are_those_of_each_alone(fits: Path) -> None:
    found = homofact.compare_fits([fits / "small", fits / "large"])
    assert (found.source, found.part, list(found.records)) == ("phong-10", "held_out", ["small", "large"])
    for label, record in found.records.items():
        report = json.loads((fits / label / "report.json").read_text())
        assert record["error"]["held_out"]["log_mse"] == pytest.approx(report["error"]["held_out"]["log_mse"])
        assert record["error"]["train"]["mae"] == pytest.approx(report["error"]["train"]["mae"])
        assert record["appearance"]["psnr_sky"] == pytest.approx(report["appearance"]["psnr_sky"])
        assert record["verdict"]["summary"] == report["verdict"]["summary"]
        assert (record["bytes"], record["fetches"]) == (report["bytes"], report["fetches"])


@pytest.mark.parametrize("other", ["all"])
def test_where_some_were_seen_all_samples_count(fits: Path, other: str) -> None:
    found = homofact.compare_fits([fits / "large", fits / other])
    assert found.part == "source"
    assert found.unlike == (other,)
    assert [list(record["error"]) for record in found.records.values()] == [["source"], ["source"]]
    alone = json.loads((fits / other / "report.json").read_text())["error"]["source"]["log_mse"]
    assert found.records[other]["error"]["source"]["log_mse"] == pytest.approx(alone)


def test_an_export_has_the_bytes_that_it_stores_and_the_held_out_samples_of_its_fit(tmp_path: Path) -> None:
    source = tmp_path / "measured" / "paint.csv"
    source.parent.mkdir()
    write_csv(str(source), homofact.read(SOURCE, count=700).samples)
    fit, export = tmp_path / "fit", tmp_path / "exports" / "engine" / "whole"
    homofact.factorize(source, fit, homofact.McCool(size=8))
    homofact.export(fit, export, quantize="png8")
    # The export knows the name of its source alone, and lies elsewhere.
    found = homofact.compare_fits([export, fit])
    assert (found.part, found.unlike) == ("held_out", ())
    assert list(found.records) == ["whole", "fit"]
    assert found.records["fit"]["bytes"] == 3 * found.records["whole"]["bytes"] == found.fits["fit"].nbytes
    other = tmp_path / "exports" / "engine" / "other"
    shutil.copytree(export, other)
    with refused("its source, paint.csv, is neither where it was nor"):
        homofact.compare_fits([export, other])
    with refused("fits: found .*whole twice, expected each once"):
        homofact.compare_fits([export, fit, export])


def test_of_equal_names_the_places_are_the_labels(fits: Path, tmp_path: Path) -> None:
    (tmp_path / "small").symlink_to(fits / "small")
    found = homofact.compare_fits([fits / "small", tmp_path / "small"])
    assert list(found.records) == [str(fits / "small"), str(tmp_path / "small")]


def test_the_picture_has_the_source_and_each_fit(fits: Path, tmp_path: Path, capsys) -> None:
    picture = tmp_path / "two.png"
    assert main(["compare", str(fits / "small"), str(fits / "large"), "--plot", str(picture), "--json"]) == 0
    record = json.loads(capsys.readouterr().out)
    assert [row["label"] for row in record["rows"]] == ["small", "large"]
    assert record["plot"] == str(picture)
    # A source and two pairs of a fit and its difference.
    assert np.asarray(Image.open(picture)).shape[1] == 16 + 5 * (160 + 16)


def test_the_tables_are_those_of_a_comparison(fits: Path, capsys) -> None:
    assert main(["compare", str(fits / "small"), str(fits / "large")]) == 0
    said = capsys.readouterr().out
    report = json.loads((fits / "small" / "report.json").read_text())
    for words in ("held out", "training", "sky dB", str(report["bytes"]), "small: not trusted"):
        assert words in said


def test_fits_that_cannot_be_compared_are_refused(fits: Path, tmp_path: Path, capsys) -> None:
    with refused("clay: found a fit of lafortune-clay, expected one of the samples of phong-10, as small"):
        homofact.compare_fits([fits / "small", fits / "clay"])
    with refused("other split: found a fit of phong-10 read with seed 3, expected .* read with seed 0, as small"):
        homofact.compare_fits([fits / "small", fits / "other split"])
    with refused("fits: found 1, expected two or more"):
        homofact.compare_fits([fits / "small"])
    with refused("two.jpg: ends in '.jpg', expected .png"):
        homofact.compare_fits([fits / "small", fits / "large"], plot=tmp_path / "two.jpg")
    assert main(["compare", str(fits / "small"), str(fits / "large"), "--csv", str(tmp_path / "a.csv")]) == 2
    assert "csv: given beside saved fits" in capsys.readouterr().err
    assert main(["compare", str(fits / "small"), str(fits / "large"), "--seeds", "2"]) == 2
    assert "seeds: given beside saved fits" in capsys.readouterr().err
    assert main(["compare", str(fits / "small"), str(fits / "large"), "--splits", "2"]) == 2
    assert "splits: given beside saved fits" in capsys.readouterr().err
    assert main(["compare", str(fits / "small"), str(fits / "none")]) == 2
    told = capsys.readouterr().err
    assert str(fits / "none") in told
    assert "no such folder" in told
    # Between fits and sources there is nothing to compare.
    assert main(["compare", str(fits / "small"), SOURCE]) == 2
    assert "found the folder of a fit" in capsys.readouterr().err


def test_metrics_are_those_asked_for(fits: Path, capsys) -> None:
    places = [fits / "small", fits / "large"]
    found = homofact.compare_fits(places, metrics=("male", "ciede2000"))
    for label, record in found.records.items():
        assert list(record["metrics"]) == ["male", "ciede2000"]
        alone = homofact.evaluate(fits / label, metrics=("male", "ciede2000")).metrics
        assert record["metrics"] == pytest.approx(alone)
    assert main(["compare", *map(str, places), "--metrics", "male,ciede2000"]) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert "ciede2000" in said
    assert found.conditions[0] in said
    # Of fits that saw different samples, on all of them.
    over_all = homofact.compare_fits([fits / "large", fits / "all"], metrics=("log_mse",)).records["large"]
    assert over_all["metrics"]["log_mse"] == pytest.approx(over_all["error"]["source"]["log_mse"], rel=1e-6)


def test_fits_of_a_source_that_was_read_in_another_way_name_what_differs(tmp_path: Path) -> None:
    for count in (300, 400):
        source = homofact.read("material:phong-10", count=count)
        homofact.factorize(source, tmp_path / str(count), homofact.McCool(size=4))
    with refused("400: found a fit of phong-10 read with count 400, expected .* read with count 300, as 300"):
        homofact.compare_fits([tmp_path / "300", tmp_path / "400"])


def test_fits_are_compared_on_another_measurement(fits: Path, tmp_path: Path, capsys) -> None:
    other = homofact.read("material:phong-10", count=400, seed=9)
    # Fits of different sources too: each is measured on the same samples.
    found = homofact.compare_fits([fits / "small", fits / "large", fits / "clay"], on=other)
    assert (found.source, found.part) == ("phong-10", "source")
    for label, record in found.records.items():
        fit = homofact.load(fits / label).factorization
        alone = measure(fit, other.samples.rotated_at_random(0), fit.transform)
        assert record["error"]["source"]["log_mse"] == pytest.approx(alone.log_mse)
    for name in ("log_mse", "mse"):
        errors = {label: record["error"]["source"][name] for label, record in found.records.items()}
        assert found.best != "clay"
        assert found.ratios["clay"][name].ratio == pytest.approx(errors[found.best] / errors["clay"])
        assert found.ratios["clay"][name].clear
    assert found.record()["best"] == found.best
    assert main(["compare", *(str(fits / name) for name in ("small", "clay")), "--on", SOURCE, "--count", "400"]) == 0
    streams = capsys.readouterr()
    assert "the errors are on all samples of phong-10" in streams.err
    words = " ".join(streams.out.split())
    assert "of small divided by those of clay (in brackets the 95% interval, from 400 samples): log mse 0." in words
    with refused("small: found a fit of the channels R, G, B, expected Y, as "):
        homofact.compare_fits([fits / "small", fits / "large"], on=one_channel(tmp_path))
    assert main(["compare", SOURCE, "--on", SOURCE]) == 2
    assert "on: found it beside sources to fit" in capsys.readouterr().err


def one_channel(folder: Path) -> Path:
    samples = homofact.read("material:phong-10", count=200).samples
    write_csv(folder / "one.csv", replace(samples, values=samples.values[:, :1], channels=("Y",)))
    return folder / "one.csv"
