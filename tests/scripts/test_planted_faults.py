"""Planted faults: the table fits the sources, and what tests notice is told from what they do not."""

from pathlib import Path

import pytest

from scripts.checks import planted_faults
from scripts.checks.planted_faults import Fault, faults, planted, survivors
from scripts.shared.harness import ROOT, Finished

NOTICED = Fault(1, "a", "numbers.py", "test_numbers.py", "2 * x", "3 * x")
SURVIVES = Fault(2, "a", "numbers.py", "test_numbers.py", "x + 1", "x + 2")
HANGS = Fault(3, "a", "numbers.py", "test_numbers.py", "return 2", "while True:\n        pass\n    return 2")


@pytest.fixture
def tree(tmp_path: Path) -> Path:
    """A package of two functions, one of them tested."""
    for folder in ("homofact", "tests"):
        (tmp_path / folder).mkdir()
    (tmp_path / "homofact/__init__.py").touch()
    code = "def double(x):\n    return 2 * x\n\n\ndef next(x):\n    return x + 1\n"
    (tmp_path / "homofact/numbers.py").write_text(code)
    test = "from homofact.numbers import double\n\n\ndef test_double():\n    assert double(3) == 6\n"
    (tmp_path / "tests/test_numbers.py").write_text(test)
    return tmp_path


def test_the_table_fits_the_sources() -> None:
    every = faults()
    assert len(every) >= 60
    assert [fault.stale(ROOT) for fault in every if fault.stale(ROOT)] == []
    assert len({fault.key for fault in every}) == len(every)
    areas = {"search", "energy", "verdict", "transport", "editing", "sweep", "export", "reading", "quality"}
    assert areas <= {fault.area for fault in every}


def test_a_stale_entry_is_named(tree: Path) -> None:
    assert NOTICED.stale(tree) is None
    assert "2 times" in str(Fault(4, "a", "numbers.py", "test_numbers.py", "return", "yield").stale(tree))
    assert "no " in str(Fault(5, "a", "absent.py", "test_numbers.py", "x", "y").stale(tree))


@pytest.mark.slow
def test_what_no_test_notices_survives_and_the_sources_stay(tree: Path, tmp_path: Path) -> None:
    before = (tree / "homofact/numbers.py").read_text()
    done = tmp_path / "done.jsonl"
    assert survivors([NOTICED, SURVIVES], tree, Finished(done), 120) == [SURVIVES]
    assert (tree / "homofact/numbers.py").read_text() == before
    # What is done is not done again.
    (tree / "tests/test_numbers.py").unlink()
    assert survivors([NOTICED, SURVIVES], tree, Finished(done), 120) == [SURVIVES]


@pytest.mark.slow
def test_tests_that_hang_are_ended(tree: Path) -> None:
    assert planted(tree, HANGS, 5) == "timeout"


@pytest.mark.slow
def test_tests_that_fail_anyway_are_an_error(tree: Path) -> None:
    (tree / "tests/test_numbers.py").write_text("def test_nothing():\n    assert False\n")
    with pytest.raises(ValueError, match="without a fault"):
        survivors([NOTICED], tree, Finished(), 120)


def test_a_table_is_listed(capsys: pytest.CaptureFixture[str]) -> None:
    assert planted_faults.main(["--list", "--area", "geometry"]) == 0
    assert "geometry/rotation.py" in capsys.readouterr().out
