"""Zemax files: where the angles lie, totals, colours, each way a file can be wrong."""

import math
from pathlib import Path

import pytest
import torch
from lighting_files import INCIDENCES, RADIALS, zemax
from refusals import refused
from slow_cases import slow_among

from homofact.brdf.formats import open_file, read_samples
from homofact.brdf.formats import zemax as format_
from homofact.brdf.materials import material
from homofact.brdf.tristimulus import from_xyz
from homofact.geometry.directions import draw_cosine_weighted, from_spherical, to_spherical


def file_of(folder: Path, text: str) -> Path:
    path = folder / "coating.bsdf"
    path.write_text(text)
    return path


def test_angles_are_about_the_mirror_direction(tmp_path: Path) -> None:
    reading = open_file(file_of(tmp_path, zemax()))
    samples = reading.samples
    assert (samples.channels, samples.isotropic) == (("Y",), True)
    own = (to_spherical(samples.wi)[0].rad2deg() - 40).abs() < 1e-6
    mirror = from_spherical(torch.tensor(math.radians(40)), torch.tensor(math.pi)).double()
    away = torch.acos((samples.wo[own] @ mirror).clamp(-1, 1)).rad2deg()
    assert sorted({round(float(x)) for x in away}) == list(RADIALS)
    # Azimuth 0 is towards the normal, 180 towards the horizon: 40 + 60 degrees are under it.
    value = {round(float(v), 6): w for v, w in zip(samples.values[own, 0], samples.wo[own], strict=True)}
    assert float(to_spherical(value[0.4 - 0.02])[0].rad2deg()) == pytest.approx(30)
    assert 0.4 - 0.12 + 0.02 not in value
    assert float(reading.reflectance.evaluate(samples.wi[own][:1], mirror[None])) == pytest.approx(0.4)  # pyright: ignore[reportOptionalMemberAccess]


def test_values_are_taken_as_they_are_or_scaled_to_the_total(tmp_path: Path) -> None:
    path = file_of(tmp_path, zemax())
    own, scaled = read_samples(path), read_samples(f"{path}#total")
    facts = own.provenance
    assert facts["units"] == "1/sr, no cosine"
    assert [each[0] for each in facts["tis"][0]] == [0.2, 0.3]
    for k, theta in enumerate(INCIDENCES):
        at = (to_spherical(own.wi)[0].rad2deg() - theta).abs() < 1e-6
        ratio = scaled.values[at] / own.values[at]
        assert torch.allclose(ratio, ratio[:1])
        assert float(ratio[0]) == pytest.approx(facts["tis"][0][k][0] / facts["tables_reflect"][0][k][0], rel=1e-4)
    assert any("its TIS and its tables differ by up to" in text for text in facts["comments"])


def test_xyz_become_colours(tmp_path: Path) -> None:
    grey = read_samples(file_of(tmp_path, zemax()))
    colour = read_samples(file_of(tmp_path, zemax("XYZ")))
    assert colour.channels == ("R", "G", "B")
    wanted = from_xyz(grey.values * torch.tensor([0.9, 1.0, 0.8], dtype=torch.float64))
    assert torch.allclose(colour.values, wanted, atol=2e-6)


@pytest.mark.parametrize("name", slow_among(["lafortune-blue-paint", "ward-brushed"], "ward-brushed"))
def test_write_then_read(tmp_path: Path, name: str) -> None:
    model = material(name).model
    format_.write(tmp_path / "out.bsdf", model, model.isotropic, ("a comment",))
    reading = open_file(tmp_path / "out.bsdf")
    assert reading.samples.isotropic == model.isotropic
    assert reading.samples.provenance["comments"][0] == "a comment"
    inner = (reading.samples.wo[:, 2] > 1e-3) & (reading.samples.wi[:, 2] > 1e-3)
    wanted = model.evaluate(reading.samples.wi[inner], reading.samples.wo[inner])
    assert float((reading.samples.values[inner] / wanted - 1).abs().max()) < 1e-3
    wi, wo = draw_cosine_weighted(500, torch.Generator().manual_seed(0))
    assert reading.reflectance is not None
    error = (reading.reflectance.evaluate(wi, wo) / model.evaluate(wi, wo) - 1).abs()
    assert float(error.median()) < 2e-3


WRONG = {
    "transmission": (zemax(kind="BTDF"), "line 5: transmission (BTDF), expected BRDF"),
    "symmetry": (zemax(symmetry="Round"), "Symmetry is 'Round', expected one of"),
    "a turn": (zemax(symmetry="Asymmetrical"), "Asymmetrical with azimuths over 180 degrees"),
    "count": (zemax().replace("ScatterRadial  3", "ScatterRadial  4"), "found 'Monochrome', expected a finite number"),
    "fewer rows": (zemax().replace("h  3\n0\t90\t180", "h  2\n0\t180"), "'0.3', expected TIS and a number"),
    "falling": (zemax().replace("0\t10\t60", "0\t60\t10"), "ScatterRadial 0, 60, 10, expected rising"),
    "twice": (zemax().replace("Source  Measured", "Symmetry  Asymmetrical"), "Symmetry for the second time"),
    "missing": (zemax().replace("ScatterType  BRDF\n", ""), "data before ScatterType"),
    "no block": (zemax("XYZ").replace("TristimulusY", "TristimulusW"), "'TristimulusW', expected TristimulusY"),
    "no DataBegin": (zemax().replace("DataBegin", "Data"), "no DataBegin"),
    "TIS": (zemax().replace("TIS 0.3", "TIS x"), "TIS is 'x'"),
    "no TIS": (zemax().replace("TIS 0.3", "TOS 0.3"), "'TOS', expected TIS and a number"),
    "word": (zemax().replace("0.28", "a"), "found 'a', expected a finite number"),
    "cut": (zemax()[:-30], "expected"),
    "more": (zemax() + "\n1 2 3\n", "lines after DataEnd (1)"),
    "end": (zemax().replace("DataEnd", "0 0 0\nDataEnd"), "more rows than the header counts"),
}


@pytest.mark.parametrize("text", WRONG.values(), ids=list(WRONG))
def test_what_is_wrong_is_said(tmp_path: Path, text: tuple[str, str]) -> None:
    content, said = text
    with refused(said.replace("(", r"\(").replace(")", r"\)")) as caught:
        read_samples(file_of(tmp_path, content))
    assert "coating.bsdf" in str(caught.value)


def test_another_reading_is_refused(tmp_path: Path) -> None:
    with refused(found="no reading #back"):
        read_samples(f"{file_of(tmp_path, zemax())}#back")
