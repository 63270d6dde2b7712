"""What cannot be loaded into Mitsuba, and what is said where it is missing. Most of it needs no Mitsuba."""

import importlib
import json
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from mitsuba_cases import RGB, factorization, random_texture, variant

from homofact.errors import BadInput, MissingDependency
from homofact.factor.factorization import Factorization
from homofact.factor.projection import fixed_projection
from homofact.files import extras
from homofact.rendering import mitsuba_bsdf


def made(channels: tuple[str, ...] = RGB) -> Factorization:
    """One random texture."""
    count = len(channels)
    fit = factorization((fixed_projection("h", True), random_texture(3, 3, channels=count)), mean=(1.0,) * count)
    return Factorization(fit.terms, fit.transform, channels)


def edited(path: Path, target: Path, change: Callable[[dict[str, Any]], None]) -> Path:
    """A copy of a saved fit with its header changed."""
    with np.load(path) as archive:
        arrays: dict[str, Any] = {name: archive[name] for name in archive.files}
    header = json.loads(str(arrays["header"]))
    change(header)
    arrays["header"] = np.array(json.dumps(header))
    with open(target, "wb") as file:
        np.savez(file, **arrays)
    return target


@pytest.fixture
def bad_files(tmp_path: Path) -> dict[Path, str]:
    """Places and what is said of each."""
    made().save(tmp_path / "good.npz")
    newer = edited(tmp_path / "good.npz", tmp_path / "newer.npz", lambda header: header.update(format_version=99))
    empty = edited(tmp_path / "good.npz", tmp_path / "empty.npz", lambda header: header.update(terms=[]))
    made(("900nm", "1200nm", "1700nm")).save(tmp_path / "three.npz")
    made(tuple(f"band {k}" for k in range(31))).save(tmp_path / "bands.npz")
    (tmp_path / "text.npz").write_text("no archive")
    (tmp_path / "folder").mkdir()
    return {
        newer: "newer.npz: format version 99, expected at most 1",
        empty: r"empty.npz: terms: found \[\], expected 1 to 1000 objects",
        tmp_path
        / "three.npz": "three.npz: wavelengths: found 900-1700 nm, expected them to cover 450-650 nm.*one of its",
        tmp_path / "bands.npz": "found the channels band 0, band 1, band 2, … .31 of them.*fit with `channels='rgb'`",
        tmp_path / "text.npz": "text.npz: not a saved factorization",
        tmp_path / "nothing.npz": "nothing.npz: no such file",
        tmp_path / "folder": "folder: found no factorization.npz in the folder",
    }


def test_bad_files(bad_files: dict[Path, str]) -> None:
    for place, words in bad_files.items():
        with pytest.raises(BadInput, match=words) as caught:
            mitsuba_bsdf.open_fit(place)
        assert "\n" not in str(caught.value)


def test_bad_files_in_mitsuba(bad_files: dict[Path, str]) -> None:
    mi = variant("scalar_rgb")
    for place, words in bad_files.items():
        with pytest.raises(BadInput, match=words):
            mitsuba_bsdf.load_bsdf(place)
        # Mitsuba wraps what its materials raise, and our line is the last of it.
        with pytest.raises(RuntimeError, match=words):
            mi.load_dict({"type": "homofact", "filename": str(place)})
    with pytest.raises(RuntimeError, match="no filename, expected a result's folder"):
        mi.load_dict({"type": "homofact"})


def test_a_sampling_that_is_unknown(tmp_path: Path) -> None:
    mi = variant("scalar_rgb")
    made().save(tmp_path / "good.npz")
    words = "sampling: found 'brdf', expected one of lobe, cosine"
    with pytest.raises(BadInput, match=words):
        mitsuba_bsdf.load_bsdf(tmp_path / "good.npz", "brdf")
    with pytest.raises(RuntimeError, match=words):
        mi.load_dict({"type": "homofact", "filename": str(tmp_path / "good.npz"), "sampling": "brdf"})


@pytest.mark.parametrize("name", ["scalar_spectral_polarized", "llvm_ad_mono_polarized"])
def test_variants_that_are_refused(name: str) -> None:
    variant(name, register=False)
    with pytest.raises(BadInput, match=f"found the variant {name}, expected one without polarization"):
        mitsuba_bsdf.register()


def pretend(monkeypatch: pytest.MonkeyPatch, **modules: Any) -> None:
    """Let the material find these modules; None is one that is not installed."""

    def found(name: str) -> Any:
        if name not in modules:
            return importlib.import_module(name)
        if modules[name] is None:
            raise ModuleNotFoundError(f"No module named {name!r}")
        return modules[name]

    monkeypatch.setattr(extras, "import_module", found)


def test_no_variant(monkeypatch: pytest.MonkeyPatch) -> None:
    pretend(monkeypatch, mitsuba=SimpleNamespace(variant=lambda: None))
    with pytest.raises(BadInput, match=r"no variant is set, expected mitsuba\.set_variant"):
        mitsuba_bsdf.register()


def test_no_mitsuba(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    pretend(monkeypatch, mitsuba=None)
    for ask in (mitsuba_bsdf.register, lambda: mitsuba_bsdf.load_bsdf(tmp_path)):
        with pytest.raises(MissingDependency, match=r"expected it \(pip install 'homofact\[mitsuba\]'\)") as caught:
            ask()
        assert "\n" not in str(caught.value)
