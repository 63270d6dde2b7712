"""What is read in silence and means something else: degrees among radians, cut numbers, weights that are none."""

import re
from pathlib import Path

import pytest
import torch
from refusals import refused

import homofact
from homofact.brdf.formats import curet, open_file
from homofact.brdf.materials import material
from homofact.brdf.samples import Samples
from homofact.brdf.sampling import sample_model
from homofact.errors import BadInput

ASTM = (
    "NUM_POINTS 4\nVARS theta_i,phi_i,theta_s,phi_s,R,G,B\n0.1,0,{a},1,1,1,1\n0.2,0,0.5,{b},1,1,1\n0.3,0,0.4,2,1,1,1\n"
)
ASTM += "0.4,0,0.4,3,1,1,1\n"
CSV = "theta_i,phi_i,theta_o,phi_o,R\n0.1,0,{a},1,1\n0.2,0,0.5,{b},1\n"
CORNELL = "2\n400 700\n0.1 0 {a} 1 0.5 0.5\n0.2 0 0.5 {b} 0.5 0.5\n"


@pytest.mark.parametrize(("text", "line"), [(ASTM, 3), (CSV, 2), (CORNELL, 3)], ids=["astm", "csv", "cornell"])
def test_an_angle_beyond_the_horizon_or_the_turn_is_named_by_its_line(text: str, line: int, tmp_path: Path) -> None:
    path = tmp_path / "a"
    path.write_text(text.format(a="1.5", b="6.2832"))
    assert len(open_file(path).samples) >= 2
    path.write_text(text.format(a="1.58", b="1"))
    with refused(rf"line {line}: .*1\.58"):
        open_file(path)
    path.write_text(text.format(a="0.5", b="90"))
    with refused(rf"line {line + 1}: phi_.*90, expected at most a turn, 2 pi radians"):
        open_file(path)


def test_degrees_are_still_degrees(tmp_path: Path) -> None:
    path = tmp_path / "a"
    text = re.sub(r"(?m)^0\.(\d)", r"\g<1>0", ASTM.format(a="5", b="300"))
    path.write_text(text)
    assert open_file(path).samples.provenance["units"].endswith("degrees")
    path.write_text(text.replace("300", "361"))
    with refused(where="a: line 4"):
        open_file(path)


@pytest.mark.parametrize("name", ["abrdf.dat", curet.TABLE, "gbrdf.dat"])
def test_a_curet_file_that_is_cut_anywhere_is_refused(name: str, tmp_path: Path) -> None:
    curet.write(tmp_path, sample_model(material("lafortune-clay").model, curet.MEASUREMENTS))
    asked = tmp_path / ("rbrdf.dat" if name == "gbrdf.dat" else "abrdf.dat")
    whole = (tmp_path / name).read_bytes()
    for kept in {*range(len(whole) - 60, len(whole)), *range(0, len(whole), 997)}:
        (tmp_path / name).write_bytes(whole[:kept])
        with pytest.raises(BadInput):
            curet.read(asked)


def weighted(*weights: float) -> Samples:
    samples = sample_model(material("phong-10").model, 200)
    given = torch.full((200,), weights[-1], dtype=torch.float64)
    given[: len(weights)] = torch.tensor(weights, dtype=torch.float64)
    return Samples(samples.wi, samples.wo, samples.values, channels=samples.channels, isotropic=True, weights=given)


@pytest.mark.parametrize(
    ("weights", "expected"),
    [
        ((0.0,), "found weights that are all 0"),
        ((1.0, 1e-310), r"found 1e-310 among the weights, expected some from 1e-40 to 1e\+40, or 0"),
        ((1.0, 0.0), "found a single one with a weight above 0, expected at least 2"),
        ((1e-310,), "found 1e-310 among the weights"),
        ((1e200,), r"found 1e\+200 among the weights"),
    ],
)
def test_weights_that_no_sum_survives_are_refused(weights: tuple[float, ...], expected: str) -> None:
    with refused(expected):
        weighted(*weights)


@pytest.mark.slow
@pytest.mark.parametrize("method", [homofact.McCool(size=4), homofact.Search(size=4, effort=1, search_samples=50)])
def test_weights_of_any_scale_are_fitted(method: homofact.McCool | homofact.Search) -> None:
    plain = homofact.fit(weighted(1.0), method).evaluate([[0, 0, 1.0]], [[0, 0, 1.0]])
    for scale in (1e-30, 1e30):
        values = homofact.fit(weighted(scale), method).evaluate([[0, 0, 1.0]], [[0, 0, 1.0]])
        assert values[0] == pytest.approx(plain[0], rel=0.3)
