"""Speos files: percentages and scales, wavelengths, rotations, each way a file can be wrong."""

import math
from pathlib import Path

import pytest
import torch
from lighting_files import INCIDENCES, PERCENTS, anisotropic, pabopto, speos, speos_table
from refusals import refused

from homofact.brdf.formats import open_file, read_samples, speos_writer
from homofact.brdf.incidences import IncidenceTables, reflected
from homofact.brdf.materials import material
from homofact.brdf.reflectance import innermost
from homofact.geometry.directions import draw_cosine_weighted, from_spherical, to_spherical


def file_of(folder: Path, text: str) -> Path:
    path = folder / "coating.brdf"
    path.write_text(text)
    return path


def tables_of(path: Path | str, channels: str = "spectral") -> IncidenceTables:
    found = innermost(open_file(path, channels).reflectance)  # pyright: ignore[reportArgumentType]
    assert isinstance(found, IncidenceTables)
    return found


def test_each_table_reflects_its_percentage(tmp_path: Path) -> None:
    path = file_of(tmp_path, speos())
    tables = tables_of(path)
    assert tables.channels == ("450nm", "550nm", "650nm")
    for table in tables.tables[0]:
        assert reflected(table).tolist() == pytest.approx([percent / 100 for percent in PERCENTS], rel=1e-9)
    facts = open_file(path).samples.provenance
    assert facts["reflected_percent"] == [list(PERCENTS)] * 2
    # ∫ 0.7 (1 + cosθ) cosθ dω over straight lines between 0, 30 and 90 degrees.
    assert facts["tables_percent"][0][0] == pytest.approx(350, rel=0.03)


def test_the_numbers_themselves_on_request(tmp_path: Path) -> None:
    tables = tables_of(f"{file_of(tmp_path, speos())}#table")
    assert float(tables.tables[0][0].values[0, 0, 0]) == pytest.approx(1.4)


def test_values_of_intensity_are_divided_by_the_cosine(tmp_path: Path) -> None:
    tables = tables_of(f"{file_of(tmp_path, speos(kind='0'))}#table")
    column = tables.tables[0][0].values[:, 0, 0].tolist()
    # At the horizon the value of the last ring that has a cosine stands.
    ring = 0.7 * (1 + math.cos(math.radians(30))) / math.cos(math.radians(30))
    assert column == pytest.approx([1.4, ring, ring], rel=1e-5)


def test_the_mirror_direction_is_at_azimuth_0(tmp_path: Path) -> None:
    bright = speos_table(0.7).replace("30\t1.30622\t", "30\t9\t", 1)
    text = speos().replace(speos_table(0.7), bright)
    samples = read_samples(f"{file_of(tmp_path, text)}#table", "spectral")
    at = int(samples.values[:, 0].argmax())
    assert float(samples.values[at, 0]) == pytest.approx(9)
    opposite = (samples.wi[at, :2] * samples.wo[at, :2]).sum()
    assert float(opposite) < 0 or float(samples.wi[at, 2]) == pytest.approx(1)
    assert samples.isotropic


def test_transmission_beside_reflection_is_passed_over(tmp_path: Path) -> None:
    through = speos_table(0.1).replace("\n0\t", "\n90\t").replace("\n30\t", "\n120\t")
    through = through.replace("\n90\t0.1\t", "\n180\t0.1\t")
    text = speos("1\t1").removesuffix("End of file") + f"5\n{through}" * 6 + "End of file"
    both = tables_of(file_of(tmp_path, text))
    assert torch.equal(both.tables[0][1].values, tables_of(file_of(tmp_path, speos())).tables[0][1].values)


def test_rotations_share_the_scale_of_the_spectrums_incidence(tmp_path: Path) -> None:
    tables = tables_of(file_of(tmp_path, anisotropic()))
    assert not tables.isotropic
    assert reflected(tables.tables[0][0]).tolist() == pytest.approx([0.2, 0.4, 0.6])
    # Its tables are twice as high.
    assert reflected(tables.tables[1][0]).tolist() == pytest.approx([0.4, 0.8, 1.2])
    assert [round(math.degrees(row[0].turn)) for row in tables.tables] == [0, 90]
    assert [round(math.degrees(table.theta_i)) for table in tables.tables[0]] == list(INCIDENCES)


def test_a_flat_spectrum_is_grey(tmp_path: Path) -> None:
    samples = read_samples(file_of(tmp_path, anisotropic(percents=(30, 30, 30))))
    assert samples.channels == ("Y",)
    assert read_samples(file_of(tmp_path, anisotropic())).channels == ("R", "G", "B")


@pytest.mark.slow
@pytest.mark.parametrize(("name", "ending"), [("lafortune-blue-paint", "brdf"), ("ward-brushed", "anisotropicbsdf")])
def test_write_then_read(tmp_path: Path, name: str, ending: str) -> None:
    model = material(name).model
    path = tmp_path / f"out.{ending}"
    write = speos_writer.write_brdf if ending == "brdf" else speos_writer.write_anisotropic
    write(path, model, model.isotropic, ("a comment",))
    reading = open_file(path)
    assert reading.samples.provenance["comments"][0] == "a comment"
    assert reading.samples.isotropic == model.isotropic
    wi, wo = draw_cosine_weighted(500, torch.Generator().manual_seed(0))
    assert reading.reflectance is not None
    found, wanted = reading.reflectance.evaluate(wi, wo), model.evaluate(wi, wo)
    # The brushed metal is grey, and so is its file.
    wanted = wanted if found.shape[1] == 3 else wanted.mean(1, keepdim=True)
    assert float((found / wanted - 1).abs().median()) < 2e-3
    theta, phi = to_spherical(wi)
    again = reading.reflectance.evaluate(from_spherical(theta, phi), wo)
    assert torch.allclose(again, found)


def test_an_anisotropic_material_has_no_brdf(tmp_path: Path) -> None:
    with refused(found="an anisotropic material", where="out.brdf"):
        speos_writer.write_brdf(tmp_path / "out.brdf", material("ward-brushed").model, False)


WRONG = {
    "binary": (speos(mode="1"), "line 2: binary mode, expected text mode"),
    "old": (speos(version="v5.0"), "line 1: version 5, expected 7 or later"),
    "transmission": (speos("0\t1"), "line 6: transmission alone, expected reflection"),
    "nothing": (speos("0\t0"), "neither reflection nor transmission"),
    "flags": (speos("1\t2"), "'1 2', expected 2 of 0 and 1"),
    "incidences": (speos().replace("\n0\t40\n", "\n40\t0\n"), "incidences 40, 0, expected rising angles"),
    "under": (speos().replace("\n0\t40\n", "\n0\t95\n"), "incidences 0, 95"),
    "count": (speos().replace("\n2\t3\n", "\n3\t3\n"), "5 numbers, expected 3: incidences"),
    "columns": (speos().replace("3\t5\n", "3\t4\n", 1), "5 numbers, expected 4: phi"),
    "theta": (speos().replace("\n30\t", "\n99\t", 1), "angles of a table that do not rise"),
    "percent": (speos().replace("\n20\n", "\n-20\n", 1), "a table that reflects -20%"),
    "black": (speos().replace(speos_table(0.7), speos_table(0)), "a table of zeros that reflects"),
    "grids": (speos().replace("\n30\t", "\n31\t", 1), "tables of an incidence with different angles"),
    "reflection below": (speos().replace("\n90\t", "\n120\t"), "theta up to 120 in reflection"),
    "word": (speos().replace("\n30\t1.30622", "\n30\tx", 1), "found 'x', expected a finite number"),
    "cut": (speos()[:-60], "expected"),
    "end": (speos().replace("End of file", "End"), "'End' after the last table"),
    "more": (speos().replace("End of file", "20\nEnd of file"), "'20' after the last table"),
    "spectrum": (anisotropic().replace("550\t", "400\t"), "wavelengths that do not rise"),
    "below zero": (anisotropic().replace("550\t40", "550\t-40"), "a percentage below 0"),
    "colour": (speos().replace("450\t550\t650", "500\t550\t600"), "nm"),
}


@pytest.mark.parametrize("text", WRONG.values(), ids=list(WRONG))
def test_what_is_wrong_is_said(tmp_path: Path, text: tuple[str, str]) -> None:
    content, said = text
    with refused(said) as caught:
        read_samples(file_of(tmp_path, content))
    assert "coating.brdf" in str(caught.value)


def test_another_reading_is_refused(tmp_path: Path) -> None:
    with refused(found="no reading #back"):
        read_samples(f"{file_of(tmp_path, speos())}#back")


def test_other_text_is_not_its_own(tmp_path: Path) -> None:
    assert read_samples(file_of(tmp_path, pabopto())).provenance["format"] == "pabopto"
