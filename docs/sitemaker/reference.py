"""The pages of the Python interface, from signatures, fields and docstrings; each with the examples that use it.

Modules are read as source, not imported, but for the settings of the methods: their help and defaults are those of the
command line.
"""

import ast
import dataclasses
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cache
from importlib import import_module

from sitemaker.navigation import ROOT
from sitemaker.sources import links_to, page_of, summary
from sitemaker.uses import front_door, scripts_using, used_by_page

# What users touch, by what it is for; a module that is not here is shown by none of these pages.
MODULES = {
    "The front door": (
        "homofact", "homofact.api.reading", "homofact.api.fitting", "homofact.api.result", "homofact.api.comparing",
        "homofact.api.compared",
        "homofact.api.charting", "homofact.api.planning", "homofact.api.evaluating", "homofact.api.factorizing",
        "homofact.api.exporting", "homofact.api.viewing", "homofact.api.rendering", "homofact.api.converting",
        "homofact.api.sweeping", "homofact.api.reporting", "homofact.api.describing", "homofact.api.terms",
        "homofact.api.progress", "homofact.errors",
    ),
    "Methods": (
        "homofact.methods.search", "homofact.methods.cole", "homofact.methods.mccool", "homofact.methods.svd",
        "homofact.methods.nmf", "homofact.methods.models", "homofact.methods.method", "homofact.methods.fitting",
        "homofact.methods.table",
    ),
    "Data": (
        "homofact.brdf.samples", "homofact.brdf.source", "homofact.brdf.reflectance", "homofact.brdf.materials",
        "homofact.brdf.sampling", "homofact.brdf.table", "homofact.brdf.scattered", "homofact.brdf.log_transform",
        "homofact.brdf.symmetry", "homofact.brdf.quality.noise_floor",
        "homofact.brdf.quality.outliers", "homofact.brdf.quality.gains",
        "homofact.brdf.quality.clipping", "homofact.brdf.quality.suspicion.suspects",
        "homofact.brdf.quality.suspicion.undo",
        "homofact.brdf.formats.csv", "homofact.brdf.formats.npz", "homofact.brdf.formats.merl",
        "homofact.brdf.formats.alta",
    ),
    "Fits": (
        "homofact.factor.fitted", "homofact.factor.factorization", "homofact.factor.projection",
        "homofact.factor.gauge", "homofact.factor.quantize", "homofact.factor.confidence", "homofact.factor.layered",
        "homofact.separable.separable",
    ),
    "Quality of a fit": (
        "homofact.evaluation.compare", "homofact.evaluation.metric_table", "homofact.evaluation.metrics",
        "homofact.evaluation.brdf_metrics",
        "homofact.evaluation.image_metrics", "homofact.evaluation.appearance", "homofact.evaluation.energy",
        "homofact.evaluation.split", "homofact.evaluation.repeats", "homofact.evaluation.reopening",
        "homofact.evaluation.judging", "homofact.evaluation.verdict.verdict", "homofact.evaluation.verdict.finding",
        "homofact.evaluation.chart",
    ),
    "Pictures, pages, exports": (
        "homofact.rendering.sphere", "homofact.rendering.light",
        "homofact.rendering.environment", "homofact.rendering.tonemap",
        "homofact.rendering.mitsuba_bsdf", "homofact.exporting.exported", "homofact.exporting.exported_reader",
        "homofact.exporting.result", "homofact.web.page", "homofact.shading.program", "homofact.shading.languages",
    ),
    "Scenes": (
        "homofact.theory.terms", "homofact.scene.lighting", "homofact.theory.harmonics", "homofact.theory.reflection",
        "homofact.theory.light_field", "homofact.theory.sphere_field", "homofact.planning.scene",
        "homofact.planning.plan", "homofact.api.relighting", "homofact.api.editing",
        "homofact.relighting.scene_file",
        "homofact.relighting.build", "homofact.relighting.relight", "homofact.editing.scene_file",
        "homofact.editing.curves", "homofact.editing.session", "homofact.editing.to_textures",
    ),
    "Without torch": ("homofact.runtime", "homofact.shading.on_arrays"),
    "Whole databases": (
        "homofact.sweeps.sweep_file", "homofact.sweeps.run", "homofact.sweeps.ledger", "homofact.sweeps.svbrdf",
        "homofact.sweeps.shared_basis", "homofact.sweeps.report.site",
    ),
}  # fmt: skip


_FEW = 6  # programs that are listed without a fold


@dataclass(frozen=True)
class Module:
    """A module of the reference: its dotted name, its file in the repository, its page."""

    name: str

    @property
    def path(self) -> str:
        """The file, from the repository's root."""
        stem = self.name.replace(".", "/")
        return f"{stem}/__init__.py" if (ROOT / stem).is_dir() else f"{stem}.py"

    @property
    def page(self) -> str:
        """The page's name."""
        return f"api/{self.name}"


def reference_modules() -> list[Module]:
    """The modules of the reference in their order."""
    return [Module(name) for names in MODULES.values() for name in names]


def reference_pages(pages: Mapping[str, str]) -> dict[str, str]:
    """A page a module, and their index; `pages` by name are searched for examples."""
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
        lines += [f"| [`{name}`](/api/{name}.md) | {summary(Module(name).path)} |" for name in names]
        lines.append("")
    return "\n".join(lines)


def _page(module: Module, pages: Mapping[str, str]) -> str:
    tree = _tree(module.path)
    lines = [
        "---",
        "orphan: true",
        "---",
        "",
        f"# {module.name}",
        "",
        "[Python interface](/api/index.md)",
        "",
        markdown(ast.get_docstring(tree) or ""),
        "",
    ]
    lines += [f"[Source](/{page_of(module.path)}.md)", ""]
    used = used_by_page(module.name, pages)
    scripts = scripts_using(module.name)
    if used:
        lines += [f"Used on: {links_to(used, pages)}.", ""]
    if scripts:
        listed = ", ".join(f"[`{path.rpartition('/')[2]}`](/{page_of(path)}.md)" for path in scripts)
        folded = len(scripts) > _FEW
        lines += [f"Used by: {listed}.", ""] if not folded else [
            f":::{{dropdown}} Used by {len(scripts)} programs", listed, ":::", ""
        ]  # fmt: skip
    if module.name == "homofact":
        return "\n".join([*lines, *_front_door()])
    lines += [f"```{{py:currentmodule}} {module.name}\n```", ""]
    names = _imported(tree)
    for node in tree.body:
        if isinstance(node, ast.FunctionDef) and not node.name.startswith("_") and not _is_overload(node):
            lines += [_function(node, names, 0), ""]
        elif isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
            lines += [_class(node, module, names), ""]
    return "\n".join(lines)


def _is_overload(node: ast.FunctionDef) -> bool:
    """Whether it only tells type checkers of a way to call the function that follows: the page describes that one."""
    return any(ast.unparse(each) in ("overload", "typing.overload") for each in node.decorator_list)


def _front_door() -> Iterable[str]:
    """Where the names of the package itself are described."""
    yield "| name | described under |\n| --- | --- |"
    for name, home in front_door().items():
        yield f"| `homofact.{name}` | {{py:obj}}`{home}.{name}` |"


def _class(node: ast.ClassDef, module: Module, names: Mapping[str, str]) -> str:
    bases = ", ".join(ast.unparse(base) for base in node.bases)
    parts = [markdown(ast.get_docstring(node) or "")]
    if bases:
        parts.append(f"Bases: {', '.join(f'`{base}`' for base in bases.split(', '))}.")
    parts += _fields(node, module)
    for each in node.body:
        if isinstance(each, ast.FunctionDef) and not each.name.startswith("_") and not _is_overload(each):
            parts.append(_function(each, names, 1))
    signature = _constructor(node, names)
    return _directive("py:class", f"{node.name}{signature}", "\n\n".join(part for part in parts if part), 4)


def _constructor(node: ast.ClassDef, names: Mapping[str, str]) -> str:
    """What the constructor takes: of `__init__` where it is written, nothing for the fields that are listed below."""
    for each in node.body:
        if isinstance(each, ast.FunctionDef) and each.name == "__init__":
            return _arguments(each, names, 1)
    return ""


def _fields(node: ast.ClassDef, module: Module) -> list[str]:
    """The fields of a dataclass: with the words and the default of the command line where it declares options."""
    if not any("dataclass" in ast.unparse(each) for each in node.decorator_list):
        return []
    declared = _declared(module.name, node.name)
    rows = []
    for each in node.body:
        if not isinstance(each, ast.AnnAssign) or not isinstance(each.target, ast.Name):
            continue
        name, kind = each.target.id, ast.unparse(each.annotation)
        if name.startswith("_") or kind.startswith("ClassVar"):
            continue
        words, default = declared.get(name, ("", _default(each.value)))
        told = f": {words}" if words else ""
        told += f" Default: {default}." if default else ""
        rows.append(f"- `{name}` (`{kind}`){told}")
    return ["\n".join(["**Fields**", "", *rows])] if rows else []


def _default(value: ast.expr | None) -> str:
    if value is None:
        return ""
    told = ast.unparse(value)
    match = re.match(r"field\(default_factory=(\w+)\)$", told)
    if match:
        return {"dict": "`{}`", "list": "`[]`"}.get(match[1], f"`{match[1]}()`")
    return f"`{told}`" if len(told) < 60 else ""


@cache
def _declared(module: str, name: str) -> dict[str, tuple[str, str]]:
    """The settings of a class that declares options: their help and default in words."""
    if "option" not in (ROOT / Module(module).path).read_text(encoding="utf-8"):
        return {}  # not loaded for nothing
    from homofact.cli.options import shown_default
    from homofact.settings.options import options_of

    settings = getattr(import_module(module), name)
    if not any("option" in each.metadata for each in dataclasses.fields(settings)):
        return {}
    return {
        key: (f"{each.option.help}.", shown_default(each)) for key, each in options_of(settings).items()
    }  # fmt: skip


def _function(node: ast.FunctionDef, names: Mapping[str, str], depth: int) -> str:
    decorators = {ast.unparse(each) for each in node.decorator_list}
    text = markdown(ast.get_docstring(node) or "")
    returns = f" -> {_qualified(node.returns, names)}" if node.returns is not None else ""
    if decorators & {"property", "cached_property", "functools.cached_property"}:
        kind = f":type: {_qualified(node.returns, names)}\n" if node.returns is not None else ""
        return _directive("py:property", node.name, text, 3, kind)
    options = "".join(f":{name}:\n" for name in ("classmethod", "staticmethod") if name in decorators)
    bound = depth if "staticmethod" not in decorators else 0
    kind = "py:method" if depth else "py:function"
    return _directive(kind, f"{node.name}{_arguments(node, names, bound)}{returns}", text, 3, options)


def _arguments(node: ast.FunctionDef, names: Mapping[str, str], bound: int) -> str:
    arguments = ast.parse(ast.unparse(node)).body[0].args  # type: ignore[attr-defined]
    positional = arguments.posonlyargs or arguments.args
    del positional[:bound]
    return f"({_qualified(arguments, names)})"


def _directive(name: str, argument: str, text: str, colons: int, options: str = "") -> str:
    fence = ":" * colons
    return f"{fence}{{{name}}} {argument}\n{options}\n{text}\n{fence}"


class _Qualify(ast.NodeTransformer):
    """Names imported from homofact by their whole path, so that they can be linked."""

    def __init__(self, names: Mapping[str, str]) -> None:
        self._names = names

    def visit_Name(self, node: ast.Name) -> ast.AST:
        return ast.Name(self._names.get(node.id, node.id))

    def visit_Constant(self, node: ast.Constant) -> ast.AST:
        if isinstance(node.value, str) and node.value in self._names:
            return ast.Name(self._names[node.value])
        return node


def _qualified(node: ast.AST, names: Mapping[str, str]) -> str:
    return ast.unparse(_Qualify(names).visit(ast.parse(ast.unparse(node), mode="eval").body)
                       if isinstance(node, ast.expr) else _Qualify(names).visit(node))  # fmt: skip


def _imported(tree: ast.Module) -> dict[str, str]:
    found = {}
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("homofact"):
            found |= {each.asname or each.name: f"{node.module}.{each.name}" for each in node.names}
    return found


@cache
def _tree(path: str) -> ast.Module:
    return ast.parse((ROOT / path).read_text(encoding="utf-8"))


def markdown(text: str) -> str:
    """A docstring as Markdown: numpy's underlined headings as bold words, their entries as a list, examples as code.

    Stars are kept.
    """
    lines = text.split("\n")
    found: list[str] = []
    listing = example = False
    for number, line in enumerate(lines):
        following = lines[number + 1] if number + 1 < len(lines) else ""
        if example or line.startswith(">>> "):
            # An example and what it prints, up to the next empty line.
            found += [] if example else ["", "```pycon"]
            found.append(line if line.strip() else "```\n")
            example = bool(line.strip())
            if example and number + 1 == len(lines):
                found.append("```")
        elif re.fullmatch(r"-{3,}", line) and number and lines[number - 1].strip():
            listing = True
            found.append("")
        elif re.fullmatch(r"-{3,}", following) and line.strip():
            found.append(f"**{line.strip()}**")
        elif listing and line.strip() and not line.startswith(" "):
            head, colon, rest = line.partition(" : ")
            found.append(f"- `{head}`: {rest}" if colon else f"- `{line}`" if line.startswith("**") else f"- {line}")
        elif listing and line.strip():
            found.append(f"  {line.strip()}")
        else:
            listing = listing and bool(line.strip())
            found.append(line)
    return re.sub(r"(?<![`*\w])\*(?=\w)", r"\\*", "\n".join(found))
