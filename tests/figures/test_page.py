"""Text on a page of pictures: broken where a reader would break it, and nothing lost."""

import pytest

from homofact.figures.page import PicturePage


@pytest.mark.parametrize(
    ("text", "parts"),
    [
        ("vch_golden_yellow_rgb.bsdf", ["vch_golden_yellow_", "rgb.bsdf"]),
        ("a measured paint", ["a measured paint"]),
        ("x" * 40, None),
        # A mark in the first half would leave a line nearly empty.
        ("a_" + "x" * 40, None),
    ],
)
def test_a_long_name_is_broken_behind_its_marks(text: str, parts: list[str] | None) -> None:
    page = PicturePage(600, 0)
    lines = page.wrapped(text, 160, bold=True)
    assert lines == parts if parts else len(lines) > 1
    assert "".join(lines).replace(" ", "") == text.replace(" ", "")
    assert all(page.extent(line, True) <= 160 for line in lines)
    if not parts:
        assert len(lines[0]) > 12
