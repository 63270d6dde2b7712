"""Tables by incidence: values at nodes, highlights that follow the mirror direction, integrals, refusals."""

import math

import pytest
import torch
from refusals import refused

from homofact.brdf.incidences import IncidenceTable, IncidenceTables, directions, reflected
from homofact.geometry.directions import draw_uniform, from_spherical
from homofact.geometry.quadrature import hemisphere_nodes

POLAR = torch.arange(0, 91, 5, dtype=torch.float64).deg2rad()
TURN = torch.arange(0, 361, 10, dtype=torch.float64).deg2rad()
HALF = torch.arange(0, 181, 10, dtype=torch.float64).deg2rad()


def table(theta: float, values: torch.Tensor, azimuth: torch.Tensor = TURN, turn: float = 0.0) -> IncidenceTable:
    return IncidenceTable(math.radians(theta), math.radians(turn), POLAR, azimuth, values)


def lobe(theta: float) -> IncidenceTable:
    """A highlight about the mirror direction, on a grid about the normal."""
    made = table(theta, torch.zeros(len(POLAR), len(TURN), 1, dtype=torch.float64))
    wo = directions(made, about_mirror=False)
    mirror = from_spherical(torch.tensor(math.radians(theta)), torch.tensor(math.pi)).double()
    return table(theta, torch.exp(-20 * (1 - wo @ mirror)).reshape(len(POLAR), len(TURN), 1))


def light(*degrees: float) -> torch.Tensor:
    theta = torch.tensor(degrees, dtype=torch.float64).deg2rad()
    return from_spherical(theta, torch.zeros_like(theta))


@pytest.mark.parametrize("azimuth", [TURN, TURN[:-1], HALF], ids=["closed", "open", "half"])
@pytest.mark.parametrize("about_mirror", [False, True])
def test_a_constant_is_the_same_everywhere(azimuth: torch.Tensor, about_mirror: bool) -> None:
    values = torch.full((len(POLAR), len(azimuth), 1), 0.25, dtype=torch.float64)
    tables = IncidenceTables(((table(10, values, azimuth), table(50, values, azimuth)),), about_mirror, ("Y",))
    wi, wo = draw_uniform(300, torch.Generator().manual_seed(0))
    assert torch.allclose(tables.evaluate(wi, wo), torch.tensor(0.25, dtype=torch.float64), atol=1e-14)
    assert float(reflected(tables.tables[0][0])) == pytest.approx(0.25 * math.pi, rel=1e-9)
    assert tables.isotropic


@pytest.mark.parametrize("about_mirror", [False, True])
def test_nodes_are_read_back(about_mirror: bool) -> None:
    generator = torch.Generator().manual_seed(1)
    values = [torch.rand(len(POLAR), len(TURN) - 1, 2, dtype=torch.float64, generator=generator) for _ in range(4)]
    # At polar angle 0 all azimuths are one direction.
    values = [torch.cat((each[:1, :1].expand(1, len(TURN) - 1, 2), each[1:])) for each in values]
    rows = tuple(
        tuple(table(theta, values[2 * j + k], TURN[:-1], turn) for k, theta in enumerate((20, 60)))
        for j, turn in enumerate((0, 90))
    )
    tables = IncidenceTables(rows, about_mirror, ("a", "b"))
    wi, wo, found, weights = tables.nodes()
    assert not tables.isotropic
    inner = wo[:, 2] > 1e-6
    assert torch.allclose(tables.evaluate(wi, wo)[inner], found[inner], atol=1e-9)
    assert float(wo[:, 2].min()) >= 0
    assert float(weights.mean()) == pytest.approx(1)


def test_a_highlight_follows_the_mirror_direction_between_incidences() -> None:
    tables = IncidenceTables(((lobe(20), lobe(40)),), False, ("Y",))
    theta = torch.arange(0, 90, 0.5, dtype=torch.float64).deg2rad()
    seen = from_spherical(theta, torch.full_like(theta, math.pi))
    found = tables.evaluate(light(30).expand(len(seen), 3), seen)[:, 0]
    assert math.degrees(float(theta[found.argmax()])) == pytest.approx(30, abs=0.5)
    assert float(found.max()) > 0.97
    # On the way back there is none.
    back = tables.evaluate(light(30), light(30))
    assert float(back) == pytest.approx(math.exp(-20 * (1 - math.cos(math.radians(60)))), rel=0.2)


def test_a_table_whose_viewer_would_be_under_the_horizon_has_no_say() -> None:
    ones = torch.ones(len(POLAR), len(TURN), 1, dtype=torch.float64)
    tables = IncidenceTables(((table(20, ones), table(40, 3 * ones)),), False, ("Y",))
    # 45 degrees beyond the mirror direction are 65 and 85 in the tables; 55 degrees are 75 and 95.
    seen = from_spherical(torch.tensor([75.0, 85.0]).deg2rad(), torch.full((2,), math.pi)).double()
    assert tables.evaluate(light(30).expand(2, 3), seen)[:, 0].tolist() == pytest.approx([2, 1])


def test_light_turned_about_the_normal_turns_what_is_seen() -> None:
    tables = IncidenceTables(((lobe(20), lobe(40)),), False, ("Y",))
    wi, wo = draw_uniform(100, torch.Generator().manual_seed(2))
    cos, sin = math.cos(1.1), math.sin(1.1)
    turn = torch.tensor([[cos, -sin, 0], [sin, cos, 0], [0, 0, 1]], dtype=torch.float64)
    assert torch.allclose(tables.evaluate(wi, wo), tables.evaluate(wi @ turn.T, wo @ turn.T), atol=1e-12)


def test_rotations_are_linear_and_go_round() -> None:
    ones = torch.ones(len(POLAR), len(TURN), 1, dtype=torch.float64)
    tables = IncidenceTables(tuple((table(30, (k + 1) * ones, turn=90.0 * k),) for k in range(4)), False, ("Y",))
    wi = from_spherical(torch.full((3,), 0.5), torch.tensor([math.pi / 4, math.pi / 2, -math.pi / 4])).double()
    wo = light(10).expand(3, 3)
    assert tables.evaluate(wi, wo)[:, 0].tolist() == pytest.approx([1.5, 2.0, 2.5])


def test_the_integral_is_that_of_the_reflectance() -> None:
    one = lobe(35)
    wi = light(35)
    wo, solid = hemisphere_nodes(wi)
    tables = IncidenceTables(((one,),), False, ("Y",))
    values = tables.evaluate(wi.expand(wo.shape[1], 3), wo[0])[:, 0]
    assert float(reflected(one)) == pytest.approx(float((values * solid[0] * wo[0, :, 2]).sum()), rel=2e-4)


def test_what_has_no_order_is_refused() -> None:
    ones = torch.ones(len(POLAR), len(TURN), 1, dtype=torch.float64)
    with refused(found="azimuths over 90 degrees"):
        table(0, ones[:, :10], TURN[:10])
    with refused(found="azimuths do not rise"):
        table(0, ones, TURN.flip(0))
    with refused(found="(19, 37) values"):
        table(0, ones, HALF)
    with refused(found="angles of incidence do not rise"):
        IncidenceTables(((table(30, ones), table(10, ones)),), False, ("Y",))
    with refused(found="rotations of the sample do not rise"):
        IncidenceTables(((table(30, ones),), (table(30, ones),)), False, ("Y",))
    with refused(found="tables with other channels"):
        IncidenceTables(((table(30, ones),),), False, ("R", "G", "B"))
    with refused(found="no incidence"):
        IncidenceTables((), False, ("Y",))
