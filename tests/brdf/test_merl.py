"""MERL tables: bins and their measure, lookup, files bit for bit, each way a file can be wrong."""

import math
import struct
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from refusals import refused
from torch import Tensor

from homofact.brdf.analytic import Lambert
from homofact.brdf.channels import LuminanceOf
from homofact.brdf.formats import merl, read_samples
from homofact.brdf.formats import merl as writer
from homofact.brdf.materials import material
from homofact.brdf.merl import SCALES, MerlGrid, MerlTable
from homofact.brdf.samples import Samples
from homofact.brdf.source import open_source
from homofact.brdf.wavelengths import spectral_names
from homofact.errors import BadInput
from homofact.geometry.coordinates import rusinkiewicz_angles
from homofact.geometry.directions import draw_uniform, from_spherical

HALF, WHOLE = (6, 8, 16), (6, 4, 16)
SCALE = torch.tensor(SCALES, dtype=torch.float64)[:, None, None, None]


def file_of(tmp_path: Path, raw: np.ndarray, header: bytes | None = None) -> Path:
    path = tmp_path / "table.dat"
    path.write_bytes((header or struct.pack("<3i", *raw.shape[1:])) + raw.astype("<f8").tobytes())
    return path


def entries(shape: tuple[int, int, int], seed: int = 0, dtype: Any = np.float64) -> np.ndarray:
    """Random entries; those of bins with a direction under the horizon, and a few others, are −1."""
    rng = np.random.default_rng(seed)
    raw = rng.lognormal(3, 2, (3, *shape)).astype(dtype).astype(np.float64)
    above = torch.cat([(wi[:, 2] >= 0) & (wo[:, 2] >= 0) for _, wi, wo in MerlGrid(shape).slabs()])
    missing = ~above.reshape(shape).numpy() | (rng.random(shape) < 0.05)
    raw[:, missing] = -1.0
    return raw


def centres(shape: tuple[int, int, int]) -> tuple[Tensor, Tensor]:
    slabs = list(MerlGrid(shape).slabs(rows=4))
    return torch.cat([wi for _, wi, _ in slabs]), torch.cat([wo for _, _, wo in slabs])


def test_centres_have_the_angles_of_their_bins() -> None:
    wi, wo = centres(HALF)
    theta_h, theta_d, phi_d = MerlGrid(HALF).centres()
    found = [x.reshape(HALF) for x in rusinkiewicz_angles(wi, wo)]
    assert torch.allclose(found[0], theta_h[:, None, None].expand(HALF))
    assert torch.allclose(found[1], theta_d[None, :, None].expand(HALF))
    folded = torch.minimum(phi_d, math.pi - phi_d)
    assert torch.allclose(found[2], folded.expand(HALF))
    assert torch.allclose(wi.norm(dim=1), torch.ones(len(wi), dtype=torch.float64))
    # Square-root spacing: the last centre of six is at (5.5/6)² of a right angle.
    assert float(theta_h[-1]) == pytest.approx((5.5 / 6) ** 2 * math.pi / 2)


@pytest.mark.parametrize("shape", [HALF, WHOLE, (9, 9, 18)])
def test_every_centre_is_in_its_own_bin(shape: tuple[int, int, int]) -> None:
    grid = MerlGrid(shape)
    assert torch.equal(grid.bins(*centres(shape)), torch.arange(grid.count))


def test_the_database_programs_own_index() -> None:
    # θh 10°, θd 40°, φd 100° in the published bins: ⌊90 √(10/90)⌋ = 30, 40 and 100.
    d = from_spherical(torch.tensor([math.radians(40.5)]).double(), torch.tensor([math.radians(100.5)]).double())
    angle = math.radians(10.0)
    c, s = math.cos(angle), math.sin(angle)
    wi = d @ torch.tensor([[c, 0, s], [0, 1, 0], [-s, 0, c]], dtype=torch.float64).T
    h = torch.tensor([[s, 0, c]], dtype=torch.float64)
    wo = 2 * (wi * h).sum(-1, keepdim=True) * h - wi
    assert MerlGrid().bins(wi, wo).tolist() == [(30 * 90 + 40) * 180 + 100]
    assert MerlGrid().bins(wo, wi).tolist() == [(30 * 90 + 40) * 180 + 100]
    assert MerlGrid((90, 90, 360)).bins(wi, wo).tolist() == [(30 * 90 + 40) * 360 + 100]
    assert MerlGrid((90, 90, 360)).bins(wo, wi).tolist() == [(30 * 90 + 40) * 360 + 280]


@pytest.mark.parametrize("shape", [(60, 60, 120), (60, 60, 240)])
def test_measure_adds_to_all_pairs_above_the_horizon(shape: tuple[int, int, int]) -> None:
    wi, wo = centres(shape)
    measure = MerlGrid(shape).measure().reshape(-1)
    above = (wi[:, 2] >= 0) & (wo[:, 2] >= 0)
    assert float(measure[above].sum()) == pytest.approx((2 * math.pi) ** 2, rel=1e-3)


def test_measure_is_how_many_uniform_pairs_fall_in_a_bin() -> None:
    grid = MerlGrid((4, 4, 4))
    wi, wo = draw_uniform(400_000, torch.Generator().manual_seed(2))
    counts = torch.bincount(grid.bins(wi, wo), minlength=64).double()
    share = counts / 400_000 * (2 * math.pi) ** 2
    # The two innermost rings of θh with θd below 45° lie above the horizon as wholes.
    inner = (torch.arange(64) // 16 < 2) & (torch.arange(64) // 4 % 4 < 2)
    expected = grid.measure().reshape(-1)
    sigma = (expected * (2 * math.pi) ** 2 / 400_000).sqrt()
    assert float(((share - expected).abs() / sigma)[inner].max()) < 4
    assert float(expected[inner].min()) > 0


@pytest.mark.parametrize("shape", [HALF, WHOLE])
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_file_to_samples_to_file_keeps_every_bit(tmp_path: Path, shape: tuple[int, int, int], dtype: Any) -> None:
    path = file_of(tmp_path, entries(shape, dtype=dtype))
    samples = merl.open_file(path).samples
    again = tmp_path / "again.binary"
    counts = writer.write(again, samples, shape)
    first, second = merl.load(path), merl.load(again)
    measured = first.raw >= 0
    assert torch.equal((second.raw * SCALE)[measured], (first.raw * SCALE)[measured])
    assert torch.equal(second.raw < 0, ~measured)
    assert counts["written"] == len(samples) == int(measured[0].sum())
    if dtype is np.float32:
        assert path.read_bytes() == again.read_bytes()
    else:
        # Two neighbouring entries can share a product, so the file's own last bit is not to be had back.
        gap = np.abs(second.raw.numpy().view("i8") - first.raw.numpy().view("i8"))
        assert gap[measured.numpy()].max() <= 1
    assert torch.equal(merl.open_file(again).samples.values, samples.values)


def test_a_table_is_written_byte_for_byte(tmp_path: Path) -> None:
    path = file_of(tmp_path, entries(HALF))
    writer.write(tmp_path / "copy", merl.load(path))
    assert (tmp_path / "copy").read_bytes() == path.read_bytes()


def test_scales_and_planes(tmp_path: Path) -> None:
    raw = np.full((3, *HALF), -1.0)
    raw[:, 1, 2, 3] = (1500.0, 3000.0, 4500.0)
    samples = merl.open_file(file_of(tmp_path, raw)).samples
    assert samples.values.tolist() == [pytest.approx([1.0, 2 * 1.15, 3 * 1.66])]
    wi, wo = centres(HALF)
    bin_ = (1 * 8 + 2) * 16 + 3
    assert torch.equal(samples.wi[0], wi[bin_])
    assert torch.equal(samples.wo[0], wo[bin_])
    assert samples.isotropic


def test_samples_are_the_measured_bins_above_the_horizon(tmp_path: Path) -> None:
    raw = entries(HALF)
    under = int((raw[0] < 0).sum())
    raw[0, 0, 0, 0] = raw[2, 0, 0, 1] = -5.0
    raw[:, 5, 7, 0] = 2.0
    raw[1, 1, 1, 1] = 0.0
    assert raw[0, 1, 1, 1] > 0
    samples = merl.open_file(file_of(tmp_path, raw)).samples
    faults = samples.provenance["faults"]
    fresh = int((entries(HALF)[0, 0, 0, :2] >= 0).sum())
    assert faults["not_measured"] == under + fresh - 1
    assert faults["under_horizon"] == 1
    assert (faults["exact_zeros"], faults["samples_with_zeros"]) == (1, 1)
    assert len(samples) == 6 * 8 * 16 - faults["not_measured"] - 1


def test_weights_are_the_solid_angle_with_mean_one(tmp_path: Path) -> None:
    raw = entries(HALF)
    samples = merl.open_file(file_of(tmp_path, raw)).samples
    assert float(samples.weights.mean()) == pytest.approx(1)
    measure = MerlGrid(HALF).measure().reshape(-1)[torch.from_numpy(raw[0].reshape(-1) >= 0)]
    assert torch.allclose(samples.weights / samples.weights[0], measure / measure[0])
    # The dense corner: the innermost ring of θh is a 36th of the range in angle, and weighs far less.
    assert float(samples.weights[0]) < 0.01


def test_lookup_at_the_centres_is_the_entry() -> None:
    raw = torch.from_numpy(entries(HALF))
    wi, wo = centres(HALF)
    keep = (raw[0].reshape(-1) >= 0).nonzero().reshape(-1)
    expected = (raw * SCALE).reshape(3, -1).T[keep]
    assert torch.equal(MerlTable(raw, "nearest").evaluate(wi[keep], wo[keep]), expected)
    assert torch.allclose(MerlTable(raw).evaluate(wi[keep], wo[keep]), expected, rtol=1e-9)


def test_linear_lookup_halfway_is_the_mean_and_skips_what_was_not_measured() -> None:
    raw = torch.full((3, 2, 2, 2), 1500.0, dtype=torch.float64)
    raw[:, :, :, 1] = 3000.0
    # φd = π/2 is halfway between the two centres π/4 and 3π/4; φd = 0 is too, round the fold.
    wi = from_spherical(torch.tensor([0.3, 0.3]).double(), torch.tensor([math.pi / 2, 0]).double())
    wi[0] = torch.tensor([0.3, 0.4, math.sqrt(0.75)], dtype=torch.float64)
    wo = wi * torch.tensor([1.0, -1.0, 1.0])
    wo[1] = from_spherical(torch.tensor([0.9]).double(), torch.tensor([0.0]).double())[0]
    assert MerlTable(raw).evaluate(wi, wo)[:, 0].tolist() == pytest.approx([1.5, 1.5])
    raw[:, :, :, 1] = -1.0
    assert MerlTable(raw).evaluate(wi, wo)[:, 0].tolist() == pytest.approx([1.0, 1.0])
    raw[:] = -1.0
    assert MerlTable(raw).evaluate(wi, wo).tolist() == [[0.0] * 3] * 2


def test_a_written_model_reads_back_near_itself(tmp_path: Path) -> None:
    model = material("lafortune-clay").model
    path = tmp_path / "clay.binary"
    counts = writer.write(path, model, (40, 40, 80))
    assert counts["clipped"] == 0
    table = merl.load(path)
    wi, wo = draw_uniform(4000, torch.Generator().manual_seed(0))
    keep = (wi[:, 2] > 0.1) & (wo[:, 2] > 0.1)
    expected = model.evaluate(wi[keep], wo[keep])
    error = (table.evaluate(wi[keep], wo[keep]) / expected - 1).abs()
    assert float(error.median()) < 0.005
    assert float(error.quantile(0.99)) < 0.05


def test_its_cost_and_how_it_is_opened(tmp_path: Path) -> None:
    table = MerlTable(torch.from_numpy(entries(HALF)))
    assert (table.nbytes, table.fetches, MerlTable(table.raw, "nearest").fetches) == (24 * 6 * 8 * 16, 8, 1)
    path = file_of(tmp_path, entries(HALF))
    source = open_source(str(path))
    assert isinstance(source.reflectance, MerlTable)
    grey = open_source(str(path), channels="luminance")
    assert isinstance(grey.reflectance, LuminanceOf)
    assert grey.samples.channels == ("Y",)


@pytest.mark.parametrize(
    ("raw", "lookup", "message"),
    [
        (torch.zeros(2, 2, 2, 2), "linear", r"raw has shape \(2, 2, 2, 2\), expected \(3, θh, θd, φd\)"),
        (torch.zeros(3, 2, 2, 2), "cubic", "lookup is 'cubic', expected linear or nearest"),
    ],
)
def test_impossible_tables_are_refused(raw: Tensor, lookup: Any, message: str) -> None:
    with refused(message):
        MerlTable(raw, lookup)


def test_one_channel_becomes_grey_and_spectra_become_colours(tmp_path: Path) -> None:
    writer.write(tmp_path / "grey", Lambert((0.5,), channels=("Y",)), HALF)
    assert torch.allclose(
        merl.open_file(tmp_path / "grey").samples.values, torch.tensor(0.5 / math.pi, dtype=torch.float64)
    )
    flat = Lambert((0.5,) * 7, channels=spectral_names(range(400, 701, 50)))
    writer.write(tmp_path / "flat", flat, HALF)
    assert torch.allclose(
        merl.open_file(tmp_path / "flat").samples.values, torch.tensor(0.5 / math.pi).double(), rtol=1e-6
    )


def test_writer_refuses_what_cannot_be_meant(tmp_path: Path) -> None:
    model = material("phong-10").model
    with refused(where="MERL bins", found="(1, 90, 180)"):
        writer.write(tmp_path / "x", model, (1, 90, 180))
    with refused(where="MERL file"):
        writer.write(tmp_path / "x", Lambert((0.1, 0.2), channels=("a", "b")), HALF)
    w = torch.tensor([[0, 0, 1.0]]).double()
    brushed = Samples(w, w, torch.ones(1, 3), channels=("R", "G", "B"), isotropic=False)
    with refused(where="MERL file"):
        writer.write(tmp_path / "x", brushed, HALF)
    with pytest.raises(BadInput, match="cannot be written"):
        writer.write(tmp_path / "nowhere" / "x", model, HALF)
    assert list(tmp_path.iterdir()) == []


def nan_at(channel: int) -> np.ndarray:
    raw = entries(HALF)
    raw[channel, 1, 2, 3] = np.nan
    return raw


BAD: dict[str, tuple[bytes | np.ndarray, str]] = {
    "nan": (nan_at(1), "G at bin θh 1, θd 2, φd 3 is nan, expected finite numbers"),
    "nothing measured": (np.full((3, *HALF), -1.0), "no bin was measured, expected at least one"),
    "cut": (struct.pack("<3i", *HALF) + b"\0" * 100, "112 bytes, expected 18444 for 6 × 8 × 16 bins"),
    "only the header": (struct.pack("<3i", 90, 90, 180), "12 bytes, expected 34992012 for 90 × 90 × 180 bins"),
    "absurd": (struct.pack("<3i", 4096, 4096, 4096) + b"\0" * 24, "36 bytes, expected 1649267441676"),
    "no bins": (struct.pack("<3i", 0, 90, 180), "of no known format"),
    "negative bins": (struct.pack("<3i", -90, 90, 180) + b"\0" * 90, "of no known format"),
}


@pytest.mark.parametrize(("content", "message"), BAD.values(), ids=list(BAD))
def test_bad_files_are_refused(tmp_path: Path, content: bytes | np.ndarray, message: str) -> None:
    path = tmp_path / "bad.binary"
    if isinstance(content, bytes):
        path.write_bytes(content)
    else:
        path = file_of(tmp_path, content)
    with refused(message) as caught:
        read_samples(path)
    assert str(caught.value).startswith(str(path))
    assert "\n" not in str(caught.value)


def test_padded_files_are_refused(tmp_path: Path) -> None:
    path = file_of(tmp_path, entries(HALF))
    path.write_bytes(path.read_bytes() + b"\0")
    with refused(where="table.dat"):
        merl.open_file(path)


def test_a_full_grid_is_read_in_two_seconds(tmp_path: Path) -> None:
    path = tmp_path / "full.binary"
    counts = writer.write(path, Lambert((0.3, 0.2, 0.1)))
    assert path.stat().st_size == 12 + 24 * 90 * 90 * 180
    # Of this process's own time, whatever else the machine is busy with.
    begun = time.process_time()
    samples = read_samples(path)
    assert time.process_time() - begun < 2
    assert len(samples) == counts["written"] == 1_096_216
    assert torch.allclose(samples.values[::1000], torch.tensor([0.3, 0.2, 0.1], dtype=torch.float64) / math.pi)
