"""The pages of the Python interface, from signatures, fields and docstrings; each with the examples that use it.

Modules are read as source. Imported are only those with settings, whose help and defaults functions make, and those
whose defaults are constants.
"""

import ast
from collections.abc import Mapping

from sitemaker.docstrings import blocks, linked, markdown, parsed, shown
from sitemaker.members import has_fields, listed, public_bases
from sitemaker.modules import MODULES, Module, reference_modules, tree_of
from sitemaker.names import Scope, assigned, definition_of, scope_of
from sitemaker.signatures import arguments, linked_type, type_of
from sitemaker.sources import first_sentence, links_to, page_of, summary
from sitemaker.uses import scripts_using, used_by_page

_FEW = 6  # programs that are listed without a fold


def reference_pages(pages: Mapping[str, str]) -> dict[str, str]:
    """Return a page a module, and their index; `pages` by name are searched for examples."""
    found = {module.page: _page(module, pages) for module in reference_modules()}
    return found | {"api/index": _index()}


def _index() -> str:
    lines = [
        "# Python interface",
        "",
        "The names that most programs need are those of [`homofact`](/api/homofact.md) itself; [In Python](/python.md)",
        "shows them at work. Each page says which tutorials, guides and programs use the module. Shapes are bracketed,",
        "(N, 3); directions are unit vectors in the surface frame, z the normal; values are sr⁻¹ without the cosine.",
        "",
    ]
    for heading, names in MODULES.items():
        lines += [f"## {heading}", "", "| module | what it is |", "| --- | --- |"]
        for module in map(Module, names):
            lines.append(f"| [`{module.name}`](/{module.page}.md) | {_summary(module)} |")
        lines.append("")
    return "\n".join(lines)


def _summary(module: Module) -> str:
    return linked(summary(module.path), scope_of(module.name))


def _page(module: Module, pages: Mapping[str, str]) -> str:
    tree, scope = tree_of(module.name), scope_of(module.name)
    lines = [
        "---",
        "orphan: true",
        "---",
        "",
        f"# {module.name}",
        "",
        "[Python interface](/api/index.md)",
        "",
        markdown(ast.get_docstring(tree) or "", scope),
        "",
    ]
    lines += [f"[Source](/{page_of(module.path)}.md)", ""]
    used = used_by_page(module.name, pages)
    scripts = scripts_using(module.name)
    if used:
        lines += [f"Used on: {links_to(used, pages)}.", ""]
    if scripts:
        programs = ", ".join(f"[`{path.rpartition('/')[2]}`](/{page_of(path)}.md)" for path in scripts)
        folded = len(scripts) > _FEW
        lines += [f"Used by: {programs}.", ""] if not folded else [
            f":::{{dropdown}} Used by {len(scripts)} programs", programs, ":::", ""
        ]  # fmt: skip
    lines += [_handed_on(module, scope), "", f"```{{py:currentmodule}} {module.name}\n```", ""]
    for node in tree.body:
        if isinstance(node, ast.FunctionDef) and not node.name.startswith("_") and not _is_overload(node):
            lines += [_function(node, scope, 0), ""]
        elif isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
            lines += [_class(node, scope), ""]
    return "\n".join(lines)


def _handed_on(module: Module, scope: Scope) -> str:
    """The names that a package has from other modules, each with a link and what it is."""
    rows = []
    for name in _exported(module):
        node = definition_of(scope.names.get(name, ""))
        if node is not None:
            told = linked(first_sentence(ast.get_docstring(node) or ""), scope).replace("|", "\\|")
            rows.append(f"| {{py:obj}}`{module.name}.{name} <{scope.names[name]}>` | {told} |")
    return "\n".join(["| name | what it is |", "| --- | --- |", *rows, ""]) if rows else ""


def _exported(module: Module) -> list[str]:
    names = assigned(f"{module.name}.__all__") if module.path.endswith("__init__.py") else None
    return [] if names is None else ast.literal_eval(names)


def _is_overload(node: ast.FunctionDef) -> bool:
    """Whether it only tells type checkers of a way to call the function that follows: the page describes that one."""
    return any(ast.unparse(each) in ("overload", "typing.overload") for each in node.decorator_list)


def _class(node: ast.ClassDef, scope: Scope) -> str:
    prose, sections = parsed(ast.get_docstring(node) or "")
    built = _constructor(node)
    titles = ("Attributes",) if built is not None or not has_fields(node) else ("Attributes", "Parameters")
    about = next((each for each in sections if each.title in titles), None)
    bases = public_bases(node, scope)
    fields = [listed(node, scope, about), "" if about is None else blocks(about.rest, scope)]
    others = [shown(each, scope) for each in sections if each is not about]
    parts = [
        blocks(prose, scope),
        f"Bases: {', '.join(bases)}." if bases else "",
        *(fields + others if built is None or about is not None else others + fields),
    ]
    for each in node.body:
        if isinstance(each, ast.FunctionDef) and not each.name.startswith("_") and not _is_overload(each):
            parts.append(_function(each, scope, 1))
    signature = "" if built is None else arguments(built, scope, 1)
    return _directive("py:class", f"{node.name}{signature}", "\n\n".join(part for part in parts if part), 4)


def _constructor(node: ast.ClassDef) -> ast.FunctionDef | None:
    """The constructor of a class where it is written; the fields of others are listed."""
    found = (each for each in node.body if isinstance(each, ast.FunctionDef) and each.name == "__init__")
    return next(found, None)


def _function(node: ast.FunctionDef, scope: Scope, depth: int) -> str:
    decorators = {ast.unparse(each) for each in node.decorator_list}
    returned = "" if node.returns is None else type_of(node.returns, scope)
    text = markdown(
        ast.get_docstring(node) or "",
        scope,
        linked_type(node.returns, scope) if node.returns is not None and "homofact." in returned else "",
    )
    if decorators & {"property", "cached_property", "functools.cached_property"}:
        return _directive("py:property", node.name, text, 3, f":type: {returned}\n" if returned else "")
    options = "".join(f":{name}:\n" for name in ("classmethod", "staticmethod") if name in decorators)
    given = arguments(node, scope, depth if "staticmethod" not in decorators else 0)
    result = f" -> {returned}" if returned else ""
    return _directive("py:method" if depth else "py:function", f"{node.name}{given}{result}", text, 3, options)


def _directive(name: str, argument: str, text: str, colons: int, options: str = "") -> str:
    fence = ":" * colons
    return f"{fence}{{{name}}} {argument}\n{options}\n{text}\n{fence}"
