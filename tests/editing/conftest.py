"""The page of edit for the tests that open it."""

from collections.abc import Iterator
from typing import Any

import pytest


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
    """The page, opened once for a module."""
    from editing.page_opened import opened_page

    with opened_page(tmp_path_factory.mktemp("page")) as driver:
        yield driver
