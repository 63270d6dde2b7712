"""The .npz layout of samples: round trip, fixed bytes, each way an archive can be wrong."""

import io
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from homofact.brdf.formats import npz
from homofact.brdf.materials import material
from homofact.brdf.samples import Samples
from homofact.brdf.sampling import sample_model
from homofact.brdf.wavelengths import spectral_names
from homofact.errors import BadInput

PAINT = sample_model(material("lafortune-blue-paint").model, 30)


def arrays() -> dict[str, Any]:
    return {
        "wi": PAINT.wi.numpy(),
        "wo": PAINT.wo.numpy(),
        "values": PAINT.values.numpy(),
        "channels": np.array(PAINT.channels),
        "isotropic": np.array(True),
        "header": np.array(json.dumps({"name": "paint"})),
    }


def saved(tmp_path: Path, **changed: Any) -> Path:
    path = tmp_path / "samples.bin"
    content = {name: array for name, array in (arrays() | changed).items() if array is not None}
    with open(path, "wb") as file:
        np.savez(file, **content)
    return path


def entry(name: str, row: int, value: float | tuple[float, float, float]) -> np.ndarray:
    array = arrays()[name].copy()
    array[row] = value
    return array


def test_round_trip_is_exact_in_float64(tmp_path: Path) -> None:
    path = tmp_path / "paint.npz"
    npz.write(path, PAINT, {"name": "paint", "noise_free": True})
    back = npz.read(path)
    assert torch.equal(back.values, PAINT.values)
    assert torch.allclose(back.wi, PAINT.wi, atol=1e-15, rtol=0)
    assert (back.channels, back.isotropic) == (PAINT.channels, PAINT.isotropic)
    assert back.provenance["name"] == "paint"
    assert back.provenance["noise_free"] is True
    assert back.provenance["format"] == "npz"


def test_float32_directions_come_back_as_unit_vectors(tmp_path: Path) -> None:
    path = tmp_path / "paint.npz"
    npz.write(path, PAINT, {}, dtype="float32")
    back = npz.read(path)
    assert torch.allclose(back.wi.norm(dim=1), torch.ones(30, dtype=torch.float64), atol=1e-15, rtol=0)
    assert torch.allclose(back.values, PAINT.values, rtol=1e-7)
    assert not torch.equal(back.values, PAINT.values)


def test_no_date_of_its_making_is_in_a_file(tmp_path: Path) -> None:
    npz.write(tmp_path / "a", PAINT, {"z": 1, "a": 2})
    # 1980-01-01 in the first member's header.
    assert (tmp_path / "a").read_bytes()[10:14] == b"\x00\x00\x21\x00"


def test_numpys_own_archives_are_read(tmp_path: Path) -> None:
    path = saved(tmp_path)
    assert npz.sniff(path.read_bytes()[:100])
    assert torch.equal(npz.read(path).values, PAINT.values)


def test_spectra_in_an_archive_become_colours(tmp_path: Path) -> None:
    wavelengths = tuple(range(400, 701, 50))
    grey = Samples(
        PAINT.wi,
        PAINT.wo,
        PAINT.values[:, :1].expand(30, 7),
        channels=spectral_names(wavelengths),
        isotropic=True,
    )
    npz.write(tmp_path / "grey", grey, {})
    assert npz.read(tmp_path / "grey").channels == ("R", "G", "B")
    assert npz.read(tmp_path / "grey", "spectral").channels == spectral_names(wavelengths)
    assert torch.allclose(npz.read(tmp_path / "grey", "luminance").values, PAINT.values[:, :1], atol=1e-12)


def test_zeros_are_counted(tmp_path: Path) -> None:
    facts = npz.read(saved(tmp_path, values=entry("values", 4, 0.0))).provenance
    assert facts["faults"] == {"exact_zeros": 3, "samples_with_zeros": 1}


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"wo": None}, "holds channels, header, isotropic, values, wi, expected .* of which wo missing"),
        ({"values": None, "header": None}, "of which values, header missing"),
        ({"wi": entry("wi", 3, (0.8, 0, -0.6))}, "wi at row 3 has z = -0.6, under the horizon"),
        ({"wi": entry("wi", 3, (0, 0, 1.01))}, "wi at row 3 has length 1.01, expected a unit vector"),
        ({"wo": entry("wo", 5, np.nan)}, "wo at row 5 has length nan, expected a unit vector"),
        ({"wi": arrays()["wi"][:, :2]}, r"wi has shape \(30, 2\), expected \(N, 3\)"),
        ({"wo": arrays()["wo"][:-1]}, r"wo has shape \(29, 3\), expected \(30, 3\)"),
        ({"values": entry("values", 2, -1.0)}, "values at row 2 is negative, expected >= 0"),
        ({"values": entry("values", 2, np.inf)}, "values at row 2 is not finite"),
        ({"values": arrays()["values"][:, :2]}, r"values has shape \(30, 2\), expected \(30, 3\)"),
        ({"values": arrays()["values"][:, 0]}, r"values has shape \(30,\) .*expected two dimensions"),
        ({"values": np.full((30, 3), "x")}, "values has shape .* expected two dimensions of floats"),
        ({"isotropic": np.array("yes")}, "isotropic is <U3, expected one boolean"),
        ({"channels": np.array([1, 2, 3])}, "channels is int64, expected a list of strings"),
        ({"header": np.array("{")}, "header is not JSON"),
        ({"header": np.array("[1]")}, "header is a JSON list, expected an object"),
        ({"wi": np.zeros((0, 3)), "wo": np.zeros((0, 3)), "values": np.zeros((0, 3))}, "no samples are left"),
    ],
)
def test_wrong_archives_name_the_array(tmp_path: Path, changed: dict[str, Any], message: str) -> None:
    path = saved(tmp_path, **changed)
    with pytest.raises(BadInput, match=message) as caught:
        npz.read(path)
    assert str(caught.value).startswith(str(path))
    assert "\n" not in str(caught.value)


def test_pickles_are_not_opened(tmp_path: Path) -> None:
    path = tmp_path / "pickled"
    content: dict[str, Any] = arrays() | {"values": np.array([{"a": 1}], dtype=object)}
    with open(path, "wb") as file:
        np.savez(file, **content)
    with pytest.raises(BadInput, match=r"a damaged archive .*expected a whole"):
        npz.read(path)


def test_a_flipped_byte_is_noticed(tmp_path: Path) -> None:
    path = saved(tmp_path)
    raw = bytearray(path.read_bytes())
    raw[len(raw) // 3] ^= 0xFF
    path.write_bytes(raw)
    with pytest.raises(BadInput):
        npz.read(path)


def test_sniff_refuses_other_zips() -> None:
    import zipfile

    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        archive.writestr("readme.txt", "nothing")
    assert not npz.sniff(buffer.getvalue())
    assert not npz.sniff(b"wi.npy")
