"""A fit under an engine's own sky: its error is the sphere's, said and warned of; made-up skies are what they say."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import torch
from engine_cases import light_of
from skies import LAMBERT, Planted

from homofact.exporting import engine_light as module
from homofact.exporting.engine_light import engine_light
from homofact.exporting.engines import materialx, three
from homofact.rendering.chain_kernels import ChainKernels, ggx_kernels
from homofact.rendering.made_skies import MADE_SKIES, made_sky
from homofact.shading.languages import MATERIALX_SKY, THREE_SKY

KERNELS = ggx_kernels((0.0, 0.2, 0.4, 0.6, 1.0), 0.02)


@pytest.fixture(autouse=True)
def room_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """One sky and one lobe: the rest has tests of its own."""
    monkeypatch.setattr(module, "MADE_SKIES", ("lamp room",))
    monkeypatch.setattr(module, "LOBES", 1)


@pytest.mark.slow
def test_a_matte_material_is_held_and_a_retroreflector_is_warned_of() -> None:
    matte = engine_light(LAMBERT, KERNELS)
    assert list(matte.errors) == ["lamp room"]
    assert matte.worst < 0.03
    assert matte.warning == ""
    back = Planted(lambda wi, wo: torch.exp(-((wi - wo) ** 2).sum(1) / 0.005) * 20)
    lost = engine_light(back, KERNELS)
    assert lost.worst > 3 * module.POOR
    assert f"{lost.worst:.0%}" in lost.warning
    assert "as lamps" in lost.warning
    assert np.isfinite(lost.texels).all()


def test_what_is_said_is_what_was_measured() -> None:
    made = light_of(LAMBERT, KERNELS)
    assert made.texels.shape == (5, 64, 4)
    assert made.texels.dtype == np.float16
    assert made.record() == {
        "reads": 4, "bytes": 2560, "relative_rms": {"a sky": 0.02}, "meaning": made.record()["meaning"],
    }  # fmt: skip
    assert "2.0% (a sky)" in made.off()
    assert "2560 bytes" in made.sentence()
    assert made.off() in made.sentence()


def test_an_error_above_a_tenth_is_warned_of() -> None:
    made = light_of(LAMBERT, KERNELS)
    assert replace(made, errors={"room": 0.02, "sun": 0.099}).warning == ""
    poor = replace(made, errors={"room": 0.02, "sun": 0.112}).warning
    assert "11%" in poor
    # Engines with their own sky do not read the files of a filtered one.
    assert "prefilter" not in poor


@pytest.mark.slow
def test_the_table_has_the_lobes_that_it_should(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "LOBES", 2)
    assert engine_light(LAMBERT, KERNELS).table.lobes == 2


@pytest.mark.parametrize(("language", "given"), [(THREE_SKY, ""), (MATERIALX_SKY, ", sampler2D paint_texture_0")])
def test_the_code_reads_the_sky_by_the_engine_s_functions(language: Any, given: str) -> None:
    text = light_of(LAMBERT, KERNELS).code(language, "paint")
    assert f"vec3 paint_reflected(vec3 n, vec3 wo{given})" in text
    assert text.count("paint_sky_1(") == 3
    assert "paint_sky_2(n, 0.0)" in text
    assert "samplerCube" not in text


def test_the_kernels_of_the_engines_are_theirs() -> None:
    """three's levels of 256 texels (PMREMGenerator.lodToRoughness), MaterialX' any roughness."""

    def roughnesses(kernels: ChainKernels) -> list[float]:
        return [math.sqrt(alpha) for alpha in kernels.alphas]

    assert roughnesses(three.KERNELS) == pytest.approx([0, 0.10557, 0.22540, 0.36754, 0.55279, 1], abs=1e-5)
    assert three.KERNELS.ggx == "cosine"
    assert roughnesses(materialx.KERNELS) == pytest.approx([k / 16 for k in range(17)])
    assert materialx.KERNELS.ggx == "Smith"


@pytest.mark.parametrize("name", MADE_SKIES)
def test_a_made_sky_is_lit_from_above(name: str) -> None:
    sky = made_sky(name, 64)
    assert sky.radiance.shape == (64, 128, 3)
    assert sky.name == name
    assert float(sky.radiance[:32].mean()) > 1.5 * float(sky.radiance[32:].mean())


def test_the_overcast_sky_is_the_standard_one() -> None:
    sky = made_sky("overcast", 64).radiance[..., 1]
    height = torch.cos((torch.arange(32, dtype=torch.float64) + 0.5) * (math.pi / 64))
    assert torch.allclose(sky[:32], ((1 + 2 * height) / 3)[:, None].expand(-1, 128))
