"""What the page is made of, without a browser: coded transports, the furnace's table, quotients, bad input."""

import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from editing.page_scene import page_prepared
from editing.scenes import prepared_paint, relative, single

from homofact.brdf.analytic import Lambert
from homofact.editing import models
from homofact.editing.basis import basis_of, product_of
from homofact.editing.block_floats import BlockFloats
from homofact.editing.furnace import albedo_of
from homofact.editing.furnace_table import furnace_table
from homofact.editing.lowrank import LowRank
from homofact.editing.material import Editable
from homofact.editing.page.build import scene_numbers, write_edit_page
from homofact.editing.page.coded import coded
from homofact.editing.page.quotients import (
    from_rusinkiewicz,
    lifted,
    quotient_table,
    to_rusinkiewicz,
)
from homofact.editing.pairs import pairs_of
from homofact.editing.picture import starting_curves, summed_curves
from homofact.editing.precompute import prepare
from homofact.editing.scene import PreparedScene, PreparedTerm
from homofact.editing.transport import FullTransport
from homofact.errors import BadInput


def data_of(page: Path) -> dict[str, Any]:
    """The data in a page."""
    found = re.search(r'<script type="application/json" id="data">(.*?)</script>', page.read_text(), re.S)
    assert found is not None
    return json.loads(found[1])


def starts_of(prepared: PreparedScene, part: PreparedTerm) -> list[torch.Tensor]:
    """The curves of a part's sum as they start."""
    material = prepared.scene.objects[part.object].material
    return summed_curves(part, material, starting_curves(prepared))


def coding_error(transport: LowRank, starts: list[torch.Tensor], curves: list[torch.Tensor]) -> float:
    """Relative RMS of the coded transport's picture of curves."""
    found = coded(transport, starts)
    assert found.numbers.dtype == found.outward.dtype == np.int16
    rho = product_of(curves) / transport.scale
    a, rows = found.numbers * found.steps[:, None, None], found.outward * found.rows[:, None] * found.columns
    return relative(torch.from_numpy(np.einsum("rpc,rc->pc", a, rows @ rho.T)), transport.picture(curves))


@pytest.mark.slow
def test_coded_transports_are_far_closer_than_half_floats() -> None:
    prepared = page_prepared()
    for part in prepared.parts:
        transport, starts = part.transport, starts_of(prepared, part)
        assert isinstance(transport, LowRank)
        generator = np.random.default_rng(1)
        edited = [each * torch.from_numpy(generator.uniform(0.5, 2.0, (len(each), 1))) for each in starts]
        for curves in (starts, edited):
            assert coding_error(transport, starts, curves) < 2.0**-11


def test_curves_over_five_decades_are_coded_without_rings() -> None:
    """Where a curve starts near nothing and the quotient is large, so is W: one step per row left an error of 0.7%."""
    pixels, bands = 400, (32, 32)
    places = [np.linspace(0, 1, count) for count in bands]
    starts = [
        torch.from_numpy(each)[:, None].expand(-1, 3) for each in (np.exp(-11.5 * places[0]), 0.01 + places[1] ** 5)
    ]
    wanders = np.random.default_rng(2).uniform(0, 1, (pixels, 2))
    parts = [np.exp(-(((each - wanders[:, k, None]) / 0.2) ** 2)) for k, each in enumerate(places)]
    block = np.einsum("pj,pk,j->pjk", *parts, np.exp(9 * places[0])).reshape(pixels, 1, -1).repeat(3, 1)
    basis = basis_of(block[:, 0], np.zeros(pixels, int), starts)
    full = FullTransport(block.reshape(pixels, 3, *bands).astype(np.float32), 2)
    kept, outward = BlockFloats.of(basis.coefficients(block)), BlockFloats.of(basis.outward[:, None])
    transport = LowRank(kept, outward, basis.scale, bands, np.arange(pixels), full)
    for curves in (starts, [starts[0] ** 0.7, starts[1]]):
        assert coding_error(transport, starts, curves) < 5e-4


def test_a_part_without_light_is_coded_as_nothing() -> None:
    prepared = page_prepared()
    part = prepared.parts[0].transport
    assert isinstance(part, LowRank)
    black = replace(part, coefficients=BlockFloats.of(np.zeros(part.coefficients.codes.shape)))
    dark = coded(black, starts_of(prepared, prepared.parts[0]))
    assert not dark.numbers.any()
    assert np.isfinite(dark.steps).all()


def table_albedo(material: Editable) -> np.ndarray:
    """(angles, C) of the tables, with the curves as they start."""
    starts = material.banded_start()
    rows = [
        furnace_table(term).albedo([starts[term.name, slot.name].values.numpy() for slot in term.slots])
        for term in material.terms
    ]
    return np.sum(rows, 0)


@pytest.mark.slow
def test_the_furnace_s_table_is_the_furnace() -> None:
    for thing in page_prepared().scene.objects[1:]:
        material = thing.material
        expected = np.array(albedo_of(material.edited(dict(material.banded_start()))).values)
        assert table_albedo(material) == pytest.approx(expected, rel=1e-6)


def test_half_and_difference_angles_go_there_and_back() -> None:
    wi, wo = pairs_of(400, 1)
    again = from_rusinkiewicz(*to_rusinkiewicz(wi, wo))
    assert (again[0] - wi).abs().max() < 1e-9
    assert (again[1] - wo).abs().max() < 1e-9
    assert lifted(torch.tensor([[0.6, 0.0, -0.8]], dtype=torch.float64))[0, 2] > 0


def test_quotient_tables_are_near_their_quotients() -> None:
    paint, steel, clay, floor = (thing.material for thing in page_prepared().scene.objects)
    assert quotient_table(floor.terms[0]).sizes == (1, 1, 1, 1)
    assert quotient_table(floor.terms[0]).error(floor.terms[0]) < 1e-12
    for material, most in ((paint, 0.05), (steel, 0.03), (clay, 0.02)):
        table = quotient_table(material.terms[-1])
        error = table.error(material.terms[-1])
        assert 0 < error < most
        # Turned about the normal, clay changes and the models' quotients do not.
        assert (table.sizes[3] > 1) == (material is clay)


@pytest.mark.slow
def test_the_page_is_one_file_that_asks_for_nothing(tmp_path: Path) -> None:
    prepared = page_prepared()
    told: list[str] = []
    size = write_edit_page(
        tmp_path / "p.html", prepared, title="<b>", numbers={"More": {"a": 12345, "b": 0.0123456}}, stage=told.append
    )
    text = (tmp_path / "p.html").read_text()
    assert size == (tmp_path / "p.html").stat().st_size
    assert told == ["materials", "transports", "writing the page"]
    assert "default-src 'none'" in text
    assert not re.search(r"https?://(?!www\.w3\.org/2000/svg)|\bsrc=|@import|url\(", text)
    assert "<title>&lt;b&gt;</title>" in text
    data = data_of(tmp_path / "p.html")
    assert data["numbers"][-1] == ["More", [["a", "12,345"], ["b", "0.0123"]]]
    assert [curve["name"] for curve in data["materials"][2]["curves"]] == ["half", "directions"]


def test_numbers_of_the_scene() -> None:
    prepared = page_prepared()
    found = scene_numbers(prepared)
    assert found["Scene"]["covered pixels"] == sum(len(seen) for seen in prepared.pixels)
    assert found["front: clay"]["pixels"] == len(prepared.parts[4].rows)
    assert re.fullmatch(r"rank \d+, error (below 0.001|[\d.]+)%", str(found["side: paint"]["specular, 64 × 32 bands"]))


@pytest.mark.slow
def test_bad_input_is_named_and_nothing_is_lost(tmp_path: Path) -> None:
    page = tmp_path / "p.html"
    page.write_text("before")
    with pytest.raises(BadInput, match=r"^page: found transports in full, expected them at low rank$"):
        write_edit_page(page, prepared_paint())
    with pytest.raises(BadInput, match=r"p\.html"):
        write_edit_page(page, page_prepared(), new=True)
    two = models.light_view(Lambert((0.5, 0.4), channels=("a", "b")), "two")
    with pytest.raises(BadInput, match=r"^channels: found a, b, expected one, or red, green and blue$"):
        write_edit_page(page, prepare(single(two), 8))
    assert page.read_text() == "before"
