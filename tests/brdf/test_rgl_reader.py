"""The tensor file itself: what is read, what is refused, and the source that it becomes."""

import random
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from refusals import refused
from rgl_files import MAGIC, constant, rough, write_tensors

from homofact.brdf.channels import LuminanceOf
from homofact.brdf.formats import READERS, read_samples, rgl
from homofact.brdf.formats.reading import Drawing
from homofact.brdf.rgl import AdaptiveTable
from homofact.brdf.source import describe, open_source
from homofact.errors import BadInput
from homofact.geometry.directions import draw_in_discs


def without(name: str) -> dict[str, np.ndarray]:
    return {key: value for key, value in constant().items() if key != name}


def header(*fields: bytes, count: int | None = None) -> bytes:
    return MAGIC + struct.pack("<I", len(fields) if count is None else count) + b"".join(fields)


def field(name: bytes, shape: tuple[int, ...], code: int = 10, offset: int = 100, rank: int | None = None) -> bytes:
    axes = len(shape) if rank is None else rank
    return struct.pack("<H", len(name)) + name + struct.pack(f"<HBQ{len(shape)}Q", axes, code, offset, *shape)


def test_fields_come_back_as_written(tmp_path: Path) -> None:
    fields = rough((-180.0, 0.0, 180.0)) | {"counts": np.arange(6, dtype="u8").reshape(2, 3)}
    found = rgl.read_tensors(write_tensors(tmp_path / "a", fields))
    assert list(found) == list(fields)
    for name, array in fields.items():
        assert found[name].dtype == array.dtype
        assert np.array_equal(found[name], array)


def test_half_and_double_precision_are_read(tmp_path: Path) -> None:
    fields = constant(0.25)
    half = rgl.load(write_tensors(tmp_path / "a", fields | {"rgb": fields["rgb"].astype("f2")}))
    double = rgl.load(write_tensors(tmp_path / "b", fields | {"rgb": fields["rgb"].astype("f8")}))
    assert (half.table.dtype, double.table.dtype) == (torch.float32, torch.float64)
    assert torch.equal(half.table.double(), double.table)


def test_content_is_recognised(tmp_path: Path) -> None:
    path = write_tensors(tmp_path / "measurement.txt", constant())
    assert [reader.NAME for reader in READERS if reader.sniff(path.read_bytes()[:65_536])] == ["rgl"]
    samples = read_samples(path)
    assert samples.provenance["format"] == "rgl"
    assert samples.provenance["comments"] == ["a made-up surface"]
    assert len(samples) == 45_000
    assert samples.isotropic


@pytest.mark.slow
def test_a_file_is_drawn_from_as_a_model_with_the_noise_of_a_measurement(tmp_path: Path) -> None:
    path = write_tensors(tmp_path / "a.bsdf", constant())
    source = open_source(str(path), count=300, scheme="cosine", seed=2)
    assert (source.name, source.kind, source.default_epsilon) == ("a.bsdf", "drawn", 1e-2)
    assert isinstance(source.reflectance, AdaptiveTable)
    assert len(source.samples) == 300
    assert torch.equal(source.reflectance.evaluate(source.samples.wi, source.samples.wo), source.samples.values)
    facts = describe(source)
    assert facts["faults"]["negative_entries"] == 0
    assert facts["sampling"] == {"scheme": "cosine", "noise_free": False, "seed": 2}
    grey = open_source(str(path), channels="luminance", count=10)
    assert isinstance(grey.reflectance, LuminanceOf)
    assert torch.allclose(grey.reflectance.evaluate(grey.samples.wi, grey.samples.wo), grey.samples.values)


@pytest.mark.slow
def test_spectral_files_give_every_kind_of_channels(tmp_path: Path) -> None:
    path = write_tensors(tmp_path / "a.bsdf", rough((0.0,), wavelengths=9))
    for channels, count in (("rgb", 3), ("spectral", 9), ("luminance", 1)):
        source = open_source(str(path), channels=channels, count=20)
        assert len(source.samples.channels) == count
        assert source.samples.channels == source.reflectance.channels
        assert describe(source)["wavelengths_nm"][0] == 360


def test_anisotropic_files_say_so(tmp_path: Path) -> None:
    path = write_tensors(tmp_path / "a.bsdf", rough((-180.0, -90.0, 0.0)))
    assert not open_source(str(path), count=20).samples.isotropic


SHAPES: list[tuple[str, Any, str]] = [
    ("theta_i", np.zeros((2, 2), "f4"), r"field theta_i has shape \(2, 2\) of float32, expected 1 axes of floats"),
    ("theta_i", np.arange(4, dtype="u4"), "field theta_i has shape .* of uint32"),
    ("theta_i", np.zeros(4, "f4"), "theta_i has .* do not rise"),
    ("theta_i", np.arange(3, dtype="f4") / 3, r"vndf has shape .* expected \(1, 3, R, C\)"),
    ("ndf", np.ones(4, "f4"), "field ndf has shape"),
    ("ndf", np.full((2, 4), np.nan, "f4"), r"field ndf at \(0, 0\) is nan, expected finite"),
    ("sigma", np.full((2, 4), np.inf, "f4"), "field sigma at .* is inf"),
    ("sigma", np.ones((1, 4), "f4"), r"sigma has shape \(1, 4\), expected \(R, C\) with R, C >= 2"),
    ("vndf", np.zeros((1, 4, 5, 5), "f4"), "vndf has a slice that is 0"),
    ("vndf", -np.ones((1, 4, 5, 5), "f4"), "vndf has negative values"),
    ("rgb", np.ones((1, 4, 4, 5, 5), "f4"), "field rgb has 4 channels, expected 3"),
    ("rgb", np.ones((1, 4, 5, 5), "f4"), "field rgb has shape"),
    ("rgb", np.ones((1, 3, 3, 5, 5), "f4"), "table has shape"),
    ("jacobian", np.ones(2, "u1"), r"field jacobian has shape \(2,\) of uint8, expected one 0 or 1"),
    ("jacobian", np.full(1, 7, "u1"), "field jacobian"),
    ("jacobian", np.ones(1, "f4"), "field jacobian"),
]


@pytest.mark.parametrize(("name", "array", "message"), SHAPES)
def test_fields_of_other_shapes_and_numbers_are_refused(tmp_path: Path, name: str, array: Any, message: str) -> None:
    path = write_tensors(tmp_path / "bad.bsdf", constant() | {name: array})
    with pytest.raises(BadInput, match=message) as caught:
        rgl.load(path)
    assert str(caught.value).startswith(f"{path}: ")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("name", ["theta_i", "phi_i", "ndf", "sigma", "vndf", "rgb"])
def test_missing_fields_are_named(tmp_path: Path, name: str) -> None:
    with refused(rf"expected theta_i, .*, of which {name} missing"):
        rgl.load(write_tensors(tmp_path / "a", without(name)))


def test_fields_that_a_value_does_not_need_may_be_missing(tmp_path: Path) -> None:
    wi, wo = draw_in_discs(50, torch.Generator().manual_seed(0), 0.9)
    whole = rgl.load(write_tensors(tmp_path / "a", constant())).evaluate(wi, wo)
    for name in ("luminance", "description"):
        assert torch.equal(rgl.load(write_tensors(tmp_path / "a", without(name))).evaluate(wi, wo), whole)
    # Without a jacobian the density counts as 1: another value, but one.
    assert bool(torch.isfinite(rgl.load(write_tensors(tmp_path / "a", without("jacobian"))).evaluate(wi, wo)).all())


def test_spectra_need_their_wavelengths(tmp_path: Path) -> None:
    fields = rough((0.0,), wavelengths=9)
    short = fields | {"wavelengths": fields["wavelengths"][:8]}
    falling = fields | {"wavelengths": fields["wavelengths"][::-1].copy()}
    with refused(where="a"):
        rgl.load(write_tensors(tmp_path / "a", {k: v for k, v in fields.items() if k != "wavelengths"}))
    with refused(where="b"):
        rgl.load(write_tensors(tmp_path / "b", short))
    with refused(where="b: wavelengths"):
        rgl.load(write_tensors(tmp_path / "b", falling))


def test_rgb_is_no_spectrum(tmp_path: Path) -> None:
    with refused(where="channels", found="'spectral' for HERE/a, which holds RGB"):
        rgl.open_file(write_tensors(tmp_path / "a", constant()), "spectral")


def test_values_beyond_all_bounds_name_the_file(tmp_path: Path) -> None:
    huge = np.full((2, 4), 3e38)
    path = write_tensors(tmp_path / "a", constant(3e38, ndf=huge * 1e200, sigma=1 / huge))
    with refused(where="a: samples"):
        rgl.open_file(path, drawing=Drawing(5))


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"tensor_file 1", "begins with b'tensor_file '"),
        (MAGIC[:12], "ends at byte 12 within the version, expected a whole header"),
        (b"tensor_file\0\2\0" + bytes(4), "of version 2.0, expected 1.0"),
        (MAGIC + b"\1\0", "ends at byte 16 within the number of fields"),
        (header(), "holds no fields, expected theta_i"),
        (header(count=2**32 - 1), "ends at byte 18 within field 1 of 4294967295"),
        (header(struct.pack("<H", 65535)), "within field 1 of 1"),
        (header(field(b"a", ())[:-3]), "ends at byte 29 within field 'a'"),
        (header(field(b"a\xff", ())), "the name of field 1 of 1 is .*, expected UTF-8"),
        (header(field(b"a", (), 1, 60), field(b"a", (), 1, 60)), "field 'a' is there twice"),
        (header(field(b"a", (4,), 0)), "field 'a' is of type 0, expected 1 to 11"),
        (header(field(b"a", (4,), 12)), "is of type 12"),
        (header(field(b"a", (), rank=65535)), "has 65535 axes, expected at most 8"),
        (header(field(b"a", (4,), offset=2**63)) + bytes(99), "takes 16 bytes from byte 9223372036854775808"),
        (header(field(b"a", (4,), offset=2)) + bytes(99), "from byte 2, expected it between the header's end, 40"),
        (header(field(b"a", (2**40, 2**40))) + bytes(99), "takes 4835703278458516698824704 bytes"),
        (header(field(b"a", (2**32, 2**32))) + bytes(99), "expected it between"),
        (header(field(b"a", (0, 2**63), offset=50)) + bytes(99), "expected at least one number"),
        (
            header(field(b"a", (25,), offset=60)) + bytes(99),
            "cut off: 139 bytes, its header asks for 160; field 'a' .25,. takes 100 bytes from byte 60",
        ),
    ],
)
def test_bad_headers_are_refused(tmp_path: Path, content: bytes, message: str) -> None:
    path = tmp_path / "bad.bsdf"
    path.write_bytes(content)
    with pytest.raises(BadInput, match=message) as caught:
        rgl.load(path)
    assert str(caught.value).startswith(f"{path}: ")
    assert "\n" not in str(caught.value)


def test_every_truncation_is_refused(tmp_path: Path) -> None:
    whole = write_tensors(tmp_path / "a", without("description")).read_bytes()
    path = tmp_path / "cut"
    for size in [*range(12, 500), *range(500, len(whole), 97)]:
        path.write_bytes(whole[:size])
        with pytest.raises(BadInput):
            rgl.load(path)


def test_damaged_files_give_a_table_or_a_named_error(tmp_path: Path) -> None:
    generator = random.Random(5)
    whole = write_tensors(tmp_path / "a", rough((-180.0, -90.0, 0.0))).read_bytes()
    path, refusals = tmp_path / "damaged", []
    for _ in range(400):
        data = bytearray(whole)
        for _ in range(generator.randint(1, 4)):
            reach = len(data) if generator.random() < 0.3 else 450
            data[generator.randrange(reach)] = generator.randrange(256)
        path.write_bytes(data)
        try:
            rgl.open_file(path, drawing=Drawing(20))
        except BadInput as error:
            refusals.append(str(error))
    assert 100 < len(refusals) < 400
    assert all(line.startswith(f"{path}: ") and "\n" not in line for line in refusals)
