"""What a material of a scene may be."""

from pathlib import Path

import torch

import homofact
from homofact.scene.materials import open_reflectance


def test_a_saved_fit_is_known_by_what_it_holds_whatever_its_name(tmp_path: Path) -> None:
    fit = homofact.fit("material:phong-10", homofact.McCool(size=4))
    fit.save(tmp_path / "paint.npz")
    up = torch.tensor([[0.0, 0.0, 1.0]], dtype=torch.float64)
    found = open_reflectance(str(tmp_path / "paint.npz")).evaluate(up, up)
    assert torch.equal(found, fit.evaluate(up, up))
