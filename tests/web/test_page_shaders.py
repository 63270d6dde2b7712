"""The page's shaders in a headless Chromium give what Python gives, pair by pair.

WebGL runs in SwiftShader, in software. Shading languages leave acos to the implementation, and SwiftShader's is off by
up to 7e-5 radians: a program that used it would be seen here. All agree to float32.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import torch
from shading_cases import CASES, SEPARABLE
from torch import Tensor
from viewer_page import PAIRS, evaluate

from homofact.brdf.materials import material
from homofact.factor.factorization import Factorization
from homofact.factor.quantize import rounded
from homofact.separable.separable import Separable
from homofact.web.layers import fit_layer
from homofact.web.viewer import source_layer

pytestmark = pytest.mark.slow

Open = Callable[..., Any]
FLOAT: dict[str, Factorization | Separable] = {
    name: CASES[name]
    for name in (
        "fixed theta_h-theta_d", "fixed theta_i-theta_o", "searched in-out", "warped half-diff",
        "warped isotropic half-diff", "five of all kinds", "McCool, one channel",
    )
} | {
    name: SEPARABLE[name]
    for name in ("in-out, parabolic, shared", "half-diff, polar, two", "half-diff, orthographic, two")
}  # fmt: skip


@pytest.mark.parametrize("start", range(0, len(FLOAT), 3))
def test_shaders_give_what_python_gives(start: int, show: Open) -> None:
    cases = dict(zip("abc", list(FLOAT.items())[start : start + 3], strict=False))
    driver = show(*(fit_layer(fitted, key, name) for key, (name, fitted) in cases.items()))
    wi, wo = (w.clone() for w in PAIRS)
    wi[:20, 2] *= -1
    for key, (name, fitted) in cases.items():
        found, expected = evaluate(driver, key, wi, wo), fitted.evaluate(wi, wo).numpy()
        assert (found[:20] == 0).all(), name
        found, expected = found[20:], np.broadcast_to(expected[20:], (len(wi) - 20, 3))
        error = np.abs(found - expected) / np.maximum(expected, 1e-3 * expected.mean())
        assert np.median(error) < 1e-6, (name, np.median(error))
        # Maps are torn at a meridian; a sum of products is cut at 0, where relative errors are of no use.
        assert np.quantile(error, 0.99) < (1e-4 if isinstance(fitted, Separable) else 1e-5), (
            name,
            np.quantile(error, 0.99),
        )


def bound(fitted: Factorization, wi: Tensor, wo: Tensor) -> np.ndarray:
    """How far the page may be from Python for 8-bit textures, (N, C).

    A sampler may divide the way from texel to texel into 1/256 and round (to nearest or down), and may round what it
    returns to 8 bits (WebGL 2 promises no more of a texture with 8 bits). Along u the logarithm then moves by at most
    Du/256, Du the largest difference of neighbouring texels, likewise along v, and by half a step of the texture's
    scale. Over all lookups that is B, and f = A (exp s − ε) moves by at most (f + εA)(exp B − 1). A hundredth of it is
    added for float32 elsewhere, 7e-4 of the logarithm for acos.
    """
    total = np.zeros(len(fitted.channels))
    for term in fitted.terms:
        texture = term.texture
        across, along = (np.abs(np.diff(texture, axis=axis)).max((0, 1), initial=0) for axis in (1, 0))
        assert term.grid is not None
        total += term.projection.lookups * ((across + along) / 256 + term.grid.step / 2)
    mean, epsilon = fitted.transform.mean, fitted.transform.epsilon
    return (fitted.evaluate(wi, wo).numpy() + epsilon * mean) * np.expm1(1.01 * total + 7e-4)


def test_eight_bits_are_within_the_sampler_s_own_bound(show: Open) -> None:
    cases = {
        key: rounded(CASES[name], "png8")
        for key, name in (("a", "five of all kinds"), ("b", "fixed h"), ("c", "warped half-diff"))
    }
    driver = show(*(fit_layer(fitted, key, key) for key, fitted in cases.items()))
    wi, wo = PAIRS
    for key, fitted in cases.items():
        found, expected = evaluate(driver, key, wi, wo), fitted.evaluate(wi, wo).numpy()
        assert (np.abs(found - expected) <= bound(fitted, wi, wo)).all()
        # The bound tells an 8-bit texture from its neighbours: one read half a texel off is outside.
        moved = replace(
            fitted, terms=tuple(replace(t, texture=(t.texture + np.roll(t.texture, 1, 1)) / 2) for t in fitted.terms)
        )
        assert (np.abs(moved.evaluate(wi, wo).numpy() - expected) > bound(fitted, wi, wo)).any()


@pytest.mark.parametrize("name", ["lafortune-blue-paint", "ward-brushed"])
def test_the_source_in_the_page_is_the_table(name: str, show: Open) -> None:
    layer = source_layer(material(name).model)
    driver = show(layer)
    assert layer.table is not None
    wi, wo = (w.clone() for w in PAIRS)
    wi[0] = wo[0] = torch.tensor([0.0, 0.0, 1.0])
    wo[1], wi[1] = wi[1] * torch.tensor([-1.0, -1.0, 1.0]), wi[1]
    wo[2, 2] *= -1
    found, expected = evaluate(driver, "source", wi, wo), layer.table.evaluate(wi, wo).numpy()
    error = np.abs(found - expected) / np.maximum(expected, 1e-3 * expected.mean())
    assert (found[2] == 0).all()
    assert np.median(error) < 2e-4
    assert np.quantile(error, 0.999) < 1e-2
