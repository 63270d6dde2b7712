"""Fixtures that every test may use."""

import os
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent


@pytest.fixture(scope="session")
def real_data() -> Path:
    """The folder of real measurements; skips where it is absent."""
    place = Path(os.environ.get("HOMOFACT_DATA", ROOT.parent / "shared" / "data"))
    if not place.is_dir():
        pytest.skip(f"real measurements not found at {place}: set HOMOFACT_DATA to their folder")
    return place
