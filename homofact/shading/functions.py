"""Functions of vectors without textures, printed in the four languages after the evaluation function of a fit."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from homofact.geometry.expression import Expression, Let, Tables, component, needed, nodes, variable
from homofact.shading.c_code import render, statement_lines, tables_in_c
from homofact.shading.languages import GLSL, HLSL, WGSL, Language, body_text, remark, tables_text
from homofact.shading.lobe_mixture import LobeMixture, parameter_tables, printed
from homofact.shading.lobe_statements import density_statements, sample_statements

_HEADS = {
    GLSL.name: ("{kind} {name}({parameters}) {{\n", "{kind} {name}"),
    HLSL.name: ("{kind} {name}({parameters})\n{{\n", "{kind} {name}"),
    WGSL.name: ("fn {name}({parameters}) -> {kind} {{\n", "{name}: {kind}"),
}
_LAYERS = {GLSL.name: "int layer", HLSL.name: "int layer", WGSL.name: "layer: i32"}


@dataclass(frozen=True)
class Function:
    """The shader function PREFIX_`name`, with vector parameters (3,) and the value `result`.

    `parameters` are the names of the parameters, and `comment` has the comment lines above the function. With `tables`,
    which have one row per layer, the layer is an additional last parameter.
    """

    name: str
    parameters: tuple[str, ...]
    statements: tuple[Let, ...]
    result: Expression
    comment: tuple[str, ...]
    tables: Tables = ()


def sampling_functions(mixture: LobeMixture) -> tuple[Function, Function]:
    """Return `PREFIX_sample(wo, u)`, a direction (3,), and `PREFIX_density(wi, wo)`, in sr⁻¹."""
    return _sampling((mixture,), mixture.constants(), ())


def sampling_of_layers(mixtures: Sequence[LobeMixture]) -> tuple[Function, Function]:
    """Return `PREFIX_sample(wo, u, layer)` and `PREFIX_density(wi, wo, layer)`; layer k uses mixture k.

    All mixtures must use the same coordinates (see `mixture_fit.fitted_mixtures`).
    """
    return _sampling(mixtures, *parameter_tables(mixtures))


def _sampling(mixtures: Sequence[LobeMixture], values: Mapping[str, Any], tables: Tables) -> tuple[Function, Function]:
    grained = mixtures[0].grained
    sample = printed(needed(sample_statements(grained), variable("wi", 3)), values)
    density = printed(needed(density_statements(grained), variable("density", 1)), values)
    of_layer = " of the layer" * bool(tables)
    return (
        Function(
            "sample",
            ("wo", "u"),
            sample,
            variable("wi", 3),
            (
                f"Importance sampling{of_layer}: wi for the viewer wo and three numbers u in [0, 1), independent"
                " and uniform.",
            ),
            _read(tables, sample),
        ),
        Function(
            "density",
            ("wi", "wo"),
            density,
            variable("density", 1),
            ("The density of wi, as it is drawn for wo: in 1/sr, 0 where either is under the horizon.",),
            _read(tables, density),
        ),
    )


def _read(tables: Tables, statements: Sequence[Let]) -> Tables:
    """The tables that the statements read."""
    read = {node.text for let in statements for node in nodes(let.expression) if node.kind == "table"}
    return tuple(table for table in tables if table[0] in read)


def _tables_of(functions: Sequence[Function]) -> Tables:
    """Those of all functions, each once."""
    return tuple({name: (name, rows) for function in functions for name, rows in function.tables}.values())


def functions_text(functions: Sequence[Function], language: Language, prefix: str = "homofact") -> str:
    """Return the source of the functions, to append to that of a shader."""
    tables = tables_text(_tables_of(functions), language, prefix)
    texts = [f"\n{tables}"] if tables else []
    for function in functions:
        head, parameter = _HEADS[language.name]
        given = ", ".join(parameter.format(kind=language.types[2], name=name) for name in function.parameters)
        given += f", {_LAYERS[language.name]}" if function.tables else ""
        kind = language.types[function.result.dimension - 1]
        begin = head.format(kind=kind, name=f"{prefix}_{function.name}", parameters=given)
        comment = "".join(f"// {remark(line)}\n" for line in function.comment)
        texts.append(f"\n{comment}{begin}{body_text(function.statements, function.result, language, prefix)}\n}}\n")
    return "".join(texts)


def functions_in_c(functions: Sequence[Function], prefix: str = "homofact") -> str:
    """Return the functions in C99; they return a scalar, or write a vector to the last argument."""
    tables = tables_in_c(_tables_of(functions), prefix).rstrip("\n")
    texts = [f"\n{tables}\n"] if tables else []
    for function in functions:
        comment = "".join(f"/* {remark(line)} */\n" for line in function.comment)
        given = ", ".join(f"const float {name}[3]" for name in function.parameters)
        given += ", int layer" if function.tables else ""
        body = statement_lines(function.statements, prefix)
        if function.result.dimension == 1:
            head = f"float {prefix}_{function.name}({given})"
            body.append(f"    return {render(function.result, prefix)};")
        else:
            count = function.result.dimension
            head = f"void {prefix}_{function.name}({given}, float out[{count}])"
            body += [f"    out[{k}] = {render(component(function.result, k), prefix)};" for k in range(count)]
        texts.append(f"\n{comment}{head}\n{{\n" + "\n".join(body) + "\n}\n")
    return "".join(texts)
