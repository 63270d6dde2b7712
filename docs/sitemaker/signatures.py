"""Signatures of functions: types with whole paths, aliases spelled out, and defaults by their values."""

import ast
import copy
import re
from functools import cache
from importlib import import_module
from typing import Any

from sitemaker.names import CONSTANT, Scope, assigned, class_of, described, scope_of

_LONGEST = 100
_TABLE = "table"  # in the place of a private class, whose keys are listed


def arguments(function: ast.FunctionDef, scope: Scope, bound: int) -> str:
    """Return the arguments of a function in brackets, without the first `bound` ones."""
    given = copy.deepcopy(function.args)
    del (given.posonlyargs or given.args)[:bound]
    for each in (*given.posonlyargs, *given.args, given.vararg, *given.kwonlyargs, given.kwarg):
        if each is not None and each.annotation is not None:
            each.annotation = _Types(scope).visit(each.annotation)
    given.defaults = [value_of(each, scope) for each in given.defaults]
    given.kw_defaults = [None if each is None else value_of(each, scope) for each in given.kw_defaults]
    return f"({ast.unparse(given)})"


def type_of(annotation: ast.expr, scope: Scope) -> str:
    """Return a type as text, in which classes that a page describes have their whole path."""
    return ast.unparse(_Types(scope).visit(copy.deepcopy(annotation)))


def linked_type(annotation: ast.expr, scope: Scope) -> str:
    """Return a type as Markdown, with links to the pages of its classes."""
    told = type_of(annotation, scope)
    return f"{{pytype}}`{told}`" if "homofact." in told else f"`{told}`"


def value_of(default: ast.expr, scope: Scope) -> ast.expr:
    """Return a default with homofact's constants replaced by their values; as it stands if it has none, or is long."""
    names = {node.id for node in ast.walk(default) if isinstance(node, ast.Name)}
    if not any(CONSTANT.fullmatch(name) and name in scope.names for name in names):
        return default
    text = repr(_evaluated(ast.unparse(default), scope.module))
    if len(text) > _LONGEST or text.startswith("<"):
        return default
    return ast.parse(text, mode="eval").body


@cache
def _evaluated(expression: str, module: str) -> Any:
    return eval(expression, vars(import_module(module)))


class _Types(ast.NodeTransformer):
    """Names by their paths, if a page describes them, and aliases by what they stand for; texts are types too."""

    def __init__(self, scope: Scope) -> None:
        self._scope = scope

    def visit_Subscript(self, node: ast.Subscript) -> ast.AST:
        if ast.unparse(node.value) in ("Literal", "typing.Literal"):
            return node
        return self.generic_visit(node)

    def visit_Constant(self, node: ast.Constant) -> ast.AST:
        return self.visit(ast.parse(node.value, mode="eval").body) if isinstance(node.value, str) else node

    def visit_Name(self, node: ast.Name) -> ast.AST:
        path = self._scope.names.get(node.id, "")
        if path in described():
            return ast.Name(path)
        if node.id.startswith("_") and class_of(path) is not None:
            return ast.Name(_TABLE)
        alias = assigned(path)
        if alias is None or not re.match(r"[A-Z][a-z]", node.id) or isinstance(alias, ast.Call):
            return node
        return _Types(scope_of(path.rpartition(".")[0])).visit(copy.deepcopy(alias))
