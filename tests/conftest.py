"""Fixtures that every test may use."""

import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from browser import end_browsers
from hypothesis import settings
from pictured import no_looks, small_spheres

# Where PYTHONDONTWRITEBYTECODE is set (many images of containers), every worker would rewrite and compile all test
# modules in every run: half a minute.
sys.dont_write_bytecode = False

pytest.register_assert_rewrite("refusals")
import refusals  # noqa: E402

# Examples a property; no deadline, since a machine may be busy. HYPOTHESIS_PROFILE=nightly for the long run.
settings.register_profile("ci", max_examples=100, deadline=None)
settings.register_profile("nightly", max_examples=2000, deadline=None)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "ci"))

# A busy machine takes seconds for anything: what commands say must not depend on it, here and in other processes.
os.environ["HOMOFACT_PROGRESS"] = "0"

ROOT = Path(__file__).resolve().parent.parent
# Seconds that a test marked slow may take; pyproject.toml has the limit of the others.
SLOW = 3600
BEFORE = pytest.StashKey[set[str]]()


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--write-messages", action="store_true", help="add messages of bad input to tests/messages")


def pytest_configure(config: pytest.Config) -> None:
    if config.getoption("--write-messages"):
        refusals.seen = set()


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    for item in items:
        if item.get_closest_marker("slow") is not None and item.get_closest_marker("timeout") is None:
            item.add_marker(pytest.mark.timeout(SLOW))


def left_in_the_tree() -> set[str]:
    """Files in the checkout that git neither tracks nor ignores; none where this is no checkout."""
    command = ["git", "-C", str(ROOT), "ls-files", "--others", "--exclude-standard"]
    try:
        return set(subprocess.run(command, capture_output=True, text=True, check=True).stdout.splitlines())
    except (OSError, subprocess.CalledProcessError):
        return set()


def pytest_sessionstart(session: pytest.Session) -> None:
    session.config.stash[BEFORE] = left_in_the_tree()


def pytest_sessionfinish(session: pytest.Session) -> None:
    """End browsers, and name the files that the run left in the tree: an error in continuous integration."""
    end_browsers()
    if refusals.seen:
        refusals.write(refusals.seen)
    if hasattr(session.config, "workerinput"):
        return
    if left := sorted(left_in_the_tree() - session.config.stash[BEFORE]):
        print(f"\nnew in the tree since the run began: {', '.join(left)}")
        if os.environ.get("CI"):
            session.exitstatus = pytest.ExitCode.TESTS_FAILED


@pytest.fixture(scope="session")
def real_data() -> Path:
    """The folder of real measurements; skips where it is absent."""
    place = refusals.DATA
    if not place.is_dir():
        pytest.skip(f"real measurements not found at {place}: set HOMOFACT_DATA to their folder")
    return place


@pytest.fixture
def small_pictures() -> Iterator[None]:
    """compare.png beside a fit with spheres 32 pixels wide: for tests of commands, not of that picture."""
    with small_spheres():
        yield


@pytest.fixture
def unseen() -> Iterator[None]:
    """Fits that no pictures are drawn of: for tests of what else a fit has."""
    with no_looks():
        yield


@pytest.fixture
def rough_sampling(monkeypatch: pytest.MonkeyPatch) -> None:
    """Exports with a mixture of two widths and a few steps: for tests of what else an export holds."""
    from homofact.shading import mixture_fit

    monkeypatch.setattr(mixture_fit, "_SCALES", (0.01, 0.1))
    monkeypatch.setattr(mixture_fit, "_TRIED", 1)
    monkeypatch.setattr(mixture_fit, "_STEPS", 2)
