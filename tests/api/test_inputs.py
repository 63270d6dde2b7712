"""What may be given to `homofact.read` and `homofact.fit`, and what is refused at the front."""

import math
import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

import homofact
from homofact.brdf.analytic import Phong
from homofact.brdf.source import Source
from homofact.errors import BadInput
from homofact.geometry.directions import draw_uniform

PAINT = Path(__file__).resolve().parents[2] / "data_synthetic" / "synthetic_cornell.brdf"
MODEL = Phong((0.1, 0.2, 0.3), (0.5, 0.4, 0.2), 20)
QUICK = homofact.McCool(size=4)
UP = np.array([0.0, 0.0, 1.0])


def directions(count: int = 300) -> tuple[np.ndarray, np.ndarray]:
    wi, wo = draw_uniform(count, torch.Generator().manual_seed(0))
    return wi.numpy(), wo.numpy()


def arrays(count: int = 300) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    wi, wo = directions(count)
    return wi, wo, np.asarray(MODEL.evaluate(wi, wo))  # type: ignore[arg-type]


def lambert(wi: np.ndarray, wo: np.ndarray) -> np.ndarray:
    assert isinstance(wi, np.ndarray)
    assert isinstance(wo, np.ndarray)
    return np.full((len(wi), 3), 0.3 / np.pi)


def in_torch(wi: torch.Tensor, wo: torch.Tensor) -> torch.Tensor:
    return torch.relu(wi[:, 2]).sqrt() * wo.clamp_min(0)[:, 2]


def test_samples_are_made_of_arrays_tensors_and_lists() -> None:
    wi, wo, values = arrays()
    expected = homofact.Samples(torch.from_numpy(wi), torch.from_numpy(wo), torch.from_numpy(values))
    assert (expected.channels, expected.isotropic) == (("R", "G", "B"), False)
    for convert in (np.asarray, np.ndarray.tolist, lambda a: torch.from_numpy(a)):
        made = homofact.Samples(convert(wi), convert(wo), convert(values), isotropic=True)
        assert torch.equal(made.wi, expected.wi)
        assert torch.equal(made.values, expected.values)
        assert torch.equal(made.weights, torch.ones(300, dtype=torch.float64))
        assert made.isotropic
    single = homofact.Samples(wi.astype(np.float32), wo.astype(np.float32), values[:, 0], weights=range(1, 301))
    assert (single.channels, single.values.shape, single.wi.dtype) == (("Y",), (300, 1), torch.float64)
    whole = homofact.Samples([[0, 0, 1]], [[1, 0, 0]], [[1, 2, 3]])
    assert whole.wi.tolist() == [[0, 0, 1]]
    # Of the caller's arrays nothing is kept.
    values[:] = -1
    assert bool((single.values >= 0).all())


@pytest.mark.parametrize(
    ("change", "where"),
    [
        ({"wi": UP}, "wi"),
        ({"wi": directions()[0].T}, "wi"),
        ({"wo": directions()[1][:-1]}, "wo"),
        ({"values": arrays()[2][:-1]}, "values"),
        ({"values": np.ones((300, 5))}, "values"),
        ({"values": "paint"}, "values"),
        ({"values": None}, "values"),
        ({"wi": directions()[0] + 1j}, "wi"),
        ({"wi": directions()[0] > 0}, "wi"),
        ({"wi": [[0, 0, 1], [0]]}, "wi"),
        ({"wi": -directions()[0]}, "wi"),
        ({"wo": directions()[1] * 2}, "wo"),
        ({"values": np.full((300, 3), math.nan)}, "values"),
        ({"values": np.full((300, 3), -1.0)}, "values"),
        ({"weights": np.ones(3)}, "weights"),
        ({"channels": ("R", "G")}, "values"),
        ({"channels": "RGB"}, "channels"),
        ({"wo": torch.from_numpy(directions()[1]).to("meta")}, "wo"),
    ],
)
def test_what_makes_no_samples_is_refused_in_a_line_that_names_it(change: dict[str, Any], where: str) -> None:
    wi, wo, values = arrays()
    given: dict[str, Any] = {"wi": wi, "wo": wo, "values": values} | change
    with pytest.raises(BadInput) as refused:
        homofact.Samples(**given)
    said = str(refused.value)
    assert where in said
    assert "expected" in said
    assert "\n" not in said


@pytest.mark.slow
def test_every_kind_of_source_is_read_and_fitted(tmp_path: Path) -> None:
    wi, wo, values = arrays()
    measured = homofact.Samples(wi, wo, values, isotropic=True)
    by_name = homofact.read(PAINT)
    assert by_name.opening is not None
    assert homofact.read(str(PAINT)).samples.values.equal(by_name.samples.values)
    fit = homofact.fit(by_name, QUICK)
    fit.save(tmp_path / "fit.npz")
    given: list[Any] = [
        "material:phong-10", os.fspath(PAINT), by_name, measured, (wi, wo, values), (wi, wo, values, np.ones(300)),
        MODEL, fit, homofact.load(tmp_path / "fit.npz"), lambert, in_torch,
    ]  # fmt: skip
    for source in given:
        read = homofact.read(source, count=300)
        assert isinstance(read, Source)
        for w in (UP, torch.from_numpy(UP).expand(2, 2, 3), [[0, 0, 1]]):
            assert np.shape(read.evaluate(w, w)) == (*np.shape(w)[:-1], len(read.channels))
    for source in (measured, (wi, wo, values), lambert, in_torch, MODEL):
        made = homofact.fit(source, QUICK)
        assert isinstance(made, homofact.Fit)
        assert made.verdict is not None
    one, same = (homofact.fit(source, QUICK) for source in (measured, (*arrays()[:2], values, None)))
    assert one.channels == same.channels


def test_a_function_is_drawn_in_its_own_kind_and_its_symmetry_found() -> None:
    source = homofact.read(lambert, count=200)
    assert (source.name, source.channels, source.samples.isotropic) == ("lambert", ("R", "G", "B"), True)
    assert torch.allclose(source.samples.values, torch.tensor(0.3 / math.pi, dtype=torch.float64))
    stripes = homofact.read(lambda wi, wo: 1 + wi[:, 0] * wo[:, 0], count=50)
    assert (stripes.channels, stripes.samples.isotropic) == (("Y",), False)
    assert homofact.read(in_torch, count=50).reflectance.takes_tensors  # type: ignore[attr-defined]
    under = source.evaluate(-UP, UP)
    assert under.tolist() == [0, 0, 0]


@pytest.mark.parametrize("call", [homofact.read, lambda source: homofact.fit(source, QUICK)])
@pytest.mark.parametrize(
    "source",
    [3, None, [PAINT], {}, homofact.McCool, (1, 2), (UP, UP, UP), lambda wi: wi, lambda wi, wo: 3.0, "none.brdf"],
)
def test_what_is_no_source_is_refused(call: Any, source: Any) -> None:
    with pytest.raises(BadInput) as refused:
        call(source)
    assert "expected" in str(refused.value)
    assert "\n" not in str(refused.value)


def test_what_is_no_method_and_no_path_is_refused() -> None:
    with pytest.raises(BadInput, match="method: found the class McCool, expected"):
        homofact.fit(MODEL, homofact.McCool)  # type: ignore[arg-type]
    with pytest.raises(BadInput, match="method: found the class McCool, expected"):
        homofact.fit(MODEL, homofact.McCool, size=4)  # type: ignore[arg-type]
    with pytest.raises(BadInput, match="path: found list, expected"):
        homofact.load([PAINT])  # type: ignore[arg-type]
    with pytest.raises(BadInput, match="channels: found 'luminance' beside Phong"):
        homofact.read(MODEL, channels="luminance")
    with pytest.raises(BadInput, match="calibrate, clipped, dismiss: found Phong"):
        homofact.read(MODEL, clipped=1.0)


def test_one_convention_to_undo_needs_no_list(tmp_path: Path) -> None:
    """The letters of a name are no names."""
    source = tmp_path / "a.csv"
    homofact.convert("material:phong-10", source, count=300)
    for name, undo in (("one", "cosine-o"), ("list", ["cosine-o"])):
        homofact.convert(source, tmp_path / f"{name}.csv", undo=undo)
    assert (tmp_path / "one.csv").read_text() == (tmp_path / "list.csv").read_text() != source.read_text()


def test_one_repair_needs_no_list(tmp_path: Path) -> None:
    source = tmp_path / "a.csv"
    homofact.convert("material:phong-10", source, count=300)
    one, several = (homofact.read(source, calibrate=asked).samples for asked in ("rows", ["rows"]))
    assert "rows" in one.provenance["gains"]
    assert torch.equal(one.values, several.values)
    homofact.convert(source, tmp_path / "b.csv", calibrate="rows")
    with pytest.raises(BadInput) as error:
        homofact.read(source, calibrate="row")
    assert "'row'" in str(error.value)
