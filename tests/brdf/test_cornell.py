"""The Cornell reader and writer: what a file says, each way a file can be wrong, the real files."""

import math
from collections.abc import Callable
from pathlib import Path

import pytest
import torch
from refusals import refused

from homofact.brdf.formats import cornell
from homofact.errors import BadInput
from homofact.geometry.directions import to_spherical

HEAD = "# A Laboratory\n# Some Paint\n\n# num wls\n3\n\n# wls\n400 550\n700\n\n# theta i, phi i, ...\n\n"
ROWS = [
    "0.872665 0.000000 0.573513 0.000000 0.1 0.2 0.3",
    "0.698132 0.000000 0.427512 -0.261799 0.4 0.0 0.6",
    "0.349066 0.000000 0.349066 3.141593 0.7 0.8 0.9",
]
# The rows are lines 13, 14 and 15 of the file.
FIRST = 13


def file_of(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "paint.brdf"
    path.write_bytes(text.encode("latin-1"))
    return path


def whole() -> str:
    return HEAD + "\n".join(ROWS) + "\n"


def test_reads_what_is_there(tmp_path: Path) -> None:
    samples = cornell.read(file_of(tmp_path, whole()), "spectral")
    assert samples.channels == ("400nm", "550nm", "700nm")
    assert samples.isotropic
    assert samples.values.tolist() == [[0.1, 0.2, 0.3], [0.4, 0.0, 0.6], [0.7, 0.8, 0.9]]
    theta, phi = to_spherical(samples.wo)
    assert theta.tolist() == pytest.approx([0.573513, 0.427512, 0.349066])
    assert phi.tolist()[:2] == pytest.approx([0, -0.261799])
    assert to_spherical(samples.wi)[0].tolist() == pytest.approx([0.872665, 0.698132, 0.349066])
    # φ is absolute: the third row looks along the mirror direction.
    assert float((samples.wi + samples.wo)[2, :2].abs().max()) < 1e-6


def test_provenance_names_comments_wavelengths_and_zeros(tmp_path: Path) -> None:
    facts = cornell.read(file_of(tmp_path, whole())).provenance
    assert facts["format"] == "cornell"
    assert facts["comments"][:2] == ["A Laboratory", "Some Paint"]
    assert facts["wavelengths_nm"] == [400, 550, 700]
    assert facts["faults"] == {"exact_zeros": 1, "samples_with_zeros": 1}
    assert facts["colour"]["illuminant"] == "D65"


def test_channels(tmp_path: Path) -> None:
    path = file_of(tmp_path, whole())
    assert cornell.read(path).channels == ("R", "G", "B")
    assert cornell.read(path, "luminance").channels == ("Y",)
    with refused(where="channels", found="'hsv'"):
        cornell.read(path, "hsv")


def test_windows_line_ends(tmp_path: Path) -> None:
    plain = cornell.read(file_of(tmp_path, whole()))
    assert torch.equal(cornell.read(file_of(tmp_path, whole().replace("\n", "\r\n"))).values, plain.values)


def test_a_rounded_right_angle_is_the_horizon(tmp_path: Path) -> None:
    samples = cornell.read(file_of(tmp_path, whole().replace("0.573513", "1.570797")), "spectral")
    assert 0 <= float(samples.wo[0, 2]) < 1e-15


def replaced(row: int, column: int, word: str) -> Callable[[], str]:
    def text() -> str:
        words = ROWS[row].split()
        words[column] = word
        return HEAD + "\n".join([*ROWS[:row], " ".join(words), *ROWS[row + 1 :]]) + "\n"

    return text


BAD = {
    "negative value": (
        replaced(1, 5, "-0.001"),
        f"line {FIRST + 1}: value 2 is -0.001, expected a BRDF >= 0",
    ),
    "nan": (replaced(2, 4, "nan"), f"line {FIRST + 2}: found 'nan', expected a finite number"),
    "infinite": (replaced(0, 6, "inf"), f"line {FIRST}: found 'inf', expected a finite number"),
    "word": (replaced(0, 6, "abc"), f"line {FIRST}: found 'abc', expected a finite number"),
    "underscore": (replaced(0, 6, "1_0"), f"line {FIRST}: found '1_0', expected a finite number"),
    "light under the horizon": (
        replaced(1, 0, "1.6"),
        f"line {FIRST + 1}: theta i is 1.6, under the horizon",
    ),
    "viewer under the horizon": (
        replaced(1, 2, "-0.1"),
        f"line {FIRST + 1}: theta s is -0.1, under the horizon",
    ),
    "degrees": (replaced(0, 0, "50"), f"line {FIRST}: theta i is 50, .*expected 0 to pi/2 radians"),
    "column missing": (lambda: whole().replace(" 0.2 0.3", " 0.2"), f"line {FIRST}: 6 columns, expected 7"),
    "column too many": (
        lambda: whole().replace(" 0.2 0.3", " 0.2 0.3 9"),
        f"line {FIRST}: 8 columns, expected 7",
    ),
    "cut in a row": (lambda: whole()[:-12], f"line {FIRST + 2}: 4 columns, expected 7"),
    "cut in the last number": (lambda: whole()[:-2], f"line {FIRST + 2} has no line end, so its last number"),
    "padded with zero bytes": (
        lambda: whole() + "\0" * 64 + "\n",
        f"line {FIRST + 3}: 1 columns, expected 7",
    ),
    "padded with words": (lambda: whole() + "end of file\n", f"line {FIRST + 3}: 3 columns, expected 7"),
    "no rows": (lambda: HEAD, "no samples after the wavelengths, expected rows of 7 numbers"),
    "only comments": (lambda: "# num wls\n", "only comments, expected the number of wavelengths"),
    "cut in the wavelengths": (lambda: HEAD.split("700")[0], "the file ends after 2 wavelengths, expected 3"),
    "too many wavelengths": (
        lambda: whole().replace("\n700\n", "\n700 710\n"),
        "line 9: 4 wavelengths, expected 3",
    ),
    "falling wavelengths": (
        lambda: whole().replace("400 550", "550 400"),
        "line 8: wavelength 400, expected rising",
    ),
    "no count": (lambda: whole().replace("\n3\n", "\nthree\n"), "line 5: found 'three', expected the number"),
    "count of none": (lambda: whole().replace("\n3\n", "\n0\n"), "line 5: found '0', expected the number"),
    "superscript count": (
        lambda: whole().replace("\n3\n", "\n²\n"),
        "line 5: found '²', expected the number",
    ),
    "absurd count": (lambda: whole().replace("\n3\n", "\n" + "9" * 5000 + "\n"), "line 5: found '999"),
}


@pytest.mark.parametrize(("text", "message"), BAD.values(), ids=list(BAD))
def test_bad_files_name_file_and_line(tmp_path: Path, text: Callable[[], str], message: str) -> None:
    path = file_of(tmp_path, text())
    with pytest.raises(BadInput, match=message) as caught:
        cornell.read(path)
    assert str(caught.value).startswith(str(path))
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 250 + len(str(path))


def test_sniff_goes_by_content() -> None:
    assert cornell.sniff(whole().encode())
    assert cornell.sniff(b"2\n400 700\n0 0 0 0 1 1\n")
    for other in (
        b"",
        b"# a comment\n",
        b"3\n1 2 3\n",
        b"3\nabc\n",
        b"0.5 0 0 0\n",
        b"PK\x03\x04",
        b"\xb2\n400 500\n",
    ):
        assert not cornell.sniff(other)


def test_write_then_read_is_the_same_to_six_digits(tmp_path: Path) -> None:
    generator = torch.Generator().manual_seed(1)
    angles = torch.rand(12, 4, dtype=torch.float64, generator=generator)
    spectra = torch.rand(12, 25, dtype=torch.float64, generator=generator)
    path = tmp_path / "made.brdf"
    cornell.write(path, angles, spectra, range(400, 650, 10), ["made"])
    samples = cornell.read(path, "spectral")
    assert torch.allclose(samples.values, spectra, atol=5.1e-7, rtol=0)
    assert torch.allclose(to_spherical(samples.wi)[0], angles[:, 0], atol=1e-6)
    assert torch.allclose(to_spherical(samples.wo)[1], angles[:, 3], atol=1e-6)
    assert samples.provenance["comments"][0] == "made"
    assert [item.name for item in tmp_path.iterdir()] == ["made.brdf"]


def test_write_refuses_shapes_that_disagree_and_places_that_cannot_be(tmp_path: Path) -> None:
    angles, spectra = torch.zeros(2, 4), torch.zeros(2, 3)
    with refused(where="x"):
        cornell.write(tmp_path / "x", angles, spectra, [1, 2, 3, 4])
    with pytest.raises(BadInput, match=r"cannot be written .*expected a writable place"):
        cornell.write(tmp_path / "nowhere" / "x", angles, spectra, [1, 2, 3])
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("name", "zeros", "title"),
    [
        ("garnet_red", 213, "Garnet Red"),
        ("krylon_blue", 1218, "Krylon"),
        ("cayman", 11840, "Cayman Metallic"),
    ],
)
def test_the_real_measurements(real_data: Path, name: str, zeros: int, title: str) -> None:
    samples = cornell.read(real_data / "cornell" / f"{name}.brdf", "spectral")
    assert samples.values.shape == (1439, 31)
    assert samples.provenance["faults"]["exact_zeros"] == zeros
    assert samples.provenance["comments"][1].startswith(title)
    theta_i, phi_i = to_spherical(samples.wi)
    assert float(theta_i.min()) == pytest.approx(math.radians(10), abs=1e-6)
    assert float(theta_i.max()) == pytest.approx(math.radians(80), abs=1e-6)
    assert float(phi_i.abs().max()) == 0
    assert float(to_spherical(samples.wo)[0].max()) < math.radians(79.1)
    # The strongest reading of a glossy paint lies beside the mirror direction.
    peak = int(samples.values.mean(1).argmax())
    mirror = samples.wi[peak] * torch.tensor([-1.0, -1.0, 1.0])
    assert float((mirror * samples.wo[peak]).sum()) > math.cos(math.radians(2))
