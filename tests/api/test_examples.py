"""The examples in the docstrings of the front, run in an empty folder."""

import doctest
import inspect
from pathlib import Path

import pytest
from slow_cases import slow_among

import homofact

DOCUMENTED = [name for name in homofact.__all__ if inspect.isroutine(getattr(homofact, name)) or name[0].isupper()]
EXAMPLES = {
    name: examples
    for name in DOCUMENTED
    if (examples := doctest.DocTestParser().get_examples(inspect.getdoc(getattr(homofact, name)) or ""))
}
SLOW = ("sweep", "report", "chart", "plan", "factorize", "export", "compare", "evaluate", "edit", "relight")


@pytest.mark.usefixtures("small_pictures", "rough_sampling")
@pytest.mark.parametrize(
    "name",
    slow_among(
        EXAMPLES, "sweep", "report", "chart", "plan", "factorize", "export", "compare", "evaluate", "edit", "relight"
    ),
)
def test_an_example_runs(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    names = {"homofact": homofact, "Path": Path}
    test = doctest.DocTest(EXAMPLES[name], names, name, None, None, None)
    said: list[str] = []
    runner = doctest.DocTestRunner(optionflags=doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE)
    runner.run(test, out=said.append)
    assert runner.failures == 0, "".join(said)


def test_every_function_has_one() -> None:
    functions = {name for name in DOCUMENTED if inspect.isfunction(getattr(homofact, name))}
    assert functions - {"apply_curves"} <= set(EXAMPLES)
