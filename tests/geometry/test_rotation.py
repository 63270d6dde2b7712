"""Laws of unit quaternions, and of pairs and single ones as rotations of R⁴ and R³."""

import math

import pytest
import torch
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from refusals import refused
from torch import Tensor

from homofact.geometry.rotation import Rotation, basis_rotations, conjugate, multiply, power

NUMBER = st.floats(-1, 1, allow_nan=False)
EXPONENT = st.floats(-6, 6, allow_nan=False)
# Angles where a power is delicate: 0, π and next to them.
ANGLES = st.one_of(
    st.sampled_from([0.0, 1e-12, 1e-7, math.pi / 2, math.pi - 1e-7, math.pi - 1e-12]), st.floats(0, math.pi)
)


@st.composite
def quaternions(draw) -> Tensor:
    axis = torch.tensor(draw(st.tuples(NUMBER, NUMBER, NUMBER)), dtype=torch.float64)
    assume(float(axis.norm()) > 1e-3)
    angle = draw(ANGLES)
    return torch.cat((torch.tensor([math.cos(angle)], dtype=torch.float64), math.sin(angle) * axis / axis.norm()))


PAIRS = st.builds(Rotation.pair, quaternions(), quaternions())
SINGLES = st.builds(Rotation.single, quaternions())
ROTATIONS = st.one_of(PAIRS, SINGLES)
LAW = settings(max_examples=60, deadline=None)


def close(a: Tensor, b: Tensor, atol: float = 1e-12) -> bool:
    return torch.allclose(a, b, atol=atol, rtol=0)


@LAW
@given(quaternions(), quaternions(), quaternions())
def test_product_is_associative_and_keeps_length(a: Tensor, b: Tensor, c: Tensor) -> None:
    assert close(multiply(multiply(a, b), c), multiply(a, multiply(b, c)))
    assert abs(float(multiply(a, b).norm()) - 1) < 1e-12


def test_hamilton() -> None:
    one, i, j, k = torch.eye(4, dtype=torch.float64)
    assert torch.equal(multiply(i, j), k)
    assert torch.equal(multiply(j, k), i)
    assert torch.equal(multiply(k, i), j)
    assert torch.equal(multiply(j, i), -k)
    assert torch.equal(multiply(i, i), -one)


@LAW
@given(quaternions())
def test_conjugate_is_the_inverse(q: Tensor) -> None:
    assert close(multiply(q, conjugate(q)), torch.eye(4, dtype=torch.float64)[0])
    assert close(power(q, -1), conjugate(q))


@LAW
@given(quaternions(), EXPONENT, EXPONENT)
def test_powers_add(q: Tensor, a: float, b: float) -> None:
    assert close(multiply(power(q, a), power(q, b)), power(q, a + b), 1e-11)
    assert close(power(q, 1.0), q)
    assert close(power(q, 0.0), torch.eye(4, dtype=torch.float64)[0])
    assert close(power(q, 2.0), multiply(q, q))


def test_powers_of_minus_one_are_finite_and_continuous() -> None:
    minus = -torch.eye(4, dtype=torch.float64)[0]
    assert close(power(minus, 0.5), torch.eye(4, dtype=torch.float64)[1])
    assert close(power(minus, 2.0), -minus)


def apply(rotation: Rotation, v: Tensor) -> Tensor:
    """v turned by the definition, in quaternion products."""
    if rotation.dimension == 4:
        left, right = rotation.quaternions
        return multiply(multiply(left, v), right)
    q = rotation.quaternions[0]
    return multiply(multiply(q, torch.cat((v.new_zeros(1), v))), conjugate(q))[1:]


@LAW
@given(ROTATIONS)
def test_the_matrix_is_a_rotation_and_turns_as_the_quaternions_do(rotation: Rotation) -> None:
    matrix, k = rotation.matrix(), rotation.dimension
    assert matrix.shape == (k, k)
    assert close(matrix @ matrix.T, torch.eye(k, dtype=torch.float64))
    assert abs(float(torch.linalg.det(matrix)) - 1) < 1e-12
    v = torch.tensor([0.3, -0.1, 0.7, 0.2], dtype=torch.float64)[:k]
    assert close(apply(rotation, v), matrix @ v)
    assert close(Rotation(-rotation.quaternions).matrix(), matrix)


def test_a_single_quaternion_turns_by_twice_its_angle() -> None:
    quarter = torch.tensor([math.cos(math.pi / 4), 0, 0, math.sin(math.pi / 4)], dtype=torch.float64)
    x = torch.tensor([1.0, 0.0, 0.0], dtype=torch.float64)
    expected = torch.tensor([0.0, 1.0, 0.0], dtype=torch.float64)
    assert close(Rotation.single(quarter).matrix() @ x, expected)


@LAW
@given(PAIRS)
def test_one_sign_of_a_pair_is_another_rotation(pair: Rotation) -> None:
    left, right = pair.quaternions
    assert close(Rotation.pair(-left, right).matrix(), -pair.matrix())


@LAW
@given(st.one_of(st.tuples(PAIRS, PAIRS), st.tuples(SINGLES, SINGLES)))
def test_composition_is_the_matrix_product(two: tuple[Rotation, Rotation]) -> None:
    a, b = two
    assert close((a @ b).matrix(), a.matrix() @ b.matrix())


@LAW
@given(ROTATIONS)
def test_a_matrix_leads_back_to_its_rotation(rotation: Rotation) -> None:
    found = Rotation.from_matrix(rotation.matrix())
    assert found.dimension == rotation.dimension
    assert close(found.matrix(), rotation.matrix(), 1e-10)


@LAW
@given(ROTATIONS)
def test_numbers_lead_back_whatever_their_length(rotation: Rotation) -> None:
    assert close(Rotation.of_numbers(rotation.numbers * 3).quaternions, rotation.quaternions)


def test_what_is_no_rotation_is_refused() -> None:
    with refused(where="rotation", found="quaternions of shape (3, 4)"):
        Rotation(torch.zeros(3, 4))


def test_composition_does_not_commute() -> None:
    generator = torch.Generator().manual_seed(0)
    a, b = Rotation.random(generator), Rotation.random(generator)
    assert not close((a @ b).matrix(), (b @ a).matrix(), 1e-2)


@LAW
@given(ROTATIONS)
def test_inverse_undoes(pair: Rotation) -> None:
    assert close((pair @ pair.inverse()).matrix(), torch.eye(pair.dimension, dtype=torch.float64))
    assert close(pair.inverse().matrix(), pair.matrix().T)


@LAW
@given(ROTATIONS, EXPONENT, EXPONENT)
def test_powers_of_rotations_add(pair: Rotation, a: float, b: float) -> None:
    assert close((pair**a @ pair**b).matrix(), (pair ** (a + b)).matrix(), 1e-11)
    assert close((pair**1.0).matrix(), pair.matrix())


@pytest.mark.parametrize(("dimension", "count"), [(4, 6), (3, 3)])
def test_basis_rotations_span_so4_and_so3(dimension: int, count: int) -> None:
    step = 1e-6
    generators = []
    for rotation in basis_rotations(dimension):
        tangent = ((rotation**step).matrix() - (rotation**-step).matrix()) / (2 * step)
        assert close(tangent, -tangent.T, 1e-9)
        generators.append(tangent.reshape(-1))
    singular = torch.linalg.svdvals(torch.stack(generators))
    assert len(generators) == count
    assert float(singular.min()) > 1


@pytest.mark.parametrize("k", range(6))
def test_basis_rotations_are_periodic_in_four(k: int) -> None:
    pair = basis_rotations()[k]
    assert close((pair**4.0).matrix(), torch.eye(4, dtype=torch.float64))
    assert close((pair**2.3).matrix(), (pair**6.3).matrix(), 1e-11)
    assert not close((pair**2.3).matrix(), (pair**4.3).matrix(), 1e-2)


def test_random_pairs_are_unit_uniform_and_seeded() -> None:
    generator = torch.Generator().manual_seed(7)
    drawn = [Rotation.random(generator) for _ in range(2000)]
    left = torch.stack([pair.quaternions[0] for pair in drawn])
    assert close(left.norm(dim=1), torch.ones(2000, dtype=torch.float64))
    assert float(left.mean(0).abs().max()) < 0.05
    assert close((left**2).mean(0), torch.full((4,), 0.25, dtype=torch.float64), 0.02)
    assert torch.equal(Rotation.random(torch.Generator().manual_seed(7)).quaternions, drawn[0].quaternions)


def test_normalized_mends_the_drift() -> None:
    pair = Rotation.random(torch.Generator().manual_seed(1))
    drifted = Rotation(pair.quaternions * torch.tensor([[1.01], [0.97]]))
    assert close(drifted.normalized().matrix(), pair.matrix())
    assert not close(drifted.matrix(), pair.matrix(), 1e-3)


@pytest.mark.parametrize("dimension", [3, 4])
def test_arrays_make_the_same_bits_as_tensors(dimension: int) -> None:
    """A search asks for the matrix by arrays, a module that is trained by tensors with a slope."""
    rotation = Rotation.random(torch.Generator().manual_seed(5), dimension)
    taught = Rotation(rotation.quaternions.clone().requires_grad_())
    assert torch.equal(rotation.matrix(), taught.matrix().detach())
    taught.matrix().sum().backward()
    assert taught.quaternions.grad is not None
