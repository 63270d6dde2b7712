"""ALTA text: parameterizations against their definitions, round trips, each way a file can be wrong, a real one."""

import math
from collections.abc import Callable
from pathlib import Path

import pytest
import torch
from refusals import refused
from torch import Tensor

from homofact.brdf.formats import alta, read_samples
from homofact.brdf.formats import alta as writer
from homofact.brdf.formats.alta_parameters import PARAMETERIZATIONS
from homofact.brdf.materials import material
from homofact.brdf.samples import Samples
from homofact.brdf.sampling import sample_model
from homofact.brdf.source import describe, open_source
from homofact.brdf.wavelengths import spectral_names
from homofact.errors import BadInput
from homofact.geometry.coordinates import rusinkiewicz_angles
from homofact.geometry.directions import draw_uniform, from_spherical, to_spherical

PAINT = sample_model(material("lafortune-blue-paint").model, 200)
BRUSHED = sample_model(material("ward-brushed").model, 200)


def file_of(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "tape.txt"
    path.write_text(text)
    return path


def head(name: str, inputs: int, output: str = "INV_STERADIAN", values: int = 1) -> str:
    return f"#SAMPLE a tape\n#DIM {inputs} {values}\n#VS 0\n#PARAM_IN {name}\n#PARAM_OUT {output}\n"


def pairs() -> tuple[Tensor, Tensor]:
    return draw_uniform(50, torch.Generator().manual_seed(3))


def difference_azimuth(light: Tensor, view: Tensor) -> Tensor:
    return to_spherical(view)[1] - to_spherical(light)[1]


# ALTA's parameters of a pair (light, view), by their definitions and not by the inverse that is tested.
FORWARD: dict[str, Callable[[Tensor, Tensor], Tensor]] = {
    "ISOTROPIC_TV_TL_DPHI": lambda li, v: torch.stack(
        (to_spherical(v)[0], to_spherical(li)[0], -difference_azimuth(li, v)), 1
    ),
    "ISOTROPIC_TL_TV_PROJ_DPHI": lambda li, v: torch.stack(
        (
            to_spherical(li)[0],
            to_spherical(v)[0] * torch.cos(difference_azimuth(li, v)),
            to_spherical(v)[0] * torch.sin(difference_azimuth(li, v)),
        ),
        1,
    ),
    "SPHERICAL_TL_PL_TV_PV": lambda li, v: torch.stack((*to_spherical(li), *to_spherical(v)), 1),
    "CARTESIAN": lambda li, v: torch.cat((v, li), 1),
    "RUSIN_VH_VD": lambda li, v: torch.cat(half_difference_of_view(li, v), 1),
    "RUSIN_TH_PH_TD_PD": lambda li, v: torch.stack(
        [angle for w in half_difference_of_view(li, v) for angle in to_spherical(w)], 1
    ),
    "RUSIN_TH_TD_PD": lambda li, v: torch.stack(
        [angle for w in half_difference_of_view(li, v) for angle in to_spherical(w)], 1
    )[:, (0, 2, 3)],
    "RETRO_TL_TVL_PROJ_DPHI": lambda li, v: retro(li, v),
}


def half_difference_of_view(light: Tensor, view: Tensor) -> tuple[Tensor, Tensor]:
    """H, and V turned by −φH about z, then by −θH about y."""
    h = (light + view) / (light + view).norm(dim=1, keepdim=True)
    theta, phi = to_spherical(h)
    x = torch.cos(phi) * view[:, 0] + torch.sin(phi) * view[:, 1]
    y = torch.cos(phi) * view[:, 1] - torch.sin(phi) * view[:, 0]
    turned = torch.cos(theta) * x - torch.sin(theta) * view[:, 2]
    return h, torch.stack((turned, y, torch.sin(theta) * x + torch.cos(theta) * view[:, 2]), 1)


def retro(light: Tensor, view: Tensor) -> Tensor:
    """By the spherical law of cosines in the triangle of normal, light and view."""
    cos_l, cos_v, cos_vl = light[:, 2], view[:, 2], (light * view).sum(1)
    sin_l, sin_v, sin_vl = ((1 - x**2).sqrt() for x in (cos_l, cos_v, cos_vl))
    cos_phi = (cos_v - cos_l * cos_vl) / (sin_l * sin_vl)
    sin_phi = torch.sin(difference_azimuth(light, view)) * sin_v / sin_vl
    angle = torch.acos(cos_vl)
    return torch.stack((torch.acos(cos_l), angle * cos_phi, angle * sin_phi), 1)


@pytest.mark.parametrize("name", FORWARD)
def test_parameterizations_invert_their_definitions(name: str) -> None:
    light, view = pairs()
    if PARAMETERIZATIONS[name].isotropic:
        turn = -to_spherical(view)[1] if name == "ISOTROPIC_TV_TL_DPHI" else -to_spherical(light)[1]
        if name == "RUSIN_TH_TD_PD":
            turn = -to_spherical(light + view)[1]
        samples = Samples(light, view, torch.ones(50, 1), channels=("Y",), isotropic=True).turned(turn)
        light, view = samples.wi, samples.wo
    numbers = FORWARD[name](light, view)
    assert numbers.shape == (50, PARAMETERIZATIONS[name].columns)
    back = PARAMETERIZATIONS[name].directions(numbers)
    assert torch.allclose(back[0], light, atol=1e-9)
    assert torch.allclose(back[1], view, atol=1e-9)


@pytest.mark.parametrize(
    ("name", "row", "expected"),
    [
        ("RUSIN_TH_TD", [0.4, 0.5], (0.4, 0.5, math.pi / 2)),
        ("COS_TH_TD", [math.cos(0.4), math.cos(0.5)], (0.4, 0.5, 0.0)),
        ("COS_TH", [math.cos(0.4)], (0.4, 0.0, None)),
        ("RUSIN_TH_PH_TD", [0.4, 1.0, 0.5], (0.4, 0.5, 0.0)),
    ],
)
def test_open_angles_are_where_alta_puts_them(name: str, row: list[float], expected: tuple) -> None:
    light, view = PARAMETERIZATIONS[name].directions(torch.tensor([row], dtype=torch.float64))
    for found, angle in zip(rusinkiewicz_angles(light, view), expected, strict=True):
        assert angle is None or float(found) == pytest.approx(angle, abs=1e-9)
    assert PARAMETERIZATIONS[name].open


def test_light_at_the_normal() -> None:
    row = torch.tensor([[0.3, -0.4]], dtype=torch.float64)
    light, view = PARAMETERIZATIONS["ISOTROPIC_TV_PROJ_DPHI"].directions(row)
    assert light.tolist() == [[0.0, 0.0, 1.0]]
    assert torch.allclose(view, from_spherical(torch.tensor([0.5]).double(), torch.atan2(row[:, 1], row[:, 0])))


def test_the_cosine_of_the_view_is_divided_out(tmp_path: Path) -> None:
    rows = "0.5 1.0 0.0 0.25\n0.5 1.565 0.0 0.1\n0.5 2.0 0.0 0.1\n0.2 0.0 0.0 -0.1\n"
    text = head("ISOTROPIC_TL_TV_PROJ_DPHI", 3, "INV_STERADIAN_COSINE_FACTOR") + rows
    samples = alta.read(file_of(tmp_path, text))
    assert samples.values.tolist() == [[pytest.approx(0.25 / math.cos(1.0))], [0.0]]
    assert float(to_spherical(samples.wi)[0][0]) == pytest.approx(0.5)
    assert samples.provenance["faults"] == {"under_horizon": 1, "at_horizon": 1, "negative": 1, "exact_zeros": 0}
    assert "cosine of the view divided out" in samples.provenance["units"]
    plain = alta.read(file_of(tmp_path, text.replace("_COSINE_FACTOR", "")))
    assert plain.values.flatten().tolist() == [0.25, 0.1, 0.0]


def test_intervals_are_left_unread(tmp_path: Path) -> None:
    text = head("COS_TH", 1).replace("#VS 0", "#VS 2") + "0.9 0.5 0.4 0.6\n"
    assert alta.read(file_of(tmp_path, text)).values.tolist() == [[0.5]]


def test_xyz_becomes_linear_srgb(tmp_path: Path) -> None:
    text = head("COS_TH", 1, "XYZ_COLOR", 3) + "0.9 0.95047 1.0 1.08883\n"
    samples = alta.read(file_of(tmp_path, text))
    assert samples.channels == ("R", "G", "B")
    assert samples.values.flatten().tolist() == pytest.approx([1, 1, 1], abs=1e-4)


@pytest.mark.parametrize("samples", [PAINT, BRUSHED], ids=["isotropic", "anisotropic"])
def test_write_then_read(tmp_path: Path, samples: Samples) -> None:
    path = tmp_path / "out.dat"
    writer.write(path, samples, comments=("blue\npaint",))
    back = read_samples(path)
    assert torch.equal(back.values, samples.values)
    assert (back.channels, back.isotropic) == (samples.channels, samples.isotropic)
    assert back.provenance["comments"] == ["SOURCE blue paint"]
    if samples.isotropic:
        difference = [to_spherical(s.wi)[1] - to_spherical(s.wo)[1] for s in (back, samples)]
        assert torch.allclose(torch.cos(difference[0]), torch.cos(difference[1]), atol=1e-12)
        assert torch.allclose(torch.sin(difference[0]), torch.sin(difference[1]), atol=1e-12)
        assert torch.allclose(back.wi[:, 2], samples.wi[:, 2], atol=1e-14)
    else:
        assert torch.allclose(back.wi, samples.wi, atol=1e-14)
        assert torch.allclose(back.wo, samples.wo, atol=1e-14)


def test_cartesian_is_bit_for_bit(tmp_path: Path) -> None:
    writer.write(tmp_path / "out.dat", BRUSHED, "CARTESIAN")
    back = alta.read(tmp_path / "out.dat")
    assert torch.equal(back.wi, BRUSHED.wi)
    assert torch.equal(back.wo, BRUSHED.wo)


def test_spectra_keep_their_wavelengths(tmp_path: Path) -> None:
    names = spectral_names(range(400, 701, 50))
    samples = Samples(PAINT.wi, PAINT.wo, PAINT.values[:, :1].expand(200, 7), channels=names, isotropic=True)
    writer.write(tmp_path / "out.dat", samples)
    assert alta.read(tmp_path / "out.dat", "spectral").channels == names
    assert alta.read(tmp_path / "out.dat").channels == ("R", "G", "B")


def test_writer_refuses_what_cannot_be_meant(tmp_path: Path) -> None:
    with refused(where="ALTA parameterization", found="'RUSIN_TH_TD'"):
        writer.write(tmp_path / "x", PAINT, "RUSIN_TH_TD")
    with refused(where="ALTA parameterization"):
        writer.write(tmp_path / "x", BRUSHED, "ISOTROPIC_TV_TL_DPHI")
    odd = Samples(PAINT.wi, PAINT.wo, PAINT.values[:, :1], channels=("a b",), isotropic=True)
    with refused(where="ALTA file"):
        writer.write(tmp_path / "x", odd)
    assert list(tmp_path.iterdir()) == []


GOOD = head("COS_TH", 1) + "0.9 0.5\n0.8 0.4\n"
BAD = {
    "no PARAM_IN": (GOOD.replace("#PARAM_IN COS_TH\n", ""), "no #PARAM_IN, so its units are unknown"),
    "no PARAM_OUT": (GOOD.replace("#PARAM_OUT INV_STERADIAN\n", ""), "no #PARAM_OUT, so its units are unknown"),
    "unknown PARAM_IN": (GOOD.replace("COS_TH", "STARK_3D"), "line 4: #PARAM_IN is 'STARK_3D', expected one of RUSIN"),
    "unknown PARAM_OUT": (GOOD.replace("INV_STERADIAN", "ENERGY"), "line 5: #PARAM_OUT is 'ENERGY', expected one of"),
    "DIM disagrees": (GOOD.replace("#DIM 1 1", "#DIM 2 1"), "line 2: #DIM is '2 1', expected 1 inputs"),
    "DIM of none": (GOOD.replace("#DIM 1 1", "#DIM 1 0"), "line 2: #DIM is '1 0', expected 1 inputs and 1 or more"),
    "DIM absurd": (GOOD.replace("#DIM 1 1", "#DIM 1 99999"), "line 2: #DIM is '1 99999'"),
    "DIM huge": (GOOD.replace("#DIM 1 1", "#DIM 1 " + "9" * 5000), "line 2: #DIM is '1 999"),
    "DIM of words": (GOOD.replace("#DIM 1 1", "#DIM one"), "line 2: #DIM is 'one', expected two numbers"),
    "VS": (GOOD.replace("#VS 0", "#VS 3"), "line 3: #VS is '3', expected 0, 1 or 2"),
    "VS of two": (GOOD.replace("#VS 0", "#VS 0 1"), "line 3: #VS has 2 numbers, expected 1"),
    "DIM twice": (GOOD + "#DIM 2 2\n", "line 8: #DIM for the second time"),
    "binary": (GOOD.replace("#VS 0", "#BINARY 1"), "line 3: binary ALTA data, expected text"),
    "colour of one": (GOOD.replace("INV_STERADIAN", "RGB_COLOR"), "RGB_COLOR with 1 values a row, expected 3"),
    "no rows": (head("COS_TH", 1), "no samples after the header, expected rows of 2 numbers"),
    "columns": (GOOD + "0.9 0.5 0.1\n", r"line 8: 3 columns, expected 2 \(1 of COS_TH, 1 values\)"),
    "word": (GOOD + "0.9 x\n", "line 8: found 'x', expected a finite number"),
    "nan": (GOOD + "0.9 nan\n", "line 8: found 'nan', expected a finite number"),
    "underscore": (GOOD + "0.9 1_0\n", "line 8: found '1_0', expected a finite number"),
    "cut": (GOOD[:-2], "line 7 has no line end"),
    "degrees": (
        head("SPHERICAL_TL_PL_TV_PV", 4) + "30 0 45 180 0.1\n",
        r"line 6: SPHERICAL_TL_PL_TV_PV is \[30.0, 0.0, 45.0, 180.0\], expected angles in radians",
    ),
    "no unit vectors": (head("CARTESIAN", 6) + "1 1 1 0 0 1 0.1\n", "none of 1 rows has both directions above"),
    "cosine above one": (GOOD.replace("0.9", "1.9").replace("0.8", "1.8"), "none of 2 rows has both"),
    "channels": (GOOD.replace("#VS 0", "#CHANNELS R G"), "line 3: #CHANNELS is 'R G', expected 1 different names"),
}


@pytest.mark.parametrize(("text", "message"), BAD.values(), ids=list(BAD))
def test_bad_files_name_file_and_line(tmp_path: Path, text: str, message: str) -> None:
    path = file_of(tmp_path, text)
    with pytest.raises(BadInput, match=message) as caught:
        read_samples(path)
    assert str(caught.value).startswith(str(path))
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 450 + len(str(path))


def test_sniff() -> None:
    assert alta.sniff(GOOD.encode())
    assert not alta.sniff(b"# a comment\n3\n400 500 600\n#DIM 1 1\n")
    assert not alta.sniff(b"")


def test_the_real_tape(real_data: Path) -> None:
    source = open_source(str(real_data / "retro" / "retro-3M-jaune.dat"))
    samples = source.samples
    assert (len(samples), samples.channels, samples.isotropic) == (7311, ("Y",), True)
    assert describe(source)["faults"]["at_horizon"] == 86
    theta = to_spherical(samples.wi)[0] * (180 / math.pi)
    assert sorted({round(float(t)) for t in theta}) == [15, 30, 60]
    # At 30° the tape sends the light back where it came from, more than to the mirror direction.
    at_30 = samples.select((theta - 30).abs() < 1)
    peak = int(at_30.values.argmax())
    assert float((at_30.wi[peak] * at_30.wo[peak]).sum()) > math.cos(math.radians(2))
    # With the cosine of the view divided out 15° → 60° and 60° → 15° agree, with any other they are 1.7 apart.
    seen = {}
    theta_o, phi_o = (angle * (180 / math.pi) for angle in to_spherical(samples.wo))
    for i, o, phi, value in torch.stack((theta, theta_o, phi_o, samples.values[:, 0]), 1).tolist():
        seen[round(i), round(o, 1), round(abs(phi))] = value
    ratios = [math.log(v / seen[o, i, p]) for (i, o, p), v in seen.items() if i < o and (o, i, p) in seen]
    assert len(ratios) > 20
    assert abs(sorted(ratios)[len(ratios) // 2]) < 0.05


def test_units_that_the_file_leaves_out_can_be_stated(tmp_path: Path) -> None:
    path = tmp_path / "tape.dat"
    path.write_text(GOOD.replace("#PARAM_OUT INV_STERADIAN\n", ""))
    with refused("no #PARAM_OUT, so its units are unknown") as caught:
        read_samples(path)
    assert "tape.dat#INV_STERADIAN" in caught.value.hint
    plain, cosine = (read_samples(f"{path}#{name}") for name in ("INV_STERADIAN", "INV_STERADIAN_COSINE_FACTOR"))
    assert torch.allclose(cosine.values, plain.values / plain.wo[:, 2:])
    assert plain.provenance["units"] == "1/sr, no cosine; INV_STERADIAN stated, not in the file"
    with refused(found="units 'ENERGY'"):
        read_samples(f"{path}#ENERGY")
    path.write_text(GOOD)
    assert torch.equal(read_samples(f"{path}#INV_STERADIAN").values, plain.values)
    with refused(found="#PARAM_OUT is 'INV_STERADIAN'"):
        read_samples(f"{path}#RGB_COLOR")
