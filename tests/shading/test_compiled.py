"""The program compiled for the processor gives what Python gives; its functions are those of mathematics."""

import math
from functools import cache

import numpy as np
import pytest
import torch
from llvmlite.binding import get_host_cpu_features
from numba import njit
from numba.core import config
from shading_cases import CASES, SEPARABLE, factorization, random_term, searched
from slow_cases import slow_among

from homofact.brdf.log_transform import LogTransform
from homofact.errors import BadInput
from homofact.factor.factorization import Factorization
from homofact.factor.projection import Projection, Warp, fixed_projection
from homofact.geometry.directions import draw_uniform
from homofact.geometry.expression import Let, variable, vector
from homofact.shading import float_functions
from homofact.shading.compiled import Compiled, compiled, compiled_program
from homofact.shading.kernel_source import BLOCK
from homofact.shading.program import Program


def pairs(count: int = 4001) -> tuple[torch.Tensor, torch.Tensor]:
    wi, wo = draw_uniform(count, torch.Generator().manual_seed(2))
    wi[:9, 2] *= -1
    return wi, wo


@cache
def fast_of(name: str) -> Compiled:
    """A case, compiled once for all tests: that takes seconds."""
    return compiled(CASES[name])


@pytest.mark.slow
@pytest.mark.parametrize("name", ["searched in-out", "warped half-diff", "five of all kinds", "McCool, one channel"])
def test_it_gives_what_python_gives(name: str) -> None:
    fitted = CASES[name]
    wi, wo = pairs()
    found, expected = fast_of(name).evaluate(wi, wo), fitted.evaluate(wi, wo)
    assert found.dtype == wi.dtype
    assert float(found[:9].abs().max()) == 0
    error = ((found - expected).abs() / expected.clamp_min(1e-6))[9:]
    assert float(error.median()) < 2e-6
    assert float(torch.quantile(error.flatten()[:10_000], 0.999)) < 1e-4


@pytest.mark.slow
def test_rows_and_single_texels() -> None:
    flat = Projection("in-out", torch.zeros(2, 4, dtype=torch.float64), False, "flat")
    line = fixed_projection("theta_h", True)
    terms = (random_term(line, 1, 3), random_term(flat, 2, 3, (1, 1)))
    fitted = Factorization(terms, LogTransform(1e-3, torch.ones(3, dtype=torch.float64)), ("R", "G", "B"))
    wi, wo = pairs()
    assert torch.allclose(compiled(fitted).evaluate(wi, wo), fitted.evaluate(wi, wo), rtol=1e-4)


@pytest.mark.slow
@pytest.mark.parametrize("channels", [1, 2, 3, 4])
def test_any_number_of_channels(channels: int) -> None:
    """Texels are one, two or four numbers wide; a row one texel high and a column one texel wide have no neighbours."""
    terms = tuple(
        random_term(fixed_projection(name, True), seed, channels, shape)
        for seed, (name, shape) in enumerate(
            [("theta_h-theta_d", (3, 7)), ("h", (1, 5)), ("theta_d-tilt", (6, 1)), ("wi", (4, 4))]
        )
    )
    mean = torch.linspace(0.5, 2, channels, dtype=torch.float64)
    fitted = Factorization(terms, LogTransform(1e-3, mean), tuple("ABCD"[:channels]))
    wi, wo = pairs(1000)
    assert torch.allclose(compiled(fitted).evaluate(wi, wo), fitted.evaluate(wi, wo), rtol=2e-4)


@pytest.mark.parametrize("name", slow_among(["searched in-out", "five of all kinds"], "five of all kinds"))
def test_directions_that_are_none_read_no_foreign_memory(name: str) -> None:
    fast = fast_of(name)
    wi, wo = (w.float().numpy() for w in pairs(100))
    odd = np.array([math.nan, math.inf, -math.inf, 1e30, -1e30, 0], np.float32)
    wi[10:28] = np.stack([np.roll(odd, k)[:3] for k in range(18)])
    expected = fast.evaluate_array(*(np.delete(w, np.s_[10:28], 0) for w in (wi, wo)))
    found = np.delete(fast.evaluate_array(wi, wo), np.s_[10:28], 0)
    assert np.allclose(found, expected, rtol=1e-5)


@pytest.mark.slow
def test_sums_of_products_too() -> None:
    fitted = SEPARABLE["in-out, polar, two"]
    fast = compiled(fitted)
    wi, wo = pairs()
    expected = fitted.evaluate(wi, wo)
    error = (fast.evaluate(wi, wo) - expected).abs() / expected.mean()
    assert float(error.median()) < 2e-6


@pytest.mark.parametrize("name", slow_among(["fixed h", "five of all kinds"], "five of all kinds"))
def test_blocks_need_not_be_full(name: str) -> None:
    """Equal bits, however many pairs are left over: on every processor, whatever its vectors' width."""
    fast = fast_of(name)
    wi, wo = (w.float().numpy() for w in pairs(2 * BLOCK + 7))
    whole = fast.evaluate_array(wi, wo)
    for count in (0, 1, BLOCK - 1, BLOCK, BLOCK + 1, 2 * BLOCK + 7):
        # What follows the values is not touched.
        out = np.full((count + 5, 3), 7, np.float32)
        fast.evaluate_array(wi[:count], wo[:count], out[:count])
        assert np.array_equal(out[:count], whole[:count])
        assert (out[count:] == 7).all()


@pytest.mark.slow
def test_pairs_side_by_side_do_not_see_each_other() -> None:
    fast = compiled(factorization(searched("isotropic-half-diff", 3, Warp(0.05))))
    wi, wo = (w.float().numpy() for w in pairs(500))
    order = np.random.default_rng(0).permutation(500)
    assert np.array_equal(fast.evaluate_array(wi[order], wo[order]), fast.evaluate_array(wi, wo)[order])


# Without fused products the argument's reduction is rounded once, which is a place of x itself: 88 · 2⁻²⁴.
FEATURES: str | None = vars(config)["CPU_FEATURES"]
FUSED = get_host_cpu_features().get("fma", False) if FEATURES is None else "+fma" in FEATURES
FUNCTIONS = [
    ("exp", np.linspace(-86.9, 87.9, 40_001), np.exp, 4e-7 if FUSED else 6e-6, 0),
    ("log", np.geomspace(1e-30, 1e30, 40_001), np.log, 0, 1.5e-5),
    ("log", np.geomspace(0.5, 4, 40_001), np.log, 0, 2e-7),
    ("asinh", np.geomspace(1e-3, 1e4, 40_001), np.arcsinh, 0, 2e-6),
]


@pytest.mark.parametrize(("name", "x", "function", "relative", "absolute"), FUNCTIONS)
def test_functions_of_one_number(name, x, function, relative, absolute) -> None:
    own = getattr(float_functions, name)

    @njit
    def every(x):  # pragma: no cover (compiled)
        return np.array([own(value) for value in x])

    x = x.astype(np.float32)
    expected = function(x.astype(np.float64))
    assert np.all(np.abs(every(x) - expected) <= relative * np.abs(expected) + absolute)


def test_the_angle_of_a_point() -> None:
    @njit
    def every(y, x):  # pragma: no cover (compiled)
        return np.array([float_functions.atan2(y[k], x[k]) for k in range(len(x))])

    angles = np.linspace(-math.pi + 1e-6, math.pi, 40_001)
    sizes = 10 ** np.random.default_rng(0).uniform(-6, 6, len(angles))
    y, x = (sizes * np.sin(angles)).astype(np.float32), (sizes * np.cos(angles)).astype(np.float32)
    expected = np.arctan2(y.astype(np.float64), x.astype(np.float64))
    assert np.abs(every(y, x) - expected).max() < 5e-7
    small = np.geomspace(1e-20, 1e-3, 1000).astype(np.float32)
    assert np.abs(every(small, np.ones_like(small)) / np.arctan(small.astype(np.float64)) - 1).max() < 4e-7
    assert every(np.zeros(1, np.float32), np.zeros(1, np.float32))[0] == 0


def test_exp_of_what_float32_cannot_hold_is_cut() -> None:
    @njit
    def one(x):  # pragma: no cover (compiled)
        return float_functions.exp(x)

    assert one(np.float32(1e6)) == pytest.approx(math.exp(88), rel=1e-4)
    assert 0 <= one(np.float32(-1e6)) <= 2e-38


@pytest.mark.parametrize(
    ("wi", "wo"),
    [
        (np.zeros((4, 3)), np.zeros((4, 3))),
        (np.zeros((4, 2), np.float32), np.zeros((4, 2), np.float32)),
        (np.zeros((4, 3), np.float32), np.zeros((5, 3), np.float32)),
    ],
)
def test_other_arrays_are_refused(wi, wo) -> None:
    fast = fast_of("fixed h")
    with pytest.raises(BadInput, match=r"expected float32 of shape \(N, 3\), N alike"):
        fast.evaluate_array(wi, wo)


def test_directions_may_lie_anyhow_in_memory_but_values_may_not() -> None:
    fast = fast_of("fixed h")
    wi, wo = (w.float().numpy() for w in pairs(50))
    columns = [np.asfortranarray(w) for w in (wi, wo)]
    assert np.array_equal(fast.evaluate_array(*columns), fast.evaluate_array(wi, wo))
    with pytest.raises(BadInput, match="out: found rows that are not one behind the other"):
        fast.evaluate_array(wi, wo, np.zeros((3, 50), np.float32).T)


def test_a_place_for_the_values_that_does_not_fit_is_refused() -> None:
    fast = fast_of("fixed h")
    w = np.zeros((4, 3), np.float32)
    for out in (np.zeros((4, 3)), np.zeros((3, 3), np.float32), np.zeros((4, 1), np.float32)):
        with pytest.raises(BadInput, match=r"out: found float.* expected float32 of shape \(4, 3\)"):
            fast.evaluate_array(w, w, out)


@pytest.mark.parametrize(
    ("scalar", "whose"), [("f_0", "f"), ("wi_2", "wi"), ("value_1", "the result"), ("row", "the kernel")]
)
def test_a_scalar_named_as_what_the_kernel_has_is_refused(scalar: str, whose: str) -> None:
    """A vector's components are scalars in the kernel: two of one name would silently be one value."""
    wi = variable("wi", 3)
    program = Program(
        (Let("f", vector(wi.x, wi.y, wi.z), ""), Let(scalar, wi.x * 2.0, "")),
        variable("f", 3) * variable(scalar, 1),
        (),
        ("r", "g", "b"),
        (),
    )
    with pytest.raises(
        BadInput, match=rf"^program: found {scalar} of {scalar} and of {whose}, expected different names$"
    ):
        compiled_program(program, [])
