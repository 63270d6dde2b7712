"""The shading program of a fit: it computes f(ωi, ωo) from the stored textures with the fewest operations.

For a product, whose textures hold logarithms p,

    f = max(0, exp(Σ fetches + B) − εA) · [both directions above the horizon],   B = log A + Σ biases

which is A max(0, exp(Σ p) − ε) with A and the biases of stored textures combined into one constant. Logs above `MOST`
are clipped, as in Python, but only if the textures can reach this sum. For a sum of products, f = max(0, Σk sk gk hk)
per channel. A lookup reads the place (u, v) = M x in [−1, 1]². The sampler's coordinate ((u + 1)/2 (n − 1) + ½)/n of a
side of n texels is affine in it, so both, with the scales of the coordinates, are folded into one matrix and one
offset.

Several materials whose textures have the same projections and sizes are the layers of texture arrays: fetches read the
layer that is an argument of the function, and tables with a row per layer contain log A and εA, which differ.

A periodic texture repeats its first row (or column) after the last one (`Term.flat`): M texels round the circle and the
repeated one are M + 1 texels from −1 to +1. So every sampler clamps and reads the same place.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from homofact.brdf.analytic.ggx import GgxBrdf
from homofact.brdf.log_transform import LogTransform
from homofact.brdf.source_names import MOST
from homofact.errors import Advice, BadInput
from homofact.factor.edited import edited_name, edits_in_words
from homofact.factor.evaluation import Evaluated, Evaluation, TextureLookup, evaluation_of, refuse_model
from homofact.files.words import on_one_line
from homofact.geometry.axes import Coordinates, coordinates_of, gathered
from homofact.geometry.coordinates import Scales, warped
from homofact.geometry.expression import Expression, Let, Tables, call, constant, fetch, needed, table, variable, vector
from homofact.parametric.model_fit import ModelFit
from homofact.shading.encoded import Encoded
from homofact.shading.ggx_statements import ggx_statements

TEXTURES = (
    "wi, wo: unit, to the light and to the viewer, in the surface frame (z normal, x tangent).",
    "The value is the BRDF in 1/sr, linear, without the cosine.",
    "Textures: bilinear, clamped to the edge, no mipmaps; row 0 is at v = 0; a texel's centre is at (k + 1/2)/n.",
)


@dataclass(frozen=True)
class Program:
    """Statements in wi and wo (3,), and `result`, the BRDF (C,) in sr⁻¹ without the cosine.

    `shapes` has the (rows, columns) of each texture, in the order of the texture numbers in fetches. It is (depth,
    rows, columns) for a 3D texture, which only GLSL supports, and (levels, 6, rows, columns) for a cube map. `title`
    has comment lines that describe the program. For texture arrays, `layers` is the number of layers (otherwise 0),
    `shapes` are those of one layer, and `tables` have a row (C,) per layer, by name. `function` is the name of the
    function after the prefix, and `parameters` are the names of its vector parameters (3,). `first` is the binding
    number of the first texture in a shader.
    """

    statements: tuple[Let, ...]
    result: Expression
    shapes: tuple[tuple[int, ...], ...]
    channels: tuple[str, ...]
    title: tuple[str, ...]
    layers: int = 0
    tables: Tables = ()
    function: str = "evaluate"
    parameters: tuple[str, ...] = ("wi", "wo")
    first: int = 0


def program_of(
    fitted: Evaluated, textures: Sequence[Encoded], cut: bool = False, layers: Sequence[LogTransform] = ()
) -> Program:
    """Return the program that evaluates a fit from its stored `textures`.

    For a model without textures, the program contains its parameters as constants. With `cut`, large logarithms are
    always clipped; use it if the texels may change later. `layers` are the transforms of several materials. Then each
    of `textures` contains the texels of all materials, stacked along the rows, and `fitted` is any one of the fits.
    Raises BadInput for more than four channels.
    """
    count = len(fitted.channels)
    check_count(count)
    if fitted.evaluation is None:
        return _of_model(fitted)
    wi, wo = variable("wi", 3), variable("wo", 3)
    evaluation = evaluation_of(fitted)
    statements, total, bias, shapes = _summed(evaluation, textures, count, max(len(layers), 1))
    transform = evaluation.transform
    tables: Tables = ()
    if layers:
        total, tables = _of_layers(total, bias, layers, cut or _runs_away(evaluation, textures), statements)
        comment = "epsilon A was added before the logarithm"
    elif transform is None:
        total = total if not np.any(bias) else total + _constant(bias)
        comment = "a truncated sum may fall below 0"
    else:
        mean = transform.mean
        total = total + _constant(bias + np.log(mean))
        comment = "the sum of logarithms; the constant is log A and the textures' biases"
        if cut or _runs_away(evaluation, textures):
            total = call("min", total, _constant(MOST + np.log(mean)))
            comment += "; runaway texels are cut"
        statements.append(Let("log_f", total, comment))
        total = call("exp", variable("log_f", count)) - _constant(transform.epsilon * mean)
        comment = "epsilon A was added before the logarithm"
    statements.append(Let("above", call("step", 0.0, call("min", wi.z, wo.z)), "0 under the horizon"))
    statements.append(Let("f", call("max", total, 0.0), comment))
    result = variable("f", count) * variable("above", 1)
    title = _title(fitted, len(layers))
    return Program(needed(statements, result), result, shapes, fitted.channels, title, len(layers), tables)


def _of_model(fitted: Evaluated) -> Program:
    """The program of a model without textures. Raises BadInput for one that no shader is made of."""
    model = fitted.model if isinstance(fitted, ModelFit) else None
    if not isinstance(model, GgxBrdf):
        refuse_model(fitted)
    statements, value = ggx_statements(model)
    wi, wo = variable("wi", 3), variable("wo", 3)
    above = Let("above", call("step", 0.0, call("min", wi.z, wo.z)), "0 under the horizon")
    statements += [above, Let("f", value, "diffuse base and lobes")]
    result = variable("f", len(fitted.channels)) * variable("above", 1)
    begin = f"BRDF of {name_of(fitted.provenance)}, by homofact {fitted.provenance.get('homofact_version', '')}:"
    title = (
        f"{begin} GGX, {len(model.lobes)} lobe{'s' * (len(model.lobes) > 1)} over a diffuse base, no textures.",
        *TEXTURES[:2],
    )
    return Program(needed(statements, result), result, (), fitted.channels, title)


def sum_program(fitted: Evaluated, textures: Sequence[Encoded]) -> Program:
    """Return the program that computes only the sum of the products of a fit, for any number of channels.

    For a product fit, the sum is the logarithms, or the coordinates in a spectral basis. The program is for
    interpretation only, since shader vectors have at most four components.
    """
    count = textures[0].stored.shape[2]
    evaluation = evaluation_of(fitted).of_channels(slice(0, count))
    statements, total, bias, shapes = _summed(evaluation, textures, count, 1)
    statements.append(Let("total", total if not np.any(bias) else total + _constant(bias)))
    result = variable("total", count)
    return Program(needed(statements, result), result, shapes, fitted.channels, _title(fitted, 0))


def _summed(
    evaluation: Evaluation, textures: Sequence[Encoded], count: int, layers: int
) -> tuple[list[Let], Expression, np.ndarray, tuple[tuple[int, int], ...]]:
    """(the statements that fetch, the sum less its biases, these, the shapes of the textures' layers)."""
    sizes = [texture.stored.shape[:2] for texture in textures]
    shapes = tuple((rows // layers, columns) for rows, columns in sizes)
    coordinates = coordinates_of(_used(evaluation))
    statements = list(coordinates.statements)
    fetched = _fetches(evaluation, shapes, count, coordinates, statements)
    total, bias = _sum(evaluation, fetched, textures, count)
    return statements, total, bias, shapes


def check_count(channels: int) -> None:
    """Raise BadInput for more than four channels, the most that a texture can have."""
    if channels > 4:
        hint = f"fit with {Advice('channels', 'rgb')}"
        raise BadInput(where="channels", found=channels, expected="at most the 4 of a texture", hint=hint)


def _of_layers(
    total: Expression, bias: np.ndarray, layers: Sequence[LogTransform], cut: bool, statements: list[Let]
) -> tuple[Expression, Tables]:
    """(f before it is cut at zero, the tables): as for one material, log A and εA those of the layer."""
    total = total if not np.any(bias) else total + _constant(bias)
    total = call("min", total, MOST) if cut else total
    tables = (
        ("log_mean", tuple(tuple(np.log(layer.mean).tolist()) for layer in layers)),
        ("floor", tuple(tuple((layer.epsilon * layer.mean).tolist()) for layer in layers)),
    )
    count = total.dimension
    comment = "the sum of logarithms; log A of the layer" + "; runaway texels are cut" * cut
    statements.append(Let("log_f", total + table("log_mean", count), comment))
    return call("exp", variable("log_f", count)) - table("floor", count), tables


def _constant(values: np.ndarray) -> Expression:
    return constant(*np.atleast_1d(values).tolist())


def _used(evaluation: Evaluation) -> frozenset[str]:
    """Names of the axes that some lookup reads; a vector of a half-diff disc comes whole."""
    used = set()
    for lookup in evaluation.lookups:
        nonzero = lookup.matrix != 0
        dense = bool((nonzero.sum(1) > 1).any())
        read = nonzero.any(0).tolist()
        used |= {axis for axis, one in zip(lookup.axes, read, strict=True) if one or dense}
    return frozenset(used)


def _fetches(
    evaluation: Evaluation,
    shapes: Sequence[tuple[int, int]],
    count: int,
    coordinates: Coordinates,
    statements: list[Let],
) -> list[Expression]:
    """The names of the lookups' values (C,); what they need is appended to `statements`. Each is fetched once."""
    vectors: dict[Any, tuple[str, list[Expression], Scales]] = {}
    places: dict[Any, Expression] = {}
    values: dict[Any, Expression] = {}
    fetched = []
    for lookup in evaluation.lookups:
        number, (rows, columns) = lookup.texture, shapes[lookup.texture]
        kind = (lookup.axes, lookup.scales, lookup.warp)
        if kind not in vectors:
            vectors[kind] = _vector(lookup, f"x_{len(vectors)}", coordinates, statements)
        x, axes, scaled = vectors[kind]
        spot = (*kind, rows, columns, tuple(map(tuple, lookup.matrix.tolist())))
        if spot not in places:
            scales = np.array(scaled)
            # u ↦ ((u + 1)/2 (n − 1) + ½)/n, and x = factor · raw + offset.
            gain = np.array([(columns - 1) / (2 * columns), (rows - 1) / (2 * rows)])
            matrix = lookup.matrix * gain[:, None]
            offsets = (matrix * scales[:, 1]).sum(1) + 0.5
            uv = _place((matrix * scales[:, 0]).tolist(), offsets.tolist(), axes, variable(x, 4))
            statements.append(Let(f"uv_{len(places)}", uv, lookup.words))
            places[spot] = variable(f"uv_{len(places)}", 2)
        read = (number, places[spot])
        if read not in values:
            again = any(known == number for known, _ in values)
            statements.append(Let(f"p_{number}{'_conjugate' * again}", fetch(number, places[spot], count)))
            values[read] = variable(statements[-1].name, count)
        fetched.append(values[read])
    return fetched


def _vector(
    lookup: TextureLookup, name: str, coordinates: Coordinates, statements: list[Let]
) -> tuple[str, list[Expression], Scales]:
    """(name of the vector of the lookup's axes, the axes, their scales), warped where the lookup is."""
    # An axis that no row reads is named by none.
    axes, scales = [coordinates.axes.get(axis, constant(0)) for axis in lookup.axes], lookup.scales
    if lookup.warp is not None:
        made, axes, scales = warped(lookup.axes, axes, scales, lookup.warp, name.replace("x", "warped"))
        statements += made
    statements.append(Let(name, vector(*gathered(axes), *([constant(1)] if len(axes) < 4 else []))))
    return name, axes, scales


def _sum(
    evaluation: Evaluation, fetched: Sequence[Expression], textures: Sequence[Encoded], count: int
) -> tuple[Expression, np.ndarray]:
    """(the sum of the products less the biases of those of one texture alone, these biases (C,))."""
    bias = np.zeros(count)
    # Lookups of one texture are added before they are scaled.
    alone: dict[int, Expression] = {}
    parts: list[tuple[Expression, tuple[float, ...]]] = []
    ones = (1.0,) * count
    for product in evaluation.products:
        first, *others = product.lookups
        number = evaluation.lookups[first].texture
        if not others and product.signs == ones:
            alone[number] = alone[number] + fetched[first] if number in alone else fetched[first]
            bias = bias + textures[number].bias
            continue
        value = _decoded(fetched[first], textures[number])
        for other in others:
            value = value * _decoded(fetched[other], textures[evaluation.lookups[other].texture])
        parts.append((value, product.signs))
    scaled = [(_scaled(value, textures[number]), ones) for number, value in alone.items()]
    (total, signs), *rest = scaled + parts
    total = total if min(signs) > 0 else total * constant(*signs)
    for value, signs in rest:
        if min(signs) > 0:
            total = total + value
        elif max(signs) < 0:
            total = total - value
        else:
            total = total + value * constant(*signs)
    return total, bias


def _scaled(value: Expression, texture: Encoded) -> Expression:
    return value if np.all(texture.scale == 1) else value * _constant(texture.scale)


def _decoded(value: Expression, texture: Encoded) -> Expression:
    value = _scaled(value, texture)
    return value if not np.any(texture.bias) else value + _constant(texture.bias)


def _runs_away(evaluation: Evaluation, textures: Sequence[Encoded]) -> bool:
    """Whether the logarithms of all lookups can add up to more than `MOST`."""
    highest = [texture.values.max((0, 1)) for texture in textures]
    most = np.sum([highest[lookup.texture] for lookup in evaluation.lookups], 0)
    return bool((most > MOST).any())


def _place(rows: list[list[float]], offsets: list[float], axes: list[Expression], x: Expression) -> Expression:
    """(u, v) = rows · axes + offsets: one product where each row has one axis, else dot products with x.

    `x` (4,) names the axes in one vector, three of them with a 1 behind, which takes the offsets.
    """
    if all(sum(c != 0 for c in row) <= 1 for row in rows):
        picked = [next((k for k, c in enumerate(row) if c), None) for row in rows]
        if picked[0] is not None and picked[1] is not None:
            gain = constant(rows[0][picked[0]], rows[1][picked[1]])
            return vector(*gathered([axes[picked[0]], axes[picked[1]]])) * gain + constant(*offsets)
        single = [
            constant(o) if k is None else axes[k] * r[k] + o for k, r, o in zip(picked, rows, offsets, strict=True)
        ]
        return vector(*single)
    if len(axes) < 4:
        return vector(*(call("dot", constant(*row, offset), x) for row, offset in zip(rows, offsets, strict=True)))
    return vector(*(call("dot", constant(*row), x) for row in rows)) + constant(*offsets)


def _title(fitted: Evaluated, layers: int) -> tuple[str, ...]:
    evaluation = evaluation_of(fitted)
    textures, fetches = len({lookup.texture for lookup in evaluation.lookups}), len(evaluation.lookups)
    if layers:
        version = fitted.provenance.get("homofact_version", "")
        begin = f"{layers} BRDFs, by homofact {version}, the layers of {textures} arrays of log textures:"
        return (f"{begin} {fetches} fetches.", *TEXTURES)
    begin = f"BRDF of {name_of(fitted.provenance)}, by homofact {fitted.provenance.get('homofact_version', '')}:"
    if evaluation.transform is None:
        count = len(evaluation.products)
        many = "product" if count == 1 else "products"
        return (f"{begin} sum of {count} {many} of textures, {fetches} fetches.", *TEXTURES)
    mean = ", ".join(f"{value:.6g}" for value in evaluation.transform.mean.tolist())
    return (
        f"{begin} {textures} log textures, {fetches} fetches.",
        f"epsilon = {evaluation.transform.epsilon:g}, A = ({mean}) 1/sr.",
        *TEXTURES,
    )


def name_of(provenance: Mapping[str, Any]) -> str:
    """Return the name of a fit's source from its provenance: a material or file name, else "samples".

    An edited fit of gold has the name "edited gold", or "edited gold (ball)" if the material is named "ball" in its
    scene. So exports of the edited and the original fit have different names.

    The name is one line and contains only characters that are valid in UTF-8 and XML text.
    """
    source = provenance.get("source")
    source = source if isinstance(source, Mapping) else {}
    name = on_one_line(str(source.get("material") or source.get("file") or "samples")) or "samples"
    if not edits_in_words(provenance):
        return name
    called = edited_name(provenance)
    return f"edited {name}" + (f" ({called})" if called and called != name else "")
