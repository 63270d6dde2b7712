"""Files of curves that the page writes and reads, in a headless Chromium."""

import json
from pathlib import Path
from typing import Any

import pytest
import torch
from editing.page_opened import begin, click, steps
from editing.page_scene import materials, page_prepared, quiet

from homofact.editing.curves_file import read_curves, write_curves
from homofact.editing.picture import Address
from homofact.editing.session import Session

pytestmark = pytest.mark.slow


@pytest.fixture(autouse=True)
def fresh(page: Any) -> None:
    """The page as it began."""
    begin(page, root=True)


def text(driver: Any) -> str:
    return driver.execute_script("return homofact.page.text()")


def dropped(driver: Any, content: str, name: str = "c.json") -> str:
    """Drop a file on the page; what it says."""
    driver.execute_script(
        "const d = new DataTransfer(); d.items.add(new File([arguments[0]], arguments[1]));"
        "document.dispatchEvent(new DragEvent('drop', {dataTransfer: d, bubbles: true, cancelable: true}));",
        content,
        name,
    )
    quiet(driver)
    return driver.execute_script("return document.getElementById('note').textContent")


def all_values(driver: Any) -> list[list[float]]:
    return driver.execute_script("return homofact.page.history.state.map((c) => Array.from(c.values))")


def test_curves_go_to_a_file_and_back_bit_for_bit(page: Any, tmp_path: Path) -> None:
    page.execute_script(
        "const p = homofact.page; p.slide({sigma: 0.0731}); p.controls.edit(2, p.curvesOf(2)[1].index);"
        "p.edit(p.values.map((x, i) => x * (1 + Math.sin(i) / 3)));"
    )
    kept, content = all_values(page), text(page)
    (tmp_path / "c.json").write_text(content)
    found = read_curves(tmp_path / "c.json", materials())
    assert list(found) == [("paint", "specular", "distribution"), ("clay", "whole", "directions")]
    for address, index in zip(found, (2, 9), strict=True):
        assert found[address].values.reshape(-1).tolist() == kept[index]
    page.execute_script("homofact.page.resetAll()")
    assert all_values(page) != kept
    before = steps(page)
    assert dropped(page, content, "mine.json") == "mine.json is shown."
    assert all_values(page) == kept
    assert steps(page) == before + 1
    assert text(page) == content


def test_a_file_of_the_library_is_shown(page: Any, tmp_path: Path) -> None:
    session = Session(page_prepared())
    session.slide(("steel", "specular", "alpha"), nu=500.0)
    write_curves(tmp_path / "c.json", materials(), session.changed)
    assert dropped(page, (tmp_path / "c.json").read_text()) == "c.json is shown."
    off = torch.tensor(page.execute_script("return Array.from(homofact.radiance(0))")).double().reshape(-1, 3)
    expected = session.picture(0)
    assert float((off - expected).abs().max() / expected.abs().max()) < 2.0**-11


def entry(address: Address = ("clay", "whole", "half"), **given: Any) -> dict[str, Any]:
    own = {
        "material": address[0],
        "term": address[1],
        "curve": address[2],
        "angle": "theta_h",
        "bands": "finer near 0",
        "values": [[1, 1, 1]] * 32,
    }
    return own | given


def holding(*entries: dict[str, Any]) -> dict[str, Any]:
    return {**WHOLE, "curves": list(entries)}


WHOLE = {"format": "homofact curves", "format_version": 2, "channels": ["R", "G", "B"], "curves": [entry()]}


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("{", "file: found no JSON, expected edited curves in JSON."),
        ([1], "file: found [1], expected an object."),
        ({**WHOLE, "format": "x"}, 'format: found "x", expected homofact curves.'),
        ({**WHOLE, "format_version": 3}, "format_version: found 3, expected 2 at most"),
        (holding(entry(bands="even")), 'curves[0].bands: found "even", expected one of equal, finer near 0.'),
        ({**WHOLE, "channels": ["grey"]}, 'channels: found ["grey"], expected ["R","G","B"], as the materials have.'),
        ({**WHOLE, "curves": []}, "curves: found [], expected 1 to 10000 objects."),
        (holding(entry(("gold", "whole", "half"))), 'curves[0].material: found "gold", expected one of'),
        (holding(entry(("clay", "diffuse", "half"))), 'curves[0].term: found "diffuse", expected whole.'),
        (holding(entry(("clay", "whole", "x"))), 'curves[0].curve: found "x", expected one of half,'),
        (holding(entry(angle="theta_d")), 'curves[0].angle: found "theta_d", expected theta_h.'),
        (holding(entry(), entry()), 'curves[1].curve: found "half", expected each curve once.'),
        (holding(entry(values=[])), "curves[0].values: found 0 rows, expected 32 rows of 3 numbers."),
        (holding(entry(values=[[1, 1, 1]] * 31 + [[1, -1, 1]])), "curves[0].values[31]: found [1,-1,1], expected"),
        (holding(entry(values=[[1, None, 1]] * 32)), "curves[0].values[0]: found [1,null,1], expected 3"),
        (holding(entry(values=[[0, 0, 0]] * 32)), "curves[0].values: found 0 everywhere, expected some value"),
    ],
)  # fmt: skip
def test_a_wrong_file_is_a_line_and_changes_nothing(page: Any, content: Any, said: str) -> None:
    click(page, "#shapes button:nth-child(1)")
    kept = all_values(page)
    found = dropped(page, content if isinstance(content, str) else json.dumps(content))
    assert found.startswith(f"c.json: {said}")
    assert page.execute_script("return document.getElementById('note').className") == "note wrong"
    assert all_values(page) == kept
    assert steps(page) == 1
