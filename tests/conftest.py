"""Fixtures that every test may use."""

import os
from pathlib import Path

import pytest
from hypothesis import settings

# Examples a property; no deadline, since a machine may be busy. HYPOTHESIS_PROFILE=nightly for the long run.
settings.register_profile("ci", max_examples=100, deadline=None)
settings.register_profile("nightly", max_examples=2000, deadline=None)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "ci"))

ROOT = Path(__file__).resolve().parent.parent


@pytest.fixture(scope="session")
def real_data() -> Path:
    """The folder of real measurements; skips where it is absent."""
    place = Path(os.environ.get("HOMOFACT_DATA", ROOT.parent / "shared" / "data"))
    if not place.is_dir():
        pytest.skip(f"real measurements not found at {place}: set HOMOFACT_DATA to their folder")
    return place
