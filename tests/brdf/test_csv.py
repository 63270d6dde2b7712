"""CSV with a stated header: the three forms of directions, round trips, each way a file can be wrong."""

import math
from pathlib import Path

import pytest
import torch
from refusals import refused

from homofact.brdf.formats import csv, read_samples
from homofact.brdf.formats import csv as writer
from homofact.brdf.materials import material
from homofact.brdf.samples import Samples
from homofact.brdf.sampling import sample_model
from homofact.brdf.source import open_source
from homofact.brdf.wavelengths import spectral_names
from homofact.errors import BadInput
from homofact.geometry.directions import to_spherical

PAINT = sample_model(material("lafortune-blue-paint").model, 60)
GOOD = (
    "# a paint\n# isotropic: true\ntheta_i,phi_i,theta_o,phi_o,R,G,B\n0.1,0.2,0.3,0.4,1,2,3\n0.5,0,0.6,3,0,0.25,1e-3\n"
)


def file_of(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "table.txt"
    path.write_bytes(text.encode("latin-1"))
    return path


def test_angles_in_radians(tmp_path: Path) -> None:
    samples = read_samples(file_of(tmp_path, GOOD))
    assert samples.channels == ("R", "G", "B")
    assert samples.isotropic
    assert samples.values.tolist() == [[1, 2, 3], [0, 0.25, 1e-3]]
    angles = [*to_spherical(samples.wi), *to_spherical(samples.wo)]
    assert [float(x[0]) for x in angles] == pytest.approx([0.1, 0.2, 0.3, 0.4])
    assert samples.provenance["comments"] == ["a paint"]
    assert samples.provenance["faults"] == {"exact_zeros": 1, "samples_with_zeros": 1}


def test_angles_in_degrees_columns_in_any_order_and_windows_line_ends(tmp_path: Path) -> None:
    text = "Y , phi_o_deg,theta_o_deg,phi_i_deg,theta_i_deg\r\n0.5,180,30,0,90\r\n"
    samples = csv.read(file_of(tmp_path, text))
    assert samples.channels == ("Y",)
    assert torch.allclose(samples.wi, torch.tensor([[1.0, 0, 0]]).double(), atol=1e-15)
    assert torch.allclose(samples.wo, torch.tensor([[-0.5, 0, math.sqrt(0.75)]]).double(), atol=1e-15)


@pytest.mark.parametrize(
    "header",
    [
        "theta_i_deg,phi_i_deg,theta_o_deg,phi_o_deg",
        "theta_in_deg,phi_in_deg,theta_out_deg,phi_out_deg",
        "theta_i_deg,phi_i_deg,theta_r_deg,phi_r_deg",
    ],
)
def test_names_of_other_programs_are_known(tmp_path: Path, header: str) -> None:
    samples = read_samples(file_of(tmp_path, f"{header},Y\n10,20,30,50,0.5\n40,20,60,200,0.1\n"))
    angles = [*to_spherical(samples.wi), *to_spherical(samples.wo)]
    assert [float(x[0]) for x in angles] == pytest.approx([math.radians(x) for x in (10, 20, 30, 50)])


@pytest.mark.parametrize(
    ("header", "unit"),
    [("theta_i,theta_o,dphi", 1.0), ("theta_in_deg,theta_out_deg,delta_phi_deg", math.degrees(1.0))],
)
def test_one_column_may_stand_for_both_azimuths(tmp_path: Path, header: str, unit: float) -> None:
    row = ",".join(f"{x * unit:.12g}" for x in (0.1, 0.3, 2.5))
    samples = read_samples(file_of(tmp_path, f"{header},Y\n{row},0.5\n{row},0.5\n"))
    assert [float(x[0]) for x in to_spherical(samples.wi)] == pytest.approx([0.1, 0.0])
    assert [float(x[0]) for x in to_spherical(samples.wo)] == pytest.approx([0.3, 2.5])
    assert samples.channels == ("Y",)
    assert samples.isotropic


def test_vectors_and_weights_come_back_bit_for_bit(tmp_path: Path) -> None:
    weights = torch.rand(60, dtype=torch.float64, generator=torch.Generator().manual_seed(0))
    samples = Samples(
        PAINT.wi, PAINT.wo, PAINT.values, channels=PAINT.channels, isotropic=True, weights=weights,
        provenance={"noise_free": True},
    )  # fmt: skip
    writer.write(tmp_path / "out.csv", samples, ("blue\npaint",))
    back = read_samples(tmp_path / "out.csv")
    for name in ("wi", "wo", "values", "weights"):
        assert torch.equal(getattr(back, name), getattr(samples, name)), name
    assert (back.channels, back.isotropic) == (samples.channels, True)
    assert back.provenance["comments"] == ["blue paint"]
    assert open_source(str(tmp_path / "out.csv")).default_epsilon == 1e-5


def test_without_weights_and_anisotropic(tmp_path: Path) -> None:
    samples = sample_model(material("ward-brushed").model, 20)
    writer.write(tmp_path / "out.csv", samples)
    assert b"weight" not in (tmp_path / "out.csv").read_bytes()
    back = csv.read(tmp_path / "out.csv")
    assert not back.isotropic
    assert torch.equal(back.weights, torch.ones(20, dtype=torch.float64))


def test_spectra(tmp_path: Path) -> None:
    names = spectral_names((400, 450.5, 500, 600, 700))
    samples = Samples(PAINT.wi, PAINT.wo, PAINT.values[:, :1].expand(60, 5), channels=names, isotropic=True)
    writer.write(tmp_path / "out.csv", samples)
    assert csv.read(tmp_path / "out.csv", "spectral").channels == names
    colour = csv.read(tmp_path / "out.csv")
    assert colour.channels == ("R", "G", "B")
    assert colour.provenance["wavelengths_nm"][1] == 450.5


@pytest.mark.parametrize(
    ("header", "found"),
    [
        ("theta_i,theta_o", "theta_i, theta_o"),
        ("theta_i,phi_i,theta_o,phi_o,dphi", "theta_i, phi_i, theta_o, phi_o, dphi"),
        ("theta_in,theta_out,dphi_deg", "theta_i, theta_o, dphi_deg"),
    ],
)
def test_directions_that_are_half_said_or_twice_are_refused(tmp_path: Path, header: str, found: str) -> None:
    text = f"{header},Y\n{','.join('0.1' for _ in header.split(','))},1\n"
    with refused(f"directions by {found}, expected all of theta_i, phi_i, theta_o, phi_o, or theta_i, theta_o, dphi"):
        csv.read(file_of(tmp_path, text))


def test_a_difference_in_degrees_is_told_how_to_say_so(tmp_path: Path) -> None:
    with refused("dphi is 12, expected at most a turn, 2 pi radians .*such as theta_i_deg"):
        csv.read(file_of(tmp_path, "theta_in,theta_out,dphi,Y\n0,0,12,1\n"))


def test_slightly_long_vectors_are_brought_back_to_length_one(tmp_path: Path) -> None:
    text = "wi_x,wi_y,wi_z,wo_x,wo_y,wo_z,Y\n0,0.6004,0.8,0,0,1.0005,0.5\n0,1,-1e-7,0,0,1,0.5\n"
    samples = csv.read(file_of(tmp_path, text))
    assert torch.allclose(samples.wi.norm(dim=1), torch.ones(2, dtype=torch.float64), atol=1e-12)
    assert float(samples.wi[1, 2]) == 0


HEAD = "theta_i,phi_i,theta_o,phi_o,Y\n"
VECTORS = "wi_x,wi_y,wi_z,wo_x,wo_y,wo_z,Y\n"
BAD = {
    "no channel": ("theta_i,phi_i,theta_o,phi_o\n0,0,0,0\n", "line 1: no channel beside the directions"),
    "half the directions": ("theta_i,phi_i,Y\n0,0,1\n", "line 1: directions by theta_i, phi_i, expected all of"),
    "two forms": ("theta_i,wi_x,Y\n0,0,1\n", "line 1: directions by theta_i, wi_x"),
    "a name twice": ("theta_i,phi_i,theta_o,phi_o,Y,Y\n0,0,0,0,1,1\n", "line 1: 'Y' names two columns"),
    "no name": ("theta_i,phi_i,theta_o,phi_o,,Y\n0,0,0,0,1,1\n", "line 1: 6 columns, one without a name"),
    "no rows": (HEAD, "no samples after the header, expected rows of 5 numbers"),
    "columns": (HEAD + "0,0,0,1\n", r"line 2: 4 columns, expected 5 \(as the header names\)"),
    "a word": (HEAD + "0,0,0,0,x\n", "line 2: found 'x', expected a finite number"),
    "nothing": (HEAD + "0,0,,0,1\n", "line 2: found an empty cell in column theta_o, expected a finite number"),
    "infinite": (HEAD + "0,0,0,0,inf\n", "line 2: found 'inf'"),
    "negative": (HEAD + "0,0,0,0,1\n\n0,0,0,0,-1\n", "line 4: Y is -1, expected >= 0"),
    "negative weight": ("weight," + HEAD + "-1,0,0,0,0,1\n", "line 2: weight is -1, expected >= 0"),
    "under the horizon": (
        HEAD + "0,0,1.6,0,1\n",
        r"line 2: theta_o is 1.6, expected radians from 0 to pi/2 \(for degrees",
    ),
    "negative angle": (HEAD + "-0.1,0,0,0,1\n", "line 2: theta_i is -0.1, expected radians from 0 to pi/2$"),
    "beyond 90 degrees": (
        HEAD.replace(",", "_deg,").replace("Y", "Y") + "91,0,0,0,1\n",
        "theta_i_deg is 91, expected degrees from 0 to 90$",
    ),
    "long vector": (VECTORS + "0,0,2,0,0,1,1\n", r"line 2: wi \[0.0, 0.0, 2.0\], expected a unit vector"),
    "vector under the horizon": (VECTORS + "0,0,1,0,0.6,-0.8,1\n", r"line 2: wo \[0.0, 0.6, -0.8\]"),
    "cut": ((HEAD + "0,0,0,0,1\n0,0,0,0,0.1")[:-1], "line 3 has no line end"),
    "degrees without saying so": (
        HEAD + "1,0,1,0,1\n1,0,1,0,1\n1,0,10,0,1\n10,180,0,0,1\n",
        r"line 4: theta_o is 10, expected radians from 0 to pi/2 \(for degrees end the names of all columns",
    ),
    "degrees in an azimuth": (
        HEAD + "0,0,0,180,1\n2,0,0,0,1\n",
        r"line 2: phi_o is 180, expected at most a turn, 2 pi radians \(for degrees",
    ),
    "more than a turn": (
        HEAD.replace(",", "_deg,") + "0,0,0,400,1\n",
        "phi_o_deg is 400, expected at most a turn, 360 degrees$",
    ),
    "two vectors": (VECTORS + "0,0,1,0,0,2,1\n0,0,2,0,0,1,1\n", r"line 2: wo \[0.0, 0.0, 2.0\]"),
    "the first negative": (
        "R,G," + HEAD + "1,1,0,0,0,0,1\n1,1,0,0,0,0,-3\n1,-2,0,0,0,0,1\n-1,1,9,0,0,0,1\n",
        "line 3: Y",
    ),
    "isotropic maybe": ("# isotropic: maybe\n" + HEAD, "line 1: isotropic is 'maybe', expected true or false"),
    "weights of nothing": ("theta_i,phi_i,theta_o,phi_o,weight\n0,0,0,0,1\n", "no channel beside"),
}


@pytest.mark.parametrize(("text", "message"), BAD.values(), ids=list(BAD))
def test_bad_files_name_file_and_line(tmp_path: Path, text: str, message: str) -> None:
    path = file_of(tmp_path, text)
    with pytest.raises(BadInput, match=message) as caught:
        read_samples(path)
    assert str(caught.value).startswith(str(path))
    assert "\n" not in str(caught.value)


def test_only_comments(tmp_path: Path) -> None:
    with refused(where="table.txt"):
        csv.read(file_of(tmp_path, "# isotropic: true\n"))


@pytest.mark.parametrize("name", ["a,b", "theta_i", "weight", " a", "", "#a"])
def test_writer_refuses_names_that_it_cannot_hold(tmp_path: Path, name: str) -> None:
    samples = Samples(PAINT.wi, PAINT.wo, PAINT.values[:, :1], channels=(name,), isotropic=True)
    with refused(where="CSV file"):
        writer.write(tmp_path / "x", samples)
    assert list(tmp_path.iterdir()) == []


ROWS = {
    "one azimuth": "10,30,40,0,0.5\n20,30,50,90,0.4\n",
    "an azimuth and the normal": "10,30,40,0,0.5\n0,77,50,90,0.4\n",
    "two azimuths": "10,30,40,0,0.5\n20,31,50,90,0.4\n",
}
DEGREES = "theta_i_deg,phi_i_deg,theta_o_deg,phi_o_deg,Y\n"


@pytest.mark.parametrize(("rows", "isotropic"), [(ROWS[k], k != "two azimuths") for k in ROWS], ids=list(ROWS))
def test_without_a_word_light_from_one_azimuth_means_isotropic(tmp_path: Path, rows: str, isotropic: bool) -> None:
    path = file_of(tmp_path, DEGREES + rows)
    samples = csv.read(path)
    assert samples.isotropic is isotropic
    said = [line for line in samples.provenance["comments"] if "taken as isotropic" in line]
    assert len(said) == isotropic
    for word, stated in (("false", False), ("true", True)):
        samples = csv.read(file_of(tmp_path, f"# isotropic: {word}\n{DEGREES}{rows}"))
        assert samples.isotropic is stated
        assert samples.provenance["comments"] == []


def test_vectors_from_one_azimuth(tmp_path: Path) -> None:
    rows = "0.3,0.4,0.866025,0,0,1,0.5\n0.48,0.64,0.6,0,0,1,0.5\n"
    assert csv.read(file_of(tmp_path, VECTORS + rows)).isotropic
    assert not csv.read(file_of(tmp_path, VECTORS + rows + "0.64,0.48,0.6,0,0,1,0.5\n")).isotropic


@pytest.mark.parametrize("stated", ["# Isotropic: yes", "#ISOTROPIC : True", "# isotropic: YES,,,,"])
@pytest.mark.parametrize("other", ["# Noise_Free: no", "# noise_free: yes"])
def test_keys_in_any_case_and_yes_and_no(tmp_path: Path, stated: str, other: str) -> None:
    text = f"{stated}\n{other}\n{DEGREES}{ROWS['two azimuths']}"
    samples = csv.read(file_of(tmp_path, text))
    assert samples.isotropic
    assert samples.provenance.get("noise_free", False) is other.endswith("yes")
    assert not csv.read(file_of(tmp_path, f"# Isotropic: No\n{DEGREES}{ROWS['one azimuth']}")).isotropic


def test_columns_may_say_that_they_are_radians(tmp_path: Path) -> None:
    plain = read_samples(file_of(tmp_path, GOOD))
    named = read_samples(file_of(tmp_path, GOOD.replace("_i,", "_i_rad,").replace("_o,", "_o_rad,")))
    assert torch.equal(named.wi, plain.wi)
    assert torch.equal(named.wo, plain.wo)
    assert named.channels == plain.channels


def test_a_byte_order_mark_is_no_part_of_the_text(tmp_path: Path) -> None:
    path = tmp_path / "excel.csv"
    for text in (GOOD, GOOD[GOOD.index("theta_i") :]):
        path.write_bytes(b"\xef\xbb\xbf" + text.encode())
        assert read_samples(path).channels == ("R", "G", "B")
        assert len(read_samples(path)) == 2


def test_sniff() -> None:
    assert csv.sniff(GOOD.encode())
    for other in (b"", b"a,b,c\n1,2,3\n", b"theta_i phi_i\n", b"\xff\xfe\0"):
        assert not csv.sniff(other)


def test_values_that_no_fit_can_hold_are_refused_with_the_file_s_name(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("theta_i,phi_i,theta_o,phi_o,R\n0.1,0,0.2,3,1e31\n0.2,0,0.2,3,0.5\n")
    with pytest.raises(BadInput, match=r"a\.csv: samples: values at row 0 are up to 1e\+31, expected at most 1e\+30"):
        read_samples(tmp_path / "a.csv")


@pytest.mark.parametrize(
    ("header", "names"), [("r,g,b", ("R", "G", "B")), ("r,g", ("r", "g")), ("b,g,r", ("b", "g", "r"))]
)
def test_colours_have_their_usual_names(header: str, names: tuple[str, ...], tmp_path: Path) -> None:
    file = tmp_path / "a.csv"
    row = ",".join(["0.3"] * len(names))
    file.write_text(f"theta_i,theta_o,dphi,{header}\n0.1,0.2,1,{row}\n0.2,0.1,2,{row}\n")
    assert csv.read(file).channels == names


def test_an_azimuth_of_another_name_may_be_the_difference(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text("theta_i,theta_o,phi_d,Y\n0.1,0.2,0.3,1\n", encoding="utf-8")
    with refused("dphi"):
        csv.read(path)


@pytest.mark.parametrize("header", ["theta_i,phi_i,theta_o,phi_o,Y", "thetaIn,phiIn,thetaOut,phiOut,Y"])
def test_angles_without_a_unit_are_degrees_where_most_cannot_be_radians(tmp_path: Path, header: str) -> None:
    rows = "5,0,0,0,1\n20,0,40,90,2\n60,0,60,180,3\n"
    plain, stated = tmp_path / "plain.csv", tmp_path / "stated.csv"
    plain.write_text(f"{header}\n{rows}")
    stated.write_text(f"theta_i_deg,phi_i_deg,theta_o_deg,phi_o_deg,Y\n{rows}")
    found, expected = csv.read(plain), csv.read(stated)
    assert found.wi.equal(expected.wi)
    assert found.wo.equal(expected.wo)
    assert found.values.equal(expected.values)
    assert any("degrees" in line for line in found.provenance["comments"])
    assert not any("degrees" in line for line in expected.provenance["comments"])


def test_a_difference_of_azimuths_without_a_unit_is_in_degrees_too(tmp_path: Path) -> None:
    plain = tmp_path / "plain.csv"
    plain.write_text("theta_i,theta_o,dphi,Y\n5,0,0,1\n20,40,90,2\n60,60,180,3\n")
    assert csv.read(plain).wo[2, 0] == pytest.approx(-(3**0.5) / 2)


def test_named_radians_are_never_degrees(tmp_path: Path) -> None:
    named = tmp_path / "named.csv"
    named.write_text("theta_i_rad,phi_i_rad,theta_o_rad,phi_o_rad,Y\n5,0,10,0,1\n20,0,40,90,2\n")
    with refused(where="named.csv: line 2"):
        csv.read(named)
