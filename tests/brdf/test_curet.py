"""CUReT: files of our own writer, held to the layout that the database's page gives, and each way to be wrong."""

import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
import torch
from refusals import refused

from homofact.brdf.formats import curet, open_file
from homofact.brdf.formats import curet as writer
from homofact.brdf.materials import material
from homofact.brdf.samples import Samples
from homofact.brdf.sampling import sample_model


def drawn(name: str = "lafortune-clay", count: int = 205) -> Samples:
    return sample_model(material(name).model, count, "discs", 0)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    writer.write(tmp_path, drawn(), 7)
    return tmp_path


def test_the_layout_is_the_published_one(folder: Path) -> None:
    row = (folder / "rbrdf.dat").read_text().split()
    assert len(row) == 206
    assert row[0] == "7"
    table = [[float(x) for x in line.split()] for line in (folder / "table.txt").read_text().splitlines()]
    assert (len(table), len(table[0])) == (205, 4)
    samples = drawn()
    # theta_v and theta_i are the first and third column: of the viewer, then of the light.
    assert torch.allclose(torch.tensor(table, dtype=torch.float64)[:, 0].cos(), samples.wo[:, 2], atol=1e-12)
    assert torch.allclose(torch.tensor(table, dtype=torch.float64)[:, 2].cos(), samples.wi[:, 2], atol=1e-12)


def test_written_and_read_is_the_same(folder: Path) -> None:
    samples, expected = open_file(folder / "gbrdf.dat").samples, drawn()
    assert torch.equal(samples.values, expected.values)
    assert torch.allclose(samples.wi, expected.wi, atol=1e-12)
    assert torch.allclose(samples.wo, expected.wo, atol=1e-12)
    assert samples.channels == ("R", "G", "B")
    assert not samples.isotropic
    assert samples.provenance["material"] == "sample 7"


def test_the_mean_and_a_colour_alone(folder: Path) -> None:
    assert torch.allclose(open_file(folder / "abrdf.dat").samples.values[:, 0], drawn().values.mean(1), rtol=1e-14)
    (folder / "bbrdf.dat").unlink()
    alone = open_file(folder / "rbrdf.dat").samples
    assert alone.channels == ("R",)
    assert torch.equal(alone.values[:, 0], drawn().values[:, 0])


def test_several_samples_are_picked_by_number(folder: Path) -> None:
    lines = [(folder / "abrdf.dat").read_text()]
    writer.write(folder, drawn("lafortune-skin"), 12)
    (folder / "abrdf.dat").write_text("".join([*lines, (folder / "abrdf.dat").read_text()]))
    assert curet.material_names(folder / "abrdf.dat") == ["7", "12"]
    picked = open_file(f"{folder / 'abrdf.dat'}#12").samples
    assert torch.allclose(picked.values[:, 0], drawn("lafortune-skin").values.mean(1), rtol=1e-14)
    with refused(where="abrdf.dat"):
        open_file(folder / "abrdf.dat")
    with refused(where="abrdf.dat", found="no sample '9'"):
        open_file(f"{folder / 'abrdf.dat'}#9")


def test_negative_values_are_cut_and_counted(folder: Path) -> None:
    row = (folder / "abrdf.dat").read_text().split()
    (folder / "abrdf.dat").write_text(" ".join([*row[:5], "-0.25", *row[6:]]) + "\n")
    samples = open_file(folder / "abrdf.dat").samples
    assert samples.provenance["faults"] == {"negative": 1, "exact_zeros": 0}
    assert float(samples.values[4, 0]) == 0


def edited(name: str, change: Callable[[list[str]], list[str]]) -> Callable[[Path], None]:
    def edit(folder: Path) -> None:
        lines = (folder / name).read_text().splitlines()
        (folder / name).write_text("\n".join(change(lines)) + "\n")

    return edit


WRONG: dict[str, tuple[Callable[[Path], object], str]] = {
    "no table": (lambda folder: (folder / "table.txt").unlink(), "table.txt: no such file"),
    "a short table": (edited("table.txt", lambda lines: lines[:-1]), "table.txt: 204 rows, expected 205"),
    "a column too few": (edited("table.txt", lambda lines: ["1 2 3", *lines[1:]]), "line 1: 3 columns, expected 4"),
    "under the horizon": (edited("table.txt", lambda lines: ["1.7 0 0 0", *lines[1:]]), "line 1: theta_v 1.7"),
    "degrees": (edited("table.txt", lambda lines: [lines[0], "45 0 10 0", *lines[2:]]), "expected radians"),
    "no number": (edited("table.txt", lambda lines: ["nan 0 0 0", *lines[1:]]), "line 1: found 'nan'"),
    "a sample twice": (edited("abrdf.dat", lambda lines: lines * 2), "line 2: sample 7, expected each of 1 to 61"),
    "a last number cut": (
        lambda folder: (folder / "table.txt").write_text((folder / "table.txt").read_text()[:-3]),
        "line 205 has no line end",
    ),
    "a second row cut": (edited("abrdf.dat", lambda lines: [*lines, "8 0.1"]), "line 2: 2 columns, expected 206"),
}


@pytest.mark.parametrize("name", WRONG)
def test_what_is_wrong_is_named(folder: Path, name: str) -> None:
    spoil, message = WRONG[name]
    spoil(folder)
    with refused(re.escape(message)) as caught:
        open_file(folder / "abrdf.dat")
    assert "\n" not in str(caught.value)


def test_colours_that_hold_other_samples_are_refused(folder: Path) -> None:
    row = (folder / "gbrdf.dat").read_text().split()
    (folder / "gbrdf.dat").write_text(" ".join(["8", *row[1:]]) + "\n")
    with refused(where="gbrdf.dat"):
        open_file(folder / "rbrdf.dat")


def test_what_the_format_cannot_hold_is_not_written(tmp_path: Path) -> None:
    with refused(where="CUReT files"):
        writer.write(tmp_path, drawn(count=300).subset(204, 0))
    with refused(where="CUReT files"):
        writer.write(tmp_path, drawn(), 62)
    two = drawn()
    with refused(where="CUReT files"):
        writer.write(tmp_path, replace(two, values=two.values[:, :2], channels=("a", "b")))
    assert list(tmp_path.iterdir()) == []
