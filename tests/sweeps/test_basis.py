"""`homofact sweep --basis N`: one basis for a database, each material left out of it once, and when it pays."""

import json
from pathlib import Path

import pytest
import torch

from homofact.brdf.materials import material as named
from homofact.brdf.pair_density import over_discs
from homofact.brdf.sampling import sample_model
from homofact.brdf.source import open_source
from homofact.cli.main import main
from homofact.errors import BadInput
from homofact.evaluation.split import Split
from homofact.factor.gauge import gauge_rows
from homofact.factor.log_basis import LogBasis, of_channel
from homofact.factor.textures import domain_masks
from homofact.methods.search import Search
from homofact.sweeps.basis_folder import fit_asked, read_basis
from homofact.sweeps.shared_basis import LADDER, BasisRow, SharedBasis, fit_basis
from homofact.sweeps.sweep_file import read_sweep

NAMES = ("phong-10", "phong-30", "lafortune-clay", "lafortune-skin", "torrance-sparrow-20")
SWEEP = f"""
sources = {json.dumps([f"material:{name}" for name in NAMES])}
[source]
count = 400
[[method]]
method = "search"
effort = 2.0
size = 6
search_size = 4
projections = ["theta_h-theta_d", "theta_i-theta_o"]
"""


def written(folder: Path, text: str = SWEEP) -> Path:
    file = folder / "paints.toml"
    file.write_text(text, encoding="utf-8")
    return file


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("basis")
    assert main(["sweep", str(written(place)), "--basis", "2", "--out", str(place / "out"), "-q"]) == 0
    return place / "out"


@pytest.fixture(scope="module")
def fit(made: Path) -> SharedBasis:
    return fit_asked(read_sweep(made.parent / "paints.toml"), 2)


def test_a_material_is_left_out_of_the_basis_that_it_is_judged_by(fit: SharedBasis) -> None:
    assert [row.count for row in fit.rows] == [1, 2]
    for row in fit.rows:
        for k, material in enumerate(fit.materials):
            others = torch.stack([each.texels for j, each in enumerate(fit.materials) if j != k])
            # Every channel is a texture by itself.
            basis = LogBasis.of(torch.cat([others[:, :, c : c + 1] for c in range(3)]), row.count)
            channels = [(of_channel(material.train, c), of_channel(material.held_out, c)) for c in range(3)]
            again = sum(test.error(basis.texels(basis.solved(train))) for train, test in channels) / 3
            assert row.left_out[k] == pytest.approx(again, rel=1e-9)
            assert row.inside[k] != row.left_out[k]
    # What a material's own samples choose is never worse on them with one direction more.
    for material in fit.materials:
        own = of_channel(material.train, 0)
        coarse, fine = (own.error(b.texels(b.solved(own))) for b in (fit.basis.first(1), fit.basis))
        assert fine <= coarse * (1 + 1e-9)


def test_textures_are_compared_in_one_gauge() -> None:
    """Also those of a material whose samples reach few texels, which the solve holds in a gauge over these."""
    samples = [sample_model(named(name).model, 300, "discs", 0) for name in NAMES[:3]]
    samples[0] = samples[0].select(samples[0].wi[:, 2] > 0.7)
    kinds = ("theta_i-theta_o", "theta_i-theta_d")
    settings = Search(effort=1.0, size=6, search_size=4, projections=kinds, smoothing=1e-3, epsilon=1e-3)
    found = fit_basis(NAMES[:3], samples, samples, settings, 1)
    few, many = (each.fit.terms for each in found.materials[:2])
    assert int(few[0].mask.sum()) < int(many[0].mask.sum())
    projections = tuple(term.projection for term in few)
    rows = gauge_rows(projections, domain_masks(projections, ((6, 6), (6, 6))))
    for each in found.materials:
        assert (rows.T @ each.texels).abs().max() < 1e-9


def test_the_folder_gives_the_materials_back_with_the_errors_that_it_states(made: Path, fit: SharedBasis) -> None:
    materials = read_basis(made)
    assert tuple(materials) == NAMES
    for k, (name, found) in enumerate(materials.items()):
        source = open_source(f"material:{name}", count=400)
        test = Split.of(source, 0.2, 0).test_samples(source)
        logs = found.transform.forward(test.values)
        squares = (found.evaluate_log(test.wi, test.wo) - logs).square().mean(1)
        weights = over_discs(test)
        assert float((squares * weights).sum() / weights.sum()) == pytest.approx(fit.rows[-1].inside[k], rel=1e-6)
    figures = json.loads((made / "basis.json").read_text())["figures"]
    row = figures["rows"][-1]
    # Two textures of 6² texels of one float, thrice; for each channel of a material two numbers and A.
    assert (row["basis_bytes"], row["material_bytes"]) == (3 * 2 * 36 * 4, 3 * 4 * (2 + 1))
    assert row["bytes"] == row["basis_bytes"] / 5 + row["material_bytes"]
    assert figures["own"][0]["bytes"] == 2 * 36 * 12 + 12
    assert row["left_out"]["worst"] >= row["left_out"]["median"]


def test_it_pays_from_where_it_takes_less_bytes() -> None:
    row = BasisRow(4, (0.1,), (0.1,), 10_000, 28)
    for own in (100.0, 333.3, 5000.0):
        least = row.pays_from(own)
        assert least is not None
        assert row.bytes_among(least) < own
        assert least == 1 or own <= row.bytes_among(least - 1)
    assert row.pays_from(28.0) is None


def test_bytes_at_equal_error_are_read_off_the_ladder(fit: SharedBasis) -> None:
    ladder = fit.ladder
    assert 2 < len(ladder) <= len(LADDER)
    assert [nbytes for nbytes, _, _ in ladder] == sorted({nbytes for nbytes, _, _ in ladder}, reverse=True)
    for nbytes, middle, _ in ladder[1:]:
        # A step that is better than the one before it is never the first to be as good.
        found, bound = fit.own_bytes(middle)
        assert found <= ladder[0][0]
        assert not bound
        assert found == pytest.approx(nbytes) or middle <= ladder[0][1]
    assert fit.own_bytes(1e9) == (ladder[-1][0], True)
    assert fit.own_bytes(0.0) == (ladder[0][0], False)


def test_bad_input_is_one_line(made: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    labels = written(tmp_path, SWEEP + '[svbrdf]\nlabels = "labels.npy"\n')
    file, out = str(made.parent / "paints.toml"), str(tmp_path / "out")
    for arguments, expected in (
        ([file, "--basis", "0", "--out", out], "basis: found 0, expected 1 or more"),
        ([file, "--basis", "12", "--out", out], "basis: found 12, expected 1 to 11 for 5 materials, one of them left"),
        ([file, "--basis", "1", "--svbrdf", "--out", out], "basis: found it beside svbrdf"),
        ([file, "--basis", "1", "--workers", "2", "--out", out], "workers: found it beside basis"),
        ([str(labels), "--basis", "1", "--out", out], "found a section [svbrdf], expected none beside basis"),
        ([file, "--basis", "1", "--out", str(made)], "found an existing shared basis, expected a new folder"),
    ):
        assert main(["sweep", *arguments]) == 2
        told = capsys.readouterr().err.strip().splitlines()
        assert len(told) == 1
        assert expected in told[0]
    assert not (tmp_path / "out").exists()
    with pytest.raises(BadInput, match=r"basis\.json: no such file"):
        read_basis(tmp_path)
