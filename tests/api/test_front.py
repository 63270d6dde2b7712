"""The flat front: what `homofact` has, and what it says of each of it."""

import ast
import inspect
import pkgutil
import re
import subprocess
import sys
from pathlib import Path

import pytest

import homofact
from homofact.cli.main import COMMANDS, RESEARCH

# It needs a prepared scene and curves that were drawn in its page.
NO_EXAMPLE = {"apply_curves"}
FUNCTIONS = [name for name in homofact.__all__ if inspect.isfunction(getattr(homofact, name))]
METHODS = ("Search", "Cole", "McCool", "Svd", "Nmf", "Ggx", "Gaussians", "Npf", "Nbrdf")
# What they do is about this installation, or has no result but a list or a document.
COMMANDS_ALONE = {"doctor", "research", "stability"}


def parameters_in(text: str, following: str) -> set[str]:
    """The names that the section Parameters of a docstring has, before the section `following`."""
    section = text.partition("\nParameters\n")[2].partition(f"\n{following}\n")[0]
    heads = [line.split(" : ")[0] for line in re.findall(r"^(\S.*)$", section, re.MULTILINE)]
    return {word.strip("* ") for head in heads for word in head.split(",")}


def test_dir_and_all_are_the_front() -> None:
    assert dir(homofact) == sorted(homofact.__all__)
    assert {name for name in homofact.__all__ if name != "__version__"} == set(homofact._HOMES)
    assert not {"Any", "Path", "TYPE_CHECKING"} & set(dir(homofact))


def test_editors_see_what_is_loaded() -> None:
    tree = ast.parse(Path(str(homofact.__file__)).read_text(encoding="utf-8"))
    (block,) = [node for node in tree.body if isinstance(node, ast.If)]
    seen = {
        alias.name: str(node.module).removeprefix("homofact.")
        for node in block.body
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }
    assert seen == homofact._HOMES


def test_no_package_has_the_name_of_a_function() -> None:
    # Loading a package of the same name would put it in the function's place.
    packages = {module.name for module in pkgutil.iter_modules(homofact.__path__)}
    assert packages & set(homofact.__all__) == set()


def test_every_command_is_a_function() -> None:
    assert {name for _, name, _ in (*COMMANDS, *RESEARCH)} - COMMANDS_ALONE <= set(FUNCTIONS)


def test_importing_and_looking_around_loads_nothing() -> None:
    program = "import sys, homofact; dir(homofact); print([n for n in ('torch', 'numpy', 'typer') if n in sys.modules])"
    ran = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert ran.stdout == "[]\n"


def test_an_unknown_name_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="'fitt'"):
        _ = homofact.fitt


@pytest.mark.parametrize("name", FUNCTIONS)
def test_a_function_documents_every_parameter(name: str) -> None:
    function = getattr(homofact, name)
    text = inspect.getdoc(function) or ""
    for heading in ("Parameters", "Returns", "Raises", *(() if name in NO_EXAMPLE else ("Examples",))):
        assert f"\n{heading}\n{'-' * len(heading)}\n" in text, heading
    section = text.partition("\nParameters\n")[2].partition("\nReturns\n")[0]
    named = {
        word.strip("* ") for line in re.findall(r"^(\S.*)$", section, re.M) for word in line.split(" : ")[0].split(",")
    }
    assert set(inspect.signature(function).parameters) <= named


@pytest.mark.parametrize("name", METHODS)
def test_a_method_documents_every_setting(name: str) -> None:
    method = getattr(homofact, name)
    text = inspect.getdoc(method) or ""
    assert "\nParameters\n----------\n" in text
    assert "\nExamples\n--------\n" in text
    section = text.partition("\nParameters\n")[2].partition("\nExamples\n")[0]
    named = {
        word.strip() for line in re.findall(r"^(\S.*)$", section, re.M) for word in line.split(" : ")[0].split(",")
    }
    assert set(inspect.signature(method).parameters) <= named
