"""What every texture format must do, of `containers.formats.FORMATS`: a new one there is held to all of this.

`BOUND` is how far a texel may come back from what was put in, root mean square, for texels in a range of 1.
"""

import os

import numpy as np
import pytest

from homofact.containers.formats import FORMATS, MOST_SIDE
from homofact.errors import BadInput

EVERY = pytest.mark.parametrize("name", list(FORMATS))
FLOATS = ("exr", "exr16", "ktx2", "dds")
# What a type of integers holds comes back as it is; 16 levels between the two ends of a block: a uniform error of a
# fifteenth would be 0.019.
BOUND = {"exr": 3e-7, "exr16": 1.5e-3, "png8": 0.0, "png16": 0.0, "ktx2": 1.5e-3, "dds": 1.5e-3, "bc6h": 0.03}


def texture(name, rows, columns, channels, seed=0):
    generator = np.random.default_rng(seed)
    dtype = np.dtype(FORMATS[name].dtype)
    if dtype.kind == "u":
        return generator.integers(0, 256**dtype.itemsize, (rows, columns, channels)).astype(dtype)
    return generator.normal(0, 4, (rows, columns, channels)).astype(dtype)


def smooth(name: str, rows: int, columns: int, channels: int, seed: int = 1) -> np.ndarray:
    """Texels from 5 to 6 for floats; for integers any. Grey for blocks, whose colours lie on one line."""
    if np.dtype(FORMATS[name].dtype).kind == "u":
        return texture(name, rows, columns, channels, seed)
    own = 1 if name == "bc6h" else channels
    values = 5 + np.random.default_rng(seed).uniform(0, 1, (rows, columns, own))
    return np.repeat(values, channels // own, 2)


def held(name):
    return FORMATS[name].channels or (1, 2, 3, 4, 31)


def test_every_format_states_its_bound():
    assert set(BOUND) == set(FORMATS)


@EVERY
def test_what_is_read_is_what_was_written_within_the_bound(tmp_path, name):
    form = FORMATS[name]
    for channels in held(name):
        for rows, columns in ((8, 12), (4, 4), (form.multiple, 3 * form.multiple)):
            stored = smooth(name, rows, columns, channels)
            before = stored.copy()
            form.write(tmp_path / "t", stored)
            np.testing.assert_array_equal(stored, before)
            found = form.read(tmp_path / "t", channels)
            assert found.shape == stored.shape
            assert found.dtype == form.dtype
            assert np.sqrt(((found.astype(np.float64) - stored) ** 2).mean()) <= BOUND[name]
            # Another texture is told from it: the bound is none of chance.
            other = smooth(name, rows, columns, channels, 2)
            assert np.sqrt(((found.astype(np.float64) - other) ** 2).mean()) > 0.1
    assert [each.name for each in tmp_path.iterdir()] == ["t"]


@EVERY
def test_rows_and_columns_are_not_exchanged_and_row_0_is_on_top(tmp_path, name):
    # One colour to every block of 4 x 4 texels, each another.
    row, column, channel = np.indices((8, 16, 3))
    stored = (10 * (row // 4) + 20 * (column // 4) + 3 * channel).astype(FORMATS[name].dtype)
    FORMATS[name].write(tmp_path / "t", stored)
    found = FORMATS[name].read(tmp_path / "t", 3).astype(np.float64)
    assert np.abs(found - stored).max() < 0.2


@EVERY
def test_strided_texels_are_written_as_they_are(tmp_path, name):
    stored = smooth(name, 8, 8, 3)
    wide = np.repeat(np.repeat(stored, 2, 0), 2, 1).transpose(1, 0, 2).copy().transpose(1, 0, 2)
    FORMATS[name].write(tmp_path / "a", stored)
    FORMATS[name].write(tmp_path / "b", wide[::2, ::2])
    assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()


@EVERY
def test_the_same_gives_the_same_bytes_and_reads_the_same(tmp_path, name):
    for place in ("a", "b"):
        FORMATS[name].write(tmp_path / place, smooth(name, 4, 8, 3))
    assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()
    np.testing.assert_array_equal(FORMATS[name].read(tmp_path / "a"), FORMATS[name].read(tmp_path / "a"))


@EVERY
@pytest.mark.parametrize("exists", [False, True])
@pytest.mark.parametrize("step", ["rename", "values", "size"])
def test_a_failure_leaves_what_was_there(tmp_path, monkeypatch, name, exists, step):
    form, path = FORMATS[name], tmp_path / f"t{FORMATS[name].suffix}"
    if exists:
        form.write(path, smooth(name, 4, 4, 3))
    before = {each: each.read_bytes() for each in tmp_path.iterdir()}

    def full(*_args):
        raise OSError(28, "No space left on device")

    stored = smooth(name, 4, 4, 3, 2)
    if step == "rename":
        monkeypatch.setattr(os, "replace", full)
    elif step == "values":
        stored = np.full((4, 4, 3), np.nan)
    else:
        stored = stored[:0]
    with pytest.raises(BadInput) as caught:
        form.write(path, stored)
    monkeypatch.undo()
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)
    assert {each: each.read_bytes() for each in tmp_path.iterdir()} == before


@EVERY
def test_an_unwritable_place_is_one_line(tmp_path, name):
    (tmp_path / "folder").mkdir()
    for path in (tmp_path / "nowhere" / "t", tmp_path / "folder"):
        with pytest.raises(BadInput, match="cannot be written") as caught:
            FORMATS[name].write(path, smooth(name, 4, 4, 3))
        assert str(path) in str(caught.value)
        assert "\n" not in str(caught.value)
    assert [each.name for each in tmp_path.iterdir()] == ["folder"]
    assert list((tmp_path / "folder").iterdir()) == []


@EVERY
def test_a_file_of_another_format_is_refused(tmp_path, name):
    for other, form in FORMATS.items():
        path = tmp_path / f"{other}{form.suffix}"
        form.write(path, smooth(other, 4, 4, 3))
        if (FORMATS[name].dtype, FORMATS[name].suffix) != (form.dtype, form.suffix):
            with pytest.raises(BadInput) as caught:
                FORMATS[name].read(path)
            assert str(path) in str(caught.value)
            assert "\n" not in str(caught.value)


@pytest.mark.parametrize("name", [*FLOATS, "png8", "png16"])
@pytest.mark.parametrize("channels", [1, 3, 4])
@pytest.mark.parametrize("shape", [(16, 16), (1, 7), (7, 1), (5, 3)])
def test_the_stored_type_comes_back_to_the_bit(tmp_path, name, channels, shape):
    form = FORMATS[name]
    stored = texture(name, shape[0], shape[1], channels)
    path = tmp_path / f"t{form.suffix}"
    form.write(path, stored)
    found = form.read(path, channels)
    assert found.dtype == form.dtype
    np.testing.assert_array_equal(found, stored)
    assert [each.name for each in tmp_path.iterdir()] == [path.name]


@pytest.mark.parametrize("name", FLOATS)
def test_doubles_are_rounded_once_to_nearest(tmp_path, name):
    form = FORMATS[name]
    stored = np.random.default_rng(2).normal(0, 4, (4, 4, 3))
    form.write(tmp_path / "t", stored)
    np.testing.assert_array_equal(form.read(tmp_path / "t", 3), stored.astype(form.dtype))


def test_bc6h_is_what_a_sampler_sees(tmp_path):
    form = FORMATS["bc6h"]
    stored = 5 + np.random.default_rng(1).uniform(0, 1, (8, 12, 1))
    form.write(tmp_path / "t.dds", stored)
    found = form.read(tmp_path / "t.dds", 1)
    assert found.shape == (8, 12, 1)
    assert found.dtype == np.float16
    error = np.sqrt(((found.astype(np.float64) - stored) ** 2).mean())
    # 16 levels between two ends: a uniform error of a fifteenth would be 0.019.
    assert 0 < error < 0.03
    assert form.read(tmp_path / "t.dds").shape == (8, 12, 3)


@EVERY
def test_files_that_are_not_whole_or_another(tmp_path, name):
    form = FORMATS[name]
    path = tmp_path / f"t{form.suffix}"
    form.write(path, texture(name, 8, 8, 3))
    whole = path.read_bytes()
    for data in (b"", b"no texture at all, but some bytes", whole[:20], whole[: len(whole) // 2], whole[:-5]):
        path.write_bytes(data)
        with pytest.raises(BadInput) as caught:
            form.read(path)
        assert str(path) in str(caught.value)
        assert "\n" not in str(caught.value)
    with pytest.raises(BadInput, match="cannot be read"):
        form.read(tmp_path / "absent")


@EVERY
def test_sizes_and_channels_that_it_cannot_hold(tmp_path, name):
    form = FORMATS[name]
    form.check(16, 16, 3)
    form.check(MOST_SIDE, form.multiple, 1)
    for rows, columns in ((MOST_SIDE + form.multiple, 4), (4, MOST_SIDE + form.multiple), (0, 4)):
        with pytest.raises(BadInput, match=f"lobe: {columns} x {rows} texels of 3 channels, expected sides of 1 to"):
            form.check(rows, columns, 3, "lobe")
    with pytest.raises(BadInput, match=f"texels of 0 channels, expected .* channels for {name}"):
        form.check(4, 4, 0)
    if form.channels is None:
        form.check(4, 4, 31)
    else:
        with pytest.raises(BadInput, match=f"8 x 4 texels of 31 channels, expected 1 or 3.* channels for {name}"):
            form.check(4, 8, 31)
        with pytest.raises(BadInput, match="of 2 channels"):
            form.write(tmp_path / "t", texture(name, 4, 4, 2))
    if name == "bc6h":
        for rows, columns in ((1, 16), (6, 8), (8, 6)):
            with pytest.raises(BadInput, match=f"{columns} x {rows} texels .* multiples of 4 for bc6h"):
                form.write(tmp_path / "t", texture(name, rows, columns, 3))
    else:
        form.check(1, 7, 1)
    assert list(tmp_path.iterdir()) == []


@EVERY
def test_values_that_it_cannot_hold(tmp_path, name):
    form = FORMATS[name]
    path = tmp_path / f"t{form.suffix}"
    with pytest.raises(BadInput, match="found pixels of shape \\(4, 4\\)"):
        form.write(path, np.zeros((4, 4)))
    if name.startswith("png"):
        other = np.uint16 if name == "png8" else np.uint8
        for dtype in (np.float32, np.int32, other):
            with pytest.raises(BadInput, match=f"type {np.dtype(dtype)}, expected {np.dtype(form.dtype)} for {name}"):
                form.write(path, np.zeros((4, 4, 3), dtype))
    else:
        with pytest.raises(BadInput, match=f"type uint8, expected floating-point numbers for {name}"):
            form.write(path, np.zeros((4, 4, 3), np.uint8))
        for value in (np.nan, -np.inf, 1e39 if name == "exr" else 65520.0):
            stored = np.zeros((4, 4, 3))
            stored[1, 2, 2] = value
            where = f"row 1, column 2, channel 2 is {value:g}".replace("+", "\\+")
            with pytest.raises(BadInput, match=f"{where}, expected finite values of at most"):
                form.write(path, stored)
    assert list(tmp_path.iterdir()) == []
