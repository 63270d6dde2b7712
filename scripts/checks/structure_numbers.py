"""Count what the package's structure consists of: lines, public names, imports, hops.

    python scripts/checks/structure_numbers.py [CHECKOUT ...]

For each checkout: lines by package, public classes and functions, class names that stand more than once, circles of
imports, functions of more than 70 lines, files in scripts/. Several checkouts stand side by side.
"""

import argparse
import ast
from collections import Counter
from collections.abc import Iterable
from pathlib import Path

LONG = 70


def parsed(root: Path) -> dict[str, ast.Module]:
    """Every module of the package by its dotted name."""
    return {
        ".".join(path.relative_to(root).with_suffix("").parts).removesuffix(".__init__"): ast.parse(path.read_text())
        for path in sorted((root / "homofact").rglob("*.py"))
    }


def imports(tree: ast.Module, modules: Iterable[str]) -> set[str]:
    """The package's modules that one imports when it runs, inside functions too; not those for type checkers alone."""
    known = set(modules)
    for_types = {
        id(inner)
        for node in ast.walk(tree)
        if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test)
        for inner in ast.walk(node)
    }
    names = set()
    for node in ast.walk(tree):
        if id(node) in for_types:
            continue
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            names |= {f"{node.module}.{alias.name}" for alias in node.names} | {node.module}
    return names & known


def circles(graph: dict[str, set[str]]) -> list[list[str]]:
    """The strongly connected components of more than one module, by Tarjan's algorithm."""
    order: dict[str, int] = {}
    low: dict[str, int] = {}
    stack: list[str] = []
    components = []

    def visit(name: str) -> None:
        order[name] = low[name] = len(order)
        stack.append(name)
        for other in sorted(graph[name]):
            if other not in order:
                visit(other)
                low[name] = min(low[name], low[other])
            elif other in stack:
                low[name] = min(low[name], order[other])
        if low[name] == order[name]:
            component = []
            while not component or component[-1] != name:
                component.append(stack.pop())
            if len(component) > 1:
                components.append(component)

    for name in sorted(graph):
        if name not in order:
            visit(name)
    return components


def figures(root: Path) -> dict[str, int]:
    """The rows of the table for one checkout."""
    modules = parsed(root)
    top = [node for name, tree in modules.items() for node in tree.body if "._" not in name]
    public = [
        node for node in top if isinstance(node, ast.ClassDef | ast.FunctionDef) and not node.name.startswith("_")
    ]
    classes = Counter(node.name for node in public if isinstance(node, ast.ClassDef))
    functions = [n for tree in modules.values() for n in ast.walk(tree) if isinstance(n, ast.FunctionDef)]
    lines = Counter(
        {
            package.name: sum(len(p.read_text().splitlines()) for p in package.rglob("*.py"))
            for package in (root / "homofact").iterdir()
            if package.is_dir()
        }
    )
    rows = {
        "lines of Python in the package": sum(
            len(p.read_text().splitlines()) for p in (root / "homofact").rglob("*.py")
        ),
        "lines of JavaScript in the package": sum(
            len(p.read_text().splitlines()) for p in (root / "homofact").rglob("*.js")
        ),
        "lines of tests": sum(len(p.read_text().splitlines()) for p in (root / "tests").rglob("*.py")),
        "lines of scripts": sum(len(p.read_text().splitlines()) for p in (root / "scripts").rglob("*.py")),
        "public classes and functions": len(public),
        "class names defined more than once": sum(count > 1 for count in classes.values()),
        "circles of imports": len(circles({name: imports(tree, modules) for name, tree in modules.items()})),
        f"functions of more than {LONG} lines": sum((n.end_lineno or 0) - n.lineno >= LONG for n in functions),
        "files directly in scripts/": sum(p.is_file() for p in (root / "scripts").iterdir()),
        "scripts": sum(1 for _ in (root / "scripts").rglob("*.py")),
    }
    return rows | {f"lines of homofact/{name}": count for name, count in sorted(lines.items()) if count}


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("checkouts", nargs="*", type=Path, default=[Path(__file__).resolve().parents[2]])
    options = parser.parse_args()
    columns = [figures(root) for root in options.checkouts]
    names = dict.fromkeys(name for column in columns for name in column)
    width = max(map(len, names))
    for name in names:
        print(f"{name:{width}}", *(f"{column.get(name, 0):8}" for column in columns))


if __name__ == "__main__":
    main()
