"""Neural BRDFs: the network's input, its laws, the archive of weights, each way that can be wrong."""

import math
import struct
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from refusals import refused
from torch import Tensor

from homofact.brdf.channels import LuminanceOf
from homofact.brdf.formats import READERS, nbrdf, npz, read_samples
from homofact.brdf.neural import LAYERS, NeuralBrdf, network_input
from homofact.brdf.source import describe, open_source
from homofact.errors import BadInput
from homofact.geometry.coordinates import rusinkiewicz_angles
from homofact.geometry.directions import draw_uniform, from_spherical


def parts(seed: int = 0, dtype: Any = np.float32) -> dict[str, np.ndarray]:
    rng = np.random.default_rng(seed)
    arrays = {}
    for k, (rows, columns) in enumerate(LAYERS):
        arrays[f"w{k}"] = rng.normal(0, 0.5, (rows, columns)).astype(dtype)
        arrays[f"b{k}"] = rng.normal(0, 0.5, columns).astype(dtype)
    return arrays


def saved(tmp_path: Path, changed: dict[str, Any] | None = None, names: tuple[str, ...] = ("tin", "zinc")) -> Path:
    arrays = {f"{name}/{part}": array for k, name in enumerate(names) for part, array in parts(k).items()}
    path = tmp_path / "weights.bin"
    with open(path, "wb") as file:
        kept: dict[str, Any] = {k: v for k, v in (arrays | (changed or {})).items() if v is not None}
        np.savez_compressed(file, **kept)
    return path


def model(seed: int = 0) -> NeuralBrdf:
    arrays = {name: torch.from_numpy(array) for name, array in parts(seed).items()}
    return NeuralBrdf((arrays["w0"], arrays["w1"], arrays["w2"]), (arrays["b0"], arrays["b1"], arrays["b2"]))


def pairs(count: int = 500, seed: int = 1) -> tuple[Tensor, Tensor]:
    return draw_uniform(count, torch.Generator().manual_seed(seed))


def turned(w: Tensor, angle: float) -> Tensor:
    c, s = math.cos(angle), math.sin(angle)
    return w @ torch.tensor([[c, s, 0], [-s, c, 0], [0, 0, 1.0]], dtype=w.dtype)


def test_input_is_half_and_difference_with_h_in_the_xz_plane() -> None:
    wi, wo = pairs()
    x = network_input(wi, wo)
    theta_h, theta_d, phi_d = rusinkiewicz_angles(wi, wo)
    assert torch.allclose(x[:, 0], torch.sin(theta_h))
    assert torch.equal(x[:, 1], torch.zeros(500, dtype=torch.float64))
    assert torch.allclose(x[:, 2], torch.cos(theta_h))
    assert torch.allclose(x[:, 5], torch.cos(theta_d))
    assert torch.allclose(x[:, 3].abs(), (torch.sin(theta_d) * torch.cos(phi_d)).abs(), atol=1e-12)
    assert torch.allclose(x[:, 4], torch.sin(theta_d) * torch.sin(phi_d), atol=1e-12)
    assert 100 < int((x[:, 3] < 0).sum()) < 400


def test_input_of_a_known_pair() -> None:
    # h at θh = 30° in the xz-plane, d at θd = 20°, φd = 70°: ωi is d turned by 30° about y.
    d = from_spherical(torch.tensor([math.radians(20)]).double(), torch.tensor([math.radians(70)]).double())
    c, s = math.cos(math.radians(30)), math.sin(math.radians(30))
    turn = torch.tensor([[c, 0, s], [0, 1, 0], [-s, 0, c]], dtype=torch.float64)
    wi = d @ turn.T
    h = torch.tensor([[s, 0, c]], dtype=torch.float64)
    wo = 2 * (wi * h).sum(-1, keepdim=True) * h - wi
    assert torch.allclose(network_input(wi, wo), torch.cat((h, d), -1), atol=1e-14)


def test_formula_by_hand() -> None:
    wi, wo = pairs(50)
    arrays = {name: array.astype(np.float64) for name, array in parts().items()}
    x = network_input(wi, wo).numpy()
    x = np.maximum(x @ arrays["w0"] + arrays["b0"], 0)
    x = np.maximum(x @ arrays["w1"] + arrays["b1"], 0)
    expected = np.maximum(np.exp(x @ arrays["w2"] + arrays["b2"]) - 1, 0)
    found = model().evaluate(wi, wo).numpy()
    assert np.allclose(found, expected, rtol=1e-12)
    assert (found == 0).any()
    assert (found > 0.1).any()


@pytest.mark.parametrize("angle", [0.0, 0.7, 2.5, -3.1])
def test_in_one_plane_rounding_does_not_choose_the_azimuth(angle: float) -> None:
    theta = torch.linspace(0.05, 1.5, 30, dtype=torch.float64)
    azimuth = torch.full_like(theta, angle)
    wi, wo = from_spherical(theta, azimuth), from_spherical(theta.flip(0) * 0.9, azimuth)
    plain = model().evaluate(from_spherical(theta, azimuth * 0), from_spherical(theta.flip(0) * 0.9, azimuth * 0))
    assert torch.allclose(model().evaluate(wi, wo), plain, rtol=1e-9, atol=1e-12)
    assert torch.allclose(model().evaluate(wo, wi), plain, rtol=1e-9, atol=1e-12)


def test_at_the_mirror_direction_azimuth_does_not_matter() -> None:
    wi = from_spherical(torch.full((8,), 0.6).double(), torch.linspace(0, 6, 8).double())
    wo = wi * torch.tensor([-1.0, -1.0, 1.0])
    values = model().evaluate(wi, wo)
    assert torch.allclose(values, values[:1].expand_as(values), rtol=1e-9)
    d = torch.tensor([math.sin(0.6), 0, math.cos(0.6)], dtype=torch.float64)
    assert torch.allclose(network_input(wi, wo)[:, 3:], d.expand(8, 3), atol=1e-12)


def test_it_takes_2700_bytes_and_no_fetches() -> None:
    net = model()
    assert (net.nbytes, net.fetches, net.channels) == (2700, 0, ("R", "G", "B"))


def test_sizes_are_checked() -> None:
    net = model()
    with refused(where="network"):
        NeuralBrdf((net.weights[0], net.weights[1][1:], net.weights[2]), net.biases)
    with refused(where="network"):
        NeuralBrdf(net.weights, (net.biases[0], net.biases[1], net.biases[2] * math.nan))


def test_read_by_name(tmp_path: Path) -> None:
    path = saved(tmp_path)
    assert nbrdf.material_names(path) == ["tin", "zinc"]
    net = nbrdf.load(f"{path}#zinc")
    wi, wo = pairs(20)
    assert torch.equal(net.evaluate(wi, wo), model(1).evaluate(wi, wo))
    samples = read_samples(f"{path}#zinc")
    assert len(samples) == 45_000
    assert samples.isotropic
    assert torch.equal(samples.values, net.evaluate(samples.wi, samples.wo))
    assert samples.provenance["material"] == "zinc"
    assert samples.provenance["noise_free"] is True


def test_the_only_material_needs_no_name(tmp_path: Path) -> None:
    path = saved(tmp_path, names=("tin",))
    (read, *_), (own, *_) = nbrdf.load(path).weights, model(0).weights
    assert torch.equal(torch.as_tensor(read), torch.as_tensor(own))
    assert nbrdf.open_file(path).samples.provenance["material"] == "tin"


def test_source_is_the_network_itself(tmp_path: Path) -> None:
    source = open_source(f"{saved(tmp_path)}#tin", count=200, seed=5)
    assert isinstance(source.reflectance, NeuralBrdf)
    assert (len(source.samples), source.default_epsilon, source.name) == (200, 1e-5, "weights.bin#tin")
    facts = describe(source)
    assert facts["format"] == "nbrdf"
    assert facts["material"] == {"material": "tin", "model": "NeuralBrdf"}
    grey = open_source(f"{saved(tmp_path)}#tin", channels="luminance", count=200)
    assert isinstance(grey.reflectance, LuminanceOf)
    assert grey.samples.channels == ("Y",)


def test_a_file_whose_name_has_the_mark_is_that_file(tmp_path: Path) -> None:
    path = saved(tmp_path, names=("tin",)).rename(tmp_path / "a#tin")
    assert nbrdf.load(path).nbytes == 2700


def test_a_member_of_another_format_is_refused(tmp_path: Path) -> None:
    npz.write(tmp_path / "plain.npz", nbrdf.open_file(saved(tmp_path, names=("tin",))).samples, {})
    with refused(where="plain.npz#tin"):
        read_samples(f"{tmp_path / 'plain.npz'}#tin")


W0 = np.zeros((6, 21), np.float32)
BAD: dict[str, tuple[dict[str, Any], str, str]] = {
    "unknown": ({}, "#tim", r"found no material 'tim', nearest tin, expected one of its 2"),
    "unlike any": ({}, "#ooooooo", "found no material 'ooooooo', expected one of its 2"),
    "no name": ({}, "", r"holds 2 materials \(tin, zinc, …\), expected one of them as weights\.bin#tin"),
    "empty name": ({}, "#", "found no material ''"),
    "a part missing": ({"tin/b1": None}, "#tin", "tin/b1 is missing, expected an array of floats"),
    "integers": ({"tin/w0": W0.astype(np.int32)}, "#tin", "tin/w0 is of int32, expected an array of floats"),
    "a wrong size": ({"tin/w0": W0[:5]}, "#tin", r"tin: network: w0 has shape \(5, 21\), expected \(6, 21\)"),
    "nan": ({"tin/w0": W0 * np.nan}, "#tin", "tin: network: w0 is not finite"),
}


@pytest.mark.parametrize(("changed", "name", "message"), BAD.values(), ids=list(BAD))
def test_bad_files_are_refused(tmp_path: Path, changed: dict[str, Any], name: str, message: str) -> None:
    path = saved(tmp_path, changed)
    with refused(message) as caught:
        read_samples(f"{path}{name}")
    assert str(caught.value).startswith(str(path))
    assert "\n" not in str(caught.value)


def test_channels(tmp_path: Path) -> None:
    path = saved(tmp_path, names=("tin",))
    with refused(where="weights.bin: channels"):
        nbrdf.open_file(path, "spectral")


def npy(header: bytes, data: bytes = b"") -> bytes:
    return b"\x93NUMPY\x01\x00" + struct.pack("<H", len(header) + 1) + header + b"\n" + data


@pytest.mark.parametrize(
    ("member", "message"),
    [
        (npy(b"{'descr': '<f4', 'fortran_order': False, 'shape': (6, 99999999999), }"), "tin/w0 has 0 bytes, expected"),
        (npy(b"{'descr': '<f4', 'fortran_order': False, 'shape': (__import__('os'),), }"), "tin/w0 is no plain array"),
        (npy(b"{'descr': '|O', 'fortran_order': False, 'shape': (1,), }", b"x" * 8), "tin/w0 is no plain array"),
        (b"hello", "tin/w0 is no numpy array"),
        (b"\0" * (80 * 2**20), "unpacks to 83886080 bytes, too many for a file of"),
    ],
)
def test_headers_are_checked_before_anything_is_allocated(tmp_path: Path, member: bytes, message: str) -> None:
    path = tmp_path / "bomb"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("tin/w0.npy", member)
    with pytest.raises(BadInput, match=message):
        nbrdf.open_file(path)


def test_sniff_goes_before_plain_archives(tmp_path: Path) -> None:
    head = saved(tmp_path).read_bytes()[:4096]
    assert nbrdf.sniff(head)
    npz.write(tmp_path / "plain", nbrdf.open_file(f"{saved(tmp_path)}#tin").samples, {})
    assert not nbrdf.sniff((tmp_path / "plain").read_bytes()[:4096])
    assert READERS.index(nbrdf) < READERS.index(npz)


def test_the_published_weights(real_data: Path) -> None:
    path = real_data / "nbrdf" / "merl_nbrdf_weights.npz"
    names = nbrdf.material_names(path)
    assert (len(names), names[0], names[-1]) == (100, "alum-bronze", "yellow-plastic")
    with refused(where="nbrdf/merl_nbrdf_weights.npz", found="no material 'alum-bonze', nearest alum-bronze"):
        nbrdf.load(f"{path}#alum-bonze")
    # MERL's white paint is nearly matte with an albedo about a third, black phenolic a mirror over black.
    theta = torch.full((4000,), 0.3, dtype=torch.float64)
    wi = from_spherical(theta, 0 * theta)
    wo, _ = draw_uniform(4000, torch.Generator().manual_seed(0))
    paint, phenolic = nbrdf.load(f"{path}#white-paint"), nbrdf.load(f"{path}#black-phenolic")
    albedo = (paint.evaluate(wi, wo) * wo[:, 2:]).mean(0) * (2 * math.pi)
    assert 0.25 < float(albedo.min()) <= float(albedo.max()) < 0.45
    mirror, side = from_spherical(theta, theta * 0 + math.pi), from_spherical(theta, theta * 0 + 1.5)
    assert float(phenolic.evaluate(wi, mirror).min()) > 100 * float(phenolic.evaluate(wi, side).max())
