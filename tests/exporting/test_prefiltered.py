"""The files of a sky: DDS beside DDS textures, else KTX2, the same texels in both."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from cube_maps import read_dds_cube, read_ktx2_cube
from skies import chain

from homofact.containers.formats import FORMATS
from homofact.exporting.prefiltered import PrefilteredExport, in_halves
from homofact.rendering.prefilter import LevelTable, Prefiltered
from homofact.rendering.sky_chain import SkyChain


def sky() -> SkyChain:
    return in_halves(chain())


def export(form: str, table: torch.Tensor) -> PrefilteredExport:
    return PrefilteredExport(
        Prefiltered(LevelTable(table, factor=sky().factor), sky()), FORMATS[form], form == "dds", 0.5
    )


@pytest.mark.parametrize(("form", "read"), [("dds", read_dds_cube), ("ktx2", read_ktx2_cube), ("exr", read_ktx2_cube)])
def test_the_sky_and_the_table_are_what_the_shader_reads(form: str, read, tmp_path: Path) -> None:
    table = torch.rand(4, 64, 4, dtype=torch.float64, generator=torch.Generator().manual_seed(0)).half().double()
    made = export(form, table)
    made.put(tmp_path, 3)
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(made.files)
    stored, levels, lit = made.names
    np.testing.assert_array_equal(read(tmp_path / lit)[0][..., :3].astype(np.float64), sky().irradiance.numpy())
    assert Path(levels).suffix == (".dds" if form == "dds" else ".ktx2")
    for level, texels in zip(read(tmp_path / levels), sky().levels, strict=True):
        np.testing.assert_array_equal(level[..., :3].astype(np.float64), texels.numpy())
        assert (level[..., 3] == 1).all()
    np.testing.assert_array_equal(FORMATS[form].read(tmp_path / stored, 4).astype(np.float64), table.numpy())
    text = (tmp_path / "prefiltered.glsl").read_text()
    assert (
        f"Texture 0: {stored}, 64 x 4. Texture 1: {levels}, a cube map of 32 texels per side, 3 levels."
        f" Texture 2: {lit}" in text
    )
    assert made.nbytes == 64 * 4 * (16 if form == "exr" else 8)


def test_a_sky_that_was_scaled_is_scaled_back_in_every_language(tmp_path: Path) -> None:
    made = export("dds", torch.ones(4, 64, 4, dtype=torch.float64))
    bright = LevelTable(made.data.material.table, factor=16.0)
    replace(made, data=Prefiltered(bright, replace(sky(), factor=16.0))).put(tmp_path, 3)
    for suffix in ("glsl", "hlsl", "wgsl", "c"):
        assert "* 16.0" in (tmp_path / f"prefiltered.{suffix}").read_text()
