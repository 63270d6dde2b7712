"""The rules of the structure, read off the source: imports go down only, no printing, no global randomness."""

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

PACKAGE = Path(__file__).resolve().parent.parent / "homofact"
MODULES = sorted(PACKAGE.rglob("*.py"))

# Lowest first: a package may import itself and those of the lines before its own. The root's __init__ is the library's
# front door and may open everything.
LAYERS: tuple[tuple[str, ...], ...] = (
    ("errors", "version"),
    ("files", "geometry", "linear", "options"),
    ("containers", "brdf", "meshes"),
    ("factor",),
    ("separable", "parametric"),
    ("methods", "shading"),
    ("render", "runtime"),
    ("evaluate",),
    ("export",),
    ("viewer", "figures"),
    ("scene",),
    ("api", "sections"),
    ("config",),
    ("sweep",),
    ("cli",),
)
LAYER = {name: number for number, names in enumerate(LAYERS) for name in names}
GLOBAL_RANDOMNESS = {
    "torch": {"manual_seed", "seed", "set_rng_state"},
    "torch.random": {"manual_seed", "seed", "set_rng_state"},
    "random": None,
    "np.random": None,
    "numpy.random": None,
}
EXPLICIT = {"default_rng", "Generator", "SeedSequence", "PCG64", "Random"}


def names(modules: list[Path]) -> list[str]:
    return [str(path.relative_to(PACKAGE)) for path in modules]


def package(path: Path) -> str:
    return path.relative_to(PACKAGE).parts[0].removesuffix(".py")


def imported(tree: ast.AST, path: Path) -> Iterator[str]:
    """Full names of the package's modules that `tree` imports, those inside functions included."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}:{node.lineno}: relative import, expected the full name"
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


def dotted(node: ast.AST) -> str:
    if isinstance(node, ast.Attribute):
        return f"{dotted(node.value)}.{node.attr}"
    return node.id if isinstance(node, ast.Name) else "?"


def upward(source: str, path: Path) -> list[str]:
    """Imports of `source` from layers that its own may not see."""
    own = package(path)
    found = []
    for name in imported(ast.parse(source), path):
        parts = name.split(".")
        if parts[0] != "homofact" or len(parts) < 2:
            continue
        if parts[1] != own and parts[1] in LAYER and LAYER[parts[1]] >= LAYER[own]:
            found.append(name)
    return found


def disorder(source: str) -> list[str]:
    """Calls in `source` that print, or that touch global random state."""
    found = []
    for node in ast.walk(ast.parse(source)):
        if not isinstance(node, ast.Call):
            continue
        name = dotted(node.func)
        owner, _, last = name.rpartition(".")
        if name == "print":
            found.append(f"{node.lineno}: print()")
        if owner in GLOBAL_RANDOMNESS and last not in EXPLICIT:
            forbidden = GLOBAL_RANDOMNESS[owner]
            if forbidden is None or last in forbidden:
                found.append(f"{node.lineno}: {name}()")
    return found


def test_every_package_has_its_layer() -> None:
    packages = {package(path) for path in MODULES} - {"__init__"}
    assert packages == set(LAYER), "give a new package its line in LAYERS, and take a gone one out"


@pytest.mark.parametrize("path", MODULES, ids=names(MODULES))
def test_imports_go_down_only(path: Path) -> None:
    if path == PACKAGE / "__init__.py":
        return
    assert upward(path.read_text(encoding="utf-8"), path) == []


def test_the_library_does_not_print_and_has_no_global_randomness() -> None:
    found = {
        str(path.relative_to(PACKAGE)): calls
        for path in MODULES
        if package(path) != "cli" and (calls := disorder(path.read_text(encoding="utf-8")))
    }
    assert found == {}


def test_everything_public_says_what_it_is() -> None:
    missing = []
    for path in MODULES:
        tree = ast.parse(path.read_text(encoding="utf-8"))
        nodes: list[ast.AST] = [tree]
        for node in tree.body:
            if isinstance(node, ast.ClassDef):
                nodes += [each for each in node.body if isinstance(each, ast.FunctionDef)]
            nodes.append(node)
        for node in nodes:
            if isinstance(node, ast.Module):
                named, documented = path.stem, bool(ast.get_docstring(node)) or not tree.body
            elif isinstance(node, ast.ClassDef | ast.FunctionDef):
                named, documented = node.name, bool(ast.get_docstring(node))
            else:
                continue
            if not documented and not named.startswith("_"):
                missing.append(f"{path.relative_to(PACKAGE)}: {named}")
    assert missing == []


def test_the_rules_see_what_they_forbid() -> None:
    assert upward("def f():\n    from homofact.cli.main import main\n", PACKAGE / "geometry" / "x.py") == [
        "homofact.cli.main.main"
    ]
    assert upward("import homofact.methods.cole_fit\nimport torch\n", PACKAGE / "brdf" / "x.py") == [
        "homofact.methods.cole_fit"
    ]
    assert upward("from homofact import cli, errors\n", PACKAGE / "errors.py") == ["homofact.cli"]
    assert upward("from homofact.brdf.samples import Samples\n", PACKAGE / "brdf" / "x.py") == []
    assert disorder("print(1)\ntorch.manual_seed(0)\nnp.random.seed(1)\nnp.random.rand()\n") == [
        "1: print()", "2: torch.manual_seed()", "3: np.random.seed()", "4: np.random.rand()",
    ]  # fmt: skip
    assert disorder("g = torch.Generator().manual_seed(0)\nr = np.random.default_rng(0)\n") == []
