"""A fit as a module of PyTorch: its texels and projections are parameters, its values differentiable.

    module = fit.module(device="cuda")
    values = module(wi, wo)  # (..., C) in sr⁻¹, differentiable in directions and parameters
    better = module.to_fit()

The parameters of a searched projection are its unit quaternions. Every call computes the matrix from them, so it stays
a rotation scaled to the texture's square, whatever an optimizer does. The parameter of a fixed projection is its
matrix. On periodic coordinates (half-angles) no other matrix is possible, so there the matrix is not a parameter.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
import torch
from torch import Tensor, nn

from homofact.brdf.in_kind import Pairs
from homofact.brdf.source_names import MOST
from homofact.errors import BadInput
from homofact.factor.evaluation import refuse_model
from homofact.factor.factorization import Factorization
from homofact.factor.projection import Projection, row_bounds
from homofact.factor.spectral_fit import SpectralFit
from homofact.geometry.directions import above_horizon
from homofact.geometry.rotation import Rotation
from homofact.linear.bilinear import lookup
from homofact.separable.separable import Separable

# How near a matrix must be to that of its rotation to be made of it.
_SAME = 1e-6


def _tensor(values: Any) -> Tensor:
    """Return a float64 copy of a tensor or an array on the CPU."""
    return torch.as_tensor(values).detach().to("cpu", torch.float64, copy=True)


class ProjectionModule(nn.Module):
    """The texture coordinates of pairs of directions in one texture; `quaternions` or `matrix` is the parameter."""

    matrix: Tensor
    swap: Tensor

    def __init__(self, projection: Projection) -> None:
        super().__init__()
        self.projection = projection
        self.width = None if projection.warp is None else projection.warp.width
        system = projection.system
        matrix = _tensor(projection.matrix)
        self.bound = _bound_of(projection)
        if self.bound is not None:
            assert projection.rotation is not None
            self.quaternions = nn.Parameter(_tensor(projection.rotation.quaternions))
        elif system.periodic:
            self.register_buffer("matrix", matrix)
        else:
            self.matrix = nn.Parameter(matrix)
        self.register_buffer("swap", torch.tensor(system.swap, dtype=torch.float64))
        self.conjugates = projection.lookups == 2
        # A fixed projection that is its own conjugate stays so: one lookup.
        self.symmetric = projection.reciprocal and not self.conjugates and not system.periodic and self.bound is None

    def rows(self) -> Tensor:
        """Return the matrix (2, k) that maps coordinates to the texture's square."""
        if self.bound is not None:
            rows = Rotation(self.quaternions).normalized().matrix().T[:2]
            largest = row_bounds(rows, self.projection.system.domain, self.bound)
            return rows / largest[:, None]
        if self.symmetric:
            return (self.matrix + self.matrix @ self.swap) / 2
        return self.matrix

    def forward(self, wi: Tensor, wo: Tensor) -> tuple[Tensor, ...]:
        """Texture coordinates (N, 2) in [−1, 1]² of pairs (N, 3), for each lookup."""
        x = self.projection.system.evaluate(wi, wo, self.width)
        rows = self.rows()
        matrices = (rows, rows @ self.swap) if self.conjugates else (rows,)
        return tuple(x @ matrix.T for matrix in matrices)

    def to_projection(self) -> Projection:
        """Return the current projection, which is the fit's own if it has not changed."""
        old = self.projection
        rows = _tensor(self.rows())
        if np.allclose(rows, _tensor(old.matrix), rtol=0, atol=1e-15):
            return old
        if self.bound is not None:
            rotation = Rotation(_tensor(self.quaternions)).normalized()
            return Projection.from_rotation(old.coordinates, rotation, old.reciprocal, self.bound, old.warp)
        return Projection(old.coordinates, rows, old.reciprocal, "trained", warp=old.warp)

    def extra_repr(self) -> str:
        """Return the projection's name and coordinates, and whether it is reciprocal or warped."""
        more = ["reciprocal"] * self.projection.reciprocal + ["warped"] * (self.width is not None)
        return ", ".join([self.projection.name, self.projection.coordinates, *more])


def _bound_of(projection: Projection) -> str | None:
    """Return the bound with which the rotation gives the projection's matrix; None without such a bound."""
    if projection.rotation is None:
        return None
    quaternions, matrix = _tensor(projection.rotation.quaternions), _tensor(projection.matrix)
    rows = Rotation(quaternions).normalized().matrix().T[:2]
    for bound in ("disc", "cube"):
        made = rows / row_bounds(rows, projection.system.domain, bound)[:, None]
        if float((made - matrix).abs().max()) < _SAME:
            return bound
    return None


class FitModule(nn.Module):
    """Base class of the modules that `Fit.module` returns; `fit` is the original `homofact.Fit`.

    `textures` contains one parameter (rows, columns, C) per texture. A product also has parameters in `projections`;
    call `module.projections.requires_grad_(False)` to freeze them.
    """

    def __init__(self, fit: Any, textures: Sequence[Any]) -> None:
        super().__init__()
        self.fit = fit
        self.textures = nn.ParameterList([nn.Parameter(_tensor(texels)) for texels in textures])

    def forward(self, wi: Any, wo: Any) -> Tensor:
        """Return BRDF values (..., C) in sr⁻¹ without the cosine; 0 where a direction is below the horizon.

        `wi` and `wo` are unit vectors (..., 3) of shapes that broadcast, on the module's device. Where the coordinates
        have no derivative (a direction along the normal), the gradient with respect to the direction is 0.
        """
        texels = self.textures[0]
        wi, wo = (w if isinstance(w, Tensor) else torch.as_tensor(np.asarray(w)).to(texels) for w in (wi, wo))
        if wi.device != texels.device:
            raise BadInput(
                where="wi", found=f"a tensor on {wi.device}", expected=f"{texels.device}, where the module is"
            )
        pairs = Pairs.of(wi.to(texels.dtype), wo.to(texels.dtype))
        above, wi, wo = above_horizon(_sound(pairs.wi), _sound(pairs.wo))
        return pairs.answer(self._values(wi, wo) * above[:, None])

    def _values(self, wi: Tensor, wo: Tensor) -> Tensor:
        raise NotImplementedError

    def to_fit(self) -> Any:
        """Return a `homofact.Fit` with the texels and projections of now, its provenance saying that it was trained."""
        raise NotImplementedError

    def _facts(self) -> dict[str, Any]:
        return {"trained": True}

    def extra_repr(self) -> str:
        """Return the channels, the sizes of the textures and their bytes."""
        sizes = ", ".join(f"{texels.shape[0]} × {texels.shape[1]}" for texels in self.textures)
        return f"channels {', '.join(self.fit.channels)}; textures {sizes}; {self.fit.nbytes} bytes"


class ProductModule(FitModule):
    """A product of textures: A max(0, exp Σ lookups − ε)."""

    mean: Tensor

    def __init__(self, fit: Any, product: Factorization) -> None:
        super().__init__(fit, [term.texture for term in product.terms])
        self.product = product
        self.projections = nn.ModuleList([ProjectionModule(term.projection) for term in product.terms])
        self.epsilon = product.transform.epsilon
        self.register_buffer("mean", _tensor(product.transform.mean))

    def _values(self, wi: Tensor, wo: Tensor) -> Tensor:
        total = torch.zeros((), dtype=wi.dtype, device=wi.device)
        for texels, projection in zip(self.textures, self.projections, strict=True):
            assert isinstance(projection, ProjectionModule)
            for uv in projection(wi, wo):
                total = total + lookup(texels, uv, projection.projection.axes)
        return self.mean * (torch.exp(total.clamp_max(MOST)) - self.epsilon).clamp_min(0)

    def to_fit(self) -> Any:
        """Return a `homofact.Fit` with the texels and projections of now, its provenance saying that it was trained."""
        trained = [module.to_projection() for module in self.projections if isinstance(module, ProjectionModule)]
        return type(self.fit)(
            self.product.trained(trained, [_tensor(texels) for texels in self.textures], self._facts())
        )


class SumModule(FitModule):
    """A sum of products of textures: max(0, Σ signs · first · second). Its direction maps are fixed."""

    signs: Tensor

    def __init__(self, fit: Any, summed: Separable) -> None:
        super().__init__(fit, [texels for term in summed.terms for texels in term.textures])
        self.summed = summed
        self.register_buffer("signs", torch.stack([_tensor(term.signs) for term in summed.terms]))

    def _values(self, wi: Tensor, wo: Tensor) -> Tensor:
        a, b = self.summed.places(wi, wo)
        textures = list(self.textures)
        seconds = len(textures) // len(self.summed.terms) == 2
        firsts = textures[::2] if seconds else textures
        total = torch.zeros((), dtype=wi.dtype, device=wi.device)
        for k, first in enumerate(firsts):
            second = textures[2 * k + 1] if seconds else first
            total = total + self.signs[k] * lookup(first, a) * lookup(second, b)
        return total.clamp_min(0)

    def to_fit(self) -> Any:
        """Return a `homofact.Fit` with the current texels; its provenance records that it was trained."""
        return type(self.fit)(
            self.summed.with_textures([_tensor(texels) for texels in self.textures], facts=self._facts())
        )


def module_of(fit: Any, device: Any = None, dtype: Any = None) -> FitModule:
    """Return the module of a fit, on a device and of a floating type. Raises BadInput for a model without textures."""
    own: Any = fit.factorization
    # Trained in all bands: a basis is for storing.
    own = own.expanded if isinstance(own, SpectralFit) else own
    if isinstance(own, Factorization):
        module: FitModule = ProductModule(fit, own)
    elif isinstance(own, Separable):
        module = SumModule(fit, own)
    else:
        refuse_model(own)
    if dtype is not None and not (isinstance(dtype, torch.dtype) and dtype.is_floating_point):
        raise BadInput(where="dtype", found=repr(dtype), expected="a floating type of torch")
    return module.to(device=device, dtype=dtype)


def _sound(w: Tensor) -> Tensor:
    """Return directions whose gradient is 0 where it would not be finite."""
    if w.requires_grad:
        w = w.clone()
        w.register_hook(lambda slope: None if slope is None else slope.nan_to_num(0.0, 0.0, 0.0))
    return w
