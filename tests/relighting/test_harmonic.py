"""Transport in low-order harmonics: exact for light that has no more, the error that is known, the page's form."""

import math

import numpy as np
import pytest
import torch
from relighting_cases import EYE, MATT, ball, knot, occluder, whole
from relit_errors import errors_of

from homofact.errors import BadInput
from homofact.meshes.occlusion import Occluder
from homofact.relighting import cube
from homofact.relighting.errors import relative
from homofact.relighting.factoring import factor
from homofact.relighting.harmonic import harmonic
from homofact.relighting.lit import lit_tuples
from homofact.relighting.precompute import TransportSettings, transport
from homofact.relighting.relight import light_coefficients
from homofact.relighting.seen import SeenVertices, seen_vertices
from homofact.theory.harmonics import harmonics
from homofact.theory.reflection import lambertian_filter


def smooth_light(order: int, size: int) -> np.ndarray:
    """A cube map of harmonics up to `order`, of three colours."""
    w = torch.from_numpy(cube.directions(size).reshape(-1, 3))
    drawn = np.random.default_rng(4).normal(size=((order + 1) ** 2, 3)) * 0.1
    drawn[0] = 6
    found = (harmonics(order, w).numpy() @ drawn).reshape(6, size, size, 3)
    assert found.min() > 0
    return found


@pytest.mark.parametrize("order", [1, 3])
def test_light_of_no_higher_order_is_exact(order: int) -> None:
    light = smooth_light(order, 16)
    exact = lit_tuples(whole(16), None, light)
    found = harmonic(whole(16), order)
    # Texel centres of a cube map: their harmonics are orthogonal within a few tenths of a percent.
    assert relative(lit_tuples(whole(16), found, light), exact) < 0.01
    fewer = harmonic(whole(16), order - 1)
    assert relative(lit_tuples(whole(16), fewer, light), exact) > 0.02


def test_a_lamp_on_a_matt_ball_errs_as_ramamoorthi_says() -> None:
    """The orders of a matt lobe that are left out, of light that has all orders alike: 8% by nine numbers."""
    mesh = ball()
    made = transport(
        mesh, factor(MATT, map_size=8), TransportSettings(16, tolerance=0.0), Occluder(mesh.positions, mesh.triangles)
    )
    lamp = np.zeros((6, 16, 16, 3))
    lamp[2, 7:9, 7:9] = 100
    gains = lambertian_filter(12)
    power = (2 * torch.arange(13) + 1) * gains**2
    exact = lit_tuples(made, None, lamp)
    for order in (1, 2, 4):
        law = math.sqrt(float(power[order + 1 :].sum() / power.sum()))
        assert relative(lit_tuples(made, harmonic(made, order), lamp), exact) == pytest.approx(law, rel=0.25)


def test_it_takes_two_bytes_a_number_and_needs_no_places() -> None:
    found = harmonic(whole(), 2)
    assert found.order == 2
    assert found.nbytes == whole().vertices * whole().factors.terms * (9 * 2 + 4)


def test_the_largest_number_of_a_vector_takes_all_16_bits() -> None:
    found = harmonic(whole(), 2)
    largest = np.abs(found.number.astype(int)).max(2)
    assert (largest[found.step > 1e-20] == 32767).all()
    assert (largest > 0).mean() > 0.9


def test_the_page_s_form_is_the_same_light() -> None:
    found = harmonic(whole(16), 2)
    light = np.random.default_rng(1).uniform(0, 1, (6, 16, 16, 3))
    same = found.clustered()
    assert len(same.steps) == 1
    assert same.components == 9 * whole().factors.terms
    assert relative(lit_tuples(whole(16), same, light), found.tuples(light_coefficients(light, 16))) < 2e-3


def test_the_ledger_names_what_harmonics_lose() -> None:
    those: SeenVertices = seen_vertices(knot(), MATT, occluder(), EYE, 10)
    from homofact.scene.lighting import named_environment

    light = named_environment("studio")
    found = errors_of(those, whole(), harmonic(whole(), 2), light, ("harmonics", "together"))
    assert set(found.errors) == {"harmonics", "together"}
    assert found.errors["harmonics"] > 0.02


@pytest.mark.parametrize("order", [-1, 8])
def test_an_order_that_is_no_choice_is_refused(order: int) -> None:
    with pytest.raises(BadInput, match=f"harmonics: found order {order}, expected 0 to 7"):
        harmonic(whole(), order)
