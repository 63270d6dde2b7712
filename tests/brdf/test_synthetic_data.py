"""The embedded data: remade, they are the same bytes; and the check notices when they are not."""

import json
import shutil
from pathlib import Path

import pytest
import torch

from homofact.brdf.formats import read_samples
from homofact.brdf.materials import material
from scripts.data import make_synthetic_data

ROOT = Path(__file__).resolve().parents[2]
FOLDER = ROOT / "data_synthetic"


def test_remaking_gives_the_embedded_bytes(tmp_path: Path, capsys) -> None:
    assert make_synthetic_data.main(["--out", str(tmp_path / "new")]) == 0
    names = sorted(path.name for path in FOLDER.iterdir())
    assert names == [
        "blue_paint.npz", "knot.ply", "labels.npy", "manifest.json", "plastic.npz", "sky.hdr", "synthetic_cornell.brdf",
    ]  # fmt: skip
    for name in names:
        assert (tmp_path / "new" / name).read_bytes() == (FOLDER / name).read_bytes(), name
    assert "blue_paint.npz: make_material('lafortune-blue-paint'), " in capsys.readouterr().out


def test_check_accepts_the_embedded_and_notices_changes(tmp_path: Path, capsys) -> None:
    assert make_synthetic_data.main(["--check"]) == 0
    place = tmp_path / "copy"
    shutil.copytree(FOLDER, place)
    (place / "plastic.npz").write_bytes(b"other")
    (place / "blue_paint.npz").unlink()
    manifest = json.loads((place / "manifest.json").read_text())
    manifest["files"][2]["seed"] = 99
    (place / "manifest.json").write_text(json.dumps(manifest))
    assert make_synthetic_data.main(["--check", "--out", str(place)]) == 1
    faults = capsys.readouterr().err
    assert "plastic.npz: SHA-256 differs" in faults
    assert "blue_paint.npz: missing" in faults
    assert "synthetic_cornell.brdf: remaking gives another file" in faults


def test_they_are_small() -> None:
    assert sum(path.stat().st_size for path in FOLDER.iterdir()) < 500_000


@pytest.mark.parametrize(
    ("name", "model", "count"),
    [("blue_paint.npz", "lafortune-blue-paint", 4000), ("plastic.npz", "cook-torrance-plastic", 1500)],
)
def test_values_are_the_models_at_the_stored_directions(name: str, model: str, count: int) -> None:
    samples = read_samples(FOLDER / name)
    assert len(samples) == count
    expected = material(model).model.evaluate(samples.wi, samples.wo)
    assert torch.allclose(samples.values, expected, rtol=1e-6)
    assert samples.provenance["noise_free"] is True


def test_the_made_up_measurement_has_the_faults_of_a_real_one() -> None:
    samples = read_samples(FOLDER / "synthetic_cornell.brdf", "spectral")
    assert samples.values.shape == (284, 31)
    stated = {entry["file"]: entry for entry in json.loads((FOLDER / "manifest.json").read_text())["files"]}
    zeros = int((samples.values == 0).sum())
    assert zeros == stated["synthetic_cornell.brdf"]["exact_zeros"] == 89
    # Weak readings at short wavelengths are the ones lost.
    assert float((samples.values[:, :5] == 0).sum()) > 0.9 * zeros
