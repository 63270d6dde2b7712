"""Our evaluation against Mitsuba 3's `measured` plugin: real files, and made-up ones of every kind.

Mitsuba computes in float32; its `eval` contains cosθo. Install the extra `mitsuba` to run these.
"""

import importlib
import importlib.util
from pathlib import Path
from types import ModuleType

import pytest
import torch
from rgl_files import rough, write_tensors
from torch import Tensor

from homofact.brdf.formats.rgl import load
from homofact.geometry.directions import draw_uniform

pytestmark = pytest.mark.skipif(
    importlib.util.find_spec("mitsuba") is None, reason="the extra `mitsuba` is not installed"
)

FILES = ("aurora_white", "chm_light_blue", "irid_flake_paint1", "vch_golden_yellow")


@pytest.fixture
def check(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    """The script that shows the whole table."""
    return importlib.import_module("scripts.data.check_rgl_against_mitsuba")


def disagreement(check: ModuleType, path: Path) -> Tensor:
    wi, wo = draw_uniform(5000, torch.Generator().manual_seed(11))
    found = check.relative_differences(load(path).signed(wi, wo) * wo[:, 2:], check.mitsuba_values(path, wi, wo).values)
    assert len(found) > 14_000
    return found


@pytest.mark.parametrize("name", FILES)
def test_real_files(check: ModuleType, real_data: Path, name: str) -> None:
    path = real_data / "rgl" / f"{name}_rgb.bsdf"
    if not path.is_file():
        pytest.skip(f"no {path}")
    relative = disagreement(check, path)
    assert float(relative.median()) < 1e-5
    assert float(relative.quantile(0.99)) < 1e-3


@pytest.mark.parametrize(
    "phi",
    [
        (0.0,),
        (-180.0, -120.0, -60.0, 0.0, 60.0, 120.0, 180.0),
        (-180.0, -150.0, -60.0, 0.0),
        (-180.0, -135.0, -90.0),
    ],
    ids=["isotropic", "whole turn", "half", "quarter"],
)
def test_made_up_files(check: ModuleType, tmp_path: Path, phi: tuple[float, ...]) -> None:
    relative = disagreement(check, write_tensors(tmp_path / "a.bsdf", rough(phi)))
    assert float(relative.median()) < 1e-6
    assert float(relative.quantile(0.999)) < 1e-4


def test_a_made_up_spectrum(check: ModuleType, tmp_path: Path) -> None:
    path = write_tensors(tmp_path / "a.bsdf", rough((0.0,), wavelengths=9))
    table = load(path, "spectral")
    wi, wo = draw_uniform(500, torch.Generator().manual_seed(12))
    ours = table.signed(wi, wo) * wo[:, 2:]
    # Mitsuba takes four wavelengths at once; each is a node of the file's here.
    nodes = [1, 2, 4, 5]
    theirs = check.mitsuba_values(
        path, wi, wo, wavelengths=[float(table.channels[k].removesuffix("nm")) for k in nodes]
    ).values
    assert torch.allclose(ours[:, nodes], theirs, rtol=1e-4)
