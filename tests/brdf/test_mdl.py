"""The MDL reader: layout, the two faults its files come with, each way a file can be wrong, a real one."""

import math
import struct
from pathlib import Path

import numpy as np
import pytest
import torch
from refusals import refused

from homofact.brdf.formats import mdl, read_samples
from homofact.brdf.source import describe, open_source
from homofact.brdf.table import AngleTable
from homofact.geometry.directions import draw_uniform, to_spherical

MAGIC = b"NVIDIA ARC MBSDF V1\n"
MARK = b"MBSDF_DATA_REFLECTION=\n"


def data(n_theta: int = 4, n_phi: int = 6, channels: int = 3) -> np.ndarray:
    shape = (n_theta, n_theta, n_phi, channels)
    return np.random.default_rng(0).random(shape).astype(np.float32) + 0.1


def content(entries: np.ndarray, head: bytes = MAGIC + MARK) -> bytes:
    kind = {1: 0, 3: 1}[entries.shape[-1]]
    return head + struct.pack("<3I", kind, entries.shape[0], entries.shape[2]) + entries.astype("<f4").tobytes()


def file_of(tmp_path: Path, raw: bytes) -> Path:
    path = tmp_path / "paint.bin"
    path.write_bytes(raw)
    return path


def test_entries_stand_at_bin_centres(tmp_path: Path) -> None:
    entries = data()
    samples = read_samples(file_of(tmp_path, content(entries)))
    assert samples.isotropic
    assert samples.channels == ("R", "G", "B")
    index = (2 * 4 + 1) * 6 + 4
    assert samples.values[index].tolist() == entries[2, 1, 4].astype(float).tolist()
    theta_i, phi_i = to_spherical(samples.wi[index])
    theta_o, phi_o = to_spherical(samples.wo[index])
    assert float(theta_i) == pytest.approx(2.5 * math.pi / 8)
    assert float(theta_o) == pytest.approx(1.5 * math.pi / 8)
    assert float(phi_o - phi_i) == pytest.approx(4.5 * math.pi / 6)
    assert float(samples.weights.mean()) == pytest.approx(1)
    # sin θi sin θo: the outermost pair of rings is the largest.
    assert float(samples.weights[-1] / samples.weights[0]) == pytest.approx(
        (math.cos(3 * math.pi / 8) / (1 - math.cos(math.pi / 8))) ** 2
    )


def test_a_scalar_file_has_one_channel(tmp_path: Path) -> None:
    path = file_of(tmp_path, content(data(channels=1), MAGIC + b'name="grey"\n' + b"MBSDF_DATA=\n"))
    source = open_source(str(path), channels="luminance")
    assert source.samples.channels == source.reflectance.channels == ("Y",)
    assert describe(source)["comments"] == ['name="grey"']


def test_the_table_is_the_reflectance(tmp_path: Path) -> None:
    reading = mdl.open_file(file_of(tmp_path, content(data())))
    assert isinstance(reading.reflectance, AngleTable)
    found = reading.reflectance.evaluate(reading.samples.wi, reading.samples.wo)
    assert torch.allclose(found, reading.samples.values, atol=1e-12)
    grey = mdl.open_file(file_of(tmp_path, content(data())), "luminance")
    assert grey.reflectance is not None
    assert grey.reflectance.channels == grey.samples.channels == ("Y",)


def test_negative_entries_become_zero_and_are_counted(tmp_path: Path) -> None:
    entries = data()
    entries[1, 2, 3, 0] = entries[1, 2, 3, 2] = -0.25
    entries[0, 0, 0, 1] = -0.5
    entries[3, 0, 0, 1] = 0
    samples = mdl.open_file(file_of(tmp_path, content(entries))).samples
    faults = samples.provenance["faults"]
    assert (faults["negative"], faults["samples_with_negative"], faults["exact_zeros"]) == (3, 2, 1)
    assert faults["most_negative"] == -0.5
    assert len(samples) == 4 * 4 * 6
    index = (1 * 4 + 2) * 6 + 3
    assert samples.values[index].tolist() == [0.0, float(entries[1, 2, 3, 1]), 0.0]


def test_repeated_ends_are_left_out(tmp_path: Path) -> None:
    entries = data(6)
    entries[:, 5] = entries[:, 4]
    entries[3:] = entries[2]
    samples = mdl.open_file(file_of(tmp_path, content(entries))).samples
    assert len(samples) == 3 * 5 * 6
    assert samples.provenance["faults"]["extrapolated"] == 6 * 6 * 6 - 3 * 5 * 6
    assert samples.provenance["faults"]["measured_to_degrees"] == [37.5, 67.5]


def test_a_constant_file_is_no_extrapolation(tmp_path: Path) -> None:
    assert len(mdl.open_file(file_of(tmp_path, content(np.full((4, 4, 6, 3), 0.25)))).samples) == 96


def test_what_follows_may_be_the_transmission(tmp_path: Path) -> None:
    raw = content(data()) + content(data(2), b"MBSDF_DATA_TRANSMISSION=\n")
    assert len(mdl.open_file(file_of(tmp_path, raw)).samples) == 96


NAN = data()
NAN[0, 0, 1, 2] = np.nan
BAD = {
    "cut": (content(data())[:-4], "1148 bytes of data, expected 1152 for 4 × 4 × 6 bins"),
    "padded": (content(data()) + b"\0" * 8, "1160 bytes of data, expected 1152"),
    "absurd sizes": (MAGIC + MARK + struct.pack("<3I", 1, 2**32 - 1, 2**32 - 1) + b"\0" * 64, "64 bytes of data"),
    "sizes of none": (MAGIC + MARK + struct.pack("<3I", 1, 0, 6), "nθ 0, nφ 6, expected type 0"),
    "a type": (MAGIC + MARK + struct.pack("<3I", 7, 4, 6), r"found type 7, .*expected type 0 \(scalar\) or 1 \(RGB\)"),
    "transmission alone": (content(data(), MAGIC + b"MBSDF_DATA_TRANSMISSION=\n"), "no reflection found after 0"),
    "no data": (MAGIC + b'a="b"\n' * 3, "no reflection found after 3 lines"),
    "cut in the header": (MAGIC + MARK + b"\1\0\0\0", "the file ends in the header"),
    "nan": (content(NAN), "number 5 of the data is nan"),
}


@pytest.mark.parametrize(("raw", "message"), BAD.values(), ids=list(BAD))
def test_bad_files_are_refused(tmp_path: Path, raw: bytes, message: str) -> None:
    path = file_of(tmp_path, raw)
    with refused(message) as caught:
        read_samples(path)
    assert str(caught.value).startswith(str(path))
    assert "\n" not in str(caught.value)


def test_no_spectrum(tmp_path: Path) -> None:
    with refused(where="paint.bin: channels"):
        mdl.open_file(file_of(tmp_path, content(data())), "spectral")


def test_the_real_paint(real_data: Path) -> None:
    reading = mdl.open_file(real_data / "mdl" / "carpaint_red.mbsdf")
    faults = reading.samples.provenance["faults"]
    assert faults["measured_to_degrees"] == [67.0, 81.0]
    assert (faults["extrapolated"], faults["negative"]) == (56790, 36744)
    assert len(reading.samples) == 34 * 41 * 90
    # Red, with a highlight near the mirror direction: Δφ = 0 is the light's own side.
    assert reading.reflectance is not None
    values = reading.samples.values
    assert float(values[:, 0].mean()) > 2 * float(values[:, 1].mean())
    peak = int(values.mean(1).argmax())
    mirror = reading.samples.wi[peak] * torch.tensor([-1.0, -1.0, 1.0])
    assert float((mirror * reading.samples.wo[peak]).sum()) > math.cos(math.radians(8))
    # Without a cosine in it the table is reciprocal to a fifth; with one in, it is off by more.
    wi, wo = draw_uniform(5000, torch.Generator().manual_seed(0))
    keep = (wi[:, 2] > 0.5) & (wo[:, 2] > 0.5)
    one = reading.reflectance.evaluate(wi[keep], wo[keep])[:, 0]
    two = reading.reflectance.evaluate(wo[keep], wi[keep])[:, 0]
    cosines = wi[keep, 2] / wo[keep, 2]
    plain = torch.log((one + 1e-2) / (two + 1e-2)).abs().mean()
    assert float(plain) < float(torch.log((one * cosines + 1e-2) / (two + 1e-2)).abs().mean())
    assert float(plain) < float(torch.log((one / cosines + 1e-2) / (two + 1e-2)).abs().mean())
