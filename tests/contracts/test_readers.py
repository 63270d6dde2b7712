"""What every reader of BRDF files must do. A new format joins `brdf_files.WHOLE_FILES` by a small whole file."""

import math
import tracemalloc
from functools import partial
from pathlib import Path
from types import ModuleType

import pytest
import torch
from brdf_files import WHOLE_FILES, jsonable

from homofact.brdf.formats import READERS, open_file, read_by
from homofact.brdf.samples import Samples
from homofact.errors import BadInput

EVERY = pytest.mark.parametrize("reader", READERS, ids=[reader.NAME for reader in READERS])


@pytest.fixture
def place(reader: ModuleType, tmp_path: Path) -> Path:
    """A whole file of the reader's format."""
    return WHOLE_FILES[reader.NAME].make(tmp_path)


def refused(reader: ModuleType, path: Path) -> None:
    """Both by the reader and at the front door: one line that names the file."""
    for read in (partial(read_by, reader), open_file):
        with pytest.raises(BadInput) as caught:
            read(path)
        assert str(path) in str(caught.value)
        assert "\n" not in str(caught.value)
        assert len(str(caught.value)) < 2000


def test_every_reader_has_its_whole_file() -> None:
    assert set(WHOLE_FILES) == {reader.NAME for reader in READERS}


@EVERY
def test_its_content_is_known_whatever_its_name(reader: ModuleType, place: Path) -> None:
    assert open_file(place).samples.provenance["format"] == reader.NAME
    raw = place.read_bytes()
    assert reader.sniff(raw[:65_536]) or len(raw) in reader.SIZES
    for nothing in (b"", b"\0", b"\n", b"hello\n", bytes(range(256))):
        assert not reader.sniff(nothing)


@EVERY
def test_samples_keep_their_own_rules(reader: ModuleType, place: Path) -> None:
    samples = read_by(reader, place).samples
    assert isinstance(samples, Samples)
    for tensor in (samples.wi, samples.wo, samples.values, samples.weights):
        assert tensor.dtype == torch.float64
        assert bool(torch.isfinite(tensor).all())
    for direction in (samples.wi, samples.wo):
        assert float((direction.norm(dim=1) - 1).abs().max()) < 1e-12
        assert float(direction[:, 2].min()) >= 0
    assert float(samples.values.min()) >= 0
    assert float(samples.values.max()) > 0
    assert float(samples.weights.min()) >= 0
    assert math.isclose(float(samples.weights.mean()), 1, rel_tol=1e-9)
    assert len(set(samples.channels)) == len(samples.channels) == samples.values.shape[1]
    assert all(name and name == name.strip() for name in samples.channels)


@EVERY
def test_it_says_where_samples_come_from_in_plain_words_and_numbers(reader: ModuleType, place: Path) -> None:
    facts = read_by(reader, place).samples.provenance
    assert facts["format"] == reader.NAME
    assert jsonable(facts)


@EVERY
def test_reading_again_gives_the_same_bits(reader: ModuleType, place: Path) -> None:
    before = place.read_bytes()
    one, other = read_by(reader, place).samples, open_file(place).samples
    for name in ("wi", "wo", "values", "weights"):
        assert torch.equal(getattr(one, name), getattr(other, name))
    assert (one.channels, one.isotropic, one.provenance) == (other.channels, other.isotropic, other.provenance)
    assert place.read_bytes() == before


@EVERY
def test_channels_are_those_asked_for(reader: ModuleType, place: Path) -> None:
    colour, grey = read_by(reader, place).samples, read_by(reader, place, "luminance").samples
    assert colour.channels == ("R", "G", "B")
    assert grey.channels == ("Y",)
    assert torch.equal(colour.wi, grey.wi)
    for call in (partial(read_by, reader), open_file):
        with pytest.raises(BadInput, match="channels: found 'xyz', expected one of rgb, spectral, luminance"):
            call(place, "xyz")


@EVERY
def test_a_file_that_is_not_whole_is_refused(reader: ModuleType, place: Path) -> None:
    whole = place.read_bytes()
    # Not the half: that of a UTIA file of float64 is as long as a whole one of float32, and nothing in it tells.
    for keep in (0, 1, 7, 20, len(whole) // 3, 3 * len(whole) // 4, len(whole) - 1):
        # A cut at the end of a line leaves a whole, shorter text.
        while keep > 0 and whole[keep - 1 : keep] in (b"\n", b"\r"):
            keep -= 1
        place.write_bytes(whole[:keep])
        refused(reader, place)


@EVERY
def test_a_file_of_another_format_is_refused(reader: ModuleType, tmp_path: Path) -> None:
    for name, other in WHOLE_FILES.items():
        if name != reader.NAME:
            folder = tmp_path / name
            folder.mkdir()
            path = other.make(folder)
            with pytest.raises(BadInput) as caught:
                read_by(reader, path)
            assert str(path) in str(caught.value)
            assert "\n" not in str(caught.value)


@EVERY
def test_noise_and_places_without_a_file_are_refused(reader: ModuleType, tmp_path: Path) -> None:
    path = tmp_path / "noise"
    for content in (b"hello\n", b"\x89PNG\r\n\x1a\n" + b"\0" * 100, b"\0" * 500, b"\n\n", b"\xff" * 4000, b"1 " * 2000):
        path.write_bytes(content)
        refused(reader, path)
    refused(reader, tmp_path / "gone")
    refused(reader, tmp_path)


HUGE = [reader for reader in READERS if WHOLE_FILES[reader.NAME].huge is not None]


@pytest.mark.parametrize("reader", HUGE, ids=[reader.NAME for reader in HUGE])
def test_an_absurd_size_in_the_head_takes_no_memory(reader: ModuleType, place: Path) -> None:
    huge = WHOLE_FILES[reader.NAME].huge
    assert huge is not None
    place.write_bytes(huge(place.read_bytes()))
    tracemalloc.start()
    try:
        refused(reader, place)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert peak < 20 * 2**20
