"""Exports of GGX models: shaders without textures give what Python gives, and the manifest has the numbers."""

import json
from pathlib import Path

import numpy as np
import pytest
import torch
from compiled_c import c_of, run_c
from refusals import refused

import homofact
from homofact.brdf.analytic.ggx import GgxBrdf, GgxLobe
from homofact.brdf.log_transform import LogTransform
from homofact.containers.formats import format_named
from homofact.errors import BadInput
from homofact.exporting.exported import exported, write_exported
from homofact.exporting.exported_reader import open_exported
from homofact.geometry.directions import draw_uniform, from_spherical
from homofact.geometry.expression import nodes
from homofact.parametric.model_fit import ModelFit
from homofact.shading.program import program_of

ONE = GgxBrdf((0.3, 0.2, 0.1), (GgxLobe((0.5, 0.4, 0.6), 0.25, 0.08),))
NARROW = GgxBrdf((0.02, 0.2, 0.1), (GgxLobe((1.0, 1.1, 0.9), 0.01, 0.05), GgxLobe((0.9, 0.5, 0.2), 0.4, 0.3)))
GREY = GgxBrdf((0.3,), (GgxLobe((0.5,), 0.2, 0.1),), channels=("Y",))


def fit_of(model: GgxBrdf) -> ModelFit:
    return ModelFit(model, LogTransform(0.01, np.full(len(model.channels), 0.2)), {"homofact_version": "0", "seed": 0})


def hard_pairs() -> tuple[torch.Tensor, torch.Tensor]:
    """Directions everywhere, about mirror directions, along the horizon, below it, and opposite on it."""
    wi, wo = draw_uniform(3000, torch.Generator().manual_seed(0))
    angle = torch.linspace(0, 1.56, 200, dtype=torch.float64)
    for offset in (0.0, 0.003, 0.01, 0.05):
        near = (angle + offset).clamp_max(1.5707)
        wi = torch.cat((wi, from_spherical(angle, 0 * angle)))
        wo = torch.cat((wo, from_spherical(near, 0 * angle + torch.pi)))
    flat = torch.tensor([[1.0, 0.0, 0.0], [0.6, 0.0, -0.8], [1.0, 0.0, 0.0]], dtype=torch.float64)
    other = torch.tensor([[-1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, 1.0]], dtype=torch.float64)
    return torch.cat((wi, flat)), torch.cat((wo, other))


@pytest.mark.parametrize("model", [ONE, NARROW, GREY], ids=["one", "narrow", "grey"])
def test_the_compiled_shader_gives_the_models_values(model: GgxBrdf, tmp_path: Path) -> None:
    wi, wo = hard_pairs()
    found = run_c(c_of(fit_of(model), []), len(model.channels), tmp_path, wi, wo)
    # What 32 bits of the directions themselves move.
    expected = model.evaluate(wi.float().double(), wo.float().double()).numpy()
    assert np.allclose(found, expected, rtol=2e-3, atol=1e-6)
    assert np.median(np.abs(found / np.maximum(expected, 1e-9) - 1)[expected > 0]) < 1e-6
    assert not found[-2].any()


def test_a_shader_of_a_model_reads_no_texture() -> None:
    program = program_of(fit_of(NARROW), [])
    expressions = [program.result, *(statement.expression for statement in program.statements)]
    assert program.shapes == ()
    assert not [node for each in expressions for node in nodes(each) if node.kind in ("fetch", "cube", "table")]


@pytest.mark.parametrize("model", [ONE, NARROW, GREY], ids=["one", "narrow", "grey"])
def test_an_export_of_a_model_reads_back_with_its_numbers(model: GgxBrdf, tmp_path: Path) -> None:
    made = exported(fit_of(model), format_named("exr"))
    written = write_exported(tmp_path / "out", made, {})
    found = open_exported(tmp_path / "out")
    assert isinstance(found, ModelFit)
    assert found.model == model
    assert (written["kind"], written["textures"], written["cost"]["fetches"]) == ("ggx", [], 0)
    assert not [each.name for each in (tmp_path / "out").iterdir() if each.name.startswith("texture")]


@pytest.mark.parametrize(
    ("name", "value", "where"),
    [
        ("roughness", [0.0], "roughness"), ("roughness", [0.1, 0.2], "roughness"), ("specular", [], "specular"),
        ("specular", [[1.0, 1.0]], "specular"), ("diffuse", [0.1, 0.1, -0.1], "diffuse"),
        ("reflectance", [1.5], "reflectance"), ("reflectance", None, "reflectance"),
    ],
)  # fmt: skip
def test_numbers_that_no_model_has_are_refused(name: str, value: object, where: str, tmp_path: Path) -> None:
    write_exported(tmp_path / "out", exported(fit_of(ONE), format_named("exr")), {})
    place = tmp_path / "out" / "manifest.json"
    record = json.loads(place.read_text(encoding="utf-8"))
    record["model"][name] = value
    place.write_text(json.dumps(record), encoding="utf-8")
    with pytest.raises(BadInput) as told:
        open_exported(tmp_path / "out")
    assert "manifest.json" in str(told.value)
    assert where in str(told.value)


def test_a_model_has_no_texels_to_solve_for(tmp_path: Path) -> None:
    fit = homofact.fit("material:phong-10", homofact.Ggx())
    with refused(where="quantize"):
        homofact.export(fit, tmp_path / "out", quantize="png8")
    assert not list(tmp_path.iterdir())


def test_models_that_no_shader_is_made_of_are_refused(tmp_path: Path) -> None:
    fit = homofact.fit("material:phong-10", homofact.Gaussians())
    with pytest.raises(BadInput, match="has no textures"):
        homofact.export(fit, tmp_path / "out")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("engine", ["three", "gltf", "materialx", "godot", "blender", "pbrt"])
def test_every_engine_takes_a_model(engine: str, tmp_path: Path) -> None:
    fit = homofact.fit("material:cook-torrance-plastic", homofact.Ggx())
    made = homofact.export(fit, tmp_path / "out", engine=engine)
    assert made.cost.fetches == 0
    reread = homofact.load(tmp_path / "out")
    wi, wo = draw_uniform(50, torch.Generator().manual_seed(1))
    assert torch.equal(reread.evaluate(wi, wo), fit.evaluate(wi, wo))
