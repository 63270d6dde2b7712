"""The graph of math nodes gives what the fit gives: run with the arithmetic of Blender's nodes, in numpy."""

import math

import numpy as np
import pytest
import torch
from node_graph_cases import run
from shading_cases import CASES, SEPARABLE

from homofact.factor.fitted import Fitted
from homofact.geometry.directions import draw_uniform
from homofact.geometry.expression import Expression, Let, call, component, constant, variable, vector
from homofact.geometry.interpret import NUMPY, value_of
from homofact.shading.encoding import as_floats
from homofact.shading.node_graph import NodeGraph, node_graph
from homofact.shading.program import Program, program_of

ALL = CASES | SEPARABLE


def graph_of(fitted: Fitted) -> tuple[NodeGraph, list[np.ndarray]]:
    plain = [as_floats(texture.texels) for texture in fitted.textures]
    return node_graph(program_of(fitted, plain)), [texture.stored.astype(float) for texture in plain]


@pytest.mark.parametrize("name", ALL)
def test_it_gives_what_the_fit_gives(name: str) -> None:
    fitted = ALL[name]
    wi, wo = draw_uniform(1000, torch.Generator().manual_seed(0))
    # Below the horizon there is nothing.
    wi[:50, 2] *= -1
    wo[50:100, 2] *= -1
    graph, textures = graph_of(fitted)
    found = run(graph, {"wi": wi.numpy().T, "wo": wo.numpy().T}, textures).reshape(-1, len(wi)).T
    above = fitted.evaluate(wi[100:], wo[100:]).numpy()
    assert np.abs(found[100:] - above) == pytest.approx(0, abs=2e-4 * above.max())
    assert (found[:100] == 0).all()
    assert (above > 0).mean() > 0.5


X, Y, Z = variable("wi", 3), variable("wo", 3), variable("wi", 3)
TWO = vector(X.x, Y.y)
FOUR = vector(X, constant(0.5))
EXPRESSIONS: dict[str, Expression] = {
    kind: call(kind, vector(*(call("abs", each) + 0.1 for each in (X.x, X.y, X.z))))
    for kind in ("sqrt", "log", "exp", "asinh", "abs")
} | {
    kind: call(kind, 3 * X) for kind in ("cos", "sin", "floor", "fract")
} | {
    kind: call(kind, X, Y) for kind in ("max", "min", "atan2", "step")
} | {
    "step at its edge": vector(call("step", X.x, X.x), call("step", Y, X).x, call("step", 0.3, X.z)),
    "dot of two": vector(call("dot", TWO + 0.25, TWO * 3), call("dot", X.xy, Y.xy), X.x),
    "dot of four": vector(call("dot", FOUR, constant(1, -2, 3, 4)), call("dot", FOUR, FOUR * 2), X.x),
    "dot of three": call("dot", X, Y) * constant(1, 2, 3),
    "a number beside a vector": 2 - (X.z * Y + 1 / (2 + X.y)) / constant(2, 3, 4),
    "constants": (constant(1) * X.x + constant(2) * 3 - constant(4)) * Y,
    "components of a vector": vector((X + Y).zx, (X - Y).y),
}  # fmt: skip


@pytest.mark.parametrize("name", EXPRESSIONS)
def test_every_function(name: str) -> None:
    expression = EXPRESSIONS[name]
    wi, wo = (each.numpy().T for each in draw_uniform(100, torch.Generator().manual_seed(3)))
    wi = wi * np.array([1, -1, 1])[:, None]
    program = Program((Let("f", expression),), variable("f", 3), (), ("R", "G", "B"), ())
    found = run(node_graph(program), {"wi": wi, "wo": wo}, [])
    expected = np.stack(value_of(expression, {"wi": list(wi), "wo": list(wo)}, NUMPY))
    assert found == pytest.approx(expected, abs=1e-12)
    assert np.ptp(found) > 0.1


def test_nothing_is_computed_twice_or_in_vain() -> None:
    for name, fitted in ALL.items():
        graph, _ = graph_of(fitted)
        assert len(set(graph.nodes)) == len(graph.nodes), name
        asked = [str(each).partition(".")[0] for node in graph.nodes for each in node[1:]] + [graph.result]
        assert {f"n{k}" for k in range(len(graph.nodes))} <= set(asked), name
        # In an order that can be built.
        for k, node in enumerate(graph.nodes):
            before = [each for each in node[2 if node[0] in ("math", "vector") else 1 :] if str(each).startswith("n")]
            assert all(int(each[1:].partition(".")[0]) < k for each in before), name
    product = X.x * Y.x
    result = vector(variable("a", 1), variable("b", 1), X.x)
    twice = Program((Let("a", product), Let("b", product)), result, (), ("R", "G", "B"), ())
    assert [node[0] for node in node_graph(twice).nodes] == ["separate", "separate", "math", "combine"]


def test_constants_are_no_nodes() -> None:
    program = Program((), (constant(2.0) * 3 + 1) * X, (), ("R", "G", "B"), ())
    assert node_graph(program).nodes == (("vector", "MULTIPLY", 7.0, "wi"),)
    graph = node_graph(Program((), vector(X.x * 1, X.y, constant(1 / 3)), (), ("R", "G", "B"), ()))
    assert graph.nodes == (("separate", "wi"), ("combine", "n0.x", "n0.y", pytest.approx(1 / 3, abs=1e-8)))
    assert math.isclose(component(constant(1 / 3), 0).values[0], 1 / 3)
