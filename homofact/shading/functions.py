"""Functions of vectors that need no texture, printed in the four languages behind the evaluation of a fit."""

from collections.abc import Sequence
from dataclasses import dataclass

from homofact.geometry.expression import Expression, Let, component, variable
from homofact.shading.c_code import render, statement_lines
from homofact.shading.languages import GLSL, HLSL, WGSL, Language, body_text, remark
from homofact.shading.lobe_mixture import LobeMixture, density_statements, printed, sample_statements

_HEADS = {
    GLSL.name: ("{kind} {name}({parameters}) {{\n", "{kind} {name}"),
    HLSL.name: ("{kind} {name}({parameters})\n{{\n", "{kind} {name}"),
    WGSL.name: ("fn {name}({parameters}) -> {kind} {{\n", "{name}: {kind}"),
}


@dataclass(frozen=True)
class Function:
    """PREFIX_`name` of vectors (3,) called `parameters`, its value `result`; `comment` are lines above it."""

    name: str
    parameters: tuple[str, ...]
    statements: tuple[Let, ...]
    result: Expression
    comment: tuple[str, ...]


def sampling_functions(mixture: LobeMixture) -> tuple[Function, Function]:
    """`PREFIX_sample(wo, u)`, a direction (3,), and `PREFIX_density(wi, wo)`, in sr⁻¹."""
    lobes, turned, numbers = len(mixture.alphas), bool(mixture.turn), mixture.constants()
    sample, density = (
        printed(statements, numbers)
        for statements in (sample_statements(lobes, turned), density_statements(lobes, turned))
    )
    return (
        Function(
            "sample",
            ("wo", "u"),
            sample,
            variable("wi", 3),
            (
                "Importance sampling: wi for the viewer wo and three numbers u in [0, 1), independent and uniform.",
                "wi.z <= 0: nothing was found, its value and its density are 0.",
            ),
        ),
        Function(
            "density",
            ("wi", "wo"),
            density,
            variable("density", 1),
            ("The density of wi, as it is drawn for wo: in 1/sr, 0 where either is under the horizon.",),
        ),
    )


def functions_text(functions: Sequence[Function], language: Language, prefix: str = "homofact") -> str:
    """The functions' text, to stand behind that of a shader."""
    texts = []
    for each in functions:
        head, parameter = _HEADS[language.name]
        given = ", ".join(parameter.format(kind=language.types[2], name=name) for name in each.parameters)
        kind = language.types[each.result.dimension - 1]
        begin = head.format(kind=kind, name=f"{prefix}_{each.name}", parameters=given)
        comment = "".join(f"// {remark(line)}\n" for line in each.comment)
        texts.append(f"\n{comment}{begin}{body_text(each.statements, each.result, language, prefix)}\n}}\n")
    return "".join(texts)


def functions_in_c(functions: Sequence[Function], prefix: str = "homofact") -> str:
    """The functions in C99: a number is returned, a vector written to the last argument."""
    texts = []
    for each in functions:
        comment = "".join(f"/* {remark(line)} */\n" for line in each.comment)
        given = ", ".join(f"const float {name}[3]" for name in each.parameters)
        body = statement_lines(each.statements, prefix)
        if each.result.dimension == 1:
            head = f"float {prefix}_{each.name}({given})"
            body.append(f"    return {render(each.result, prefix)};")
        else:
            count = each.result.dimension
            head = f"void {prefix}_{each.name}({given}, float out[{count}])"
            body += [f"    out[{k}] = {render(component(each.result, k), prefix)};" for k in range(count)]
        texts.append(f"\n{comment}{head}\n{{\n" + "\n".join(body) + "\n}\n")
    return "".join(texts)
