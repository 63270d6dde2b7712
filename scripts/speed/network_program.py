"""Write the NBRDF network (`homofact.brdf.neural`) as a shading program, and train it on samples.

The program has no textures. With s = ωi + ωo, e = ωi − ωo, |s| = 2 h·ωi and the turn that brings h into the xz-plane,

    h = (|s.xy|, 0, s.z)/|s|,   dz = |s|/2,   dy = |s.x e.y − s.y e.x|/(2 |s.xy|),
    dx = ± (s.z (s.xy · e.xy)/|s.xy| − |s.xy| e.z)/(2 |s|),

the sign that of s.x e.y − s.y e.x, for the network takes φd modulo π. Compiled like the textures' program
(`homofact.shading.compiled`), it is as fast as this processor runs the network.
"""

from collections.abc import Sequence

import numpy as np
import torch
from torch import Tensor

from homofact.brdf.log_transform import LogTransform
from homofact.brdf.neural import LAYERS, NeuralBrdf
from homofact.brdf.samples import Samples
from homofact.geometry.expression import Expression, Let, call, constant, variable
from homofact.parametric.network import train as trained
from homofact.shading.program import Program

Weights = Tensor | np.ndarray
LOSSES = ("cole", "log1p")


def network_program(network: NeuralBrdf) -> Program:
    """The statements of the module's head, one a neuron; three channels."""
    wi, wo = variable("wi", 3), variable("wo", 3)
    s, e = variable("s", 3), variable("e", 3)
    size, in_plane, across = variable("size", 1), variable("in_plane", 1), variable("across", 1)
    along = (s.z * call("dot", s.xy, e.xy) / in_plane - in_plane * e.z) / (size * 2)
    statements = [
        Let("s", wi + wo),
        Let("e", wi - wo),
        Let("size", call("sqrt", call("dot", s, s))),
        Let("in_plane", call("max", call("sqrt", call("dot", s.xy, s.xy)), 1e-6)),
        Let("across", s.x * e.y - s.y * e.x),
        Let("along", along * (call("step", 0.0, across) * 2 - 1)),
        Let("x_0", in_plane / size),
        Let("x_2", s.z / size),
        Let("x_4", call("abs", across) / (in_plane * 2)),
        Let("x_5", size * 0.5),
    ]
    names = ("x_0", None, "x_2", "along", "x_4", "x_5")
    used = [k for k, name in enumerate(names) if name is not None]
    values: list[Expression] = [variable(name, 1) for name in names if name is not None]
    for layer, (weight, bias) in enumerate(zip(network.weights, network.biases, strict=True)):
        # hy is always 0.
        neurons = dense(values, weight[used] if layer == 0 else weight, bias, f"layer_{layer}")
        if layer < len(LAYERS) - 1:
            neurons = [Let(let.name, call("max", let.expression, 0.0)) for let in neurons]
        statements += neurons
        values = [variable(let.name, 1) for let in neurons]
    above = call("step", 0.0, call("min", wi.z, wo.z))
    parts = [call("max", call("exp", value) - 1.0, 0.0) * above for value in values]
    result = Expression("vector", 3, tuple(parts))
    return Program(tuple(statements), result, (), ("R", "G", "B"), ("the network",))


def dense(values: Sequence[Expression], weight: Weights, bias: Weights, name: str) -> list[Let]:
    """A layer without its activation: a statement NAME_J for each of the neurons of `weight` (inputs, neurons)."""
    statements = []
    for j in range(weight.shape[1]):
        total = constant(float(bias[j]))
        for value, factor in zip(values, weight[:, j].tolist(), strict=True):
            total = total + value * factor
        statements.append(Let(f"{name}_{j}", total))
    return statements


def train(samples: Samples, transform: LogTransform, loss: str, steps: int, seed: int = 0) -> NeuralBrdf:
    """A network trained on samples by so many steps with the paper's loss ("log1p") or the Cole error ("cole")."""
    if loss == "log1p":
        return trained(samples, steps, seed)

    def cole(values: Tensor, y: Tensor, expected: Tensor, _: Tensor) -> Tensor:
        off = (transform.forward(values.clamp_min(0)) - transform.forward(expected)).square().mean()
        # Below 0 the cut has no slope; the difference of the uncut value has.
        return off + torch.relu(-y).square().mean()

    return trained(samples, steps, seed, cole)
