"""What every fit says of itself, product and sum alike: its evaluation as data, its textures, its manifest."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from brdf_files import WHOLE_FILES
from shading_cases import CASES, SEPARABLE
from torch import Tensor

import homofact
from homofact.errors import BadInput
from homofact.exporting.manifest import manifest
from homofact.factor.evaluation import evaluation_of
from homofact.factor.fitted import Fitted
from homofact.factor.quantize import LEVELS, is_solved, quantize, rounded
from homofact.geometry.coordinates import axes_of
from homofact.geometry.directions import draw_uniform
from homofact.linear.bilinear import lookup
from homofact.methods.saved import open_saved

EVERY: dict[str, Fitted] = {**CASES, **SEPARABLE}
ALL = pytest.mark.parametrize("name", EVERY)


def pairs() -> tuple[Tensor, Tensor]:
    return draw_uniform(500, torch.Generator().manual_seed(3))


def from_data(fitted: Fitted, wi: Tensor, wo: Tensor) -> Tensor:
    """F by the words of `Evaluation` alone."""
    evaluation, textures = evaluation_of(fitted), fitted.textures
    values = []
    for each in evaluation.lookups:
        x = axes_of(each.axes, wi, wo, each.scales, each.warp)
        values.append(lookup(torch.from_numpy(textures[each.texture].texels), x @ torch.from_numpy(each.matrix).T))
    total = torch.zeros_like(values[0])
    for product in evaluation.products:
        total = total + torch.stack([values[k] for k in product.lookups]).prod(0) * torch.tensor(product.signs)
    if evaluation.transform is None:
        return total.clamp_min(0)
    return torch.from_numpy(evaluation.transform.mean) * (total.exp() - evaluation.transform.epsilon).clamp_min(0)


@ALL
def test_the_evaluation_as_data_is_the_evaluation(name: str) -> None:
    fitted = EVERY[name]
    wi, wo = pairs()
    assert torch.allclose(from_data(fitted, wi, wo), fitted.evaluate(wi, wo), rtol=1e-9, atol=1e-12)
    assert len(evaluation_of(fitted).lookups) == fitted.fetches
    assert sum(texture.texels.size * 4 for texture in fitted.textures) == fitted.nbytes


@ALL
def test_other_texels_are_taken_and_the_rest_stays(name: str, tmp_path: Path) -> None:
    fitted = EVERY[name]
    wi, wo = pairs()
    same = fitted.with_textures([texture.texels for texture in fitted.textures])
    assert torch.equal(same.evaluate(wi, wo), fitted.evaluate(wi, wo))
    moved = fitted.with_textures([texture.texels + 0.1 for texture in fitted.textures], facts={"moved": True})
    assert not torch.allclose(moved.evaluate(wi, wo), fitted.evaluate(wi, wo))
    assert moved.provenance == fitted.provenance | {"moved": True}
    assert "moved" not in fitted.provenance
    with pytest.raises((ValueError, StopIteration)):
        fitted.with_textures([])
    moved.save(tmp_path / "fit.npz")
    assert torch.equal(open_saved(tmp_path / "fit.npz").evaluate(wi, wo), moved.evaluate(wi, wo))


@ALL
def test_rounded_texels_are_on_their_grid_and_survive_the_file(name: str, tmp_path: Path) -> None:
    fitted = rounded(EVERY[name], "png8")
    fitted.save(tmp_path / "fit.npz")
    again = open_saved(tmp_path / "fit.npz")
    assert again.provenance["quantize"] == "png8"
    for texture, before, read in zip(fitted.textures, EVERY[name].textures, again.textures, strict=True):
        assert texture.grid is not None
        assert read.grid is not None
        steps = (texture.texels - texture.grid.low) / texture.grid.step
        assert float(abs(steps - steps.round()).max()) < 1e-9
        assert 0 <= float(steps.min()) <= float(steps.max()) <= LEVELS["png8"] + 1e-9
        assert bool((abs(texture.texels - before.texels) <= texture.grid.step * 0.5001).all())
        assert np.array_equal(read.texels, texture.texels)
        assert np.array_equal(read.grid.low, texture.grid.low)
        assert np.array_equal(read.grid.step, texture.grid.step)
        assert read.grid.levels == texture.grid.levels == LEVELS["png8"]


@ALL
def test_its_manifest_is_plain_and_names_each_texture(name: str) -> None:
    fitted = EVERY[name]
    files = [{"exr": f"{texture.name}.exr"} for texture in fitted.textures]
    text = json.dumps(manifest(fitted, files), allow_nan=False)
    assert all(f'"{texture.name}.exr"' in text for texture in fitted.textures)
    assert all(texture.caption and texture.quantity in ("log", "factor") for texture in fitted.textures)
    with pytest.raises(BadInput, match="manifest: files of 0 textures"):
        manifest(fitted, [])
    json.dumps(fitted.describe(), allow_nan=False)


@ALL
def test_pairs_under_the_horizon_are_zero_even_straight_down(name: str) -> None:
    down = torch.tensor([[0.0, 0.0, -1.0]], dtype=torch.float64)
    up = torch.tensor([[0.0, 0.6, 0.8]], dtype=torch.float64)
    for wi, wo in ((down, up), (up, down), (down, down)):
        assert float(EVERY[name].evaluate(wi, wo).abs().max()) == 0


@pytest.mark.parametrize("method", [homofact.Svd, homofact.Nmf])
def test_a_sum_is_quantised_as_part_of_the_fit(method: Any) -> None:
    source = homofact.read("material:phong-10", count=1000)
    plain = homofact.fit(source, method(size=8, textures=2)).factorization
    eight = homofact.fit(source, method(size=8, textures=2, quantize="png8")).factorization
    assert not is_solved(plain)
    assert all(texture.grid is not None and texture.grid.levels == 255 for texture in eight.textures)
    assert np.array_equal(quantize(plain, source.samples, "png8").textures[0].texels, eight.textures[0].texels)
    wi, wo = pairs()
    off = (eight.evaluate(wi, wo) - plain.evaluate(wi, wo)).abs()
    assert 0 < float(off.mean()) < 0.02 * float(plain.evaluate(wi, wo).mean())


@pytest.mark.parametrize("form", ["rgl", "csv", "cornell", "nbrdf", "utia"])
def test_a_measurement_is_to_be_fitted_first(form: str, tmp_path: Path) -> None:
    path = WHOLE_FILES[form].make(tmp_path)
    with pytest.raises(BadInput) as caught:
        open_saved(path)
    assert (
        str(caught.value)
        == f"{path}: is a measurement, expected a saved fit (fit it first: `homofact.fit({str(path)!r})`)"
    )


def test_a_damaged_fit_is_no_measurement(tmp_path: Path) -> None:
    path = tmp_path / "fit.npz"
    next(iter(EVERY.values())).save(path)
    whole = path.read_bytes()
    for damaged in (whole[:-1], whole[: len(whole) // 2], b"no"):
        path.write_bytes(damaged)
        with pytest.raises(BadInput, match="not a saved factorization"):
            open_saved(path)
