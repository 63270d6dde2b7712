"""WINDOW and Radiance XML: bands, sides, colours, trees, what is written, each way a file can be wrong."""

import math
from pathlib import Path

import pytest
import torch
from lighting_files import COARSE, MATRIX, SHIRLEY, coloured_window, matrix, tree_window, window, window_block
from refusals import refused
from slow_cases import slow_among

from homofact.brdf.analytic import Lambert
from homofact.brdf.band_means import klems_means
from homofact.brdf.formats import open_file, read_samples, window_writer
from homofact.brdf.formats import window as format_
from homofact.brdf.klems import BASES, FULL, KlemsTable
from homofact.brdf.materials import material
from homofact.brdf.reflectance import Reflectance
from homofact.brdf.tensor_tree import from_yuv, to_disk, to_square, to_yuv
from homofact.brdf.tristimulus import from_xyz, to_xyz
from homofact.geometry.directions import draw_cosine_weighted, draw_uniform, from_spherical


def file_of(folder: Path, text: str) -> Path:
    path = folder / "cloth.xml"
    path.write_text(text)
    return path


def at(theta: float, phi: float) -> torch.Tensor:
    angles = torch.tensor([theta, phi], dtype=torch.float64).deg2rad()
    return from_spherical(angles[:1], angles[1:])


def value(path: Path | str, wi: torch.Tensor, wo: torch.Tensor) -> float:
    reflectance = open_file(path).reflectance
    assert reflectance is not None
    return float(reflectance.evaluate(wi, wo)[0, 0])


GREY = window(window_block("Reflection Back", "Visible", matrix()))


def test_columns_are_the_light_and_rows_the_viewer(tmp_path: Path) -> None:
    path = file_of(tmp_path, GREY)
    # The light at azimuth 180 is in patch 1, whose azimuth is 0; the viewer at azimuth 90 in patch 2.
    assert value(path, at(60, 180), at(60, 90)) == pytest.approx(MATRIX[2][1])
    assert value(path, at(60, 90), at(10, 33)) == pytest.approx(MATRIX[0][4])
    # The mirror direction is in the light's own patch.
    assert value(path, at(60, 250), at(60, 70)) == pytest.approx(MATRIX[2][2])
    rows = file_of(tmp_path, GREY.replace("Columns", "Rows"))
    assert value(rows, at(60, 180), at(60, 90)) == pytest.approx(MATRIX[1][2])


def test_the_front_of_the_file_has_x_on_the_other_side(tmp_path: Path) -> None:
    path = file_of(tmp_path, GREY.replace("Reflection Back", "Reflection Front"))
    # Right becomes left, up stays up.
    assert value(path, at(60, 0), at(60, 90)) == pytest.approx(MATRIX[2][1])
    assert value(path, at(60, 180), at(60, 90)) == pytest.approx(MATRIX[2][3])


def test_samples_are_at_the_middles_of_the_bands(tmp_path: Path) -> None:
    samples = read_samples(file_of(tmp_path, GREY))
    assert len(samples) == 25
    assert not samples.isotropic
    reflectance = open_file(file_of(tmp_path, GREY)).reflectance
    assert reflectance is not None
    assert torch.equal(reflectance.evaluate(samples.wi, samples.wo), samples.values)
    cap = 1 - math.cos(math.radians(30))
    ring = math.cos(math.radians(30)) / 4
    assert float(samples.weights[0] / samples.weights[-1]) == pytest.approx((cap / ring) ** 2)


def test_front_and_back_by_name(tmp_path: Path) -> None:
    front = window_block("Reflection Front", "Visible", matrix(2.0))
    path = file_of(tmp_path, window(window_block("Reflection Back", "Visible", matrix()) + front))
    assert format_.material_names(path) == ["front", "back"]
    with refused(found="holds Reflection Front and Reflection Back"):
        open_file(path)
    assert value(f"{path}#front", at(0, 0), at(0, 0)) == pytest.approx(2 * MATRIX[0][0])
    assert value(f"{path}#back", at(0, 0), at(0, 0)) == pytest.approx(MATRIX[0][0])
    # Where both are the same, none need be named.
    same = window(
        window_block("Reflection Back", "Visible", matrix()) + window_block("Reflection Front", "Visible", matrix())
    )
    assert open_file(file_of(tmp_path, same)).samples.provenance["side"] == "front"


def test_xyz_become_colours(tmp_path: Path) -> None:
    samples = read_samples(file_of(tmp_path, coloured_window()))
    flat = torch.tensor(MATRIX, dtype=torch.float64).T.reshape(-1, 1)
    wanted = from_xyz(flat * torch.tensor([0.9, 1.0, 0.8], dtype=torch.float64))
    assert torch.allclose(samples.values, wanted, atol=1e-9)


def test_what_depends_on_the_difference_of_azimuths_is_isotropic(tmp_path: Path) -> None:
    rows = [[1.0] + [0.5] * 4] + [[0.5] + [0.1 * min((i - o) % 4, (o - i) % 4) for i in range(4)] for o in range(4)]
    text = "\n".join(" ".join(map(str, row)) for row in rows)
    reading = open_file(file_of(tmp_path, window(window_block("Reflection Back", "Visible", text))))
    assert reading.samples.isotropic
    assert reading.samples.provenance["anisotropy"] < 1e-12
    assert not read_samples(file_of(tmp_path, GREY)).isotropic
    # What prefers one turn to the other is not mirror-symmetric.
    twisted = [[1.0] + [0.5] * 4] + [[0.5] + [(0.1, 0.2, 0.1, 0.9)[(o - i) % 4] for i in range(4)] for o in range(4)]
    text = "\n".join(" ".join(map(str, row)) for row in twisted)
    assert not read_samples(file_of(tmp_path, window(window_block("Reflection Back", "Visible", text)))).isotropic


def test_bases_divide_the_hemisphere() -> None:
    for basis, size in zip(BASES.values(), (145, 77, 41), strict=True):
        assert basis.size == size
        assert float(basis.projected.sum()) == pytest.approx(math.pi)
        assert float(basis.solid_angles.sum()) == pytest.approx(2 * math.pi)
        assert basis.index(basis.middles()).tolist() == list(range(size))
        draws = torch.rand(2, 16, dtype=torch.float64, generator=torch.Generator().manual_seed(0))
        inside = basis.inside(*draws)
        assert basis.index(inside.reshape(-1, 3)).tolist() == [k for k in range(size) for _ in range(16)]


def test_a_tree_of_four_dimensions(tmp_path: Path) -> None:
    # Branches: bit 0 and 1 are the light's square, bit 2 and 3 the viewer's; within a grid dimension 0 is slowest.
    leaves = [f"{{ {k} }}" for k in range(15)] + ["{ " + " ".join(str(100 + k) for k in range(16)) + " }"]
    path = file_of(tmp_path, tree_window("{\n" + "\n".join(leaves) + "\n}", 4))
    # The opposite of light at azimuth 225 is at 45: the upper half of both; the viewer at 225 in the lower.
    assert value(path, at(50, 225), at(50, 225)) == 3
    assert value(path, at(50, 45), at(50, 45)) == 12
    assert value(path, at(50, 135), at(50, 225)) == 1
    # In the grid both at 45 degrees: the coordinates' halves by their distance from the middle.
    assert value(path, at(80, 225), at(80, 45)) == 115
    assert value(path, at(5, 225), at(80, 45)) == 103
    assert not open_file(path).samples.isotropic


def test_a_tree_of_three_dimensions_is_isotropic(tmp_path: Path) -> None:
    # Light at the horizon is in the lower half of dimension 0, and the upper half is not used.
    path = file_of(tmp_path, tree_window("{ { 1 } { 0 } { 2 } { 0 } { 3 } { 0 } { 4 } { 0 } }"))
    for turn in (0, 70, 200):
        # The mirror direction has azimuth 0 in the square: a > 0; just beside it b > 0 or b < 0.
        assert value(path, at(40, turn), at(40, turn + 180 + 10)) == 4
        assert value(path, at(40, turn), at(40, turn + 180 - 10)) == 2
        assert value(path, at(40, turn), at(40, turn + 10)) == 1
    assert open_file(path).samples.isotropic
    assert value(path, at(0, 0), at(20, 0)) > 0


def test_the_square_and_the_disk_are_inverse_and_of_one_area() -> None:
    square = torch.rand(2000, 2, dtype=torch.float64, generator=torch.Generator().manual_seed(0))
    disk = to_disk(square)
    assert torch.allclose(to_square(disk), square, atol=1e-12)
    assert float((disk**2).sum(1).mean()) == pytest.approx(0.5, abs=0.02)
    assert to_square(torch.tensor([[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0]])).tolist() == [
        [1, 0.5], [0.5, 1], [0, 0.5], [0.5, 0],
    ]  # fmt: skip


def test_colours_of_a_tree_come_back() -> None:
    rgb = torch.rand(50, 3, dtype=torch.float64, generator=torch.Generator().manual_seed(0))
    assert torch.allclose(from_yuv(to_yuv(to_xyz(rgb, ("R", "G", "B")))), rgb, atol=1e-9)


@pytest.mark.parametrize("name", ["lafortune-blue-paint", "ward-brushed"])
def test_klems_bands_hold_the_means(tmp_path: Path, name: str) -> None:
    model = material(name).model
    facts = window_writer.write_klems(tmp_path / "out.xml", model, model.isotropic, name)
    assert facts["values"] == 6 * 145**2
    draws = torch.quasirandom.SobolEngine(4, scramble=True, seed=7).draw(4096, dtype=torch.float64).T
    lights, views = FULL.inside(draws[0], draws[1]), FULL.inside(draws[2], draws[3])
    for side in ("front", "back"):
        reading = open_file(f"{tmp_path / 'out.xml'}#{side}")
        assert isinstance(reading.reflectance, KlemsTable)
        assert reading.samples.isotropic == model.isotropic
        for i, o in ((0, 0), (5, 5), (30, 31), (100, 40), (144, 120)):
            light, view = lights[i], views[o]
            sign = torch.tensor([-1.0, 1, 1]) if side == "front" else torch.ones(3)
            wi, wo = light * sign * torch.tensor([-1.0, -1, 1]), view * sign
            wanted = model.evaluate(wi.double(), wo.double()).mean(0)
            found = reading.reflectance.values[i, o]
            assert torch.allclose(found, wanted, rtol=0.01), (i, o)


def test_a_constant_is_the_same_in_every_band() -> None:
    means = klems_means(Lambert((0.3, 0.2, 0.1)), FULL, True, 16)
    assert torch.allclose(means.table.values * math.pi, torch.tensor([0.3, 0.2, 0.1]).double(), atol=1e-12)
    assert means.error < 1e-12


def test_the_other_side_of_a_table_is_itself_again() -> None:
    values = torch.rand(145, 145, 1, dtype=torch.float64, generator=torch.Generator().manual_seed(0))
    table = KlemsTable(FULL, FULL, values, ("Y",))
    other = table.other_side()
    wi, wo = draw_uniform(200, torch.Generator().manual_seed(1))
    # Drawn to the middles of bands: at their edges the two differ by which band has the edge.
    wi, wo = (FULL.middles()[FULL.index(w)] for w in (wi, wo))
    assert torch.equal(table.evaluate(wi, wo), other.evaluate(wi, wo))
    assert not torch.equal(other.values, values)
    assert torch.equal(other.other_side().values, values)


@pytest.mark.parametrize("name", slow_among(["lafortune-blue-paint", "ward-brushed"], "lafortune-blue-paint"))
def test_trees_are_near_the_model(tmp_path: Path, name: str) -> None:
    model: Reflectance = material(name).model
    isotropic = name != "ward-brushed"
    window_writer.write_tree(tmp_path / "out.xml", model, isotropic, name)
    wi, wo = draw_cosine_weighted(2000, torch.Generator().manual_seed(3))
    wanted = model.evaluate(wi, wo).mean(1)
    for side in ("front", "back"):
        reflectance = open_file(f"{tmp_path / 'out.xml'}#{side}").reflectance
        assert reflectance is not None
        error = (reflectance.evaluate(wi, wo).mean(1) / wanted - 1).abs()
        assert float(error.median()) < 0.003
        assert float(error.mean()) < (0.01 if isotropic else 0.12)


TREE = "{ { 1 } { 0 } { 2 } { 0 } { 3 } { 0 } { 4 } { 0 } }"
THROUGH = window(window_block("Transmission Front", "Visible", matrix()))
SOLAR = window(window_block("Reflection Back", "Solar", matrix()))
WRONG = {
    "cut": (GREY[:-200], "damaged or cut XML"),
    "entities": (GREY.replace("<WindowElement", "<!DOCTYPE a [<!ENTITY b 'c'>]><WindowElement", 1), "a document type"),
    "no layer": (GREY.replace("Optical", "Thermal"), "without a layer, expected WindowElement/Optical/Layer"),
    "structure": (GREY.replace("Columns", "Spheres"), "IncidentDataStructure is 'Spheres', expected one of Columns"),
    "transmission": (THROUGH, "holds Transmission Front alone, expected Reflection Front or Reflection Back"),
    "empty": (window(""), "holds no reflection, expected Reflection Front or Reflection Back"),
    "band": (SOLAR, "Reflection Back at 'Solar' alone, expected Visible"),
    "two bands": (
        window(
            window_block("Reflection Back", "Visible", matrix()) + window_block("Reflection Back", "CIE-X", matrix())
        ),
        "Reflection Back with Visible and CIE-X but no CIE-Z, expected Visible alone, or with CIE-X and CIE-Z",
    ),
    "basis": (GREY.replace("<ColumnAngleBasis>Coarse", "<ColumnAngleBasis>Fine"), "ColumnAngleBasis is 'Fine'"),
    "few values": (GREY.replace("0.05,", "", 1), "Reflection Back, Visible: 24 values, expected 25, 5 × 5 of Coarse"),
    "many values": (GREY.replace("0.05,", "0.05, 1,", 1), "26 values, expected 25"),
    "word": (GREY.replace("0.05,", "x,", 1), "value 1 is 'x', expected a finite number"),
    "infinite": (GREY.replace("0.05,", "inf,", 1), "value 1 is 'inf'"),
    "gaps": (GREY.replace("<LowerTheta>30", "<LowerTheta>35"), "AngleBasis 'Coarse' whose rings leave gaps"),
    "short": (GREY.replace("<UpperTheta>90", "<UpperTheta>80"), "basis Coarse with counts"),
    "angles": (GREY.replace("<UpperTheta>30", "<UpperTheta>a"), "AngleBasis 'Coarse'"),
    "huge": (GREY.replace("<nPhis>4", "<nPhis>400000"), "basis Coarse with counts"),
    "tree basis": (tree_window(TREE).replace(SHIRLEY, ""), "AngleBasis is '', expected LBNL/Shirley-Chiu"),
    "branches": (tree_window(TREE.replace("{ 4 }", "")), "a node of 7 branches, expected 8, or values"),
    "grid": (tree_window("{ 1 2 3 }"), "a leaf of 3 values, expected 1, 8, 64, 512 or more"),
    "open": (tree_window(TREE[:-1]), "a tree that is cut"),
    "closed": (tree_window("} " + TREE), "a closing brace too many"),
    "two trees": (tree_window(TREE + TREE), "expected one tree"),
    "outside": (tree_window("5 " + TREE), "'5' outside of a leaf"),
    "leaf word": (tree_window(TREE.replace("3", "x")), "found 'x', expected a finite number"),
    "deep": (tree_window("{" * 40 + "1" + "}" * 40), "braces deeper than 20"),
}


@pytest.mark.parametrize("text", WRONG.values(), ids=list(WRONG))
def test_what_is_wrong_is_said(tmp_path: Path, text: tuple[str, str]) -> None:
    content, said = text
    with refused(said) as caught:
        open_file(file_of(tmp_path, content))
    assert "cloth.xml" in str(caught.value)


@pytest.mark.parametrize(
    ("member", "said"),
    [
        ("front", "no Reflection Front, expected #back, which it holds"),
        ("transmission", "no reading #transmission, expected front or back: homofact reads and fits reflection alone"),
    ],
)
def test_a_side_that_is_not_there_is_refused(tmp_path: Path, member: str, said: str) -> None:
    with refused(said):
        open_file(f"{file_of(tmp_path, GREY)}#{member}")


def test_a_basis_by_name_needs_no_definition(tmp_path: Path) -> None:
    quarter = "".join(f"<{w}AngleBasis>LBNL/Klems Quarter</{w}AngleBasis>" for w in ("Column", "Row"))
    text = "1 " * 41**2
    plain = window(window_block("Reflection Back", "Visible", text, quarter), basis="")
    assert len(read_samples(file_of(tmp_path, plain))) == 41**2
    assert COARSE not in plain
