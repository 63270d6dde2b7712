"""Shading programs: printed as C, compiled and run, they give what Python gives; their costs are counted."""

import itertools
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from compiled_c import c_of, run_c
from shading_cases import CASES, SEPARABLE, factorization, searched

from homofact.errors import BadInput
from homofact.factor.factorization import Factorization, Term
from homofact.factor.fitted import Fitted
from homofact.factor.projection import Warp, fixed_projection
from homofact.geometry.directions import draw_uniform
from homofact.geometry.expression import call, component, constant, variable, vector
from homofact.shading.c_code import c_source
from homofact.shading.cost import cost_of
from homofact.shading.encoding import Encoded, encode_texture
from homofact.shading.languages import GLSL, HLSL, WGSL, render, shader
from homofact.shading.program import program_of


def pairs(count: int = 4000) -> tuple[torch.Tensor, torch.Tensor]:
    return draw_uniform(count, torch.Generator().manual_seed(0))


def encoded(fitted: Fitted, storage: str = "float32") -> list[Encoded]:
    return [encode_texture(texture, storage) for texture in fitted.textures]


@pytest.mark.parametrize("name", CASES)
def test_c_gives_what_python_gives(name: str, tmp_path: Path) -> None:
    fitted = CASES[name]
    wi, wo = pairs()
    # Some pairs under the horizon, which give 0.
    wi[:50, 2] *= -1
    found = run_c(c_of(fitted, encoded(fitted)), len(fitted.channels), tmp_path, wi, wo)
    expected = fitted.evaluate(wi, wo).numpy()
    assert (found[:50] == 0).all()
    error = np.abs(found[50:] - expected[50:]) / np.maximum(expected[50:], 1e-6)
    assert np.median(error) < 2e-6
    assert np.quantile(error, 0.999) < 1e-4


@pytest.mark.parametrize("name", SEPARABLE)
def test_sums_of_products_too(name: str, tmp_path: Path) -> None:
    fitted = SEPARABLE[name]
    wi, wo = pairs()
    found = run_c(c_of(fitted, encoded(fitted)), len(fitted.channels), tmp_path, wi, wo)
    expected = fitted.evaluate(wi, wo).numpy()
    error = np.abs(found - expected) / expected.mean()
    assert np.median(error) < 2e-6
    # The polar map is torn at one meridian.
    assert np.quantile(error, 0.999) < 1e-3


def test_the_horizon_along_the_tangent_is_finite_and_agrees(tmp_path: Path) -> None:
    fitted = CASES["searched half-diff"]
    z = 1e-3
    grazing = torch.tensor([[(1 - z * z) ** 0.5, 0.0, z], [-((1 - z * z) ** 0.5), 0.0, z]], dtype=torch.float64)
    wi, wo = (torch.stack(part) for part in zip(*itertools.product(grazing, repeat=2), strict=True))
    found = run_c(c_of(fitted, encoded(fitted)), 3, tmp_path, wi, wo)
    assert np.allclose(found, fitted.evaluate(wi, wo).numpy(), rtol=1e-3)


def test_runaway_texels_are_cut_as_in_python(tmp_path: Path) -> None:
    term = CASES["fixed h"].terms[0]
    wild = Term(term.projection, term.texture * 100, term.mask)
    fitted = Factorization((wild,), CASES["fixed h"].transform, ("R", "G", "B"))
    source = c_of(fitted, encoded(fitted))
    assert "runaway" in source
    assert "runaway" not in c_of(CASES["fixed h"], encoded(CASES["fixed h"]))
    wi, wo = pairs()
    found = run_c(source, 3, tmp_path, wi, wo)
    assert np.isfinite(found).all()
    expected = fitted.evaluate(wi, wo).numpy()
    assert np.median(np.abs(found - expected) / np.maximum(expected, 1e-3)) < 1e-4


def constants(logs: tuple[float, ...], reciprocal: bool = False) -> Factorization:
    """A product of textures that are one number each."""
    names = ("wi", "h", "d")[: len(logs)]
    made = factorization(*(fixed_projection(name, reciprocal) for name in names))
    terms = tuple(replace(t, texture=np.full_like(t.texture, x)) for t, x in zip(made.terms, logs, strict=True))
    return replace(made, terms=terms)


@pytest.mark.parametrize("logs", [(70.0, 30.0), (30.0, 30.0, 30.0), (200.0, -150.0), (100.0, -10.0)])
def test_the_cut_is_of_the_sum_and_of_no_texture_by_itself(logs: tuple[float, ...], tmp_path: Path) -> None:
    fitted = constants(logs)
    wi, wo = pairs(5)
    source = c_of(fitted, encoded(fitted))
    found = run_c(source, 3, tmp_path, wi, wo)
    assert np.allclose(found, fitted.evaluate(wi, wo).numpy(), rtol=1e-4)
    assert np.allclose(found, fitted.transform.mean * np.exp(min(sum(logs), 80)), rtol=1e-4)
    assert ("runaway" in source) is (sum(logs) > 80)


def test_a_texture_that_is_looked_up_twice_counts_twice(tmp_path: Path) -> None:
    fitted = constants((50.0,), reciprocal=True)
    assert fitted.fetches == 2
    wi, wo = pairs(5)
    found = run_c(c_of(fitted, encoded(fitted)), 3, tmp_path, wi, wo)
    assert np.allclose(found, fitted.evaluate(wi, wo).numpy(), rtol=1e-4)


@pytest.mark.parametrize("storage", ["float16", "unorm8", "unorm16"])
def test_a_stored_texture_decodes_to_within_half_a_step(storage: str) -> None:
    term = CASES["fixed h"].terms[0]
    texture = encode_texture(CASES["fixed h"].textures[0], storage)
    step = {
        "float16": 2.0**-11,
        "unorm8": float(texture.scale.max()) / 255,
        "unorm16": float(texture.scale.max()) / 65535,
    }
    assert float(abs(texture.values - term.texture).max()) <= step[storage] / 2 * 1.001


def test_the_program_decodes_what_is_stored(tmp_path: Path) -> None:
    """The constants that the shader multiplies and adds, applied to raw texels, are the decoded texels' program."""
    fitted = CASES["five of all kinds"]
    textures = encoded(fitted, "unorm8")
    raw = c_source(program_of(fitted, textures), [texture.stored / 255 for texture in textures])
    wi, wo = pairs()
    direct = run_c(raw, 3, tmp_path, wi, wo)
    decoded = run_c(c_of(fitted, textures), 3, tmp_path / "..", wi, wo)
    assert np.median(np.abs(direct - decoded) / decoded.mean()) < 1e-5


def test_two_isotropic_textures_cost_three_fetches_and_under_forty_operations() -> None:
    """The dearest mix of two isotropic textures that the search can find: general, warped, conjugate."""
    fitted = factorization(searched("isotropic-half-diff", 3, Warp(0.03)), searched("isotropic-in-out", 4))
    cost = cost_of(program_of(fitted, encoded(fitted)), fitted.nbytes)
    assert cost.fetches == 3
    assert cost.total < 40


def test_counts_are_those_of_the_printed_operations() -> None:
    fitted = factorization(fixed_projection("h", True))
    program = program_of(fitted, encoded(fitted))
    text = "\n".join(
        line.split("//")[0] for line in shader(program, GLSL).splitlines() if " = " in line or "return" in line
    )
    cost = cost_of(program, 0)
    for operator in "+*/":
        assert text.count(f" {operator} ") == cost.operations.get(operator, 0), operator
    for name in ("dot(", "sqrt(", "exp(", "max(", "min(", "step("):
        assert text.count(name) == cost.operations.get(name[:-1], 0), name
    # s.xy: 2 additions, z: 1 and its guard; |s|²: 5, root 1; disc 1 + 2; uv 2 + 2; sum 3, exp 3, less 3, max 3; above 3
    # in all, and the product with it 3.
    assert cost.scalar == 2 + 2 + 5 + 1 + 1 + 2 + 2 + 2 + 3 + 3 + 3 + 3 + 2 + 3


def test_nothing_is_computed_that_is_not_read() -> None:
    text = shader(program_of(CASES["fixed theta_h"], encoded(CASES["fixed theta_h"])), GLSL)
    for absent in ("theta_d", "phi_d", "disc", " e ", "conjugate", "asinh", "if ("):
        assert absent not in text.split("{", 1)[1], absent


@pytest.mark.parametrize(
    ("language", "marks"),
    [
        (GLSL, ("uniform highp sampler2D fit_texture_0;", "vec3 fit_evaluate(vec3 wi, vec3 wo)", "textureLod(")),
        (
            HLSL,
            (
                "Texture2D<float4> fit_texture_0",
                "SamplerState fit_trilinear_clamp_sampler",
                ".SampleLevel(fit_trilinear_clamp_sampler, ",
            ),
        ),
        (
            WGSL,
            ("var fit_texture_0: texture_2d<f32>", "-> vec3<f32>", "textureSampleLevel(fit_texture_0, fit_sampler,"),
        ),
    ],
)
def test_each_language_declares_its_textures_and_says_what_it_evaluates(language, marks) -> None:
    fitted = CASES["five of all kinds"]
    text = shader(program_of(fitted, encoded(fitted)), language, "fit")
    for mark in (*marks, "epsilon = 0.001", "row 0 is at v = 0"):
        assert mark in text, mark
    assert max(len(line) for line in text.splitlines()) < 400


def test_parentheses_are_where_they_are_needed() -> None:
    a, b, c = (variable(name, 1) for name in "abc")
    assert render(a - (b - c), GLSL, "") == "a - (b - c)"
    assert render((a + b) * c, GLSL, "") == "(a + b) * c"
    assert render(a / (b * c), GLSL, "") == "a / (b * c)"
    assert render(a * b + c, GLSL, "") == "a * b + c"
    assert render(a * constant(-2), GLSL, "") == "a * (-2.0)"


def test_components_of_vectors() -> None:
    v = variable("v", 3)
    assert render(component(v * 2 + constant(1, 2, 3), 1), GLSL, "") == "v.y * 2.0 + 2.0"
    assert render(component(vector(v.zx, constant(7)), 2), GLSL, "") == "7.0"
    assert render(component(call("dot", v.xy, v.yz), 5), GLSL, "") == "v.x * v.y + v.y * v.z"


def test_more_than_four_channels_are_refused() -> None:
    term = CASES["fixed h"].terms[0]
    five = np.repeat(term.texture.mean(2, keepdims=True), 5, 2)
    transform = type(CASES["fixed h"].transform)(1e-3, torch.ones(5, dtype=torch.float64))
    fitted = Factorization((Term(term.projection, five, term.mask),), transform, tuple("abcde"))
    with pytest.raises(BadInput, match=r"channels: found 5, expected at most the 4 of a texture"):
        program_of(fitted, encoded(fitted))


def test_unknown_storages_are_refused() -> None:
    with pytest.raises(BadInput, match=r"storage: found 'float8', expected one of float32, float16"):
        encode_texture(CASES["fixed h"].textures[0], "float8")


def test_a_name_neither_ends_a_comment_nor_begins_a_line(tmp_path: Path) -> None:
    plain = CASES["fixed h"]
    term = plain.terms[0]
    named = replace(term.projection, name="h */ #error\n#error")
    odd = {"source": {"file": "a\n#error */ #error"}}
    fitted = replace(plain, terms=(replace(term, projection=named),), provenance=odd)
    wi, wo = pairs(50)
    assert np.allclose(run_c(c_of(fitted, encoded(fitted)), 3, tmp_path, wi, wo), plain.evaluate(wi, wo), rtol=1e-4)
    for language in (GLSL, HLSL, WGSL):
        text = shader(program_of(fitted, encoded(fitted)), language)
        assert not [line for line in text.splitlines() if line.startswith("#")]
