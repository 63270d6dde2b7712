"""pab-opto tables: directions, cosines, sides, tables that belong together, each way a file can be wrong."""

import math
from pathlib import Path

import pytest
import torch
from lighting_files import pabopto
from refusals import refused

from homofact.brdf.formats import read_samples
from homofact.brdf.tristimulus import from_xyz
from homofact.geometry.directions import to_spherical


def file_of(folder: Path, text: str, name: str = "scan.txt") -> Path:
    path = folder / name
    path.write_text(text)
    return path


def test_directions_and_values(tmp_path: Path) -> None:
    samples = read_samples(file_of(tmp_path, pabopto()))
    assert (samples.channels, samples.isotropic) == (("Y",), True)
    assert [float(x[0].rad2deg()) for x in to_spherical(samples.wi)] == pytest.approx([30, 180])
    # The second row is at theta 0, the fifth at (15, 90).
    assert [float(x[4].rad2deg()) for x in to_spherical(samples.wo)] == pytest.approx([15, 90])
    assert float(samples.values[4, 0]) == pytest.approx(0.1 + 0.15 + 0.09)


def test_up_becomes_90_degrees(tmp_path: Path) -> None:
    samples = read_samples(file_of(tmp_path, pabopto().replace("#upphi 90", "#upphi 0")))
    assert float(to_spherical(samples.wi)[1][0].rad2deg()) == pytest.approx(-90)
    assert abs(float(to_spherical(samples.wo)[1][4].rad2deg())) == pytest.approx(180)
    assert float(to_spherical(samples.wo)[1][3].rad2deg()) == pytest.approx(90)


def test_the_cosine_is_divided_out(tmp_path: Path) -> None:
    plain, cosine = (read_samples(file_of(tmp_path, pabopto(kind=kind))) for kind in ("BSDF", "DSF"))
    assert torch.allclose(cosine.values, plain.values / plain.wo[:, 2:])
    assert cosine.provenance["units"].endswith("cosine of the view divided out")


def test_the_back_is_seen_from_the_back(tmp_path: Path) -> None:
    text = "#format: theta phi BSDF\n#incident_angle 150 0\n#upphi 90\n100 0 0.5\n20 10 9\n150 90 0.25\n"
    samples = read_samples(file_of(tmp_path, text))
    assert samples.provenance["side"] == "back"
    assert samples.provenance["faults"]["transmitted"] == 1
    # Right in front is left behind; up stays up.
    assert [float(x[0].rad2deg()) for x in to_spherical(samples.wi)] == pytest.approx([30, 180])
    assert samples.wo[1].tolist() == pytest.approx([0, 0.5, math.cos(math.radians(30))])


def test_tables_of_a_sample_belong_together(tmp_path: Path) -> None:
    for theta in (0, 30, 60):
        file_of(tmp_path, pabopto(theta, name="cloth"), f"cloth_{theta}.txt")
    file_of(tmp_path, pabopto(45, name="other"), "other.txt")
    file_of(tmp_path, pabopto(45, kind="DSF", name="cloth"), "with_cosine.txt")
    (tmp_path / "notes.txt").write_text("not a table\n")
    samples = read_samples(tmp_path / "cloth_30.txt")
    lights = to_spherical(samples.wi)[0].rad2deg().round().unique().tolist()
    assert lights == [0, 30, 60]
    assert samples.provenance["files"] == ["cloth_0.txt", "cloth_30.txt", "cloth_60.txt"]
    assert samples.isotropic
    # Without a name it is alone.
    alone = read_samples(file_of(tmp_path, pabopto(30), "alone.txt"))
    assert len(alone) == 18


def test_one_file_of_several_tables(tmp_path: Path) -> None:
    samples = read_samples(file_of(tmp_path, pabopto(10) + pabopto(50, 90)))
    assert to_spherical(samples.wi)[0].rad2deg().round().unique().tolist() == [10, 50]
    assert not samples.isotropic


def test_light_on_both_sides_needs_a_name(tmp_path: Path) -> None:
    back = "#format: theta phi BSDF\n#incident_angle 150 0\n150 90 0.25\n"
    path = file_of(tmp_path, pabopto(30) + back)
    with refused(found="light on both sides", where="scan.txt"):
        read_samples(path)
    assert len(read_samples(f"{path}#front")) == 18
    assert len(read_samples(f"{path}#back")) == 1
    with refused(found="no light on #back"):
        read_samples(f"{file_of(tmp_path, pabopto(30))}#back")


def test_xyz_become_colours(tmp_path: Path) -> None:
    grey, colour = (read_samples(file_of(tmp_path, pabopto(colour=own))) for own in (False, True))
    assert torch.allclose(colour.values, from_xyz(grey.values * torch.tensor([0.9, 1.0, 0.8])).double(), atol=2e-6)


GOOD = pabopto()
WRONG = {
    "BTDF": (GOOD.replace("BSDF", "BTDF"), "transmission (BTDF), expected BSDF, BRDF or DSF"),
    "format": (GOOD.replace("BSDF", "XYZ"), "format theta phi 'XYZ'"),
    "light": (GOOD.replace("#intheta 30\n", ""), "a header without the light's direction"),
    "level": (GOOD.replace("#intheta 30", "#intheta 90"), "intheta 90, expected degrees"),
    "word": (GOOD.replace("#intheta 30", "#intheta x"), "found 'x', expected a finite number"),
    "colours": (GOOD.replace("#upphi 90", "#colorimetry: RGB"), "colorimetry 'RGB', expected CIE-Y or CIE-XYZ"),
    "columns": (GOOD.replace("#upphi 90", "#colorimetry: CIE-XYZ"), "3 columns, expected 5"),
    "angle": (GOOD.replace("75 200", "195 200"), "theta 195, phi 200"),
    "no rows": (GOOD + "#format: theta phi BSDF\n#incident_angle 3 3\n", "a header without rows"),
    "mixed": (GOOD + pabopto(kind="DSF"), "tables of several samples"),
    "through": ("#format: theta phi BSDF\n#incident_angle 30 0\n150 0 1\n", "all rows (1) are transmission"),
    "cut": (GOOD[:-1], "has no line end"),
}


@pytest.mark.parametrize("text", WRONG.values(), ids=list(WRONG))
def test_what_is_wrong_is_said(tmp_path: Path, text: tuple[str, str]) -> None:
    content, said = text
    with refused(said.replace("(", r"\(").replace(")", r"\)")) as caught:
        read_samples(file_of(tmp_path, content))
    assert "scan.txt" in str(caught.value)
