"""HF and HD: a measured material's own curves, found from it, with the rest in the quotient (eq. 17 and 18).

HF, ρ = ρ_q P(θi) Q(θh) P(θo): P and Q are one-dimensional textures of logarithms, solved like all others
(`factor.textures`), P read at both θi and θo.

HD, ρ = ρ_q (G_d(θi) H_d(θo) + G_s(θd) H_s(θh)): four curves whose logarithms are piecewise linear between knots, so
that the curves are positive. L-BFGS finds them from a fixed start by minimising

    Σ (log(f/A + ε) − log(m/A + ε))² / N + λ Σ (second differences of the knots' logarithms)²,

where A is the mean of f and m the model in brackets. Logarithms give the dark parts of a glossy material weight. Smooth
curves make a smooth quotient, which matters because pictures evaluate it at few points of each light. Both terms have
the same quotient f/m.

The quotient contains what the curves cannot represent, so that either form without edits equals the material. No curve
is zero, so that no division by zero occurs. Where the material is zero, its quotient is zero too, and no edit changes
this.
"""

import numpy as np
import torch
from scipy.optimize import minimize
from torch import Tensor

from homofact.brdf.log_transform import LogTransform
from homofact.brdf.reflectance import Reflectance
from homofact.editing.angles import angle
from homofact.editing.curves import Knots, hat
from homofact.editing.material import Editable, EditableTerm, Slot
from homofact.editing.models import DIFFUSE, SPECULAR, WHOLE, quotient_of
from homofact.editing.pairs import pairs_of
from homofact.errors import BadInput
from homofact.factor.projection import fixed_projection
from homofact.factor.textures import LogSamples, solve_terms

PAIRS, SEED = 16_000, 0
_KNOTS, _STEPS = 91, 300
# Smooth curves leave a smooth quotient.
_SMOOTHING, _LOG_EPSILON = 1.0, 1e-4
_STIFFNESS, _SPLIT_EPSILON = 0.3, 1e-3


def homomorphic(reflectance: Reflectance, name: str = "material", bands: tuple[int, int] = (128, 128)) -> Editable:
    """HF of any reflectance: Q over θh ("half"), P over θi and θo at once ("directions").

    Raises BadInput for a channel that is zero everywhere.
    """
    wi, wo = pairs_of(PAIRS, SEED)
    values = _values(reflectance, wi, wo)
    transform = LogTransform.of_values(values, _LOG_EPSILON)
    ones = torch.ones(len(wi), dtype=torch.float64)
    samples = LogSamples(wi, wo, transform.forward(values), ones)
    projections = (fixed_projection("theta_h", True), fixed_projection("theta_i", True))
    solved = solve_terms(samples, projections, ((1, _KNOTS),) * 2, _SMOOTHING, "cholesky")
    half, directions = (Knots(term.texture[0], logs=True) for term in solved.terms)
    half = Knots(half.values + torch.from_numpy(transform.mean).log(), logs=True)
    whole = quotient_of(reflectance)

    def quotient(wi: Tensor, wo: Tensor) -> Tensor:
        ends = directions.at(angle("theta_i", wi, wo)) * directions.at(angle("theta_o", wi, wo))
        return whole(wi, wo) / (half.at(angle("theta_h", wi, wo)) * ends)

    slots = (
        Slot("half", "theta_h", half, bands[0]),
        Slot("directions", "theta_i", directions, bands[1], also_outgoing=True),
    )
    return Editable(name, reflectance.channels, (EditableTerm(WHOLE, quotient, slots),), _zeros(values))


def half_and_diffuse(reflectance: Reflectance, name: str = "material", bands: tuple[int, int] = (256, 32)) -> Editable:
    """HD of any reflectance: a diffuse-like term over θi and θo, a specular-like one over θh and θd.

    Raises BadInput for a channel that is zero everywhere.
    """
    wi, wo = pairs_of(PAIRS, SEED)
    values = _values(reflectance, wi, wo)
    names = ("theta_i", "theta_o", "theta_d", "theta_h")
    knots = _factored(values, [angle(each, wi, wo) for each in names])
    curves = [Knots(each, logs=True) for each in knots]

    def model(wi: Tensor, wo: Tensor) -> Tensor:
        at = [curve.at(angle(each, wi, wo)) for curve, each in zip(curves, names, strict=True)]
        return at[0] * at[1] + at[2] * at[3]

    whole = quotient_of(reflectance)

    def quotient(wi: Tensor, wo: Tensor) -> Tensor:
        return whole(wi, wo) / model(wi, wo)

    diffuse = (Slot("incident", "theta_i", curves[0], bands[0]), Slot("outgoing", "theta_o", curves[1], bands[0]))
    specular = (Slot("half", "theta_h", curves[3], bands[0]), Slot("difference", "theta_d", curves[2], bands[1]))
    terms = (EditableTerm(DIFFUSE, quotient, diffuse), EditableTerm(SPECULAR, quotient, specular))
    return Editable(name, reflectance.channels, terms, _zeros(values))


def _factored(values: Tensor, angles: list[Tensor]) -> Tensor:
    """Fit logarithms (4, M, C) of G_d, H_d, G_s, H_s at the knots to values (N, C) at four angles each."""
    channels, mean = values.shape[1], values.mean(0)
    target = torch.log(values / mean + _SPLIT_EPSILON)
    places = [hat(gamma, _KNOTS) for gamma in angles]
    # First an even diffuse part, the darkest fifth, and over θh the mean logarithm of what is above it.
    even = torch.quantile(values, 0.2, dim=0).clamp_min(_SPLIT_EPSILON * mean)
    above = torch.log((values - even).clamp_min(_SPLIT_EPSILON * mean))
    start = torch.zeros(4, _KNOTS, channels, dtype=torch.float64)
    start[:2] = torch.log(even) / 2
    start[3] = _means(above, *places[3])

    def objective(flat: np.ndarray) -> tuple[float, np.ndarray]:
        knots = torch.from_numpy(flat.reshape(start.shape)).requires_grad_()
        at = [
            torch.lerp(curve[number], curve[number + 1], share[:, None])
            for curve, (number, share) in zip(knots, places, strict=True)
        ]
        model = torch.exp(at[0] + at[1]) + torch.exp(at[2] + at[3])
        rest = torch.log(model / mean + _SPLIT_EPSILON) - target
        bends = knots[:, 2:] - 2 * knots[:, 1:-1] + knots[:, :-2]
        value = rest.square().mean() + _STIFFNESS * bends.square().sum() / channels
        value.backward()
        assert knots.grad is not None
        return float(value.detach()), knots.grad.numpy().reshape(-1)

    options = {"maxiter": _STEPS, "maxfun": 2 * _STEPS}
    found = minimize(objective, start.numpy().reshape(-1), jac=True, method="L-BFGS-B", options=options)
    return torch.from_numpy(found.x.reshape(start.shape))


def _means(values: Tensor, number: Tensor, share: Tensor) -> Tensor:
    """Return hat-weighted means (M, C) of values (N, C) about each knot; empty knots repeat the previous one."""
    numbers, weights = torch.cat((number, number + 1)), torch.cat((1 - share, share))
    sums = torch.zeros(_KNOTS, values.shape[1], dtype=values.dtype)
    counts = torch.zeros(_KNOTS, 1, dtype=values.dtype)
    sums.index_add_(0, numbers, values.repeat(2, 1) * weights[:, None])
    counts.index_add_(0, numbers, weights[:, None])
    found = sums / counts.clamp_min(1e-300)
    for knot in range(1, _KNOTS):
        if float(counts[knot]) == 0:
            found[knot] = found[knot - 1]
    return found


def _values(reflectance: Reflectance, wi: Tensor, wo: Tensor) -> Tensor:
    values = torch.as_tensor(reflectance.evaluate(wi, wo)).to(torch.float64)
    for channel, name in enumerate(reflectance.channels):
        if not bool((values[:, channel] > 0).any()):
            raise BadInput(f"channel {name} is zero everywhere", where="reflectance", expected="some reflectance")
    return values


def _zeros(values: Tensor) -> tuple[str, ...]:
    """Return a note if some values are zero: multiplying curves cannot change them."""
    share = float((values <= 0).to(torch.float64).mean())
    if share == 0:
        return ()
    return (f"the material is zero at {share:.1%} of the directions looked at: no curve lights it there",)
