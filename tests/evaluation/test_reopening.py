"""A saved fit finds its source again, wherever both have gone, with the error that it was measured with."""

import json
import os
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from slow_cases import slow_among

import homofact
from homofact.brdf.neural import LAYERS
from homofact.brdf.source import open_source
from homofact.containers.formats import format_named
from homofact.errors import BadInput
from homofact.evaluation.compare import ComparisonRow, fit_and_measure
from homofact.evaluation.metrics import measure
from homofact.evaluation.reopening import NotReopened, Reopened, reopen
from homofact.evaluation.split import Split, without_places
from homofact.exporting.exported import exported, write_exported
from homofact.factor.fitted import Fitted
from homofact.methods.cole import Cole
from homofact.methods.mccool import McCool
from homofact.methods.method import Method
from homofact.methods.nmf import Nmf
from homofact.methods.search import Search
from homofact.methods.svd import Svd

pytestmark = pytest.mark.usefixtures("unseen")
PAINT = Path(__file__).resolve().parents[2] / "data_synthetic" / "synthetic_cornell.brdf"
QUICK = McCool(size=6)
SEARCHED: dict[str, Any] = {"textures": 1, "size": 6, "restarts": 1, "search_size": 4, "search_samples": 100}


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The working folder of a user: data/paint.brdf and data/networks.npz in it."""
    place = tmp_path / "here"
    (place / "data").mkdir(parents=True)
    shutil.copy(PAINT, place / "data" / "paint.brdf")
    rng = np.random.default_rng(0)
    arrays: dict[str, Any] = {
        f"{name}/{part}{k}": rng.normal(0, 0.3, shape).astype(np.float32)
        for name in ("tin", "zinc")
        for k, layer in enumerate(LAYERS)
        for part, shape in (("w", layer), ("b", layer[1]))
    }
    np.savez(place / "data" / "networks.npz", **arrays)
    monkeypatch.chdir(place)
    return place


def fitted_row(
    path: str, *, held_out: float = 0.2, subset: int = 0, settings: Method = QUICK, **how: Any
) -> ComparisonRow:
    return fit_and_measure(open_source(path, **how), settings, held_out, subset=subset)


def saved(row: ComparisonRow, folder: str = "out/fit") -> Fitted:
    """The fit as it is read back from its file."""
    Path(folder).mkdir(parents=True, exist_ok=True)
    row.factorization.save(Path(folder) / "factorization.npz")
    return homofact.load(folder)


def check(row: ComparisonRow, fitted: Fitted, found: Reopened) -> None:
    """The very samples, so the very errors."""
    assert found.known
    assert found.held_out
    assert found.split == row.split
    parts = found.parts
    for part, expected in (("train", row.train), ("held_out", row.held_out)):
        assert measure(fitted, parts[part], fitted.transform) == expected, part


FITS: dict[str, Callable[[], ComparisonRow]] = {
    "a file": lambda: fitted_row("data/paint.brdf"),
    "an absolute path": lambda: fitted_row(os.path.abspath("data/paint.brdf")),
    "all wavelengths": lambda: fitted_row("data/paint.brdf", channels="spectral"),
    "one wavelength": lambda: fitted_row("data/paint.brdf", channels="550nm"),
    "luminance": lambda: fitted_row("data/paint.brdf", channels="luminance"),
    "one channel": lambda: fitted_row("material:phong-10", channels="G", count=400),
    "a tenth held out": lambda: fitted_row("data/paint.brdf", held_out=0.1),
    "a subset": lambda: fitted_row("data/paint.brdf", subset=200),
    "another seed": lambda: fitted_row("data/paint.brdf", settings=replace(QUICK, seed=7)),
    "one material of a file": lambda: fitted_row("data/networks.npz#zinc", count=500),
    "a material": lambda: fitted_row("material:blinn-phong-50", count=700, scheme="cosine", seed=3, held_out=0.4),
    "a grid": lambda: fitted_row("material:blinn-phong-50", count=700, scheme="grid"),
    "svd": lambda: fitted_row("data/paint.brdf", settings=Svd(size=6)),
    "nmf": lambda: fitted_row("data/paint.brdf", settings=Nmf(size=6)),
    "cole": lambda: fitted_row("data/paint.brdf", settings=Cole(**SEARCHED)),
    "search": lambda: fitted_row("data/paint.brdf", settings=Search(budget=0.2, **SEARCHED)),
    "split by another seed": lambda: fit_and_measure(open_source("data/paint.brdf"), QUICK, split_seed=9),
}


@pytest.mark.parametrize(
    "name",
    slow_among(
        FITS,
        "an absolute path",
        "one wavelength",
        "luminance",
        "a tenth held out",
        "a subset",
        "another seed",
        "split by another seed",
        "search",
    ),
)
def test_a_saved_fit_knows_its_samples(name: str, here: Path) -> None:
    row = FITS[name]()
    fitted = saved(row)
    check(row, fitted, reopen(fitted))
    check(row, fitted, reopen(fitted, row.split.opening and open_source(row.split.opening.path, **how_of(row))))


def how_of(row: ComparisonRow) -> dict[str, Any]:
    opening = row.split.opening
    assert opening is not None
    return {"channels": opening.channels, "count": opening.count, "scheme": opening.scheme, "seed": opening.seed}


def nothing(here: Path) -> None:
    pass


def move_result(here: Path) -> None:
    shutil.move("out/fit", here.parent / "moved")


def move_all(here: Path) -> None:
    shutil.move(here, here.parent / "there")
    os.chdir(here.parent)


def move_source_beside(here: Path) -> None:
    shutil.move("data/paint.brdf", "out/fit/paint.brdf")
    os.chdir("/")


def move_source_to_working_folder(here: Path) -> None:
    (here.parent / "other").mkdir()
    shutil.move("data/paint.brdf", here.parent / "other")
    os.chdir(here.parent / "other")


def go_elsewhere(here: Path) -> None:
    os.chdir("/")


def move_result_and_go(here: Path) -> None:
    (here.parent / "far").mkdir()
    shutil.move("out/fit", here.parent / "far")
    os.chdir("/")


@pytest.mark.parametrize(
    ("move", "result"),
    [
        (nothing, "here/out/fit"),
        (move_all, "there/out/fit"),
        (move_source_to_working_folder, "here/out/fit"),
        (move_result_and_go, "far/fit"),
        *(
            pytest.param(*case, marks=pytest.mark.slow)
            for case in (
                (move_result, "moved"),
                (move_source_beside, "here/out/fit"),
                (go_elsewhere, "here/out/fit"),
            )
        ),
    ],
)
def test_it_is_found_after_moving(move: Callable[[Path], None], result: str, here: Path) -> None:
    row = fitted_row("data/paint.brdf")
    saved(row)
    move(here)
    folder = here.parent / result
    fitted = homofact.load(str(folder))
    check(row, fitted, reopen(fitted, near=(folder,)))


def test_of_two_files_the_one_with_the_samples_is_taken(here: Path) -> None:
    row = fitted_row("data/paint.brdf")
    fitted = saved(row)
    shutil.copy("data/paint.brdf", "out/fit")
    Path("data/paint.brdf").write_text("".join(PAINT.read_text().splitlines(keepends=True)[:-2]))
    check(row, fitted, reopen(fitted, near=("out/fit",)))
    with pytest.raises(NotReopened, match=r"^its source, paint\.brdf, has changed: its samples are not those of the"):
        reopen(fitted)
    # Naming it is asking for it, but its samples are not called held out.
    other = reopen(fitted, "data/paint.brdf")
    assert (other.known, other.held_out, other.part) == (False, False, "source")
    assert list(other.parts) == ["train", "source"]


@pytest.mark.slow
def test_one_that_is_gone_is_one_line(here: Path) -> None:
    fitted = saved(fitted_row("data/paint.brdf"))
    os.remove("data/paint.brdf")
    words = "its source, paint.brdf, is neither where it was nor in the working folder nor beside the result"
    with pytest.raises(NotReopened, match=f"^{words} \\(an export keeps"):
        reopen(fitted)
    with pytest.raises(BadInput, match=r"data/paint\.brdf: no such file"):
        reopen(fitted, "data/paint.brdf")
    with pytest.raises(BadInput, match="found the channels R, G, B, expected Y"):
        reopen(
            saved(fitted_row("material:phong-10", channels="luminance", count=300)), open_source("material:phong-10")
        )


@pytest.mark.slow
def test_a_fit_from_python_had_all_samples(here: Path) -> None:
    source = homofact.read("data/paint.brdf")
    fitted = homofact.fit(source, Cole(textures=1, size=6, restarts=1)).factorization
    found = reopen(fitted)
    assert (found.known, found.held_out, found.part) == (True, False, "source")
    parts = found.parts
    assert len(parts["source"]) == len(source.samples)
    assert len(parts["train"]) == len(source.samples)


def test_bare_samples_have_no_split(here: Path) -> None:
    fitted = homofact.fit(
        open_source("data/paint.brdf").samples.subset(100, 0), McCool(size=6, epsilon=1e-2)
    ).factorization
    assert Split.saved_with(fitted) is None
    assert not reopen(fitted, near=("data",)).known


@pytest.mark.slow
def test_samples_thinned_after_the_split_are_noticed(here: Path) -> None:
    source = open_source("data/paint.brdf")
    train = Split.of(source, 0.2, 0).parts(source)[0]
    fitted = homofact.fit(train.select(torch.arange(200)), McCool(size=6, epsilon=1e-2)).factorization
    assert not reopen(fitted).known


def test_an_export_names_no_folders(here: Path) -> None:
    row = fitted_row(os.path.abspath("data/paint.brdf"))
    passed_on = without_places(saved(row).provenance)
    assert str(here) not in json.dumps(passed_on)
    assert str(here) in json.dumps(saved(row).provenance)
    write_exported("engine", exported(saved(row), format_named("exr")), {})
    assert str(here) not in Path("engine/manifest.json").read_text()
    fitted = homofact.load("engine")
    found = reopen(fitted, near=("data",))
    assert (found.known, found.split.held_out, found.split.digest) == (True, 0.2, row.split.digest)


def without_split(fitted: Fitted) -> Fitted:
    """As version 0.1.0 saved it."""
    del fitted.provenance["source"]["split"]
    return fitted


@pytest.mark.parametrize(
    "name",
    slow_among(
        ["a file", "one wavelength", "a tenth held out", "a subset", "another seed", "svd", "cole"],
        "one wavelength",
        "a tenth held out",
        "a subset",
        "another seed",
        "svd",
    ),
)
def test_the_split_of_a_fit_of_0_1_0_is_guessed(name: str, here: Path) -> None:
    row = FITS[name]()
    fitted = without_split(saved(row))
    found = reopen(fitted, near=("data",))
    assert found.held_out
    assert measure(fitted, found.parts["held_out"], fitted.transform) == row.held_out
    assert measure(fitted, found.parts["train"], fitted.transform) == row.train
    with pytest.raises(NotReopened, match=r"^its source, paint\.brdf, is neither in the working folder nor beside"):
        reopen(fitted)
    assert reopen(fitted, "data/paint.brdf").held_out


def test_a_guess_that_fails_says_so(here: Path) -> None:
    row = fitted_row("material:blinn-phong-50", count=700, held_out=0.4)
    fitted = without_split(saved(row))
    found = reopen(fitted)
    assert (found.known, found.part) == (False, "source")
