"""UTIA's headless tables: layout, round trip, what is told by size alone."""

import math
from pathlib import Path

import numpy as np
import pytest
import torch
from refusals import refused

from homofact.brdf.formats import read_samples, utia
from homofact.brdf.formats import utia as writer
from homofact.brdf.materials import material
from homofact.brdf.source import open_source
from homofact.brdf.table import AngleTable
from homofact.geometry.directions import draw_uniform, to_spherical


def file_of(tmp_path: Path, entries: np.ndarray, dtype: str = "<f8") -> Path:
    path = tmp_path / "cloth.bin"
    path.write_bytes(entries.astype(dtype).tobytes())
    return path


def entries() -> np.ndarray:
    return np.random.default_rng(0).random(utia.SHAPE) + 0.1


@pytest.mark.parametrize("dtype", ["<f8", "<f4"])
def test_layout(tmp_path: Path, dtype: str) -> None:
    table = entries().astype(dtype)
    samples = read_samples(file_of(tmp_path, table, dtype))
    assert (len(samples), samples.isotropic, samples.channels) == (6 * 48 * 6 * 48, False, ("R", "G", "B"))
    index = ((2 * 48 + 5) * 6 + 4) * 48 + 40
    assert samples.values[index].tolist() == table[:, 2, 5, 4, 40].astype(float).tolist()
    angles = [*to_spherical(samples.wi[index]), *to_spherical(samples.wo[index])]
    assert [math.degrees(float(x)) for x in angles] == pytest.approx([30, 37.5, 60, 300 - 360])
    assert float(samples.weights.mean()) == pytest.approx(1)
    assert "scale of this database is not established" in samples.provenance["units"]


def test_the_table_is_the_reflectance(tmp_path: Path) -> None:
    source = open_source(str(file_of(tmp_path, entries())))
    assert isinstance(source.reflectance, AngleTable)
    # At the pole azimuths are one direction of several entries.
    off = (to_spherical(source.samples.wi)[0] > 0.1) & (to_spherical(source.samples.wo)[0] > 0.1)
    found = source.reflectance.evaluate(source.samples.wi[off], source.samples.wo[off])
    assert torch.allclose(found, source.samples.values[off], atol=1e-9)


def test_negative_entries_become_zero_and_are_counted(tmp_path: Path) -> None:
    table = entries()
    table[0, 1, 1, 1, 1] = table[2, 1, 1, 1, 1] = -0.5
    table[0, 0, 0, 0, 0] = 0
    faults = utia.open_file(file_of(tmp_path, table)).samples.provenance["faults"]
    assert faults == {"negative": 2, "samples_with_negative": 1, "exact_zeros": 1}


def test_a_written_model_reads_back_near_itself(tmp_path: Path) -> None:
    model = material("ward-brushed").model
    writer.write(tmp_path / "out.bin", model)
    reading = utia.open_file(tmp_path / "out.bin")
    assert torch.equal(reading.samples.values, model.evaluate(reading.samples.wi, reading.samples.wo))
    assert reading.reflectance is not None
    wi, wo = draw_uniform(2000, torch.Generator().manual_seed(1))
    keep = (wi[:, 2] > 0.4) & (wo[:, 2] > 0.4)
    expected = model.evaluate(wi[keep], wo[keep])
    error = (reading.reflectance.evaluate(wi[keep], wo[keep]) / expected - 1).abs()
    assert float(error.median()) < 0.03


def test_other_sizes_and_wild_numbers_are_refused(tmp_path: Path) -> None:
    path = file_of(tmp_path, entries())
    path.write_bytes(path.read_bytes()[:-8])
    with refused(where="cloth.bin"):
        read_samples(path)
    with refused(where="cloth.bin"):
        utia.open_file(path)
    wild = entries()
    wild[1, 0, 0, 0, 2] = np.nan
    with refused(where="cloth.bin"):
        read_samples(file_of(tmp_path, wild))
    wild[1, 0, 0, 0, 2] = 1e9
    with refused(where="cloth.bin"):
        read_samples(file_of(tmp_path, wild))


def test_writer_wants_rgb(tmp_path: Path) -> None:
    from homofact.brdf.analytic import Lambert

    with refused(where="UTIA file"):
        writer.write(tmp_path / "x", Lambert((0.1,), channels=("Y",)))
