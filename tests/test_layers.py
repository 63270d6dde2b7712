"""The order of the layers stands once, in pyproject.toml; the pages that name it say the same."""

import re
import textwrap
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
_MARKED = re.compile(r"<!-- layers -->\n(.*?)<!-- end of layers -->", re.DOTALL)


def layers(page: str) -> str:
    """The layers as the page has them: in a paragraph, or as a list."""
    found = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["homofact"]["layers"]
    rows = [", ".join(f"`{name}`" for name in names) for names in found]
    if page == "README.md":
        return textwrap.fill(f"{'; '.join(rows)}.", 120, break_on_hyphens=False) + "\n"
    return "".join(f"{number}. {row}\n" for number, row in enumerate(rows, 1))


@pytest.mark.parametrize("page", ["README.md", "CONTRIBUTING.md"])
def test_a_page_has_the_layers_of_pyproject(page: str) -> None:
    # Between the marks belongs what `layers` returns.
    assert _MARKED.findall((ROOT / page).read_text(encoding="utf-8")) == [layers(page)]
