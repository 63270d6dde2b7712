"""What the tests of commands share."""

from collections.abc import Callable

import pytest
from ran import Ran

from homofact.cli.main import main


@pytest.fixture
def run(capsys: pytest.CaptureFixture[str]) -> Callable[..., Ran]:
    """Runs the program in this process and says how it ended."""

    def run(*arguments: object) -> Ran:
        capsys.readouterr()
        code = main([str(each) for each in arguments])
        out, err = capsys.readouterr()
        return Ran(code, out, err)

    return run


@pytest.fixture(autouse=True)
def _quickly(small_pictures: None, rough_sampling: None, unseen: None) -> None:
    """Commands are what these tests are about, not their pictures or how evenly light is drawn."""
