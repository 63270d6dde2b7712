"""The gauge in closed form: constants, ramps and products that can move between textures without changing their sum.

A texture is read at uv = M x, which is linear in the coordinates x of its parameterization (after the warp, if there is
one). Bilinear interpolation reproduces {1, u, v, uv}, and the Laplacian rows of a whole texture vanish on these
functions. So neither samples nor smoothing determine a combination Σj (aj + bj·(u, v) + cj u v) whose sum over the
textures is zero:

    constants        Σj nj aj = 0                       with nj the lookups of texture j
    ramps            Σj bjᵀ Σl Mjl = 0                  over textures that share coordinates
    products         Σj cj Σl sym(ujl vjlᵀ) = 0         with ujl, vjl the rows of Mjl

Constants, linear and quadratic forms are independent functions on a domain with an interior, and different
parameterizations are not linear in each other, so the three conditions are independent. Their solutions span the null
space of the problem for any number of samples. A texture whose conjugate lookup cancels a ramp has a null ramp of its
own.

On a periodic axis (`linear.layout`), a ramp is discontinuous: interpolation and smoothing see its whole height between
the last texel and the first. Only functions that are constant along this axis remain undetermined. Of {1, u, v, uv},
these are {1, u} if the texture is periodic in v, and {1} if it is periodic in both axes. The conditions are the same,
with bj or cj equal to zero for the other functions. A pole requires one value along its line, which {1, u} satisfies.
(If a mask cuts a circle open, the ramp along the remaining arc is undetermined again for textures that share the
azimuth. No two textures of a fit do, and the ridge would determine it.)

homofact uses this gauge: every texture except the first has zero mean over its mask, and its projection onto the null
ramps and products (with their means subtracted) is zero. So the gauge depends neither on the solver nor on noise, and a
constant factor on the data adds a constant to the first texture only. `linear.least_squares` keeps these rows at zero.
"""

import torch
from torch import Tensor

from homofact.factor.projection import WARPED_AXES, Projection, Warp, layout_of
from homofact.linear.layout import Axes, Axis, Shape, TexelLayout, texel_centres

_RANK = 1e-9


def null_space(projections: tuple[Projection, ...], masks: tuple[Tensor, ...]) -> Tensor:
    """Return orthonormal columns (T, G) that span the null space; zero for texels outside `masks` (rows, columns)."""
    layout = _layout(projections, masks)
    fields, forms = _fields(projections, layout, _inside(layout, masks))
    return _orthonormal(fields @ _null_combinations(forms)).to(masks[0].device)


def gauge_rows(projections: tuple[Projection, ...], masks: tuple[Tensor, ...]) -> Tensor:
    """Return orthonormal columns Z (T, G) such that the gauge is Zᵀy = 0; G is the same as in `null_space`."""
    layout = _layout(projections, masks)
    inside = _inside(layout, masks)
    fields, forms = _fields(projections, layout, inside)
    constant = forms[:, 0] != 0
    owners = layout.owners()
    for j in range(len(masks)):
        own = (owners == j) & inside
        centred = fields[own] - fields[own].mean(0)
        fields[own] = torch.where(constant, fields[own], centred)
    means = fields[:, constant][:, 1:]
    ramps = fields[:, ~constant] @ _null_combinations(forms[~constant])
    return torch.cat((_orthonormal(means), _orthonormal(ramps)), 1).to(masks[0].device)


def _layout(projections: tuple[Projection, ...], masks: tuple[Tensor, ...]) -> TexelLayout:
    return layout_of(projections, tuple((int(mask.shape[0]), int(mask.shape[1])) for mask in masks))


def _inside(layout: TexelLayout, masks: tuple[Tensor, ...]) -> Tensor:
    # Few numbers, many small steps: on the CPU, wherever the masks are.
    return layout.join(masks).cpu()


def _null_combinations(forms: Tensor) -> Tensor:
    """Return coefficients (F, G) of the combinations of fields whose forms (F, ·) sum to zero."""
    if forms.shape[0] == 0:
        return forms.new_zeros(0, 0)
    left, values, _ = torch.linalg.svd(forms, full_matrices=True)
    return left[:, int((values > _RANK * values[0]).sum()) :]


def _orthonormal(columns: Tensor) -> Tensor:
    """Return an orthonormal basis of the columns' span."""
    if columns.shape[1] == 0:
        return columns
    basis, sizes, _ = torch.linalg.svd(columns, full_matrices=False)
    return basis[:, sizes > _RANK * sizes.max().clamp_min(1)]


def _fields(projections: tuple[Projection, ...], layout: TexelLayout, inside: Tensor) -> tuple[Tensor, Tensor]:
    """Return fields (T, F), each texture's constant, ramps and product, and their forms (F, 1 + V + V²).

    A form contains the polynomial that a field adds to the logarithm: its constant, linear and quadratic coefficients.
    V is the number of distinct variables of all projections (`_variables`).
    """
    variables = list(dict.fromkeys(name for projection in projections for name in _variables(projection)))
    owner = layout.owners()
    fields, forms = [], []
    for j, projection in enumerate(projections):
        places = [variables.index(name) for name in _variables(projection)]
        matrices = [torch.zeros(2, len(variables), dtype=torch.float64, device="cpu") for _ in projection.matrices()]
        for matrix, own in zip(matrices, projection.matrices(), strict=True):
            matrix[:, places] = own.to(matrix)
        for form, field in _of_texture(matrices, layout.shapes[j], layout.axes[j]):
            placed = torch.zeros(len(owner), dtype=torch.float64, device="cpu")
            placed[owner == j] = field
            fields.append(placed * inside)
            forms.append(form)
    return torch.stack(fields, 1), torch.stack(forms)


def _variables(projection: Projection) -> list[tuple[str, Warp | None]]:
    """Return the variable of each matrix column as (axis, warp); a warped axis is a separate variable."""
    return [(name, projection.warp if name in WARPED_AXES else None) for name in projection.system.axes]


def _of_texture(matrices: list[Tensor], shape: Shape, axes: Axes) -> list[tuple[Tensor, Tensor]]:
    """Return (form, texels (T,)) of a texture's constant, ramps and product from its lookup matrices (2, V)."""
    rows, columns = shape
    up, across = torch.cartesian_prod(texel_centres(rows, axes[0]), texel_centres(columns, axes[1])).unbind(1)
    width = matrices[0].shape[1]
    linear = torch.stack(matrices).sum(0)
    product = torch.stack([_symmetric(matrix) for matrix in matrices]).sum(0).reshape(-1)

    def form(constant: float = 0.0, ramp: Tensor | None = None, quadratic: Tensor | None = None) -> Tensor:
        nothing = linear.new_zeros(width + width * width)
        return torch.cat(
            (
                linear.new_full((1,), constant),
                nothing[:width] if ramp is None else ramp,
                nothing[width:] if quadratic is None else quadratic,
            )
        )

    found = [(form(constant=float(len(matrices))), torch.ones_like(across))]
    sloped = [count > 1 and axis is not Axis.PERIODIC for count, axis in zip(shape, axes, strict=True)]
    if sloped[1]:
        found.append((form(ramp=linear[0]), across))
    if sloped[0]:
        found.append((form(ramp=linear[1]), up))
    if all(sloped):
        found.append((form(quadratic=product), across * up))
    return found


def _symmetric(matrix: Tensor) -> Tensor:
    outer = matrix[0][:, None] * matrix[1]
    return (outer + outer.T) / 2


def in_gauge(texels: Tensor, projections: tuple[Projection, ...], masks: tuple[Tensor, ...]) -> Tensor:
    """Return the texels (T, C) with the same sum everywhere that meet the gauge over `masks`: Zᵀy = 0.

    The result is y − N (ZᵀN)⁻¹ Zᵀy, with the null space N. Textures of several materials are solved over different
    texels, those that their samples reach. Once all of them meet the gauge over the same masks, they can be compared
    texel by texel.
    """
    null = null_space(projections, masks).to(texels)
    rows = gauge_rows(projections, masks).to(texels)
    return texels - null @ torch.linalg.solve(rows.T @ null, rows.T @ texels)
