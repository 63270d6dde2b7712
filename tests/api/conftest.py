"""What the tests of the library's front share."""

import pytest


@pytest.fixture(autouse=True)
def _quickly(unseen: None) -> None:
    """Calls are what these tests are about, not what pictures of their fits show."""
