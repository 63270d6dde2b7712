"""Sniffing, and files that cannot be opened at all."""

import os
from pathlib import Path

import pytest
import torch
from brdf_files import WHOLE_FILES
from refusals import refused

from homofact.brdf.formats import READERS, npz, read_samples
from homofact.brdf.materials import material
from homofact.brdf.sampling import sample_model
from homofact.errors import BadInput

CORNELL = b"# num wls\n3\n400 550 700\n0.1 0 0.1 0 0.5 0.5 0.5\n"


def test_content_decides_and_the_name_does_not(tmp_path: Path) -> None:
    text = tmp_path / "measurement.npz"
    text.write_bytes(CORNELL)
    archive = tmp_path / "samples.brdf"
    npz.write(archive, sample_model(material("phong-10").model, 5), {})
    assert read_samples(text).provenance["format"] == "cornell"
    assert read_samples(archive).provenance["format"] == "npz"
    assert read_samples(text, "spectral").channels == ("400nm", "550nm", "700nm")


@pytest.mark.parametrize("content", [b"hello\n", b"\x89PKG\r\n\x1a\n" + b"\0" * 100, b"\0" * 500, b"\n\n"])
def test_unknown_content_lists_the_formats(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "thing.brdf"
    path.write_bytes(content)
    with refused(where="thing.brdf") as caught:
        read_samples(path)
    assert all(f"{reader.NAME}: " in str(caught.value) for reader in READERS)
    assert "\n" not in str(caught.value)


ROW = "0.1,0,0.2,3,0.5\n"
NAMES = "theta_i,phi_i,theta_o,phi_o,Y\n"
TABLES = {
    "semicolons": (
        NAMES.replace(",", ";") + ROW.replace(",", ";"),
        "a table separated by ';', expected commas",
    ),
    "few columns": ("theta_i_deg; theta_o_deg ; Y\n", "a table separated by ';', expected commas"),
    "other names and semicolons": (
        "incidence; scatter; azimuth; R; G\n5; 0; 0; 0.4; 0.3\n",
        "separated by ';', with columns 'incidence', 'scatter', 'azimuth', 'R', 'G'; expected commas and theta_i",
    ),
    "decimal commas": ("0,1;0;0,2;3;0,5\n", "a table separated by ';', expected commas and a header line"),
    "tabs": (NAMES.replace(",", "\t"), "a table separated by tabs"),
    "blanks": ("# mine\n" + ROW.replace(",", " "), "a table separated by blanks, .*theta_i,phi_i,theta_o"),
    "no header": ("# theta_i,…\n" + ROW, "a table without a header line, expected theta_i,phi_i,theta_o,phi_o"),
    "other names": ("a,b,c,d,Y\n" + ROW, "its header names no directions: the columns are .* expected theta_i"),
}


@pytest.mark.parametrize(("text", "hint"), TABLES.values(), ids=list(TABLES))
@pytest.mark.parametrize("mark", ["", "\ufeff"])
def test_a_table_that_is_nearly_a_csv_is_told_what_it_lacks(tmp_path: Path, text: str, hint: str, mark: str) -> None:
    path = tmp_path / "table.csv"
    path.write_text(mark + text, "utf-8")
    with refused(f"{hint}") as caught:
        read_samples(path)
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) - len(str(path)) < 350


def test_quotes_and_capitals_in_the_names_of_directions_do_not_matter(tmp_path: Path) -> None:
    header = '"Theta_In_deg",THETA_OUT_deg,"Delta_Phi_DEG",Weight,R,G,B'
    (tmp_path / "loud.csv").write_text(f"{header}\n30,40,180,2,1,2,3\n")
    (tmp_path / "plain.csv").write_text("theta_i_deg,theta_o_deg,dphi_deg,weight,R,G,B\n30,40,180,2,1,2,3\n")
    loud, plain = (read_samples(tmp_path / f"{name}.csv") for name in ("loud", "plain"))
    assert torch.equal(loud.wo, plain.wo)
    assert torch.equal(loud.weights, plain.weights)
    assert loud.channels == plain.channels == ("R", "G", "B")
    for header in ("thetaIn_deg,thetaOut_deg,deltaPhi_deg,weight,R,G,B", "ThetaI_deg,ThetaR_deg,dPhi_deg,weight,R,G,B"):
        (tmp_path / "inner.csv").write_text(f"{header}\n30,40,180,2,1,2,3\n")
        assert torch.equal(read_samples(tmp_path / "inner.csv").wo, plain.wo)
    (tmp_path / "words.csv").write_text("theta_i,theta_o,dphi,Red,GREEN,blue\n0.1,0.2,3,1,2,3\n")
    assert read_samples(tmp_path / "words.csv").channels == ("R", "G", "B")
    (tmp_path / "twice.csv").write_text('theta_i,"Theta_I",theta_o,dphi,Y\n0.1,0.1,0.2,3,0.5\n')
    with refused("'theta_i' names two columns"):
        read_samples(tmp_path / "twice.csv")


@pytest.mark.parametrize("head", [b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n", b"\x89PNG\r\n\x1a\n\0\0"])
def test_a_picture_is_called_one(tmp_path: Path, head: bytes) -> None:
    path = tmp_path / "sky.hdr"
    path.write_bytes(head)
    with refused("a picture, no BRDF"):
        read_samples(path)


def test_how_an_unknown_file_begins_is_shown_as_text(tmp_path: Path) -> None:
    path = tmp_path / "thing"
    for content, shown in (
        ("hällo you\nthere".encode(), r"'hällo you'"),
        (b"\x1b[31m" + b"red" * 20, r"'\\u001b\[31mredredredredredredr…'"),
        (b"\n\n", "''"),
    ):
        path.write_bytes(content)
        with refused(rf"\(begins with {shown}\), expected one of: nbrdf: "):
            read_samples(path)


def test_a_byte_order_mark_hides_no_text_format(tmp_path: Path) -> None:
    for name in ("cornell", "alta", "astm", "csv"):
        folder = tmp_path / name
        folder.mkdir()
        path = WHOLE_FILES[name].make(folder)
        plain = read_samples(path)
        path.write_bytes(b"\xef\xbb\xbf" + path.read_bytes())
        marked = read_samples(path)
        assert marked.provenance == plain.provenance
        assert torch.equal(marked.values, plain.values)


def test_missing_file(tmp_path: Path) -> None:
    with refused(where="gone.brdf"):
        read_samples(tmp_path / "gone.brdf")


def test_folder(tmp_path: Path) -> None:
    with refused(where="HERE"):
        read_samples(tmp_path)


def test_empty_file(tmp_path: Path) -> None:
    (tmp_path / "empty").touch()
    with refused(where="empty"):
        read_samples(tmp_path / "empty")


def test_name_that_no_file_can_have() -> None:
    with pytest.raises(BadInput, match="cannot be read"):
        read_samples("a\0b")
    with pytest.raises(BadInput, match="cannot be read"):
        read_samples("x" * 5000)


@pytest.mark.skipif(os.geteuid() == 0, reason="root reads everything")
def test_unreadable_file(tmp_path: Path) -> None:
    path = tmp_path / "secret"
    path.write_bytes(CORNELL)
    path.chmod(0)
    with pytest.raises(BadInput, match=r"cannot be read .*expected a BRDF file"):
        read_samples(path)


def test_unreadable_file_for_everyone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(self: Path) -> bytes:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr("homofact.files.reading._opened", refuse)
    with pytest.raises(BadInput, match=r"cannot be read \(Permission denied\)"):
        read_samples(tmp_path / "any")


def test_unknown_channels_are_refused_before_the_file(tmp_path: Path) -> None:
    with refused(where="channels", found="'xyz'"):
        read_samples(tmp_path / "gone", "xyz")
