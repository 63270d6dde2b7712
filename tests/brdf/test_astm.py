"""ASTM E1392 text: layout, units of angles, round trips, each way a file can be wrong."""

import math
from pathlib import Path

import pytest
import torch
from refusals import refused

from homofact.brdf.formats import astm, read_samples
from homofact.brdf.formats import astm as writer
from homofact.brdf.materials import material
from homofact.brdf.samples import Samples
from homofact.brdf.sampling import sample_model
from homofact.geometry.directions import to_spherical

PAINT = sample_model(material("lafortune-blue-paint").model, 60)


def text(rows: str, variables: str = "theta_i,phi_i,theta_s,phi_s,R,G,B", points: int | None = None) -> str:
    count = rows.count("\n") if points is None else points
    return (
        f'LAB_NAME A Laboratory\n\nSAMPLE_NAME "paint"\nMEAS_NAME BRDF\nNUM_POINTS {count}\nVARS {variables}\n\n{rows}'
    )


def file_of(tmp_path: Path, content: str) -> Path:
    path = tmp_path / "paint.txt"
    path.write_text(content)
    return path


ROWS = "0.5,0,0.7,3.0,0.1,0.2,0.3\n0.5,0,0.0,0.0,0.0,-0.2,0.3\n"


def test_reads_what_is_there(tmp_path: Path) -> None:
    samples = read_samples(file_of(tmp_path, text(ROWS)))
    assert (samples.channels, samples.isotropic) == (("R", "G", "B"), True)
    assert samples.values.tolist() == [[0.1, 0.2, 0.3], [0, 0, 0.3]]
    assert float(to_spherical(samples.wi)[0][0]) == pytest.approx(0.5)
    assert [float(x[0]) for x in to_spherical(samples.wo)] == pytest.approx([0.7, 3.0])
    assert samples.provenance["faults"] == {"negative": 1, "exact_zeros": 1}
    assert samples.provenance["comments"] == ["LAB_NAME A Laboratory", 'SAMPLE_NAME "paint"', "MEAS_NAME BRDF"]
    assert samples.provenance["units"].endswith("radians")


def test_degrees_are_known_by_their_size(tmp_path: Path) -> None:
    samples = astm.read(file_of(tmp_path, text("30,10,45,190,0.1,0.2,0.3\n")))
    assert samples.provenance["units"].endswith("degrees")
    assert [math.degrees(float(x[0])) for x in to_spherical(samples.wo)] == pytest.approx([45, -170])


def test_missing_azimuths(tmp_path: Path) -> None:
    samples = astm.read(file_of(tmp_path, text("0.5,-0.7,0.4\n0.5,0.7,0.3\n", "theta_i,theta_s,Integrated 300 to 700")))
    assert samples.isotropic
    assert samples.channels == ("Integrated 300 to 700",)
    assert float(samples.wo[0, 0]) == pytest.approx(-math.sin(0.7))
    assert float(samples.wo[1, 0]) == pytest.approx(math.sin(0.7))


def test_spectra_and_xyz_become_colours(tmp_path: Path) -> None:
    spectral = text("0.5,0.7,3,1,1,1\n", "theta_i,theta_s,phi_s,400nm,550nm,700nm")
    assert astm.read(file_of(tmp_path, spectral), "spectral").channels == ("400nm", "550nm", "700nm")
    assert astm.read(file_of(tmp_path, spectral)).values.flatten().tolist() == pytest.approx([1, 1, 1])
    white = astm.read(file_of(tmp_path, text("0.5,0.7,0.95047,1,1.08883\n", "theta_i,theta_s,X,Y,Z")))
    assert white.channels == ("R", "G", "B")
    assert white.values.flatten().tolist() == pytest.approx([1, 1, 1], abs=1e-4)


@pytest.mark.parametrize("name", ["lafortune-blue-paint", "ward-brushed"])
def test_write_then_read(tmp_path: Path, name: str) -> None:
    samples = sample_model(material(name).model, 100)
    writer.write(tmp_path / "out.astm", samples)
    back = read_samples(tmp_path / "out.astm")
    assert torch.equal(back.values, samples.values)
    assert (back.channels, back.isotropic) == (samples.channels, samples.isotropic)
    assert torch.allclose((back.wi * back.wo).sum(1), (samples.wi * samples.wo).sum(1), atol=1e-12)
    assert torch.allclose(back.wi[:, 2], samples.wi[:, 2], atol=1e-14)
    if not samples.isotropic:
        assert torch.allclose(back.wi, samples.wi, atol=1e-14)
        assert torch.allclose(back.wo, samples.wo, atol=1e-14)


def test_writer_refuses_names_that_it_cannot_hold(tmp_path: Path) -> None:
    samples = Samples(PAINT.wi, PAINT.wo, PAINT.values[:, :1], channels=("phi_s",), isotropic=True)
    with refused(where="ASTM file"):
        writer.write(tmp_path / "x", samples)


BAD = {
    "no count": (text(ROWS).replace("NUM_POINTS 2\n", ""), "line 5: VARS before NUM_POINTS"),
    "count of words": (text(ROWS).replace("NUM_POINTS 2", "NUM_POINTS two"), "line 5: NUM_POINTS is 'two'"),
    "count of none": (text(ROWS, points=0), "line 5: NUM_POINTS is '0'"),
    "too few rows": (text(ROWS, points=3), r"2 rows, expected 3 \(NUM_POINTS\)"),
    "too many rows": (text(ROWS, points=1), r"2 rows, expected 1 \(NUM_POINTS\)"),
    "absurd count": (text(ROWS, points=999_999_999), "2 rows, expected 999999999"),
    "huge count": (text(ROWS).replace("NUM_POINTS 2", "NUM_POINTS " + "9" * 5000), "NUM_POINTS is '999"),
    "columns": (text("0.5,0,0.7\n"), "line 8: 3 columns, expected 7"),
    "no values": (text("0.5,0.7\n", "theta_i,theta_s"), "line 6: VARS is .* expected theta_i, theta_s and values"),
    "no viewer": (text("0.5,0.7\n", "theta_i,Y"), "line 6: VARS is"),
    "a name twice": (text("0.5,0.7,1,1\n", "theta_i,theta_s,Y,Y"), "line 6: VARS has 4 columns, expected different"),
    "nan": (text(ROWS.replace("0.3\n", "nan\n", 1)), "line 8: found 'nan'"),
    "under the horizon": (text("95,0,30,0,1,1,1\n"), "line 8: theta_i 95, theta_s 30, expected angles up to"),
    "negative light": (text("-0.1,0,0.3,0,1,1,1\n"), "line 8: theta_i -0.1"),
    "cut": (text(ROWS)[:-1], "line 9 has no line end"),
}


@pytest.mark.parametrize(("content", "message"), BAD.values(), ids=list(BAD))
def test_bad_files_name_file_and_line(tmp_path: Path, content: str, message: str) -> None:
    path = file_of(tmp_path, content)
    with refused(message) as caught:
        read_samples(path)
    assert str(caught.value).startswith(str(path))
    assert "\n" not in str(caught.value)


def test_no_vars(tmp_path: Path) -> None:
    with refused(where="paint.txt"):
        astm.read(file_of(tmp_path, "NUM_POINTS 3\n"))
