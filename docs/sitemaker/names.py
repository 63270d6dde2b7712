"""What the names in a module of homofact mean: classes and functions that a page describes, aliases, constants."""

import ast
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache

from sitemaker.modules import reference_modules, tree_of
from sitemaker.uses import front_door

CONSTANT = re.compile(r"_?[A-Z][A-Z0-9_]+")


@dataclass(frozen=True)
class Scope:
    """The names in a module that are homofact's, each with its whole path: imported ones, and the module's own."""

    module: str
    names: Mapping[str, str]

    def described(self, word: str) -> str | None:
        """Return the path of the class or function that `word` names, if a page describes it: `Fit`, `homofact.fit`."""
        first, _, rest = word.removeprefix("homofact.").partition(".")
        if word.startswith("homofact."):
            home = front_door().get(first)
            path = word if home is None else f"{home}.{first}" + (f".{rest}" if rest else "")
        else:
            path = self.names.get(first, _unique().get(first, "")) + (f".{rest}" if rest else "")
        return path if path in described() else None

    def class_named(self, name: str) -> ast.ClassDef | None:
        """Return the definition of the class that `name` means in this module; None if it means none."""
        return class_of(self.names.get(name, ""))

    def constant(self, name: str) -> str | None:
        """Return the value of a constant as Python writes it, if it is a number or a text."""
        value = assigned(self.names.get(name, ""))
        if isinstance(value, ast.Constant) and isinstance(value.value, int | float | str):
            return ast.unparse(value)
        return None


@cache
def scope_of(module: str) -> Scope:
    """Return the names of a module."""
    names = {}
    for node in ast.walk(tree_of(module)):
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("homofact"):
            names |= {each.asname or each.name: f"{node.module}.{each.name}" for each in node.names}
    own = [node.name for node in tree_of(module).body if isinstance(node, ast.FunctionDef | ast.ClassDef)]
    return Scope(module, names | {name: f"{module}.{name}" for name in [*own, *_assignments(module)]})


@cache
def described() -> frozenset[str]:
    """Return the paths of all classes, functions and methods that the pages of the reference describe."""
    return frozenset(path for module in reference_modules() for path in _public(module.name, tree_of(module.name)))


def assigned(path: str) -> ast.expr | None:
    """Return the expression that a module assigns to a name; None if it assigns nothing."""
    module, _, name = path.rpartition(".")
    return _assignments(module).get(name)


def definition_of(path: str) -> ast.ClassDef | ast.FunctionDef | None:
    """Return the definition of a class or function, the last one after overloads; None if the module has none."""
    module, _, name = path.rpartition(".")
    nodes = [node for node in tree_of(module).body if isinstance(node, ast.FunctionDef | ast.ClassDef)]
    return next((node for node in reversed(nodes) if node.name == name), None)


def class_of(path: str) -> ast.ClassDef | None:
    """Return the definition of a class; None if there is no such class."""
    found = definition_of(path)
    return found if isinstance(found, ast.ClassDef) else None


def _public(path: str, node: ast.Module | ast.ClassDef) -> Iterator[str]:
    for each in node.body:
        if isinstance(each, ast.FunctionDef | ast.ClassDef) and not each.name.startswith("_"):
            yield f"{path}.{each.name}"
            if isinstance(each, ast.ClassDef):
                yield from _public(f"{path}.{each.name}", each)


@cache
def _unique() -> Mapping[str, str]:
    """The paths of the described classes whose names no other one has."""
    classes = [path for path in described() if class_of(path) is not None]
    names = [path.rpartition(".")[2] for path in classes]
    return {name: path for name, path in zip(names, classes, strict=True) if names.count(name) == 1}


@cache
def _assignments(module: str) -> Mapping[str, ast.expr]:
    found: dict[str, ast.expr] = {}
    for node in _statements(tree_of(module)):
        target = node.targets[0] if isinstance(node, ast.Assign) else node.target
        if isinstance(target, ast.Name) and node.value is not None:
            found[target.id] = node.value
        elif isinstance(target, ast.Tuple) and isinstance(node.value, ast.Tuple):
            pairs = zip(target.elts, node.value.elts, strict=True)
            found |= {each.id: value for each, value in pairs if isinstance(each, ast.Name)}
    return found


def _statements(tree: ast.Module) -> Iterator[ast.Assign | ast.AnnAssign]:
    """The assignments of a module, with those for type checkers only."""
    for node in tree.body:
        inner = node.body if isinstance(node, ast.If) else [node]
        yield from (each for each in inner if isinstance(each, ast.Assign | ast.AnnAssign))
