"""A texture over θh and φh: it closes, its pole is one place, it is found again, and it is saved with what it is."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from homofact.brdf.analytic import Ward
from homofact.brdf.log_transform import LogTransform
from homofact.brdf.samples import Samples
from homofact.containers.formats import FORMATS
from homofact.errors import BadInput
from homofact.exporting.exported import exported, log_difference, write_exported
from homofact.exporting.exported_reader import open_exported
from homofact.factor.factorization import Factorization, Term
from homofact.factor.projection import Warp, fixed_projection
from homofact.factor.textures import LogSamples, solve_terms
from homofact.files.archive import read_archive, write_archive
from homofact.geometry.coordinates import coordinate_system
from homofact.geometry.directions import draw_in_discs, from_half_difference, from_spherical
from homofact.geometry.names import COORDINATE_NAMES
from homofact.linear.layout import Axis
from homofact.methods.kinds import ANISOTROPIC_CANDIDATES, ISOTROPIC_CANDIDATES, loosened, takes_warp

ROUND = fixed_projection("theta_h-phi_h", True)


def fit(size: int = 12) -> Factorization:
    generator = torch.Generator().manual_seed(0)
    texture = torch.randn(size, size, 2, dtype=torch.float64, generator=generator)
    beside = torch.randn(5, 5, 2, dtype=torch.float64, generator=generator)
    terms = (
        Term(replace(ROUND, warp=Warp(0.1)), texture, torch.rand(size, size, generator=generator) > 0.2),
        Term(fixed_projection("theta_h-theta_d", True), beside, torch.ones(5, 5, dtype=torch.bool)),
    )
    return Factorization(terms, LogTransform(1e-3, torch.tensor([0.3, 0.7], dtype=torch.float64)), ("R", "G"))


def around(phi: torch.Tensor, theta: float = 0.6) -> tuple[torch.Tensor, torch.Tensor]:
    """Pairs whose half vectors have these azimuths."""
    h = from_spherical(torch.full_like(phi, theta), phi)
    d = from_spherical(torch.full_like(phi, 0.3), torch.full_like(phi, 0.4))
    return from_half_difference(h, d)


def test_half_angles_are_those_of_the_half_vector_and_swapping_leaves_them() -> None:
    system = coordinate_system("half-angles")
    phi = torch.linspace(-3, 3, 13, dtype=torch.float64)
    x = system.evaluate(*around(phi))
    assert torch.allclose(x[:, 1], phi / torch.pi)
    assert torch.allclose((x[:, 0] + 1) * (torch.pi / 4), torch.full_like(phi, 0.6))
    wi, wo = draw_in_discs(200, torch.Generator().manual_seed(0))
    assert torch.equal(system.evaluate(wi, wo), system.evaluate(wo, wi))
    normal = torch.tensor([[0.0, 0.0, 1.0]], dtype=torch.float64)
    assert system.evaluate(normal, normal).tolist() == [[-1, 0]]


def test_the_values_close_at_the_end_of_the_circle() -> None:
    found = fit()
    ends = torch.tensor([np.pi - 1e-9, -np.pi + 1e-9], dtype=torch.float64)
    logs = found.evaluate_log(*around(ends))
    assert torch.allclose(logs[0], logs[1], atol=1e-6)
    # A texel further on they differ.
    logs = found.evaluate_log(*around(torch.tensor([np.pi, np.pi - np.pi / 6], dtype=torch.float64)))
    assert float((logs[0] - logs[1]).abs().max()) > 0.1


def test_a_solve_finds_a_planted_texture_that_closes() -> None:
    """cos φh is smooth all round, and as steep at ±π/2 as anywhere."""
    wi, wo = draw_in_discs(6000, torch.Generator().manual_seed(1), 0.98)
    x = coordinate_system("half-angles").evaluate(wi, wo)
    logs = ((x[:, :1] + 1) * torch.cos(torch.pi * x[:, 1:])).double()
    samples = LogSamples(wi, wo, logs, torch.ones(len(wi), dtype=torch.float64))
    solved = solve_terms(samples, (ROUND,), ((16, 8),), 1e-4, "cholesky")
    texture = solved.terms[0].texture[..., 0]
    phi = torch.arange(16, dtype=torch.float64) * (2 * torch.pi / 16) - torch.pi
    assert torch.allclose(texture[:, 4], torch.cos(phi) * 8 / 7, atol=0.03)
    # At the pole no azimuth is another.
    assert float(texture[:, 0].std()) < 0.03


def test_the_pole_is_one_value_where_samples_pull_it_apart() -> None:
    values = Ward((0.15,), (0.19,), alpha_x=0.05, alpha_y=0.3, channels=("Y",))
    wi, wo = draw_in_discs(8000, torch.Generator().manual_seed(2), 0.98)
    samples = Samples(wi, wo, values.evaluate(wi, wo), channels=("Y",), isotropic=False)
    logs = LogSamples.of(samples, LogTransform.of(samples, 1e-5))
    solved = solve_terms(logs, (replace(ROUND, warp=Warp(0.03)),), ((16, 16),), 1e-3, "cholesky")
    texture = solved.terms[0].texture[..., 0]
    assert float(texture[:, 0].std()) < 0.05 * float(texture[:, 5].std())


def test_flat_and_round_undo_each_other_and_read_alike() -> None:
    found = fit()
    term = found.terms[0]
    flat = term.flat()
    assert flat.size == (13, 12)
    assert np.array_equal(flat.texture[12], term.texture[0])
    assert np.array_equal(flat.round().texture, term.texture)
    assert np.array_equal(flat.round().mask, term.mask)
    assert found.nbytes == 4 * 2 * (13 * 12 + 25)
    assert found.terms[1].flat().size == (5, 5)


def test_a_saved_fit_says_what_its_axes_are(tmp_path: Path) -> None:
    found = fit()
    found.save(tmp_path / "f.npz")
    loaded = Factorization.load(tmp_path / "f.npz")
    assert loaded.terms[0].projection.axes == (Axis.PERIODIC, Axis.POLAR)
    wi, wo = draw_in_discs(300, torch.Generator().manual_seed(1))
    assert torch.equal(loaded.evaluate(wi, wo), found.evaluate(wi, wo))
    data, header = read_archive(tmp_path / "f.npz")
    arrays = {name: array for name, array in data.items() if name != "header"}
    assert header["terms"][0]["axes"] == ["periodic", "polar"]
    # A file of 0.1.0 does not say it, and means clamped axes.
    del header["terms"][1]["axes"]
    write_archive(tmp_path / "old.npz", header, arrays)
    assert Factorization.load(tmp_path / "old.npz").terms[1].projection.axes == (Axis.CLAMPED, Axis.CLAMPED)
    header["terms"][0]["axes"] = ["clamped", "clamped"]
    write_archive(tmp_path / "odd.npz", header, arrays)
    with pytest.raises(BadInput, match=r"odd.npz.*axes: found .*clamped.*, expected .*periodic.*polar.*, which thet"):
        Factorization.load(tmp_path / "odd.npz")


def test_an_export_reads_back_round(tmp_path: Path) -> None:
    found = fit()
    made = exported(found, FORMATS["exr"])
    write_exported(tmp_path / "e", made, {})
    manifest = json.loads((tmp_path / "e" / "manifest.json").read_text(encoding="utf-8"))
    assert manifest["textures"][0]["rows"] == 13
    assert manifest["terms"][0]["projection"]["periodic"] == [False, True]
    opened = open_exported(tmp_path / "e")
    assert isinstance(opened, Factorization)
    assert opened.terms[0].size == (12, 12)
    assert np.array_equal(opened.terms[0].mask, found.terms[0].mask)
    assert log_difference(found, opened) < 1e-5
    for name, value, message in (
        ("matrix", [[0.6, 0.4], [0, 1]], "expected one that half-angles has"),
        ("rotation", {"kind": "single", "quaternion": [1, 0, 0, 0]}, "which has fixed projections only"),
    ):
        edited = json.loads(json.dumps(manifest))
        edited["terms"][0]["projection"][name] = value
        (tmp_path / "e" / "manifest.json").write_text(json.dumps(edited), encoding="utf-8")
        with pytest.raises(BadInput, match=message):
            open_exported(tmp_path / "e")


def test_it_is_a_fixed_kind_for_anisotropic_materials() -> None:
    assert "theta_h-phi_h" in ANISOTROPIC_CANDIDATES
    assert "theta_h-phi_h" not in ISOTROPIC_CANDIDATES
    assert "half-angles" not in COORDINATE_NAMES
    assert takes_warp("theta_h-phi_h")
    assert loosened(ROUND) is None
    assert [takes_warp(kind) for kind in ("d", "theta_d-phi_d", "theta_d", "wi", "in-out")] == [False] * 5
    assert all(takes_warp(kind) for kind in ("h", "theta_h", "theta_h-phi_d", "half-diff", "isotropic-half-diff"))
