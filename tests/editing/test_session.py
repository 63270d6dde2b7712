"""Sessions: history, presets, pictures kept where nothing changed, strokes, albedo; and curves as JSON."""

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from editing.page_scene import both_ends
from editing.scenes import PAINT, prepared_paint, relative, single

from homofact.brdf.analytic import Lambert
from homofact.editing import models
from homofact.editing.curves import Bands
from homofact.editing.curves_file import read_curves, write_curves
from homofact.editing.enlarged import enlarged
from homofact.editing.furnace import albedo_of
from homofact.editing.picture import radiance, starting_curves
from homofact.editing.precompute import prepare
from homofact.editing.sender_albedo import mean_weights
from homofact.editing.session import Session
from homofact.editing.shown import shown_pictures
from homofact.errors import BadInput
from homofact.rendering.sphere import SphereImage
from homofact.rendering.tonemap import DEFAULT_CURVE, automatic_exposure, tonemap

HALF, FRESNEL = ("paint", "specular", "distribution"), ("paint", "specular", "fresnel")
FLOOR_IN, FLOOR_OUT = ("floor", "diffuse", "incident"), ("floor", "diffuse", "outgoing")


def raised(session: Session, address, factor: float = 2.0) -> Bands:
    return Bands(session.curves[address].values * factor)


def test_written_pictures_have_the_exposure_and_curve_of_all_pictures_for_people() -> None:
    prepared = prepared_paint("full")
    found = shown_pictures(prepared)
    times = found[0].shape[1] // prepared.scene.cameras[0].pixels[0]
    values = [radiance(prepared, view, starting_curves(prepared)) for view in range(len(found))]
    large = [enlarged(prepared, view, each, times) for view, each in enumerate(values)]
    exposure = automatic_exposure(SphereImage(large[0].radiance, large[0].coverage))
    for own, each in zip(found, large, strict=True):
        whole = SphereImage(each.radiance, torch.ones_like(each.coverage))
        assert torch.equal(torch.from_numpy(own), tonemap(whole, exposure, curve=DEFAULT_CURVE).pixels)


@pytest.mark.parametrize("form", ["full", "low-rank"])
def test_pictures_are_those_of_the_curves(form: str) -> None:
    session = Session(prepared_paint(form))
    before = session.picture(0)
    assert torch.equal(before, radiance(session.prepared, 0, session.curves))
    session.slide(HALF, sigma=0.5)
    session.set({FLOOR_OUT: raised(session, FLOOR_OUT, 0.3)})
    after = session.picture(0)
    assert torch.equal(after, radiance(session.prepared, 0, session.curves))
    assert relative(after, before) > 0.1
    assert set(session.changed) == {HALF, FLOOR_OUT}


def test_parts_that_did_not_change_are_not_computed_again(monkeypatch: pytest.MonkeyPatch) -> None:
    from homofact.editing import session as module

    session, asked = Session(prepared_paint()), []
    original = module.part_picture
    monkeypatch.setattr(module, "part_picture", lambda *given: asked.append(given[1].term) or original(*given))
    session.picture(0)
    asked.clear()
    session.set({FRESNEL: raised(session, FRESNEL)})
    session.picture(0)
    assert asked == ["specular"]


def test_undo_and_redo() -> None:
    session = Session(prepared_paint())
    start = session.picture(0)
    assert not session.undo()
    assert not session.redo()
    session.set({FRESNEL: raised(session, FRESNEL)})
    once = session.picture(0)
    session.set({FLOOR_IN: raised(session, FLOOR_IN)})
    assert session.undo()
    assert torch.equal(session.picture(0), once)
    assert session.undo()
    assert torch.equal(session.picture(0), start)
    assert session.redo()
    assert torch.equal(session.picture(0), once)
    # A new step after an undone one takes the place of what was undone.
    session.set({FLOOR_OUT: raised(session, FLOOR_OUT)})
    assert not session.redo()


def test_kept_curves_come_back_and_undo() -> None:
    session = Session(prepared_paint())
    start = session.picture(1)
    session.set({FRESNEL: raised(session, FRESNEL)})
    session.keep("B")
    kept = session.picture(1)
    session.recall("start")
    assert torch.equal(session.picture(1), start)
    session.recall("B")
    assert torch.equal(session.picture(1), kept)
    session.undo()
    assert torch.equal(session.picture(1), start)
    assert session.kept == ("start", "B")
    with pytest.raises(BadInput, match="preset: found 'C', expected one of start, B"):
        session.recall("C")
    with pytest.raises(BadInput, match="preset: found the name 'start'"):
        session.keep("start")


@pytest.mark.parametrize("address", [HALF, FRESNEL, FLOOR_IN])
@pytest.mark.parametrize("form", ["full", "low-rank"])
def test_a_stroke_settles_at_the_sessions_picture(address, form: str) -> None:
    session = Session(prepared_paint(form))
    stroke = session.stroke(address)
    for view in (0, 1):
        assert relative(stroke.picture(view), session.picture(view)) < 1e-6
    values = session.curves[address].values.clone()
    values[5:20] *= torch.tensor([3.0, 1.5, 0.2], dtype=torch.float64)
    stroke.set(Bands(values))
    frames = 0
    while stroke.update(10):
        frames += 1
    assert frames > 1
    session.set({address: Bands(values)})
    wanted = [session.picture(view) for view in (0, 1)]
    session.undo()
    for view in (0, 1):
        assert relative(stroke.picture(view), wanted[view]) < 1e-6
    stroke.finish()
    assert torch.equal(session.picture(0), wanted[0])


def test_what_a_scene_does_not_have_is_refused() -> None:
    session = Session(prepared_paint())
    ones = Bands(torch.ones(256, 3, dtype=torch.float64))
    before = session.curves
    for call, words in (
        (lambda: session.set({("glass", "x", "y"): ones}), "material: found 'glass', expected one of paint, floor"),
        (lambda: session.set({FRESNEL: ones}), "found a curve of 256 bands of 3 channels, expected 32"),
        (lambda: session.set({("floor", "diffuse", "half"): ones}), "diffuse: has no curve 'half'"),
        (lambda: session.slide(FLOOR_IN, sigma=1.0), "floor: diffuse: incident: has no sliders"),
        (lambda: session.slide(HALF, sigma=-1.0), "sigma: found -1.0, expected a finite number above 0"),
        (lambda: session.stroke(FLOOR_OUT), "floor: diffuse: outgoing: has one number per pixel"),
        (lambda: session.picture(2), "view: found number 2, expected 0 to 1"),
    ):
        with pytest.raises(BadInput, match=words):
            call()
    # One bad curve among good ones: none is set.
    with pytest.raises(BadInput):
        session.set({FLOOR_IN: raised(session, FLOOR_IN), FRESNEL: ones})
    assert session.curves == before
    assert not session.undo()


def test_the_furnace_knows_lambert_and_warns_above_1() -> None:
    found = albedo_of(Lambert((0.9, 0.5, 0.1)))
    for row in found.values:
        assert row == pytest.approx((0.9, 0.5, 0.1), abs=2e-3)
    assert found.warning() is None
    session = Session(prepared_paint())
    assert session.albedo("floor").warning() is None
    session.set({FLOOR_IN: raised(session, FLOOR_IN, 2.5)})
    line = session.albedo("floor").warning()
    assert line is not None
    assert line.startswith("albedo 1.2")
    assert line.endswith("in R: more light comes back than falls in")


def test_curves_come_back_from_their_file(tmp_path: Path) -> None:
    session = Session(prepared_paint())
    session.slide(HALF, sigma=0.37)
    session.set({FLOOR_OUT: raised(session, FLOOR_OUT, 0.3)})
    materials = [thing.material for thing in session.prepared.scene.objects]
    write_curves(tmp_path / "curves.json", materials, session.changed)
    found = read_curves(tmp_path / "curves.json", materials)
    assert set(found) == {HALF, FLOOR_OUT}
    assert all(torch.equal(found[each].values, session.curves[each].values) for each in found)


def test_equal_bands_of_earlier_files_are_taken_to_finer_ones(tmp_path: Path) -> None:
    materials = [models.cook_torrance(PAINT, "paint", (64, 64))]
    rows = (1 + torch.arange(64, dtype=torch.float64)[:, None].expand(-1, 3)).tolist()
    entry = {"material": "paint", "term": "specular", "curve": "distribution", "angle": "theta_h", "values": rows}
    file = {"format": "homofact curves", "format_version": 1, "channels": ["R", "G", "B"], "curves": [entry]}
    place = tmp_path / "curves.json"
    place.write_text(json.dumps(file), encoding="utf-8")
    (found,) = read_curves(place, materials).values()
    assert found.finer
    # The last band, of 2.8 degrees, covers the last two; the first ones lie within the first.
    assert found.values[:8, 0].tolist() == pytest.approx([1.0] * 8)
    share = 1 - (63 / 64) ** 2
    assert float(found.values[63, 0]) == pytest.approx((64 / 64 + (share - 1 / 64) * 63) / share, rel=1e-12)


def good_file() -> dict[str, Any]:
    rows = [[1.0, 1.0, 1.0]] * 64
    entry = {
        "material": "paint",
        "term": "specular",
        "curve": "fresnel",
        "angle": "theta_d",
        "bands": "equal",
        "values": rows,
    }
    channels = ["R", "G", "B"]
    return {"format": "homofact curves", "format_version": 2, "channels": channels, "curves": [entry]}


def with_values(values: Any) -> dict[str, Any]:
    found = good_file()
    found["curves"][0]["values"] = values
    return found


def with_entry(**change: Any) -> dict[str, Any]:
    found = good_file()
    found["curves"][0] |= change
    return found


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (with_values([]), r"curves\[0\].values: found \[\], expected rows of 3 numbers"),
        (with_values("high"), r"curves\[0\].values: found \"high\", expected rows of 3 numbers"),
        (with_values([[1.0, 1.0, 1.0]] * 63), r"curves\[0\]: curve: found values of the shape \(63, 3\)"),
        (with_values([[1.0, 1.0, 1.0]] * 256), r"curves\[0\]: paint: specular: fresnel: found a curve of 256 bands"),
        (with_values([[1.0, 1.0]] * 64), r"curves\[0\].values\[0\]: found \[1.0, 1.0\], expected 3 numbers"),
        (with_values([[1.0, True, 1.0]] * 64), r"curves\[0\].values\[0\]: found"),
        (with_values([[1.0, 1.0, 1.0]] * 63 + [[0.0, -2.0, 1.0]]), "value 63 of channel 1 is -2.0, expected finite"),
        (with_values([[1.0, math.nan, 1.0]] * 64), "value 0 of channel 1 is nan"),
        (with_values([[0.0, 0.0, 0.0]] * 64), "found a curve that is 0 everywhere"),
        (with_entry(curve="gloss"), "specular: has no curve 'gloss', expected one of distribution, fresnel"),
        (with_entry(term="coat"), "paint: has no term 'coat', expected one of diffuse, specular"),
        (with_entry(material="glass"), r"curves\[0\].material: found \"glass\", expected one of paint"),
        (with_entry(angle="theta_h"), r"curves\[0\].angle: found \"theta_h\", expected one of theta_d"),
        ({**good_file(), "channels": ["Y"]}, r"channels: found \[\"Y\"\], expected \[\"R\", \"G\", \"B\"\]"),
        ({**good_file(), "format": "x"}, 'format: found "x", expected one of homofact curves'),
        ({**good_file(), "format_version": 3}, r"format version 3, expected at most 2 \(update homofact\)"),
        (with_entry(bands="even"), r"curves\[0\].bands: found \"even\", expected one of equal, finer near 0"),
        ({**good_file(), "curves": []}, "curves: found .., expected 1 to"),
        (
            {**good_file(), "curves": good_file()["curves"] * 2},
            r"curves\[1\].curve: .*, expected each curve once",
        ),
    ],
)
def test_files_that_hold_no_curves_are_refused(content: dict[str, Any], words: str, tmp_path: Path) -> None:
    place = tmp_path / "curves.json"
    place.write_text(json.dumps(content), encoding="utf-8")
    materials = [models.cook_torrance(PAINT, "paint", (64, 64))]
    with pytest.raises(BadInput, match=words) as caught:
        read_curves(place, materials)
    assert str(caught.value).startswith(f"{place}: ")
    assert "\n" not in str(caught.value)
    place.write_text(json.dumps(good_file()), encoding="utf-8")
    assert list(read_curves(place, materials)) == [("paint", "specular", "fresnel")]


def test_widening_multiplies_the_angles_of_a_curve() -> None:
    session = Session(prepared_paint("full"))
    before = session.curves[HALF]
    session.widen(HALF, 1.5)
    after = session.curves[HALF]
    # Where both are read between middles of bands, the wide curve at γ is the old one at γ / 1.5.
    middles = math.pi / 2 * ((torch.arange(before.count, dtype=torch.float64) + 0.5) / before.count) ** 2
    for band in range(10, before.count - 10, 7):
        expected = torch.from_numpy(
            np.stack([np.interp(float(middles[band]) / 1.5, middles, channel) for channel in before.values.T])
        )
        assert torch.allclose(after.values[band], expected, rtol=0.02)
    assert torch.allclose(after.values[0], before.values[0], rtol=1e-3)
    assert session.undo()
    session.widen(HALF, 0.5)
    assert (session.curves[HALF].values[20:60] < before.values[20:60]).all()


@pytest.mark.parametrize("factor", [0.0, -1.0, math.nan, math.inf])
def test_a_factor_that_widens_nothing(factor: float) -> None:
    session = Session(prepared_paint("full"))
    with pytest.raises(BadInput) as refused:
        session.widen(HALF, factor)
    assert refused.value.where == "factor"
    assert not session.changed


def test_a_flat_curve_has_no_width() -> None:
    session = Session(prepared_paint("full"))
    session.set({HALF: Bands(torch.ones_like(session.curves[HALF].values), True)})
    with pytest.raises(BadInput) as refused:
        session.widen(HALF, 2.0)
    assert "HF" in str(refused.value.hint)


def test_a_wider_highlight_can_keep_the_albedo() -> None:
    session = Session(prepared_paint("full"))
    weights = torch.from_numpy(mean_weights())

    def mean() -> torch.Tensor:
        return weights @ torch.tensor(session.albedo("paint").values, dtype=torch.float64)

    before = mean()
    session.widen(HALF, 1.5)
    wide, curve = mean(), session.curves[HALF].values
    assert (wide > 1.02 * before).any()
    session.keep_albedo(HALF)
    assert torch.allclose(mean(), before, rtol=1e-9)
    lit = curve[:, 0] > 0
    ratios = session.curves[HALF].values[lit] / curve[lit]
    assert torch.allclose(ratios, ratios[:1].expand_as(ratios))
    diffuse = ("paint", "diffuse", "incident")
    session.set({diffuse: raised(session, diffuse, 20.0)})
    with pytest.raises(BadInput) as refused:
        session.keep_albedo(HALF)
    assert "paint" in str(refused.value.where)


def test_a_curve_over_both_directions_keeps_the_albedo_too() -> None:
    session = Session(prepare(single(both_ends()), 60))
    address = ("clay", "whole", "directions")
    before = torch.tensor(session.albedo("clay").values)
    session.set({address: raised(session, address, 1.3)})
    assert torch.allclose(torch.tensor(session.albedo("clay").values), 1.69 * before)
    session.keep_albedo(address)
    assert torch.allclose(torch.tensor(session.albedo("clay").values), before)


def test_scaled_curves_make_darker_pictures_at_the_exposure_of_the_start() -> None:
    session = Session(prepared_paint("full"))
    before, start = session.picture(0), session.shown()
    assert all(np.array_equal(one, other) for one, other in zip(start, shown_pictures(session.prepared), strict=True))
    for address in (HALF, FLOOR_OUT):
        was = session.curves[address].values
        session.scale(address, 0.5)
        assert torch.equal(session.curves[address].values, 0.5 * was)
    assert set(session.changed) == {HALF, FLOOR_OUT}
    assert float(session.picture(0).sum()) < 0.8 * float(before.sum())
    # The same exposure shows the difference; an automatic one would hide it.
    assert session.shown()[0].astype(float).mean() < 0.93 * start[0].astype(float).mean()
    session.undo()
    session.undo()
    assert np.array_equal(session.shown()[0], start[0])


def test_a_factor_per_channel_scales_each_channel() -> None:
    session = Session(prepared_paint("full"))
    channels = len(session.material("floor").channels)
    before = session.curves[FLOOR_OUT].values
    session.scale(FLOOR_OUT, [0.5, *[1.0] * (channels - 1)])
    after = session.curves[FLOOR_OUT].values
    assert torch.equal(after[:, 0], before[:, 0] * 0.5) or torch.equal(after, before * 0.5)
    assert torch.equal(after[:, 1:], before[:, 1:])


@pytest.mark.parametrize(
    ("address", "factor", "where"),
    [
        (("paint", "x", "y"), 0.5, "address"),
        (HALF, 0.0, "factor"),
        (HALF, float("nan"), "factor"),
        (HALF, [1, 2], "factor"),
    ],
)
def test_what_cannot_be_scaled_is_refused(address: tuple[str, str, str], factor: object, where: str) -> None:
    session = Session(prepared_paint("full"))
    with pytest.raises(BadInput) as error:
        session.scale(address, factor)  # type: ignore[arg-type]
    assert error.value.where == where
    assert not session.changed
