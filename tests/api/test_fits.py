"""The library from Python: methods as objects, what a fit carries, arrays and lists, and what loading costs."""

import math
import subprocess
import sys
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

import homofact
from homofact.api.factorizing import FactorizeResult
from homofact.brdf.analytic.ggx import GgxBrdf, GgxLobe
from homofact.brdf.formats.csv import write as write_csv
from homofact.brdf.sampling import sample_model
from homofact.brdf.source import Source
from homofact.errors import BadInput, Status
from homofact.evaluation.metrics import measure
from homofact.evaluation.reopening import settings_of
from homofact.factor.factorization import Factorization
from homofact.factor.fitted import Fitted
from homofact.files.archive import read_archive, write_archive
from homofact.geometry.directions import draw_uniform
from homofact.methods.method import Method
from homofact.methods.table import (
    ALL_METHODS,
    METHODS,
    bytes_to_fill,
    made,
    made_each,
    mccool_like,
    methods_with,
    unused_settings,
    with_bytes,
)
from homofact.separable.separable import Separable

FAST: dict[str, Any] = {"size": 5, "restarts": 1, "search_size": 4, "search_samples": 100, "copies": 2, "effort": 20}


def quick(name: str, **more: Any) -> Any:
    own = {each.name for each in fields(METHODS[name])}
    return METHODS[name](**({each: value for each, value in FAST.items() if each in own} | more))


@pytest.fixture(scope="module")
def source() -> Source:
    return homofact.read("material:phong-10", count=400)


@pytest.mark.parametrize("name", METHODS)
def test_every_method_fits_and_its_fit_carries_report_and_verdict(name: str, source: Source, tmp_path: Path) -> None:
    method: Method = quick(name)
    fit = homofact.fit(source, method)
    assert fit.report is not None
    assert isinstance(fit.report.status, Status)
    assert fit.verdict is not None
    assert isinstance(fit.verdict.trusted, bool)
    wi, wo = draw_uniform(50, torch.Generator().manual_seed(0))
    values = fit.evaluate(wi, wo)
    assert isinstance(fit, homofact.Fit)
    assert torch.equal(values, fit.factorization.evaluate(wi, wo))
    assert (fit.channels, fit.nbytes, fit.fetches) == (
        fit.factorization.channels,
        fit.factorization.nbytes,
        fit.factorization.fetches,
    )
    fit.save(tmp_path / "fit.npz")
    back = homofact.load(tmp_path / "fit.npz")
    assert isinstance(back, homofact.Fit)
    assert torch.equal(back.evaluate(wi, wo), values)
    # The saved fit tells the method that made it, whole.
    assert settings_of(back) == replace(method, epsilon=source.default_epsilon)


def test_a_saved_fit_keeps_its_verdict_and_how_its_search_ended(source: Source, tmp_path: Path) -> None:
    fit = homofact.fit(source, quick("mccool"))
    fit.save(tmp_path / "fit.npz")
    back = homofact.load(tmp_path / "fit.npz")
    assert fit.verdict is not None
    assert back.verdict is not None
    assert (back.verdict.trusted, back.verdict.summary) == (fit.verdict.trusted, fit.verdict.summary)
    assert [each.name for each in back.verdict.findings] == [each.name for each in fit.verdict.findings]
    for quantity, theta in (("albedo", None), ("albedo", 45), ("highlight", None)):
        assert back.interval(quantity, theta) == fit.interval(quantity, theta)
    assert fit.report is not None
    assert back.report is not None
    assert (back.report.status, back.report.evaluations) == (fit.report.status, fit.report.evaluations)
    assert math.isnan(back.report.seconds)
    # Equal fits are equal files, also of one that took another time, or was read back.
    back.save(tmp_path / "again.npz")
    homofact.fit(source, quick("mccool")).save(tmp_path / "other.npz")
    files = {(tmp_path / name).read_bytes() for name in ("fit.npz", "again.npz", "other.npz")}
    assert len(files) == 1
    # What nobody judged has no verdict in its file.
    fit.with_textures([texture.texels for texture in fit.textures]).save(tmp_path / "bare.npz")
    bare = homofact.load(tmp_path / "bare.npz")
    assert (bare.verdict, bare.report) == (None, None)


@pytest.mark.parametrize("record", ["{", "[1]", '{"verdict": 3, "status": "gone"}', '{"verdict": {"trusted": "yes"}}'])
def test_a_record_that_says_nothing_is_passed_over(source: Source, tmp_path: Path, record: str) -> None:
    path = tmp_path / "fit.npz"
    homofact.fit(source, quick("mccool")).save(path)
    arrays, header = read_archive(path)
    write_archive(path, header, arrays | {"record": np.array(record)})
    assert (homofact.load(path).verdict, homofact.load(path).report) == (None, None)


def test_what_is_there_is_said_of_no_method_it_does_not_have() -> None:
    assert {name for name in METHODS if "textures" not in {f.name for f in fields(METHODS[name])}} == {"mccool"}
    assert methods_with("joint_terms") == ("cole",)
    assert methods_with("effort") == ("search",)
    assert methods_with("budget") == ("search", "cole")
    assert methods_with("decomposition") == ("svd",)
    assert methods_with("size") == tuple(METHODS)
    assert methods_with("seed") == methods_with("epsilon") == tuple(ALL_METHODS)
    assert methods_with("lobes") == ("ggx", "gaussians")


def test_settings_by_keyword_are_those_of_search(source: Source) -> None:
    with pytest.raises(BadInput, match=r"^joint_terms: search has no such setting, expected one of .*; cole has it$"):
        homofact.fit(source, joint_terms=1)
    with pytest.raises(BadInput, match=r"^parameterization: search has no such setting, expected one of its own"):
        homofact.fit(source, parameterization="h")
    with pytest.raises(BadInput, match=r"method: found a method and size beside it, .* as in McCool\(size=...\)"):
        homofact.fit(source, homofact.McCool(), size=8)
    with pytest.raises(BadInput, match="method: found 'mccool', expected one such as"):
        homofact.fit(source, "mccool")  # type: ignore[arg-type]
    fit = homofact.fit(source, **FAST, textures=1)
    assert fit.factorization.provenance["method"] == "search"


@pytest.fixture(scope="module", params=["mccool", "svd", "loaded"])
def reflecting(request: pytest.FixtureRequest, source: Source, tmp_path_factory: pytest.TempPathFactory) -> Any:
    if request.param != "loaded":
        return homofact.fit(source, quick(request.param))
    path = tmp_path_factory.mktemp("fits") / "fit.npz"
    homofact.fit(source, quick("mccool")).save(path)
    return homofact.load(str(path))


def test_arrays_lists_and_tensors_are_answered_in_kind(reflecting: Fitted) -> None:
    evaluate: Any = reflecting.evaluate
    wi, wo = draw_uniform(20, torch.Generator().manual_seed(3))
    expected = evaluate(wi, wo)
    assert isinstance(expected, torch.Tensor)
    arrays = evaluate(wi.numpy(), wo.numpy())
    assert isinstance(arrays, np.ndarray)
    assert arrays.dtype == np.float64
    # Arrays are evaluated by the shading program, tensors by torch.
    assert np.allclose(arrays, expected.numpy(), rtol=1e-9, atol=1e-12)
    assert evaluate(wi.tolist(), wo.tolist()) == arrays.tolist()
    assert torch.equal(evaluate(wi.numpy(), wo), expected)
    assert np.array_equal(evaluate(wi.numpy(), wo.tolist()), arrays)
    # Whole numbers, and a slice that runs backwards.
    assert evaluate([[0, 0, 1]], [[0, 0, 1]]) == evaluate([[0.0, 0.0, 1.0]], [[0.0, 0.0, 1.0]])
    assert np.array_equal(evaluate(wi.numpy()[::-1], wo.numpy()[::-1]), arrays[::-1])
    for dtype in (torch.float32, torch.float16, torch.bfloat16):
        single = evaluate(wi.to(dtype), wo.to(dtype))
        assert single.dtype == dtype
        assert torch.allclose(single.double(), expected, rtol=0.3, atol=0.02)
    half = evaluate(wi.numpy().astype(np.float16), wo.numpy().astype(np.float16))
    assert half.dtype == np.float16
    grid = evaluate(wi[:, None], wo)
    assert grid.shape == (20, 20, 3)
    assert torch.equal(grid[3, 5], evaluate(wi[3], wo[5]))
    assert evaluate(wi[:4].reshape(2, 2, 3), wo[:4].reshape(2, 2, 3)).shape == (2, 2, 3)
    with pytest.raises(BadInput, match=r"wo: found"):
        evaluate(wi.numpy(), [["a", "b", "c"]])
    with pytest.raises(BadInput, match=r"wi: found .* of shape \(20, 2\)"):
        evaluate(wi[:, :2], wo)
    with pytest.raises(BadInput, match=r"wo: found a tensor on meta, expected cpu"):
        evaluate(wi, wo.to("meta"))


def test_azimuth_copies_are_the_methods_own_and_only_of_what_needs_them(source: Source) -> None:
    at_all = source.samples
    azimuth = torch.atan2(at_all.wi[:, 1], at_all.wi[:, 0])
    measured = replace(at_all.turned(-azimuth), all_azimuths=False)
    assert at_all.all_azimuths
    turned = measured.rotated_at_random(5)
    for method in (quick("mccool", size=8), quick("cole", textures=1)):
        found = method.fit(measured).factorization
        assert found.provenance["samples"] == len(measured)
        misses = [measure(found, each, found.transform).log_mse for each in (measured, turned)]
        # Without copies the fit of one azimuth is no fit of another.
        assert misses[1] < 2 * misses[0]
    same = quick("mccool", projections=("theta_h-theta_d",))
    one, other = (same.fit(each).factorization for each in (measured, replace(measured, all_azimuths=True)))
    assert np.array_equal(one.terms[0].texture, other.terms[0].texture)


# What version 0.1.0 left of its settings in every file, whatever the method.
OLD: dict[str, Any] = {
    "method": "search", "textures": 2, "size": 16, "epsilon": None, "parameterization": None, "reciprocal": True,
    "solver": "cholesky", "smoothing": None, "together": 2, "restarts": 6, "search": "gradient",
    "validation": "rings", "budget": 20.0, "refine": "none", "search_size": None, "search_samples": 8000, "copies": 8,
    "mirrored": True, "bound": "disc", "projections": [], "map": "parabolic", "decomposition": None, "robust": False,
    "confidence": False, "quantize": "none", "seed": 0,
}  # fmt: skip


@pytest.mark.parametrize(
    ("old", "expected"),
    [
        ({}, homofact.Search(budget=20.0, objective="log", reciprocal=True)),
        (
            {"parameterization": "h+half-diff", "refine": "looks", "reciprocal": False, "search_size": 0, "seed": 3},
            homofact.Search(
                budget=20.0, projections=("h", "half-diff"), objective="log", reciprocal=False, search_size=0, seed=3
            ),
        ),
        ({"method": "cole", "together": 0, "textures": 5}, homofact.Cole(joint_terms=0, textures=5)),
        (
            {"method": "cole", "parameterization": "in-out", "smoothing": 0.5, "bound": "cube"},
            homofact.Cole(coordinates="in-out", smoothing=0.5, bound="cube"),
        ),
        ({"method": "mccool", "size": 8}, homofact.McCool(size=8)),
        ({"method": "mccool", "projections": ["wi", "h", "wo"]}, homofact.McCool(projections=("wi", "h", "wo"))),
        (
            {"method": "svd", "parameterization": "half-diff", "map": "polar"},
            homofact.Svd(coordinates="half-diff", map="polar"),
        ),
        ({"method": "svd", "decomposition": "power"}, homofact.Svd(decomposition="power")),
        ({"method": "nmf", "textures": 3, "budget": 1.0}, homofact.Nmf(textures=3)),
    ],
)  # fmt: skip
def test_the_settings_of_old_files_are_those_of_the_method(old: dict[str, Any], expected: Any, source: Source) -> None:
    # No settings are believed that name larger textures than there are.
    fitted = homofact.fit(source, replace(quick("mccool"), size=16)).factorization
    assert isinstance(fitted, Factorization)
    kept = OLD | old
    aged = replace(fitted, provenance=fitted.provenance | {"method": kept["method"], "settings": kept})
    assert settings_of(aged) == replace(expected, epsilon=fitted.transform.epsilon)


def test_mccools_own_factorization_has_what_a_method_shares_with_it() -> None:
    search = homofact.Search(size=9, epsilon=0.1, reciprocal=False, seed=4, quantize="png8", smoothing=None)
    assert mccool_like(search) == homofact.McCool(size=9, epsilon=0.1, reciprocal=False, seed=4, quantize="png8")
    assert mccool_like(homofact.McCool(projections=("d",), size=7)) == homofact.McCool(size=7)
    # As many bytes where bytes were given: 2 textures of 11² texels of 12 bytes take 2904, of 12² 3456.
    assert mccool_like(homofact.Search(bytes=3072)) == homofact.McCool(size=11)
    assert mccool_like(homofact.Search(bytes=20)).size == 2
    assert mccool_like(homofact.Svd(size=7, coordinates="half-diff")) == homofact.McCool(size=7)


def test_importing_and_making_methods_loads_no_torch() -> None:
    program = (
        "import sys, homofact\n"
        "methods = [getattr(homofact, name)() for name in ('Search', 'Cole', 'McCool', 'Svd', 'Nmf')]\n"
        "print([name for name in ('torch', 'numpy', 'scipy', 'matplotlib') if name in sys.modules])\n"
    )
    assert subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True).stdout == "[]\n"


def test_help_loads_no_torch() -> None:
    program = (
        "import sys\nfrom homofact.cli.main import main\n"
        "main(['--help']), main(['factorize', '--help']), main(['compare', '--help']), main(['research', '--help'])\n"
        "print([name for name in ('torch', 'numpy', 'scipy', 'matplotlib') if name in sys.modules])\n"
    )
    said = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True).stdout
    assert said.splitlines()[-1] == "[]"


def test_a_sum_of_products_is_a_fit_too(source: Source) -> None:
    assert isinstance(homofact.fit(source, quick("nmf")).factorization, Separable)


@pytest.mark.parametrize("name", METHODS)
def test_what_is_printed_is_a_line_without_numbers(name: str, source: Source) -> None:
    found = homofact.fit(source, quick(name))
    for shown in (found, found.factorization, source, source.samples):
        text = repr(shown)
        assert "tensor" not in text
        assert len(text) < 400  # a line or two, with the longest verdict
        assert "Y" in text or "R, G, B" in text
    assert found.verdict is not None
    assert found.verdict.summary in repr(found)
    assert repr(found.factorization) in repr(found)
    assert source.name in repr(source)
    assert "400 pairs" in repr(source)


@pytest.mark.slow
def test_a_files_name_is_read() -> None:
    place = Path(__file__).resolve().parents[2] / "data_synthetic" / "synthetic_cornell.brdf"
    by_name, read = (homofact.fit(each, homofact.McCool(size=4)) for each in (place, homofact.read(str(place))))
    up = [[0.0, 0.6, 0.8]]
    assert by_name.evaluate(up, up) == read.evaluate(up, up)
    with pytest.raises(BadInput, match=r"source: found int, expected a path"):
        homofact.fit(3, homofact.McCool(size=4))
    with pytest.raises(BadInput, match=r"none\.brdf"):
        homofact.fit("none.brdf")


def test_methods_that_are_compared_within_bytes_all_get_them() -> None:
    found = made_each(["search", "mccool", "mccool:d", "cole", "svd"], {"bytes": 3072, "textures": 2, "size": 16})
    assert found["search"].bytes == 3072
    sizes = {label: method.size for label, method in found.items() if label != "search"}
    # √(3072/(12 · textures)), rounded down.
    assert sizes == {"mccool": 11, "mccool:d": 16, "cole": 11, "svd": 11}
    with pytest.raises(BadInput) as refused:
        made_each(["search", "mccool"], {"bytes": 90})
    assert (refused.value.where, refused.value.found) == ("bytes", "90")
    assert made_each(["search", "mccool"], {})["mccool"] == homofact.McCool()
    # Also without a search beside them, and alone.
    assert {label: one.size for label, one in made_each(["mccool", "ggx"], {"bytes": 3072}).items() if label != "ggx"}
    assert made("mccool", {"bytes": 3072}).size == made("cole", {"bytes": 3072, "textures": 2}).size == 11
    assert unused_settings(["mccool", "ggx"], ["bytes"]) == {}
    assert list(unused_settings(["nbrdf", "ggx"], ["bytes"])) == ["bytes"]


@pytest.mark.parametrize(
    ("method", "stored"),
    [
        (homofact.Svd(textures=2), 2),
        (homofact.Svd(textures=2, reciprocal=False), 4),
        (homofact.Svd(textures=2, coordinates="half-diff"), 4),
        (homofact.Svd(textures=2, decomposition="normalized"), 2),
        (homofact.Nmf(textures=2), 4),
        (homofact.Nmf(textures=1, coordinates="in-out"), 2),
    ],
)
def test_a_decomposition_within_bytes_takes_the_largest_size(method: Method, stored: int, source: Source) -> None:
    sized = with_bytes(method, 12 * stored * 5**2 + 11)
    assert sized is not None
    assert sized.size == 5
    fit = homofact.fit(source, sized)
    assert (len(fit.textures), fit.nbytes) == (stored, 12 * stored * 5**2)


def test_the_bytes_that_a_method_had_to_fill() -> None:
    assert bytes_to_fill(made("search", {"bytes": 3000})) == 3000
    assert bytes_to_fill(made("search", {"textures": 3, "size": 8})) == 12 * 3 * 8**2
    assert bytes_to_fill(made("svd", {})) is None
    # McCool's textures of two sources may be 17 × 15 and 16 × 16: both had the bytes of 16².
    assert bytes_to_fill(homofact.McCool(size=16)) == 12 * 2 * 16**2


def test_a_model_of_two_lobes_is_named_if_one_errs_clearly_more(tmp_path: Path) -> None:
    wide, narrow = GgxLobe((0.5, 0.4, 0.3), 0.5, 0.05), GgxLobe((0.2, 0.2, 0.2), 0.15, 0.05)
    file = tmp_path / "list.csv"
    write_csv(str(file), sample_model(GgxBrdf((0.1, 0.2, 0.3), (wide, narrow)), 600, "lobe", 0))
    found = homofact.factorize(file, tmp_path / "rough", homofact.McCool(size=4))
    assert found.report["model"]["lobes"] == 2
    assert found.report["model"]["bytes"] == 52


def names_of(result: FactorizeResult) -> list[str]:
    return [each.name for each in result.verdict.findings]


def test_a_model_that_errs_no_more_than_the_textures_is_named(tmp_path: Path) -> None:
    model = GgxBrdf((0.1, 0.2, 0.3), (GgxLobe((0.5, 0.4, 0.3), 0.4, 0.05),))
    full = sample_model(model, 400, "discs", 0)
    file = tmp_path / "list.csv"
    write_csv(str(file), full)
    rough = homofact.factorize(file, tmp_path / "rough", homofact.McCool(size=4))
    assert rough.model is not None
    assert rough.report["model"] == {
        "method": "ggx", "lobes": 1, "bytes": 32, "held_out": rough.model.held_out.record(),
    }  # fmt: skip
    assert rough.model.held_out.log_mse < rough.row.held_out.log_mse
    # A result names its folder and its verdict, and not its samples and figures.
    assert len(repr(rough)) < 1200
    assert str(rough.folder) in repr(rough)
    assert rough.row.verdict.summary in repr(rough)
    assert rough.verdict is rough.row.verdict
    # Printed, it gives the findings and the model too, each in a line.
    first, *lines = str(rough).splitlines()
    assert str(rough.folder) in first
    assert lines[0] == rough.verdict.summary
    assert [line.partition(":")[0] for line in lines if line.partition(":")[0] in names_of(rough)] == names_of(rough)
    assert repr(rough.model.factorization) in lines[-1]
    # Without held-out samples nothing tells which is better.
    whole = homofact.factorize(file, tmp_path / "whole", homofact.McCool(size=4), held_out=0)
    assert whole.model is None
    # A fit without textures is a model itself, and a material has no list of samples.
    assert homofact.factorize(file, tmp_path / "ggx", homofact.Ggx()).model is None
    assert homofact.factorize("material:phong-10", tmp_path / "phong", homofact.McCool(size=4)).model is None
