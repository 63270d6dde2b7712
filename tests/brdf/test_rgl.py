"""Evaluation through the adaptive parameterization: closed forms, symmetries, bad tables."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from refusals import refused
from rgl_files import constant, rough, write_tensors
from torch import Tensor

from homofact.brdf.formats.rgl import load
from homofact.brdf.rgl import AdaptiveTable
from homofact.geometry.directions import draw_uniform, from_spherical, normalize, to_spherical

FULL = (-180.0, -60.0, 60.0, 180.0)
HALF = (-180.0, -120.0, -60.0, 0.0)
QUARTER = (-180.0, -135.0, -90.0)


def pairs(count: int = 300, seed: int = 0) -> tuple[Tensor, Tensor]:
    return draw_uniform(count, torch.Generator().manual_seed(seed))


def half_angles(wi: Tensor, wo: Tensor) -> tuple[Tensor, Tensor]:
    return to_spherical(normalize(wi + wo))


def turned(w: Tensor, angle: float) -> Tensor:
    cos, sin = math.cos(angle), math.sin(angle)
    return w @ torch.tensor([[cos, sin, 0], [-sin, cos, 0], [0, 0, 1]], dtype=torch.float64)


def test_a_constant_table_is_the_microfacet_factor_alone(tmp_path: Path) -> None:
    table = load(write_tensors(tmp_path / "a", constant(0.25)))
    wi, wo = pairs()
    assert torch.allclose(table.evaluate(wi, wo), (0.25 * 2 / (4 * wo[:, 2:])).expand(-1, 3), rtol=1e-12)
    plain = load(write_tensors(tmp_path / "b", constant(0.25, jacobian=np.zeros(1, "u1"))))
    assert torch.allclose(plain.evaluate(wi, wo), (0.25 / wo[:, 2:]).expand(-1, 3), rtol=1e-12)


def test_d_is_read_at_the_half_vector_and_sigma_at_the_incidence(tmp_path: Path) -> None:
    # Both linear along √(2θ/π), which a table of any size holds exactly.
    ramp = np.linspace(0, 1, 5, dtype="f4")
    table = load(
        write_tensors(tmp_path / "a", constant(1, ndf=np.tile(3 - ramp, (3, 1)), sigma=np.tile(1 + ramp, (2, 1))))
    )
    wi, wo = pairs()
    d = 3 - (half_angles(wi, wo)[0] * 2 / math.pi).sqrt()
    sigma = 1 + (to_spherical(wi)[0] * 2 / math.pi).sqrt()
    assert torch.allclose(table.evaluate(wi, wo)[:, 0], d / (4 * sigma * wo[:, 2]), rtol=1e-6)


def test_the_table_is_read_where_the_visible_normals_put_it(tmp_path: Path) -> None:
    # Visible normals p = 2x take x to x² = 2θm/π; the table is that coordinate, and the other in G.
    nodes = np.linspace(0, 1, 7, dtype="f4")
    rgb = np.zeros((1, 4, 3, 7, 7), "f4")
    rgb[:, :, 0] = nodes
    rgb[:, :, 1] = nodes[:, None]
    vndf = np.broadcast_to(nodes, (1, 4, 7, 7)).copy()
    table = load(write_tensors(tmp_path / "a", constant(rgb=rgb, vndf=vndf, jacobian=np.zeros(1, "u1"))))
    wi, wo = pairs()
    theta, phi = half_angles(wi, wo)
    found = table.evaluate(wi, wo) * wo[:, 2:]
    assert torch.allclose(found[:, 0], theta * 2 / math.pi, atol=1e-6)
    from_incidence = torch.remainder((phi - to_spherical(wi)[1]) / (2 * math.pi) + 0.5, 1)
    assert torch.allclose(found[:, 1], from_incidence, atol=1e-6)


def test_linear_between_slices_and_held_beyond(tmp_path: Path) -> None:
    theta = np.radians([20, 40, 70]).astype("f4")
    fields = constant(jacobian=np.zeros(1, "u1"), theta_i=theta, vndf=np.ones((1, 3, 5, 5), "f4"))
    fields["rgb"] = np.broadcast_to(theta[:, None, None, None], (1, 3, 3, 5, 5)).astype("f4")
    table = load(write_tensors(tmp_path / "a", fields))
    wi, wo = pairs()
    wanted = to_spherical(wi)[0].clamp(math.radians(20), math.radians(70))
    assert torch.allclose((table.evaluate(wi, wo) * wo[:, 2:])[:, 2], wanted, atol=1e-6)


@pytest.mark.parametrize("phi", [(-180.0, -60.0, 60.0, 180.0), (0.0, 120.0, 240.0, 360.0), (-90.0, 30.0, 150.0, 270.0)])
def test_slices_over_the_whole_turn_are_found_by_azimuth(tmp_path: Path, phi: tuple[float, ...]) -> None:
    angles = np.radians(phi).astype("f4")
    fields = constant(jacobian=np.zeros(1, "u1"), phi_i=angles, vndf=np.ones((4, 4, 5, 5), "f4"))
    # A triangle wave that closes upon itself, up and down once in the turn.
    fields["rgb"] = np.broadcast_to(np.array([0, 2, 2, 0], "f4")[:, None, None, None, None], (4, 4, 3, 5, 5)).copy()
    table = load(write_tensors(tmp_path / "a", fields))
    assert not table.isotropic
    wi, wo = pairs()
    part = torch.remainder(to_spherical(wi)[1] - math.radians(phi[0]), 2 * math.pi) / (2 * math.pi)
    wanted = 6 * torch.minimum(part, 1 - part)
    assert torch.allclose((table.evaluate(wi, wo) * wo[:, 2:])[:, 0], wanted.clamp_max(2), atol=1e-5)


def test_isotropic_tables_turn_freely(tmp_path: Path) -> None:
    table = load(write_tensors(tmp_path / "a", rough((0.0,))))
    wi, wo = pairs()
    assert table.isotropic
    found = table.evaluate(wi, wo)
    assert torch.allclose(table.evaluate(turned(wi, 1.0), turned(wo, 1.0)), found, rtol=1e-9)
    assert float((table.evaluate(wo, wi) / found - 1).abs().median()) > 0.01


@pytest.mark.parametrize(("phi", "half", "mirror"), [(FULL, False, False), (HALF, True, False), (QUARTER, True, True)])
def test_partial_turns_bring_their_symmetry(tmp_path: Path, phi: tuple[float, ...], half: bool, mirror: bool) -> None:
    table = load(write_tensors(tmp_path / "a", rough(phi)))
    wi, wo = pairs()
    # Off the lines at which the random tables do not close; float32 azimuths leave the rest 1e-7 off.
    keep = (wi[:, :2].abs() > 0.02).all(1)
    wi, wo = wi[keep], wo[keep]
    found = table.evaluate(wi, wo)
    assert bool((found > 0).all())
    for symmetric, change in ((half, [-1, -1, 1]), (mirror, [1, -1, 1]), (mirror, [-1, 1, 1])):
        sign = torch.tensor(change).double()
        assert torch.allclose(table.evaluate(wi * sign, wo * sign), found, rtol=1e-5) is symmetric


def test_light_along_the_horizon_is_reflected(tmp_path: Path) -> None:
    table = load(write_tensors(tmp_path / "a", constant()))
    up, flat = (torch.tensor([w], dtype=torch.float64) for w in ([0.0, 0, 1], [1.0, 0, 0]))
    assert table.evaluate(flat, up)[0].tolist() == pytest.approx([0.125] * 3)


def test_negative_values_are_kept_apart(tmp_path: Path) -> None:
    fields = constant(0.5)
    fields["rgb"][:, :, 2] = -0.5
    table = load(write_tensors(tmp_path / "a", fields))
    assert table.facts["faults"] == {"negative_entries": 100}
    wi, wo = pairs(5)
    assert torch.allclose(table.signed(wi, wo)[:, 2], -table.signed(wi, wo)[:, 0])
    assert bool((table.evaluate(wi, wo)[:, 2] == 0).all())
    samples = table.sample(200, "cosine", seed=4)
    assert samples.provenance["faults"] == {
        "negative_entries": 100,
        "negative_values": 200,
        "samples_with_negative_values": 200,
        "exact_zeros": 0,
    }
    assert samples.provenance["sampling"] == {"scheme": "cosine", "noise_free": False, "seed": 4}


def test_no_facet_seen_reflects_nothing(tmp_path: Path) -> None:
    table = load(write_tensors(tmp_path / "a", constant(sigma=np.zeros((2, 4), "f4"))))
    assert bool((table.evaluate(*pairs(20)) == 0).all())


def test_costs_and_chunks(tmp_path: Path) -> None:
    table = load(write_tensors(tmp_path / "a", rough((0.0,))))
    assert table.nbytes == 4 * (4 + 1 + 30 + 21 + 4 * 72 + 4 * 108)
    assert table.fetches == 6
    assert load(write_tensors(tmp_path / "b", rough(FULL))).fetches == 10
    wi, wo = pairs(50_000)
    whole = table.evaluate(wi, wo)
    assert torch.equal(whole[49_000:], table.evaluate(wi[49_000:], wo[49_000:]))


def test_spectra_are_converted_at_the_nodes(tmp_path: Path) -> None:
    fields = rough((0.0,), wavelengths=9)
    path = write_tensors(tmp_path / "a", fields)
    spectral, rgb, grey = (load(path, channels) for channels in ("spectral", "rgb", "luminance"))
    assert (len(spectral.channels), rgb.channels, grey.channels) == (9, ("R", "G", "B"), ("Y",))
    assert spectral.channels[:2] == ("360nm", "440nm")
    wi, wo = pairs()
    from homofact.brdf.spectral import to_luminance

    wanted, _ = to_luminance(spectral.evaluate(wi, wo), fields["wavelengths"].tolist())
    assert torch.allclose(grey.evaluate(wi, wo), wanted, rtol=1e-5)
    flat = load(write_tensors(tmp_path / "b", fields | {"spectra": np.full_like(fields["spectra"], 0.7)}))
    wide = load(write_tensors(tmp_path / "c", fields | {"spectra": np.full_like(fields["spectra"], 0.7)}), "spectral")
    assert torch.allclose(flat.evaluate(wi, wo), wide.evaluate(wi, wo)[:, :3], rtol=1e-5)
    assert flat.facts["colour"]["illuminant"] == "D65"
    assert flat.facts["wavelengths_nm"][0] == 360


def good() -> AdaptiveTable:
    return AdaptiveTable(
        torch.tensor([0.0, 1.0]),
        torch.tensor([0.0]),
        torch.ones(2, 2),
        torch.ones(2, 3),
        torch.ones(1, 2, 3, 3),
        torch.ones(1, 2, 4, 4, 1),
        True,
        ("Y",),
    )


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"ndf": torch.ones(2)}, r"ndf has shape \(2,\), expected \(R, C\)"),
        ({"sigma": torch.ones(2, 1)}, r"sigma has shape \(2, 1\)"),
        ({"vndf": torch.ones(1, 3, 3, 3)}, r"vndf has shape .* expected \(1, 2, R, C\)"),
        ({"table": torch.ones(1, 2, 4, 4, 2)}, r"table has shape .* expected \(1, 2, R, C, 1\)"),
        ({"table": torch.ones(1, 2, 4, 4)}, "table has shape"),
        ({"theta_i": torch.tensor([1.0, 0.5])}, "theta_i has .* do not rise"),
        ({"theta_i": torch.tensor([0.0, 1.7])}, "theta_i is 0 to 1.7, expected radians within 0 to 1.571"),
        ({"theta_i": torch.tensor([-0.1, 1.5])}, "theta_i is -0.1"),
        ({"theta_i": torch.zeros(2)}, "do not rise"),
        ({"phi_i": torch.tensor([7.0])}, "phi_i is 7"),
        ({"ndf": -torch.ones(2, 2)}, "ndf has negative values"),
        ({"sigma": -torch.ones(2, 2)}, "sigma has negative values"),
        ({"vndf": -torch.ones(1, 2, 3, 3)}, "vndf has negative values"),
        ({"vndf": torch.zeros(1, 2, 3, 3)}, "vndf has a slice that is 0 throughout"),
    ],
)
def test_bad_tables_are_refused(change: dict[str, Tensor], message: str) -> None:
    assert good().isotropic
    with refused(message) as caught:
        replace(good(), **change)
    assert "\n" not in str(caught.value)


def test_azimuths_must_cover_a_part_of_the_turn() -> None:
    three = replace(good(), vndf=torch.ones(1, 2, 3, 3))
    fields = {"vndf": torch.ones(3, 2, 3, 3), "table": torch.ones(3, 2, 4, 4, 1)}
    assert not replace(three, phi_i=torch.tensor([0.0, 1.0, math.pi]), **fields).isotropic
    with refused(r"phi_i covers 114\.6 degrees, expected 360, 180 or 90"):
        replace(three, phi_i=torch.tensor([0.0, 1.0, 2.0]), **fields)


def test_the_real_files_are_read_whole(real_data: Path) -> None:
    folder = real_data / "rgl"
    if not folder.is_dir():
        pytest.skip(f"no RGL files at {folder}")
    table = load(folder / "vch_golden_yellow_rgb.bsdf")
    assert table.isotropic
    assert table.facts["comments"] == ["TeckWrap vinyl wrapping film (Golden Yellow VCH508N)"]
    assert table.facts["faults"] == {"negative_entries": 1118}
    assert tuple(table.table.shape) == (1, 8, 32, 32, 3)
    # Energy: a yellow film lit from 60 degrees, albedo by uniform directions.
    wo = pairs(50_000)[0]
    wi = from_spherical(torch.full((len(wo),), math.pi / 3).double(), torch.zeros(len(wo)).double())
    red, green, blue = (2 * math.pi * table.evaluate(wi, wo) * wo[:, 2:]).mean(0).tolist()
    assert red == pytest.approx(0.43, abs=0.02)
    assert green == pytest.approx(0.27, abs=0.02)
    assert blue == pytest.approx(0.08, abs=0.01)
