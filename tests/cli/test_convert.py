"""`homofact convert`: every ending, what survives, what is refused."""

import json
import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
import torch
from goniometer import steel_rings
from refusals import refused

import homofact
from homofact.brdf.adaptive import tabulated
from homofact.brdf.formats import csv, merl, read_samples, rgl, window_writer
from homofact.brdf.materials import material
from homofact.brdf.quality.faults import light_over_rings
from homofact.brdf.reflectance import Reflectance
from homofact.brdf.samples import Samples
from homofact.brdf.sampling import sample_model
from homofact.brdf.source import open_source
from homofact.cli.main import main
from homofact.errors import Advice

MATERIAL = "material:lafortune-clay"
SYNTHETIC = Path(__file__).resolve().parents[2] / "data_synthetic" / "synthetic_cornell.brdf"


@pytest.mark.parametrize(("ending", "name"), [(".csv", "csv"), (".npz", "npz"), (".dat", "alta")])
def test_samples_survive(tmp_path: Path, ending: str, name: str, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "deep" / f"clay{ending}"
    assert main(["convert", MATERIAL, str(out), "--count", "80", "--seed", "4", "--json"]) == 0
    answer = json.loads(capsys.readouterr().out)
    assert (answer["format"], answer["samples"], answer["out"]) == (name, 80, str(out))
    assert answer["bytes"] == out.stat().st_size
    back = read_samples(out)
    assert back.provenance["format"] == name
    expected = sample_model(material("lafortune-clay").model, 80, "lobe", seed=4)
    assert torch.equal(back.values, expected.values)
    assert torch.allclose((back.wi * back.wo).sum(1), (expected.wi * expected.wo).sum(1), atol=1e-12)
    assert back.isotropic
    # What was noise-free stays so where the format can say it.
    assert open_source(str(out)).default_epsilon == (1e-2 if ending == ".dat" else 1e-5)


def test_a_model_becomes_a_merl_table(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "clay.binary"
    assert main(["convert", MATERIAL, str(out), "--count", "10"]) == 0
    assert f"{out}: merl, 34992012 bytes" in capsys.readouterr().out.replace("\n", "")
    table = open_source(str(out)).reflectance
    samples = sample_model(material("lafortune-clay").model, 500)
    keep = (samples.wi[:, 2] > 0.1) & (samples.wo[:, 2] > 0.1)
    error = (table.evaluate(samples.wi[keep], samples.wo[keep]) / samples.values[keep] - 1).abs()
    assert float(error.median()) < 0.002


def test_a_merl_table_stays_as_it_is(tmp_path: Path) -> None:
    first, second = tmp_path / "first.binary", tmp_path / "second.binary"
    merl.write(first, material("phong-10").model, (6, 8, 16))
    assert main(["convert", str(first), str(second), "-q"]) == 0
    assert first.read_bytes() == second.read_bytes()


def test_a_model_becomes_an_adaptive_table(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "clay.bsdf"
    assert main(["convert", MATERIAL, str(out), "--count", "10", "--json"]) == 0
    answer = json.loads(capsys.readouterr().out)
    assert (answer["format"], answer["samples"], answer["bytes"]) == ("rgl", 32 * 96 * 96, out.stat().st_size)
    assert answer["difference"]["median"] < 0.004
    assert answer["difference"]["quantile_99"] < 0.06
    table = rgl.load(out)
    samples = sample_model(material("lafortune-clay").model, 500)
    keep = (samples.wi[:, 2] > 0.1) & (samples.wo[:, 2] > 0.1)
    error = (table.evaluate(samples.wi[keep], samples.wo[keep]) / samples.values[keep] - 1).abs()
    # Of directions even in the discs more are low ones.
    assert float(error.median()) < 0.01
    assert table.facts["comments"][0] == "converted from lafortune-clay"


@pytest.mark.slow
def test_an_adaptive_table_stays_as_it_is_and_becomes_a_merl_table(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    first, second, table = tmp_path / "first.bsdf", tmp_path / "second.bsdf", tmp_path / "table.binary"
    rgl.write(first, tabulated(material("phong-10").model, True, side=24, thetas=8))
    assert main(["convert", str(first), str(second)]) == 0
    assert "the source's own table, every number as it was" in " ".join(capsys.readouterr().out.split())
    before, after = rgl.load(first), rgl.load(second)
    for name in ("ndf", "sigma", "vndf", "table", "theta_i"):
        assert torch.equal(getattr(before, name), getattr(after, name))
    assert main(["convert", str(first), str(table), "-q"]) == 0
    pairs = sample_model(material("phong-10").model, 300)
    wi, wo = pairs.wi, pairs.wo
    keep = (wi[:, 2] > 0.2) & (wo[:, 2] > 0.2)
    found, wanted = merl.load(table).evaluate(wi[keep], wo[keep]), before.evaluate(wi[keep], wo[keep])
    assert float((found / wanted - 1).abs().median()) < 0.01


@pytest.mark.slow
def test_a_fit_is_a_source_too(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    fit = homofact.fit(homofact.read(MATERIAL, count=2000), homofact.McCool(projections=("theta_h", "theta_d"), size=8))
    fit.save(tmp_path / "fit.npz")
    (tmp_path / "result").mkdir()
    fit.save(tmp_path / "result" / "factorization.npz")
    for name in ("fit.npz", "result"):
        out = tmp_path / f"{name}.csv"
        assert main(["convert", str(tmp_path / name), str(out), "--count", "50", "-q"]) == 0
        back = read_samples(out)
        assert back.isotropic
        assert torch.allclose(back.values, fit.evaluate(back.wi, back.wo), rtol=1e-9)
    assert main(["convert", str(tmp_path / "fit.npz"), str(tmp_path / "fit.bsdf"), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["difference"]["median"] < 0.01
    refused = (["--channels", "luminance"], ["--calibrate", "rings"])
    for more, said in zip(refused, ("channels: found it with a fit", "with a fit"), strict=True):
        assert main(["convert", str(tmp_path / "fit.npz"), str(tmp_path / "no.bsdf"), *more]) == 2
        assert said in " ".join(capsys.readouterr().err.split())
    (tmp_path / "empty").mkdir()
    assert main(["convert", str(tmp_path / "empty"), str(tmp_path / "no.bsdf")]) == 2
    assert "found no factorization.npz in the folder" in " ".join(capsys.readouterr().err.split())
    assert not (tmp_path / "no.bsdf").exists()


def test_weights_are_kept_in_csv_and_their_loss_is_said(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    table = tmp_path / "table.binary"
    merl.write(table, material("phong-10").model, (6, 8, 16))
    assert main(["convert", str(table), str(tmp_path / "a.csv")]) == 0
    assert "weights are not kept" not in capsys.readouterr().out
    assert torch.equal(read_samples(tmp_path / "a.csv").weights, read_samples(table).weights)
    assert main(["convert", str(table), str(tmp_path / "a.dat")]) == 0
    assert "weights are not kept" in capsys.readouterr().out


def test_a_spectral_measurement(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "paint.csv"
    assert main(["convert", str(SYNTHETIC), str(out), "--channels", "spectral", "-q"]) == 0
    assert capsys.readouterr().out == ""
    back, first = (read_samples(path, "spectral") for path in (out, SYNTHETIC))
    assert torch.equal(back.values, first.values)
    assert back.channels == first.channels
    assert back.provenance["comments"][0] == "converted from synthetic_cornell.brdf"


def test_an_existing_file_wants_force(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "clay.csv"
    out.write_text("mine")
    arguments = ["convert", MATERIAL, str(out), "--count", "10"]
    assert main(arguments) == 2
    assert "exists already, expected a new file or --force" in capsys.readouterr().err
    assert out.read_text() == "mine"
    assert main([*arguments, "--force"]) == 0
    assert len(read_samples(out)) == 10


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        ([MATERIAL, "{here}/a.txt"], r"a.txt: ends in '.txt', expected .binary or .bsdf or .csv or .npz or .dat"),
        ([MATERIAL, "{here}/a"], "a: ends in nothing, expected .binary"),
        ([MATERIAL, "{here}"], "is a folder, expected a file's name"),
        ([MATERIAL, "/proc/homofact/a.csv"], "cannot be written"),
        (["{here}/none.brdf", "{here}/a.csv"], "none.brdf: no such file"),
        (["material:clay", "{here}/a.csv"], "material: found 'clay'"),
        ([MATERIAL], "Missing argument 'OUT'"),
    ],
)
def test_one_line_names_what_is_wrong(
    arguments: list[str], expected: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["convert", *(each.format(here=tmp_path) for each in arguments)]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert expected in err
    assert err.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


def test_anisotropy_that_a_table_cannot_hold_is_said(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "brushed.csv"
    csv.write(path, sample_model(material("ward-brushed").model, 40))
    whole = merl.write

    def small(target: Path, source: Reflectance | Samples) -> dict[str, int]:
        return whole(target, source, (4, 4, 8))

    monkeypatch.setattr(merl, "write", small)
    assert main(["convert", str(path), str(tmp_path / "out.binary")]) == 0
    shown = " ".join(capsys.readouterr().out.split())
    assert "an anisotropic source: the table holds the cut" in shown
    assert "bins between and beyond the samples are interpolated" in shown


def test_conventions_are_undone(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with_cosine, out = tmp_path / "cosine.csv", tmp_path / "clean.csv"
    samples = sample_model(material("phong-30").model, 600, "discs", seed=1)
    csv.write(with_cosine, replace(samples, values=samples.values * samples.wo[:, 2:]))
    assert main(["info", str(with_cosine), "--json"]) == 0
    suspected = json.loads(capsys.readouterr().out)["suspected"]
    assert (suspected[0]["name"], suspected[0]["words"]) == ("cosine-o", "the values hold cosθo")
    assert suspected[0]["remedy"] == str(Advice("undo", "cosine-o", of="convert"))
    assert main(["convert", str(with_cosine), str(out), "--undo", "cosine-o", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["undone"] == ["cosine-o"]
    back = read_samples(out)
    assert torch.allclose(back.values, samples.values, rtol=1e-12)
    refused = (
        ("a.csv", "cosine", "undo: found 'cosine', expected some of"),
        ("a.binary", "pi", "undo: found it with"),
        ("a.bsdf", "pi", "undo: found it with"),
    )
    for target, names, words in refused:
        assert main(["convert", str(with_cosine), str(tmp_path / target), "--undo", names]) == 2
        assert words in capsys.readouterr().err.replace("\n", " ")
        assert not (tmp_path / target).exists()


@pytest.mark.parametrize(
    ("name", "more", "form", "read"),
    [
        ("clay.xml", [], "klems", "window"),
        pytest.param("clay.xml", ["--form", "tree"], "tree", "window", marks=pytest.mark.slow),
        ("clay.bsdf", ["--form", "zemax"], "zemax", "zemax"),
        pytest.param("clay.brdf", [], "speos", "speos", marks=pytest.mark.slow),
        ("clay.anisotropicbsdf", [], "speos", "speos"),
    ],
)
def test_formats_of_lighting_and_optics(
    tmp_path: Path, name: str, more: list[str], form: str, read: str, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / name
    assert main(["convert", MATERIAL, str(out), "--count", "10", "--json", *more]) == 0
    answer = json.loads(capsys.readouterr().out)
    assert (answer["format"], answer["bytes"]) == (form, out.stat().st_size)
    source = open_source(str(out))
    assert source.samples.provenance["format"] == read
    assert source.samples.isotropic
    if form == "klems":
        assert any("145 x 145 bands" in note for note in answer["notes"])
    else:
        assert answer["difference"]["median"] < 0.005
    samples = sample_model(material("lafortune-clay").model, 300, "cosine")
    error = (source.reflectance.evaluate(samples.wi, samples.wo).mean(1) / samples.values.mean(1) - 1).abs()
    assert float(error.median()) < (0.05 if form == "klems" else 0.01)


def test_a_format_that_an_ending_has_not_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["convert", MATERIAL, str(tmp_path / "a.bsdf"), "--form", "speos"]) == 2
    assert "form: found 'speos' with a.bsdf, expected one of rgl, zemax" in capsys.readouterr().err
    assert main(["convert", "material:ward-brushed", str(tmp_path / "a.brdf"), "--count", "10"]) == 2
    said = capsys.readouterr().err
    assert "an anisotropic material, expected an ending .anisotropicbsdf" in said
    assert list(tmp_path.iterdir()) == []


class _Unasked:
    """A reflectance of channels that are no colour, which must not be evaluated before that is told."""

    channels = ("a", "b")
    isotropic = True

    def evaluate(self, wi: torch.Tensor, wo: torch.Tensor) -> torch.Tensor:
        raise AssertionError("evaluated for minutes before it is refused")


@pytest.mark.parametrize("write", [window_writer.write_klems, window_writer.write_tree])
def test_channels_that_are_no_colour_are_refused_first(write: Callable[..., object], tmp_path: Path) -> None:
    with refused("channels a, b, expected R, G, B"):
        write(tmp_path / "out.xml", _Unasked(), True, "two")
    assert not list(tmp_path.iterdir())


def test_parts_done_are_told_and_rise(tmp_path: Path) -> None:
    parts: list[tuple[int, int]] = []
    model = material("phong-30").model
    window_writer.write_klems(tmp_path / "out.xml", model, True, "phong", progress=lambda *at: parts.append(at))
    shares = [done / whole for done, whole in parts]
    assert shares == sorted(shares)
    assert shares[0] == 0
    assert 0.5 <= shares[-1] < 1


@pytest.mark.slow
@pytest.mark.parametrize("even", [True, False])
def test_the_light_between_samples_is_told(even: bool, tmp_path: Path) -> None:
    samples = steel_rings(steps=(5, 15))
    samples = replace(samples, values=torch.full_like(samples.values, 0.1) if even else samples.values)
    found = homofact.convert(samples, tmp_path / "steel.bsdf")
    rows = dict(light_over_rings(samples, homofact.read(samples).reflectance))
    worst = max(rows, key=lambda angle: abs(math.log(rows[angle])))
    (note,) = [note for note in found.notes if note.startswith("between and beyond the samples")]
    assert f"at {worst:g}° incidence they have {rows[worst]:.0%} of the light of the samples" in note
    assert note.endswith("convert a fit of the samples") is not even
