"""The rules of the structure, read off the source: imports go down only, no printing, no global randomness."""

import ast
import re
import tomllib
from collections.abc import Iterator
from pathlib import Path

import pytest

PACKAGE = Path(__file__).resolve().parent.parent / "homofact"
MODULES = sorted(PACKAGE.rglob("*.py"))

# Lowest first: a package may import itself and those of the lines before its own. The root's __init__ is the library's
# front door and may open everything.
LAYERS: list[list[str]] = tomllib.loads((PACKAGE.parent / "pyproject.toml").read_text(encoding="utf-8"))["tool"][
    "homofact"
]["layers"]
LAYER = {name: number for number, names in enumerate(LAYERS) for name in names}
GLOBAL_RANDOMNESS = {
    "torch": {"manual_seed", "seed", "set_rng_state"},
    "torch.random": {"manual_seed", "seed", "set_rng_state"},
    "random": None,
    "np.random": None,
    "numpy.random": None,
}
EXPLICIT = {"default_rng", "Generator", "SeedSequence", "PCG64", "Random"}
# What a reader still takes in at once. The two lists only shrink: take out what keeps to the limits again.
MOST_LINES, MOST_ARGUMENTS = 90, 8
LONG = {
    "editing/overlap.py: _transport",
    "relighting/lobe_kernels.py: sum_lobe",
}
# Compiled kernels take arrays one by one.
WIDE = {
    "editing/overlap.py: _divide",
    "editing/overlap.py: _one_angle",
    "editing/overlap.py: _two_angles",
    "relighting/plan.py: plan_object",
    "relighting/reference.py: vertex_radiance",
    "rendering/filtered.py: _gathered",
    "rendering/lobe_search.py: _moved",
    "shading/vector_code.py: function",
}


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


def module_name(path: Path) -> str:
    return ".".join(path.relative_to(PACKAGE.parent).with_suffix("").parts).removesuffix(".__init__")


def module_imports(sources: dict[str, str]) -> dict[str, set[str]]:
    """Which of the modules `sources` (text by full name) each of them imports, inside functions too."""
    graph: dict[str, set[str]] = {}
    for own, source in sources.items():
        names = imported(ast.parse(source), Path(own))
        targets = {name if name in sources else name.rpartition(".")[0] for name in names}
        graph[own] = {name for name in targets if name in sources}
    return graph


def circles(graph: dict[str, set[str]]) -> list[list[str]]:
    """Modules that import each other, directly or by way of others: strongly connected components above one module."""
    order: list[str] = []
    seen: set[str] = set()

    def finish(name: str, edges: dict[str, set[str]], out: list[str]) -> None:
        stack = [(name, iter(sorted(edges[name])))]
        seen.add(name)
        while stack:
            top, rest = stack[-1]
            following = next((other for other in rest if other not in seen), None)
            if following is None:
                out.append(top)
                stack.pop()
            else:
                seen.add(following)
                stack.append((following, iter(sorted(edges[following]))))

    for name in graph:
        if name not in seen:
            finish(name, graph, order)
    backwards: dict[str, set[str]] = {name: set() for name in graph}
    for name, targets in graph.items():
        for target in targets:
            backwards[target].add(name)
    seen.clear()
    result = [[name] for name in graph if name in graph[name]]
    for name in reversed(order):
        if name not in seen:
            component: list[str] = []
            finish(name, backwards, component)
            if len(component) > 1:
                result.append(sorted(component))
    return result


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


def flags(source: str) -> list[str]:
    """Options of the command line in the strings of `source`."""
    return [
        f"{node.lineno}: {match[0]}"
        for node in ast.walk(ast.parse(source))
        if isinstance(node, ast.Constant) and isinstance(node.value, str)
        for match in re.finditer(r"(?<![\w-])--[a-z][a-z-]+", node.value)
    ]


def lines(function: ast.FunctionDef) -> int:
    """How many lines it has without its docstring, which names every argument of a public function."""
    first = function.body[0]
    documented = ast.get_docstring(function) is not None
    words = (first.end_lineno or first.lineno) - first.lineno + 1 if documented else 0
    return (function.end_lineno or function.lineno) - function.lineno + 1 - words


def positional(function: ast.FunctionDef) -> int:
    """How many arguments may be given by their place, without a method's own object."""
    return sum(each.arg not in ("self", "cls") for each in (*function.args.posonlyargs, *function.args.args))


def test_every_package_has_its_layer() -> None:
    packages = {package(path) for path in MODULES} - {"__init__"}
    assert packages == set(LAYER), "give a new package its line in LAYERS, and take a gone one out"


@pytest.mark.parametrize("path", MODULES, ids=names(MODULES))
def test_imports_go_down_only(path: Path) -> None:
    if path == PACKAGE / "__init__.py":
        return
    assert upward(path.read_text(encoding="utf-8"), path) == []


def test_no_modules_import_each_other() -> None:
    sources = {module_name(path): path.read_text(encoding="utf-8") for path in MODULES}
    assert circles(module_imports(sources)) == []


def test_the_library_does_not_print_and_has_no_global_randomness() -> None:
    found = {
        str(path.relative_to(PACKAGE)): calls
        for path in MODULES
        if package(path) != "cli" and (calls := disorder(path.read_text(encoding="utf-8")))
    }
    assert found == {}


def test_only_the_command_line_speaks_of_its_options() -> None:
    """The library advises settings (`errors.Advice`), which the command line shows as options (`cli.flags`)."""
    found = {
        str(path.relative_to(PACKAGE)): options
        for path in MODULES
        if package(path) != "cli" and (options := flags(path.read_text(encoding="utf-8")))
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


def test_every_public_class_has_a_name_of_its_own() -> None:
    places: dict[str, list[str]] = {}
    for path in MODULES:
        for node in ast.parse(path.read_text(encoding="utf-8")).body:
            if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                places.setdefault(node.name, []).append(str(path.relative_to(PACKAGE)))
    assert {name: modules for name, modules in places.items() if len(modules) > 1} == {}


def test_functions_are_short_and_take_few_arguments() -> None:
    functions = [
        (f"{path.relative_to(PACKAGE)}: {node.name}", node)
        for path in MODULES
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.FunctionDef)
    ]
    assert {name for name, node in functions if lines(node) > MOST_LINES} == LONG
    # A command's arguments are its options.
    wide = {name for name, node in functions if positional(node) > MOST_ARGUMENTS and not name.startswith("cli/")}
    assert wide == WIDE


def test_the_rules_see_what_they_forbid() -> None:
    assert upward("def f():\n    from homofact.cli.main import main\n", PACKAGE / "geometry" / "x.py") == [
        "homofact.cli.main.main"
    ]
    assert upward("import homofact.methods.cole_fit\nimport torch\n", PACKAGE / "brdf" / "x.py") == [
        "homofact.methods.cole_fit"
    ]
    assert upward("from homofact import cli, errors\n", PACKAGE / "errors.py") == ["homofact.cli"]
    assert upward("from homofact.brdf.samples import Samples\n", PACKAGE / "brdf" / "x.py") == []
    sources = {
        "homofact.a": "import homofact.b",
        "homofact.b": "def f():\n    from homofact.c import g\n",
        "homofact.c": "from homofact import a, d\n",
        "homofact.d": "import os\n",
        "homofact": "",
    }
    assert circles(module_imports(sources)) == [["homofact.a", "homofact.b", "homofact.c"]]
    assert circles({"a": {"b"}, "b": set(), "c": {"a", "b"}}) == []
    assert disorder("print(1)\ntorch.manual_seed(0)\nnp.random.seed(1)\nnp.random.rand()\n") == [
        "1: print()", "2: torch.manual_seed()", "3: np.random.seed()", "4: np.random.rand()",
    ]  # fmt: skip
    assert disorder("g = torch.Generator().manual_seed(0)\nr = np.random.default_rng(0)\n") == []
    assert flags('def f():\n    """As --size."""\n    return f"more {x} or --bytes"\n') == ["2: --size", "3: --bytes"]
    assert flags("a = '-- b --' + 'a--b'\n") == []
