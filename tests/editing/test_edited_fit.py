"""Edits of what is no product of textures: fitted anew, and what is said to be left is what is left."""

import pytest
import torch
from editing.scenes import relative

import homofact
from homofact.editing import edited_fit, models
from homofact.editing.angles import angle
from homofact.editing.build import EditMaterial
from homofact.editing.curves import Bands, band_centres
from homofact.errors import BadInput
from homofact.geometry.directions import draw_cosine_weighted
from homofact.methods.mccool import McCool
from homofact.scene.materials import FIT, OpenedMaterial
from homofact.separable.separable import Separable

PLACE = ("whole", "theta_h")


def test_a_sum_of_products_keeps_its_edit_and_errs_by_what_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    # By a method that searches nothing, of fewer samples: how well is not looked at here.
    monkeypatch.setattr(edited_fit, "Search", lambda: McCool(size=16))
    monkeypatch.setattr(edited_fit, "DEFAULT_COUNT", 6000)
    source = homofact.read("material:phong-10", count=3000)
    fit = homofact.fit(source, homofact.Nmf(size=8, textures=3)).factorization
    assert isinstance(fit, Separable)
    curves = models.from_reflectance(fit, ("theta_h",), "sum", (256,))
    material = EditMaterial(OpenedMaterial("sum", FIT, fit), curves)
    raised = 1 + 4 * torch.exp(-(((band_centres(256) - 0.6) / 0.25) ** 2))
    curve = Bands(raised[:, None] * torch.tensor([1.0, 0.6, 0.3], dtype=torch.float64))
    made = edited_fit.fit_edit(material, {PLACE: curve})
    assert made.row is not None
    # The edit itself, looked up here, at other pairs than were asked.
    wi, wo = draw_cosine_weighted(8000, torch.Generator().manual_seed(12))
    wanted = curve.at(angle("theta_h", wi, wo)) * fit.evaluate(wi, wo)
    off = relative(torch.as_tensor(made.fit.evaluate(wi, wo)), wanted)
    assert made.rms == pytest.approx(off, rel=0.1)
    assert off < 0.3 * relative(fit.evaluate(wi, wo), wanted)
    with pytest.raises(BadInput, match=r"way: sum is no product of textures and is fitted anew, expected none"):
        edited_fit.fit_edit(material, {PLACE: curve}, "texels")
