"""Fits evaluated without torch: every kind of saved fit gives what torch gives, and only NumPy and numba are loaded."""

import math
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from shading_cases import CASES, SEPARABLE, random_term, searched

import homofact
from homofact import runtime
from homofact.brdf.analytic.ggx import GgxBrdf, GgxLobe
from homofact.brdf.analytic.spherical_gaussians import Gaussian, SphericalGaussians
from homofact.brdf.factored import BINS, FactoredBrdf
from homofact.brdf.log_transform import LogTransform
from homofact.brdf.neural import LAYERS, NeuralBrdf
from homofact.containers.formats import format_named
from homofact.errors import BadInput
from homofact.exporting.exported import exported, write_exported
from homofact.factor.factorization import Factorization
from homofact.factor.fitted import Fitted, QuantizationGrid
from homofact.factor.projection import fixed_projection
from homofact.files.archive import read_archive, write_archive
from homofact.geometry.directions import draw_uniform
from homofact.parametric.model_fit import ModelFit
from homofact.shading import on_arrays
from homofact.shading.on_arrays import TexturesOnArrays
from homofact.shading.program import Program

RGB = LogTransform(1e-3, torch.tensor([0.3, 0.2, 0.1], dtype=torch.float64))


def spectral(channels: int) -> Factorization:
    terms = (
        random_term(fixed_projection("h", True), 1, channels),
        random_term(searched("in-out", 5), 2, channels),
    )
    mean = torch.linspace(0.1, 2, channels, dtype=torch.float64)
    return Factorization(terms, LogTransform(1e-2, mean), tuple(f"{400 + 10 * k} nm" for k in range(channels)))


def network() -> NeuralBrdf:
    generator = torch.Generator().manual_seed(4)
    weights = [torch.randn(shape, generator=generator, dtype=torch.float64) * 0.4 for shape in LAYERS]
    biases = [torch.randn(shape[1], generator=generator, dtype=torch.float64) * 0.2 for shape in LAYERS]
    return NeuralBrdf((weights[0], weights[1], weights[2]), (biases[0], biases[1], biases[2]))


def whole_numbers() -> Factorization:
    """Textures on a grid, with deviations, as quantized fits and `--confidence` leave them."""
    fit = CASES["five of all kinds"]
    grid = QuantizationGrid(
        torch.full((3,), -1.0, dtype=torch.float64), torch.full((3,), 0.1, dtype=torch.float64), 255
    )
    terms = (
        replace(each, grid=grid, deviation=np.random.default_rng(0).random(each.texture.shape)) for each in fit.terms
    )
    return replace(fit, terms=tuple(terms))


def runaway() -> Factorization:
    """Texels whose logarithms together are beyond what float32 holds."""
    term = random_term(fixed_projection("theta_h-theta_d", True), 3, 3)
    return Factorization((replace(term, texture=term.texture * 400),), RGB, ("R", "G", "B"))


MODELS = {
    "ggx": GgxBrdf((0.3, 0.2, 0.1), (GgxLobe((0.5, 0.4, 0.6), 0.05, 0.08), GgxLobe((0.9, 0.5, 0.2), 0.4, 0.3))),
    "gaussians": SphericalGaussians(
        (0.2, 0.3, 0.4), (Gaussian((1.0, 0.5, 0.2), 60.0), Gaussian((0.1, 0.2, 0.3), 4.0)), 0.05
    ),
    "network": network(),
    "factored": FactoredBrdf(torch.rand(2 + 3 * BINS, 3, generator=torch.Generator().manual_seed(1)).double()),
}
FITS: dict[str, Fitted] = {
    **CASES,
    **SEPARABLE,
    "six channels": spectral(6),
    "eight channels": spectral(8),
    "whole numbers": whole_numbers(),
    "runaway": runaway(),
    **{name: ModelFit(model, RGB, {"seed": 1}) for name, model in MODELS.items()},
}
# Imports nothing from outside but what is named, evaluates every file of a folder, says what was loaded.
ALONE = """
import sys
from importlib.abc import MetaPathFinder
from pathlib import Path

class Only(MetaPathFinder):
    def find_spec(self, name, path=None, target=None):
        top = name.partition(".")[0]
        if top not in {*sys.stdlib_module_names, "numpy", "numba", "llvmlite", "homofact"}:
            raise ImportError(f"{name} is not to be had here")

sys.meta_path.insert(0, Only())
from homofact import runtime
assert "numba" not in sys.modules
import numpy as np
folder = Path(sys.argv[1])
pairs = np.load(folder / "pairs.npy")
found = {each.stem: runtime.load(each).evaluate(*pairs) for each in (folder / "fits").iterdir()}
assert "numba" not in sys.modules
if sys.argv[2] != "-":
    fast, = runtime.load(folder / "fits" / sys.argv[2]).on_arrays.compiled()
    found["compiled"] = fast.evaluate_array(*pairs.astype(np.float32))
    assert "numba" in sys.modules
np.savez(folder / "found.npz", **found)
print(*sorted({name.partition(".")[0] for name in sys.modules} & {"torch", "scipy", "colour", "rich", "typer"}))
"""


def pairs(count: int = 600) -> tuple[torch.Tensor, torch.Tensor]:
    wi, wo = draw_uniform(count, torch.Generator().manual_seed(3))
    # Some below the horizon, one straight down, one pair mirrored about the normal and one along it.
    wi[:9, 2] *= -1
    wi[9] = torch.tensor([0, 0, -1])
    wo[10] = wi[10] * torch.tensor([-1, -1, 1])
    wi[11] = wo[11] = torch.tensor([0, 0, 1])
    return wi, wo


@pytest.fixture(scope="module")
def loaded(tmp_path_factory: pytest.TempPathFactory) -> dict[str, homofact.Fit]:
    folder = tmp_path_factory.mktemp("fits")
    found = {}
    for number, (name, fit) in enumerate(FITS.items()):
        fit.save(folder / f"{number}.npz")
        found[name] = runtime.load(folder / f"{number}.npz")
    return found


@pytest.mark.parametrize("name", FITS)
def test_a_saved_fit_gives_what_torch_gives(name: str, loaded: dict[str, homofact.Fit]) -> None:
    fit, own, (wi, wo) = FITS[name], loaded[name], pairs()
    expected = fit.evaluate(wi, wo).numpy()
    found = own.evaluate(wi.numpy(), wo.numpy())
    assert own.channels == tuple(fit.channels)
    assert own.provenance == fit.provenance
    assert found.dtype == np.float64
    assert not found[:10].any()
    assert np.allclose(found, expected, rtol=1e-9, atol=1e-12)


def test_float32_is_answered_in_float32(loaded: dict[str, homofact.Fit]) -> None:
    wi, wo = (w.numpy().astype(np.float32) for w in pairs())
    for name in ("five of all kinds", "in-out, polar, two", "ggx", "network", "factored"):
        found = loaded[name].evaluate(wi, wo)
        exact = loaded[name].evaluate(wi.astype(np.float64), wo.astype(np.float64))
        assert found.dtype == np.float32
        assert float(np.median(np.abs(found - exact) / np.maximum(exact, 1e-6))) < 2e-6


@pytest.mark.slow
def test_no_more_than_numpy_and_numba_is_loaded(tmp_path: Path) -> None:
    (tmp_path / "fits").mkdir()
    chosen = ("five of all kinds", "in-out, polar, two", "six channels", *MODELS)
    for name in chosen:
        FITS[name].save(tmp_path / "fits" / f"{name}.npz")
    made = exported(FITS["five of all kinds"], format_named("ktx2"))
    write_exported(tmp_path / "fits" / "exported", made, {})
    wi, wo = pairs()
    np.save(tmp_path / "pairs.npy", torch.stack((wi, wo)).numpy())
    run = subprocess.run(
        [sys.executable, "-c", ALONE, str(tmp_path), "in-out, polar, two.npz"], capture_output=True, text=True
    )
    assert (run.returncode, run.stdout.split()) == (0, []), run.stderr
    found = np.load(tmp_path / "found.npz")
    assert set(found) == {*chosen, "compiled", "exported"}
    assert np.allclose(found["exported"], made.stored.evaluate(wi, wo).numpy(), rtol=1e-9, atol=1e-12)
    for name in chosen:
        assert np.allclose(found[name], FITS[name].evaluate(wi, wo).numpy(), rtol=1e-9, atol=1e-12), name
    expected = FITS["in-out, polar, two"].evaluate(wi, wo).numpy()
    error = np.abs(found["compiled"][10:] - expected[10:]) / expected.mean()
    assert float(np.median(error)) < 2e-6


def test_many_pairs_are_compiled_four_channels_each(
    monkeypatch: pytest.MonkeyPatch, loaded: dict[str, homofact.Fit]
) -> None:
    made = []

    class Counted:
        def __init__(self, program: Program, texels: list[np.ndarray]) -> None:
            made.append((program.channels, [each.dtype for each in texels], texels[0].shape[2]))

        def evaluate_array(self, wi: np.ndarray, wo: np.ndarray) -> np.ndarray:
            assert (wi.dtype, wo.dtype, wi.flags.c_contiguous) == (np.float32, np.float32, True)
            return np.full((len(wi), 4), wi[-1, 2], np.float32)

    monkeypatch.setattr("homofact.shading.on_arrays.MANY", 500)
    monkeypatch.setattr("homofact.shading.compiled.compiled_program", Counted)
    wi, wo = (w.numpy().astype(np.float32) for w in pairs())
    own = loaded["eight channels"].on_arrays
    assert isinstance(own, TexturesOnArrays)
    fit = replace(own)
    few = fit.evaluate(wi[:499], wo[:499])
    assert made == []
    many = fit.evaluate(wi, wo)
    names = FITS["eight channels"].channels
    assert made == [(names[:4], [np.float32] * 2, 4), (names[4:], [np.float32] * 2, 4)]
    assert (many.shape, many.dtype) == ((600, 8), np.float32)
    assert not many[:10].any()
    assert np.allclose(many[10:], wi[-1, 2], rtol=1e-6)
    assert np.allclose(few[10:], FITS["eight channels"].evaluate(*pairs()).numpy()[10:499], rtol=1e-3)
    # Whoever asks in float64 is answered in float64, however many pairs there are.
    exact = fit.evaluate(*(w.numpy() for w in pairs()))
    assert np.allclose(exact[10:], FITS["eight channels"].evaluate(*pairs()).numpy()[10:], rtol=1e-9)


def test_a_fetch_is_bilinear_between_centres_and_stays_beyond_the_edge() -> None:
    texels = np.arange(6.0).reshape(2, 3, 1)
    u = np.array([-0.5, 0, 0.5 / 3, 0.5, 2 / 3, 2.5 / 3, 1, 1.5])
    (low,) = on_arrays._fetch(texels, u, np.zeros(8))
    assert low.tolist() == pytest.approx([0, 0, 0, 1, 1.5, 2, 2, 2])
    (middle,) = on_arrays._fetch(texels, u, np.full(8, 0.5))
    assert (middle - low).tolist() == pytest.approx([1.5] * 8)
    (high,) = on_arrays._fetch(texels, u, np.full(8, 9.0))
    assert (high - low).tolist() == pytest.approx([3] * 8)
    (single,) = on_arrays._fetch(texels[:1, :1] + 7, u, u)
    assert single.tolist() == [7] * 8


def test_shapes_broadcast(loaded: dict[str, homofact.Fit]) -> None:
    fit, (wi, wo) = loaded["warped half-diff"], (w.numpy()[12:] for w in pairs(32))
    grid = fit.evaluate(wi[:, None], wo)
    assert grid.shape == (20, 20, 3)
    assert np.allclose(grid[3, 5], fit.evaluate(wi[3], wo[5]), rtol=1e-12)
    assert np.shape(fit.evaluate(wi[0].tolist(), wo[:2].tolist())) == (2, 3)
    assert np.shape(fit.evaluate([0, 0, 1], [0, 0, 1])) == (3,)
    assert fit.evaluate(np.empty((0, 3)), [0, 0, 1]).shape == (0, 3)
    # Chunks: none is left out, none counted twice.
    many = np.tile(wi, (1000, 1))
    assert np.array_equal(fit.evaluate(many, wo[0])[-20:], fit.evaluate(many[-20:], wo[0]))


@pytest.mark.parametrize(
    ("wi", "wo", "words"),
    [
        ([0.0, 1], [0.0, 0, 1], r"wi: found float64 of shape \(2,\), expected real numbers of shape \(..., 3\)"),
        ([0.0, 0, 1], ["a", "b", "c"], r"wo: found <U1"),
        ([0.0, 0, 1j], [0.0, 0, 1], r"wi: found complex128"),
        (1.0, [0.0, 0, 1], r"wi: found float64 of shape \(\)"),
        ([[0.0, 0, 1], [0.0]], [0.0, 0, 1], r"wi: found no table of numbers"),
        (np.zeros((2, 3)), np.zeros((5, 3)), r"found the shapes \(2, 3\) and \(5, 3\), expected shapes that broadcast"),
    ],
)
def test_what_are_no_directions_is_refused(wi, wo, words: str, loaded: dict[str, homofact.Fit]) -> None:
    with pytest.raises(BadInput, match=words):
        loaded["ggx"].evaluate(wi, wo)


def test_what_is_no_number_stays_none_and_disturbs_no_other(loaded: dict[str, homofact.Fit]) -> None:
    wi, wo = (w.numpy()[12:] for w in pairs(32))
    bad = wi.copy()
    bad[4] = math.nan
    for name in ("five of all kinds", "in-out, polar, two"):
        found = loaded[name].evaluate(bad, wo)
        assert np.array_equal(np.delete(found, 4, 0), np.delete(loaded[name].evaluate(wi, wo), 4, 0))


@pytest.mark.parametrize("name", ["five of all kinds", "in-out, polar, two", "ggx", "network"])
def test_damaged_files_are_refused_as_torch_refuses_them(name: str, tmp_path: Path) -> None:
    path = tmp_path / "fit.npz"
    FITS[name].save(path)
    arrays, header = read_archive(path)
    biggest = max((key for key in arrays if key != "header"), key=lambda key: arrays[key].size)

    def both(words: str) -> None:
        told = []
        for read in (homofact.load, runtime.load):
            with pytest.raises(BadInput, match=words) as refused:
                read(str(path))
            told.append(str(refused.value))
        assert told[0] == told[1]
        assert "\n" not in told[0]

    def changed(more: dict, **others: object) -> None:
        kept = {key: value for key, value in (arrays | more).items() if key != "header" and value is not None}
        write_archive(path, header | others, kept)

    changed({biggest: arrays[biggest] * math.nan})
    both("holds nan, expected numbers from")
    changed({biggest: arrays[biggest][..., None]})
    both("expected floats of shape")
    changed({biggest: None})
    both(f"holds no {biggest}, expected what save wrote")
    changed({}, format="another")
    both('format: found "another", expected one of')
    changed({}, format_version=99)
    both("format version 99, expected at most 1")
    changed({}, epsilon=-1.0)
    both("epsilon: found -1.0, expected a finite number above 0")
    path.write_bytes(path.read_bytes()[:500])
    both("not a saved factorization")
    path.unlink()
    both(r"fit\.npz")


def test_a_result_folder_is_read_and_one_without_a_fit_refused(tmp_path: Path) -> None:
    FITS["ggx"].save(tmp_path / "factorization.npz")
    up = np.array([0.0, 0, 1])
    expected = FITS["ggx"].evaluate(*(torch.from_numpy(up)[None],) * 2).numpy()[0]
    assert np.allclose(runtime.load(tmp_path).evaluate(up, up), expected, rtol=1e-12)
    (tmp_path / "factorization.npz").unlink()
    with pytest.raises(BadInput, match=r"found no factorization\.npz in the folder, expected a result of a fit"):
        runtime.load(tmp_path)
