"""The shading program of a factorization: f(ωi, ωo) from its stored textures, nothing in it that it does not need.

    f = max(0, exp(Σ fetches + B) − εA) · [both directions above the horizon],   B = log A + Σ biases

which is A max(0, exp(Σ p) − ε) with A and the biases of stored textures taken into one constant. A lookup's place is
(u, v) = M x in [−1, 1]²; the sampler's coordinate ((u + 1)/2 (n − 1) + ½)/n of a side of n texels is affine in it, and
both, with the coordinates' own scales, are folded into one matrix and one offset. Logs above `MOST` are cut, as
Python does, only where the textures can add up to that.

A texture that goes round has its first row (or column) once more behind the last (`Term.flat`): M texels evenly round
and the first again are M + 1 from −1 to +1, so the same place is read, and every sampler clamps.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch

from homofact.brdf.log_transform import MOST
from homofact.errors import BadInput
from homofact.factor.factorization import Factorization, Term
from homofact.shading.coordinates import SCALES, Coordinates, coordinates_of, gathered, place, warped
from homofact.shading.encoding import Encoded
from homofact.shading.expression import Expression, Let, call, constant, fetch, needed, variable, vector

TEXTURES = (
    "wi, wo: unit, to the light and to the viewer, in the surface frame (z normal, x tangent).",
    "The value is the BRDF in 1/sr, linear, without the cosine.",
    "Textures: bilinear, clamped to the edge, no mipmaps; row 0 is at v = 0; a texel's centre is at (k + 1/2)/n.",
)


@dataclass(frozen=True)
class Program:
    """Statements over wi and wo (3,), and the BRDF (C,) in sr⁻¹ without the cosine as `result`.

    `shapes` are the (rows, columns) of the textures that fetches number; `title` are lines on what it evaluates.
    """

    statements: tuple[Let, ...]
    result: Expression
    shapes: tuple[tuple[int, int], ...]
    channels: tuple[str, ...]
    title: tuple[str, ...]


def program_of(factorization: Factorization, textures: Sequence[Encoded]) -> Program:
    """The program that reads `textures`, one a term. Raises BadInput for more than four channels."""
    count = len(factorization.channels)
    if count > 4:
        raise BadInput(f"channels: found {count}, expected at most the 4 of a texture: fit with --channels rgb")
    wi, wo = variable("wi", 3), variable("wo", 3)
    coordinates = coordinates_of(_used(factorization))
    statements = list(coordinates.statements)
    fetched: list[Expression] = []
    bias = np.log(factorization.transform.mean.cpu().numpy().astype(np.float64))
    most = np.zeros(count)
    for number, (term, texture) in enumerate(zip(factorization.terms, textures, strict=True)):
        decoded = texture.decoded().amax((0, 1)).numpy()
        value: Expression | None = None
        for k, uv in enumerate(_places(term, number, coordinates, statements)):
            name = f"p_{number}" if k == 0 else f"p_{number}_conjugate"
            statements.append(Let(name, fetch(number, uv, count)))
            value = variable(name, count) if value is None else value + variable(name, count)
            bias = bias + texture.bias
            most = most + decoded
        if value is not None:
            fetched.append(value if np.all(texture.scale == 1) else value * _constant(texture.scale))
    total = fetched[0]
    for value in fetched[1:]:
        total = total + value
    total = total + _constant(bias)
    epsilon, mean = factorization.transform.epsilon, factorization.transform.mean.cpu().numpy().astype(np.float64)
    comment = "the sum of logarithms; the constant is log A and the textures' biases"
    if bool((most > MOST).any()):
        total = call("min", total, _constant(MOST + np.log(mean)))
        comment += "; runaway texels are cut"
    statements.append(Let("log_f", total, comment))
    statements.append(Let("above", call("step", 0.0, call("min", wi.z, wo.z)), "0 under the horizon"))
    value = call("max", call("exp", variable("log_f", count)) - _constant(epsilon * mean), 0.0)
    statements.append(Let("f", value, "epsilon A was added before the logarithm"))
    result = variable("f", count) * variable("above", 1)
    return Program(
        needed(statements, result),
        result,
        tuple(term.flat().size for term in factorization.terms),
        factorization.channels,
        _title(factorization),
    )


def _constant(values: np.ndarray) -> Expression:
    return constant(*np.atleast_1d(values).tolist())


def _used(factorization: Factorization) -> set[str]:
    """Names of the axes that some projection reads; a vector of a half-diff disc comes whole."""
    used = set()
    for term in factorization.terms:
        projection = term.projection
        dense = any(bool((matrix != 0).sum(1).gt(1).any()) for matrix in projection.matrices())
        read = torch.stack([(matrix != 0).any(0) for matrix in projection.matrices()]).any(0)
        used |= {axis for axis, one in zip(projection.system.axes, read.tolist(), strict=True) if one or dense}
    return used


def _places(term: Term, number: int, coordinates: Coordinates, statements: list[Let]) -> list[Expression]:
    """Names of the sampler coordinates (2,) of the term's lookups; what they need is appended to `statements`."""
    projection = term.projection
    # An axis that no row reads is named by none.
    axes = [coordinates.axes.get(axis, constant(0)) for axis in projection.system.axes]
    scaled = SCALES[projection.coordinates]
    if projection.warp is not None:
        made, axes, scaled = warped(projection.coordinates, projection.warp.width, number, axes)
        statements += made
    rows, columns = term.flat().size
    scales = torch.tensor(scaled, dtype=torch.float64)
    # u ↦ ((u + 1)/2 (n − 1) + ½)/n, and x = factor · raw + offset.
    gain = torch.tensor([(columns - 1) / (2 * columns), (rows - 1) / (2 * rows)], dtype=torch.float64)[:, None]
    statements.append(Let(f"x_{number}", vector(*gathered(axes), *([constant(1)] if len(axes) < 4 else []))))
    places = []
    for k, matrix in enumerate(projection.matrices()):
        m = matrix.cpu().to(torch.float64) * gain
        offsets = (m * scales[:, 1]).sum(1) + 0.5
        uv = place((m * scales[:, 0]).tolist(), offsets.tolist(), axes, variable(f"x_{number}", 4))
        name = f"uv_{number}" if k == 0 else f"uv_{number}_conjugate"
        words = f"texture {number}: {projection.name} on {projection.coordinates}, {columns} x {rows} texels"
        statements.append(Let(name, uv, words if k == 0 else "reciprocity: the directions swapped"))
        places.append(variable(name, 2))
    return places


def _title(factorization: Factorization) -> tuple[str, ...]:
    facts = factorization.provenance
    mean = ", ".join(f"{value:.6g}" for value in factorization.transform.mean.tolist())
    return (
        f"BRDF of {name_of(facts)}, by homofact {facts.get('homofact_version', '')}: {len(factorization.terms)} log"
        f" textures, {factorization.fetches} fetches.",
        f"epsilon = {factorization.transform.epsilon:g}, A = ({mean}) 1/sr.",
        *TEXTURES,
    )


def name_of(provenance: Mapping[str, Any]) -> str:
    """What a fit was made from, as its provenance tells: a material's or a file's name, else "samples"."""
    source = provenance.get("source", {})
    return str(source.get("material") or source.get("file") or "samples")
